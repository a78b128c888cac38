// Tests the page as a person uses it, on the CPU and on WebGPU.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { GPU, click, layout, open, picture, serveBuilt } from "./support.js";

const HELPERS = readFileSync(new URL("helpers.js", import.meta.url), "utf8");
// Parts of the sample image: its nearest and its farthest objects.
const [NEAR, FAR] = [[0.1, 0.5, 0.3, 0.9], [0.7, 0.1, 0.9, 0.4]];

/** Opens the page and returns it, once it is idle, with functions that return its state after they chose or waited. */
async function opened(t, query, ...flags) {
  const address = await serveBuilt();
  const { page, ...seen } = await open(t, ...flags);
  await page.evaluateOnNewDocument(HELPERS);
  await page.goto(`${address}/page/index.html${query}`);
  const still = () => page.evaluate("still()");
  await still();
  return { page, address, still, choose: (...said) => page.evaluate((...said) => choose(...said), ...said), ...seen };
}

test("the page focuses, computes what is chosen, fills a screen and takes a camera", async (t) => {
  const camera = ["--disable-gpu", "--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream"];
  const { page, address, still, choose, asked, wrong } = await opened(t, "", camera);
  const { source, frames, wrong: said } = await still();
  assert.deepEqual([source, frames, said], ["sample", 1, ""]);
  assert.deepEqual(await page.evaluate("[pixels('shown').width, pixels('shown').height, pixels('phases').width]"), [640, 360, 640]);

  // It opens in focus on the nearest surface in the middle, the chart at depths from 0.07 to 0.13.
  const { focus } = await still();
  assert.ok(focus >= 60 * 0.07 - 1 && focus <= 60 * 0.13 + 1, `${focus}`);
  assert.equal(await page.$eval("#focus", ({ value }) => Number(value)), focus);
  assert.match(await page.evaluate("textOf('z')"), /\+2\./);

  // The slider: near objects are sharper at a near focus, and far objects at a far focus.
  const sharp = {};
  for (const key of ["Home", "End"]) {
    await page.keyboard.press(key);
    await still();
    sharp[key] = await page.evaluate((parts) => parts.map(sharpness), [NEAR, FAR]);
  }
  assert.equal((await still()).focus, 60);
  // The sweep's halos are sharp too, at a wrong focus.
  assert.ok(sharp.Home[0] > 1.1 * sharp.End[0] && sharp.End[1] > 1.2 * sharp.Home[1], JSON.stringify(sharp));
  await click(page, "#focus", 0.02);
  assert.ok((await still()).focus <= 1);
  await click(page, "#shown canvas", 0.8, 0.25);
  const far = (await still()).focus;
  await click(page, "#shown canvas", 0.2, 0.7);
  assert.ok((await still()).focus < far);
  await picture(page, "web-desktop.jpg");

  // Other settings make other holograms, and an impossible setting gives one line of error.
  const phases = () => page.evaluate("pixels('phases').data.join()");
  const before = await phases();
  assert.equal((await choose("localSteps", 0)).wrong, "");
  assert.notEqual(await phases(), before);
  // This browser has no hardware for WebGPU: the page says so, and the CPU goes on.
  for (const setting of [["width", 320], ["method", "sweep"], ["backend", "webgpu"]]) assert.equal((await choose(...setting)).wrong, "");
  assert.match(await page.evaluate("textOf('computed')"), /no GPU/);
  assert.equal((await choose("backend", "cpu")).wrong, "");
  await page.evaluate("drop(['a.png', 'scene_rgb.jpg'])");
  assert.match((await still()).wrong, /give two/);
  await page.evaluate("drop(['a.png', 'scene_depth.png'], ['b.png', 'scene_rgb.jpg'])");
  const dropped = await still();
  assert.deepEqual([dropped.source, dropped.wrong], ["files", ""]);

  // The hologram fills a screen, one pixel of it on one of the screen.
  await (await page.createCDPSession()).send("Browser.grantPermissions", { permissions: ["windowManagement"] });
  await page.click("#screens");
  await page.waitForFunction("document.querySelectorAll('#screen option').length === 1 && document.querySelector('#screen option').textContent.includes('×')");
  await page.click("#full");
  const canvas = await page.waitForSelector("#stage:fullscreen canvas");
  await page.waitForFunction((canvas) => canvas.clientWidth * devicePixelRatio === 320 && canvas.width === 320, {}, canvas);
  await page.evaluate("document.exitFullscreen()");
  await page.waitForFunction("!document.fullscreenElement");

  // The camera delivers frames until it is stopped.
  await page.click("#camera");
  await page.waitForFunction((frames) => state.frames >= frames, { timeout: 120_000 }, dropped.frames + 3);
  await page.click("#camera");
  const filmed = await still();
  assert.deepEqual([filmed.source, filmed.wrong], ["camera", ""]);
  assert.deepEqual(wrong, []);
  assert.deepEqual(asked.filter((url) => !url.startsWith(address) && !/^(data|blob):/.test(url)), []);

  await page.setViewport({ width: 390, height: 844, deviceScaleFactor: 2, isMobile: true });
  await page.reload();
  await still();
  const wide = await page.evaluate("document.documentElement.scrollWidth");
  assert.ok(wide <= 390, `${wide} pixels wide`);
  await layout(page);
});

test("the page shows on WebGPU what it shows on the CPU", async (t) => {
  const { page, choose } = await opened(t, "?adapter=swiftshader", GPU);
  // A driver in software takes long to compile both methods of the automatic choice.
  assert.equal((await choose("method", "rgbd-8")).wrong, "");
  const images = [];
  for (const setting of [["width", 320], ["localSteps", 0], ["localSteps", 1], ["backend", "webgpu"], ["localSteps", 0]]) {
    assert.equal((await choose(...setting)).wrong, "");
    images.push(await page.evaluate("['phases', 'shown'].map((canvas) => [...pixels(canvas).data])"));
  }
  assert.notDeepEqual(images[3][0], images[4][0], "WebGPU drew nothing");
  assert.match(await page.evaluate("textOf('computed')"), /swiftshader/);
  for (const [canvas, gpu] of images[4].entries()) {
    const far = gpu.reduce((sum, byte, i) => sum + Math.abs(((byte - images[1][canvas][i] + 384) % 256) - 128), 0) / gpu.length;
    // Some bytes of the view differ by one: the CPU has sRGB's curve as a table, the GPU computes a power.
    assert.ok(new Set(gpu).size > 50 && far < [0.1, 0.5][canvas], `canvas ${canvas} is ${far} of 255 from the CPU's on average`);
  }
});
