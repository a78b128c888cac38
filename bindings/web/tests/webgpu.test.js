// Compares WebGPU on Chromium's driver in software with the CPU, and tests adapters that cannot be used.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { join } from "node:path";
import { test } from "node:test";
import { BUILT, GPU, MODULES, ROOT, open, serveBuilt } from "./support.js";

for (const [module, name] of [["webgpu", "run"], ["webgpu", "canvases"], ["webgpu", "refusals"], ["sessions", "onWebgpu"]])
  test(`${module}.js: ${name}`, async (t) => {
    const { page } = await open(t, GPU);
    await page.goto(`${await serveBuilt()}/tests/empty.html`);
    const said = await page.evaluate((module, name) => import(`/tests/${module}.js`).then((tests) => tests[name]()), module, name);
    said.forEach((line) => t.diagnostic(line));
  });

test("in Node, on Dawn", (t) => {
  const script = [join(ROOT, "bindings/web/tests/dawn.js"), join(BUILT, "phasefront"), join(ROOT, "models"), join(MODULES, "webgpu/index.js")];
  const driver = { VK_DRIVER_FILES: "/usr/lib/chromium/vk_swiftshader_icd.json" };
  const { status, stdout, stderr } = spawnSync("node", ["--no-warnings", ...script], { env: { ...process.env, ...driver }, encoding: "utf8" });
  t.diagnostic(stdout);
  assert.equal(status, 0, stderr);
});
