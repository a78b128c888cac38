// Serves the built package with its tests, and starts browsers.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { createReadStream, existsSync, mkdtempSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { extname, join } from "node:path";
import { text } from "node:stream/consumers";
import { fileURLToPath } from "node:url";
import puppeteer from "puppeteer-core";

export const ROOT = fileURLToPath(new URL("../../..", import.meta.url));
/** Where `bindings/web/build` leaves the package and the page. */
export const BUILT = join(process.env.CARGO_TARGET_DIR ?? "", "npm");
export const MODULES = fileURLToPath(new URL("../node_modules", import.meta.url));

const FOLDERS = {
  suite: join(ROOT, "tests/conformance"),
  models: join(ROOT, "models"),
  tests: join(ROOT, "bindings/web/tests"),
  package: join(BUILT, "phasefront"), // The whole package, on isolated pages too.
};
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".wasm": "application/wasm" };
/** Isolates pages from other origins, as shared memory needs. */
export const ISOLATED = { "Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp" };

/** Serves a folder and returns its address. `answer` may take a request. */
export async function serve(fileOf, headers = {}, answer = () => false) {
  const server = createServer(async (request, response) => {
    if (await answer(request, response)) return;
    const path = decodeURIComponent(new URL(request.url, "http://localhost").pathname);
    const file = fileOf(path.endsWith("/") ? `${path}index.html` : path);
    if (!existsSync(file)) return response.writeHead(404, headers).end();
    const type = TYPES[extname(file)] ?? "application/octet-stream";
    response.writeHead(200, { "Content-Type": type, "Content-Length": statSync(file).size, ...headers });
    createReadStream(file).pipe(response);
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  server.unref();
  return `http://127.0.0.1:${server.address().port}`;
}

const built = (path) => {
  const [, first, ...rest] = path.split("/");
  return join(FOLDERS[first] ?? join(BUILT, first), ...rest);
};

/** Runs functions of the modules beside this file in a browser that opens a page and is left alone: workers of workers
 * sometimes do not start in a Firefox that WebDriver BiDi controls. */
export class Runner {
  #next;
  #asked;
  #answered;

  /** Starts a program with flags that take `profile` for its folder. */
  static async start(program, flags) {
    const runner = new Runner();
    const answer = async (request, response) => {
      if (request.url === "/next") response.end(await runner.#asked, runner.#wait());
      else if (request.url === "/answer") runner.#answered(JSON.parse(await text(request)), response.writeHead(204).end());
      else return false;
      return true;
    };
    runner.#wait();
    runner.plain = await serve(built, {}, answer);
    runner.isolated = await serve((path) => built(path.replace("/phasefront/", "/phasefront/threads/")), ISOLATED, answer);
    runner.profile = mkdtempSync(join(tmpdir(), "phasefront-"));
    // Clocks of Firefox are otherwise coarser than the time of a small frame.
    writeFileSync(join(runner.profile, "user.js"), 'user_pref("privacy.reduceTimerPrecision", false);\n');
    const environment = { ...process.env, HOME: runner.profile };
    runner.browser = spawn(program, [...flags(runner.profile), `${runner.plain}/tests/`], { env: environment, stdio: "ignore" });
    return runner;
  }

  #wait() {
    this.#asked = new Promise((done) => (this.#next = done));
  }

  /** Returns what `name` of a module of tests returns in a new document of the server at `address`. */
  async run(address, module, name = "run", ...values) {
    const answer = new Promise((done) => (this.#answered = done));
    const asked = encodeURIComponent(JSON.stringify({ module: `/tests/${module}`, name, values }));
    this.#next(`${address}/tests/?${asked}`);
    const { value, error } = await answer;
    if (error) throw new Error(error);
    return value;
  }

  async close() {
    this.browser.kill();
    await new Promise((done) => this.browser.once("exit", done));
    rmSync(this.profile, { recursive: true, force: true, maxRetries: 5 });
  }
}

/** Chromium refuses to sandbox itself for root. */
export const SANDBOX = process.getuid() === 0 ? ["--no-sandbox"] : [];
/** The browsers that the package's tests run in. */
export const BROWSERS = {
  Chromium: () =>
    Runner.start("chromium", (profile) => ["--headless", "--disable-gpu", "--no-first-run", `--user-data-dir=${profile}`, ...SANDBOX]),
  Firefox: () => Runner.start("firefox-esr", (profile) => ["--headless", "--no-remote", "--profile", profile]),
};

/** WebGPU with its canvases on SwiftShader, Chromium's driver in software. */
export const GPU = ["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--use-gl=angle", "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader", "--enable-features=Vulkan", "--use-vulkan=swiftshader", "--ignore-gpu-blocklist"];

/** Opens a page of Chromium, which notes in `asked` what it loads and in `wrong` its errors, and closes after the test `t`. */
export async function open(t, flags = ["--disable-gpu"]) {
  const browser = await puppeteer.launch({
    executablePath: "/usr/bin/chromium",
    args: ["--hide-scrollbars", ...SANDBOX, ...flags],
    protocolTimeout: 600_000,
  });
  t.after(() => browser.close());
  const page = await browser.newPage();
  const [asked, wrong] = [[], []];
  page.on("request", (request) => asked.push(request.url()));
  page.on("pageerror", (error) => wrong.push(error));
  await page.setViewport({ width: 1280, height: 900 });
  return { page, asked, wrong };
}

/** Clicks at a part of an element's width and height. */
export async function click(page, selector, x = 0.5, y = 0.5) {
  const element = await page.$(selector);
  await element.scrollIntoView();
  const { width, height } = await element.boundingBox();
  await element.click({ offset: { x: x * width, y: y * height } });
}

/** Checks at the sizes of a desktop and of a phone upright and on its side that the page is no wider than the window, that
 * its slider is in sight without scrolling and after it, and that every canvas has a name. */
export async function layout(page) {
  const accessibility = await page.createCDPSession();
  for (const [width, height] of [[1280, 900], [375, 667], [667, 375]]) {
    await page.setViewport({ width, height, isMobile: width < 1000, deviceScaleFactor: 1 });
    for (const scrolled of [0, 1]) {
      const seen = await page.evaluate((part) => {
        scrollTo(0, part * document.documentElement.scrollHeight);
        const { top, bottom, left, right } = document.getElementById("focus").getBoundingClientRect();
        return { top, bottom, left, right, wide: document.documentElement.scrollWidth, high: innerHeight };
      }, scrolled * 0.3);
      const inside = seen.top >= 0 && seen.bottom <= seen.high && seen.left >= 0 && seen.right <= width;
      assert.ok(inside && seen.wide <= width, `${width}×${height}: ${JSON.stringify(seen)}`);
    }
    await page.evaluate("scrollTo(0, 0)");
    // Chromium computes the names that a screen reader gets, some time after it has laid out the page.
    const drawn = await page.$$eval("canvas", (all) => all.filter((one) => one.checkVisibility()).length);
    let names = [];
    for (let i = 0; i < 50 && (i === 0 || names.length < drawn); i++) {
      await new Promise((done) => setTimeout(done, 100));
      const { nodes } = await accessibility.send("Accessibility.getFullAXTree");
      names = nodes.filter(({ role, name, ignored }) => !ignored && role?.value === "image" && name?.value);
    }
    assert.ok(drawn > 0 && names.length === drawn, `${names.length} names for ${drawn} canvases at ${width}×${height}`);
    await picture(page, `layout-${width}x${height}.jpg`, false);
  }
}

/** Saves a picture of the page for the documents, in the folder that PHASEFRONT_PICTURES names. */
export async function picture(page, name, fullPage = true) {
  const folder = process.env.PHASEFRONT_PICTURES;
  if (folder) await page.screenshot({ path: join(folder, name), fullPage, quality: 82 });
}

/** Returns the address of the built page's server. */
export const serveBuilt = () => serve(built);
