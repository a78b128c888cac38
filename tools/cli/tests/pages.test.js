// Opens pages of `phasefront view` in Chromium as a person does, and compares what they show with `phasefront refocus`,
// at the sizes of a desktop and of a phone: `tools/cli/tests/pages`. PHASEFRONT_PICTURES=docs/images saves the pictures
// of the documents.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { pathToFileURL } from "node:url";
import { ROOT, click, layout, open, picture } from "../../../bindings/web/tests/support.js";

const work = mkdtempSync(join(tmpdir(), "phasefront-"));
after(() => rmSync(work, { recursive: true, force: true }));
const released = (name) => (...said) =>
  execFileSync(join(process.env.CARGO_TARGET_DIR, "release", name), said.map(String), { stdio: ["ignore", "ignore", "inherit"] });
const phasefront = released("phasefront");
const laboratory = released("phasefront-lab");
const data = (path) => `data:image/png;base64,${readFileSync(path, "base64")}`;
const [rgb, depth] = ["samples/scene_rgb.jpg", "samples/scene_depth.png"].map((path) => join(ROOT, path));
const still = join(work, "view.html");

/** Functions in the page: its state once it is idle, and the comparison of images. */
const HELPERS = `
window.still = async () => {
  let was = '';
  for (let i = 0; i < 400; i++) {
    await new Promise((done) => setTimeout(done, 60));
    const now = JSON.stringify(state) + document.documentElement.getAttribute('aria-busy');
    if (now === was && now.endsWith('false')) return state;
    was = now;
  }
  throw new Error('the page does not come to rest');
};
window.pixels = (id) => {
  const canvas = document.querySelector('#' + id + ' canvas');
  return [...canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data];
};
window.colours = (id) => {
  const sums = [0, 0, 0];
  pixels(id).forEach((value, i) => { if (i % 4 < 3) sums[i % 4] += value; });
  return sums;
};
window.drawn = async (url, width, height) => {
  const image = new Image();
  image.src = url;
  await image.decode();
  const other = new OffscreenCanvas(width ?? image.width, height ?? image.height).getContext('2d');
  other.imageSmoothingQuality = 'high';
  other.drawImage(image, 0, 0, other.canvas.width, other.canvas.height);
  return other;
};
window.psnr = async (id, url) => {
  const { width, height } = document.querySelector('#' + id + ' canvas');
  const theirs = (await drawn(url, width, height)).getImageData(0, 0, width, height).data;
  let sum = 0;
  pixels(id).forEach((value, i) => { if (i % 4 < 3) sum += (value - theirs[i]) ** 2; });
  return 10 * Math.log10(255 * 255 * 3 * width * height / sum);
};
window.middle = async (url) => {
  const { data } = (await drawn(url, 240, 135)).getImageData(60, 34, 120, 67);
  return [...data].filter((_, i) => i % 4 === 0).map((value) => value / 255);
};
window.depthAt = async (url, x, y) => {
  const other = await drawn(url);
  return other.getImageData(x * other.canvas.width, y * other.canvas.height, 1, 1).data[0] / 255;
};`;

/** Opens a page of a file. Returns it with functions that use it and return its state. */
async function opened(t, path, viewport = {}) {
  const { page, ...seen } = await open(t);
  await page.setViewport({ width: 1280, height: 900, ...viewport });
  await page.evaluateOnNewDocument(HELPERS);
  await page.goto(pathToFileURL(path).href);
  const state = () => page.evaluate("still()");
  await state();
  const clicked = async (...said) => (await click(page, ...said), state());
  const key = async (name) => (await page.keyboard.press(name), state());
  const visible = () => page.$$eval("figure", (figures) => figures.filter((figure) => !figure.hidden).map(({ id }) => id));
  return { page, state, clicked, key, visible, ...seen };
}

test("a still's page focuses as refocus does, by slider, click and key", async (t) => {
  phasefront("view", "--rgb", rgb, "--depth", depth, "--title", "The sample", "-o", still);
  const { size } = statSync(still);
  assert.ok(size < 5e6, `${size} bytes for 1920×1080`);
  const { page, state, clicked, key, visible, asked, wrong } = await opened(t, still);
  const z = await page.evaluate("scenes[0].z_mm");
  // It opens in focus on the nearest surface in the middle of the picture.
  const opening = (await state()).focus;
  // The sample has a chart there, in front of a room: 11 % of the middle half lies at depths from 0.07 to 0.13.
  const depths = await page.evaluate((url) => middle(url), data(depth));
  const chart = depths.filter((d) => d < 0.2);
  assert.ok(chart.length > 0.1 * depths.length && chart.length < 0.2 * depths.length);
  assert.ok(chart.filter((d) => Math.abs(d * (z.length - 1) - opening) < 1).length > 0.9 * chart.length, `${opening}`);

  phasefront("hologram", "--rgb", rgb, "--depth", depth, "-o", join(work, "h.png"));
  const ends = [[2, "near"], [z.length - 3, "far"]];
  for (const [index, name] of ends) phasefront("refocus", join(work, "h.png"), "--z-mm", z[index], "--width", 1280, "-o", join(work, `${name}.png`));
  for (const [[index, mine], [, other]] of [ends, ends.toReversed()]) {
    // The thumb of a range moves over a little less than the width of its box.
    const { width } = await (await page.$("#focus")).boundingBox();
    assert.equal((await clicked("#focus", (8 + ((width - 16) * index) / (z.length - 1)) / width)).focus, index);
    const [same, different] = await Promise.all([mine, other].map((name) =>
      page.evaluate((url) => psnr("shown", url), data(join(work, `${name}.png`)))));
    t.diagnostic(`focused ${mine}: ${same.toFixed(1)} dB from refocus there, ${different.toFixed(1)} dB from refocus ${other}`);
    assert.ok(same > 30 && same > different + 4, mine);
  }

  // A click focuses on the depth at its position.
  for (const [x, y] of [[0.2, 0.6], [0.5, 0.5], [0.8, 0.3]]) {
    const { focus } = await clicked("#shown canvas", x, y);
    const wanted = (z.length - 1) * (await page.evaluate((...said) => depthAt(...said), data(depth), x, y));
    assert.ok(Math.abs(focus - wanted) < 0.8, `${x} ${y}: ${focus}, not ${wanted}`);
  }

  // Keys: focus, colours, views.
  for (const [name, focus] of [["Home", 0], ["ArrowRight", 1], ["End", z.length - 1]]) assert.equal((await key(name)).focus, focus);
  for (const [name, colour, left] of [["r", "red", 0], ["g", "green", 1], ["b", "blue", 2]]) {
    assert.equal((await key(name)).colour, colour);
    const sums = await page.evaluate("colours('shown')");
    assert.deepEqual(sums.map((sum) => sum > 0), [0, 1, 2].map((c) => c === left));
  }
  await key("a");
  for (const [name, view, figures] of [["2", "field", ["field"]], ["4", "phase", ["phase", "pixels"]], ["3", "beside", ["field", "shown"]]]) {
    assert.equal((await key(name)).view, view);
    assert.deepEqual(await visible(), figures);
    if (view === "phase") await picture(page, "view-phases.jpg");
  }
  const apart = await page.evaluate("(() => { const [a, b] = [pixels('field'), pixels('shown')]; return a.reduce((s, v, i) => s + Math.abs(v - b[i]), 0) / a.length; })()");
  assert.ok(0.2 < apart && apart < 30, `${apart}`);
  await key("Home");
  await picture(page, "view-desktop.jpg");

  // The sweep moves automatically, and stops.
  await page.evaluate("document.activeElement.blur()");
  await page.keyboard.press("Space");
  await page.waitForFunction("state.focus > 0");
  await page.keyboard.press("Space");
  assert.ok((await state()).focus > 0);

  // A link restores the view.
  await page.evaluate("location.hash = 'focus=3&view=field&colour=green'");
  const { focus, view, colour } = await state();
  assert.deepEqual([focus, view, colour].map(String), ["3", "field", "green"]);
  await key("r");
  await page.waitForFunction("location.hash.includes('colour=red') && location.hash.includes('focus=3')");
  assert.deepEqual(wrong, []);
  assert.deepEqual(asked.filter((url) => !/^(file|data):/.test(url)), []);
});

test("the policy of a page prevents all loads by injected content", async (t) => {
  const spy = '<img src="http://127.0.0.1:9/spy.png"><script src="http://127.0.0.1:9/spy.js"></script><main>';
  writeFileSync(join(work, "spied.html"), readFileSync(still, "utf8").replace("<main>", spy));
  const { page } = await open(t);
  const blocked = [];
  const network = await page.createCDPSession();
  network.on("Network.loadingFailed", ({ blockedReason }) => blocked.push(blockedReason));
  await network.send("Network.enable");
  await page.goto(pathToFileURL(join(work, "spied.html")).href);
  assert.deepEqual(blocked, ["csp", "csp"]);
  assert.equal(await page.evaluate("fetch('http://127.0.0.1:9/').then(() => true, () => false)"), false);
});

test("the slider is in sight and canvases have names", async (t) => {
  const { page, clicked } = await opened(t, still);
  await layout(page);
  await clicked("#views [data-view=beside]");
  await layout(page);
  assert.match(await page.$eval("#what", ({ textContent }) => textContent), /focus/);
  assert.match(await page.$eval("#shown canvas", (one) => one.getAttribute("aria-label")), /displayed image.*mm/);
});

test("a phone shows the page", async (t) => {
  const { page, clicked } = await opened(t, still, { width: 390, height: 844, deviceScaleFactor: 2, isMobile: true });
  await clicked("#views [data-view=beside]");
  const wide = await page.evaluate("document.documentElement.scrollWidth");
  assert.ok(wide <= 390, `${wide} pixels wide`);
  const small = await page.$$eval("button, input", (all) =>
    all.filter((one) => !one.hidden && one.offsetParent && one.getBoundingClientRect().height < 30).map((one) => one.textContent));
  assert.deepEqual(small, []);
  assert.ok((await clicked("#focus", 0.02)).focus <= 1);
  await picture(page, "view-phone.jpg");
});

test("a film and a gallery", async (t) => {
  const frames = join(work, "frames");
  mkdirSync(frames);
  for (let i = 0; i < 4; i++) {
    laboratory("scene", "--seed", 3, "--size", "96x64", "--layers", 1, "-o", join(work, `s${i}`));
    for (const [name, to] of [["layer_0", "rgb"], ["depth_0", "depth"]]) copyFileSync(join(work, `s${i}/${name}.png`), join(frames, `${to}_${i}.png`));
  }
  phasefront("video", frames, "-o", join(work, "video"));
  phasefront("view", join(work, "video"), "--frames", 3, "--views", 3, "-o", join(work, "video.html"));
  const film = await opened(t, join(work, "video.html"));
  assert.equal(await film.page.$eval("#time", ({ hidden }) => hidden), false);
  assert.equal((await film.clicked("#frame", 0.97)).frame, 2);

  phasefront("view", still, join(work, "video.html"), join(work, "h.png"), "-o", join(work, "gallery.html"));
  const { page, clicked, wrong } = await opened(t, join(work, "gallery.html"));
  assert.equal((await page.$$("#scenes-list button")).length, 3);
  assert.equal((await clicked("#scenes-list button:nth-child(2)")).scene, 1);
  assert.equal(await page.$eval("#title", ({ textContent }) => textContent), "video");
  // A hologram without a frame has no field, and its depth is the sharpest focus.
  const before = await clicked("#scenes-list button:nth-child(3)");
  assert.equal(await page.$eval("[data-view=field]", ({ hidden }) => hidden), true);
  assert.match(await page.$eval("#hint", ({ textContent }) => textContent), /sharpest/);
  const foci = new Set();
  for (const x of [0.2, 0.5, 0.8]) for (const y of [0.3, 0.6]) foci.add((await clicked("#shown canvas", x, y)).focus);
  assert.notDeepEqual([...foci], [before.focus]);
  assert.deepEqual([...film.wrong, ...wrong], []);
});
