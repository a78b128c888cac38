// Builds an app with the packed package by Vite, webpack and esbuild, as in the guide, and runs it; by Vite's server, too.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { copyFileSync, cpSync, mkdtempSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { BUILT, ISOLATED, MODULES, ROOT, open, serve } from "./support.js";

test("apps that bundlers build of the package make levels", async (t) => {
  const app = mkdtempSync(join(tmpdir(), "phasefront-"));
  t.after(() => rmSync(app, { recursive: true, force: true }));
  cpSync(join(ROOT, "bindings/web/tests/app"), app, { recursive: true });
  writeFileSync(join(app, "package.json"), '{ "private": true, "type": "module" }');
  const call = (program, ...said) => execFileSync(program, said, { cwd: app, stdio: ["ignore", "ignore", "inherit"] });
  const tool = (name, ...said) => call(join(MODULES, ".bin", name), ...said);
  const packed = readdirSync(BUILT).filter((name) => name.endsWith(".tgz")).map((name) => join(BUILT, name));
  // A link to the folder lies outside of the app, where Vite's server refuses to read.
  call("npm", "install", "--silent", "--no-fund", "--no-audit", "--offline", ...packed);
  tool("publint", "--strict", "node_modules/phasefront");
  tool("vite", "build", "--logLevel", "error", "--outDir", "vite");
  tool("webpack", "--output-path", "webpack", "--no-performance");
  const entries = ["copied.js", "session-worker=phasefront/session-worker", "gpu-worker=phasefront/webgpu/session-worker"];
  tool("esbuild", ...entries, "--bundle", "--format=esm", "--loader:.wasm=file", "--log-level=error", "--outdir=esbuild");
  for (const [name, folder] of [["default", "webpack"], ["address", "webpack"], ["copied", "esbuild"]])
    copyFileSync(join(app, `${name}.html`), join(app, folder, `${name}.html`));

  const { page } = await open(t);
  async function runs(address, ...names) {
    for (const name of names) {
      await page.goto(`${address}/${name}.html`);
      const answer = await page.waitForFunction("globalThis.answer", { timeout: 120_000 });
      assert.equal(await answer.jsonValue(), `${3 * 48 * 64} levels`, `${address}/${name}`);
    }
  }
  for (const [bundler, ...names] of [["vite", "default", "address"], ["webpack", "default", "address"], ["esbuild", "copied"]])
    await runs(await serve((path) => join(app, bundler, path), ISOLATED), ...names);

  const vite = spawn(join(MODULES, ".bin/vite"), ["--host", "127.0.0.1", "--clearScreen", "false"], {
    cwd: app,
    env: { ...process.env, NO_COLOR: "1" },
    stdio: ["ignore", "pipe", "inherit"],
  });
  t.after(() => vite.kill());
  const address = await new Promise((found) => vite.stdout.on("data", (said) => {
    const [match] = /http:\/\/127\.0\.0\.1:\d+/.exec(said) ?? [];
    if (match) found(match);
  }));
  await runs(address, "default", "address");
});
