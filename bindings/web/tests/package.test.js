// Tests the built package in browsers, without and with threads.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { gzipSync } from "node:zlib";
import { BROWSERS, BUILT, ROOT } from "./support.js";

const suite = join(ROOT, "tests/conformance");
const { cases } = JSON.parse(readFileSync(join(suite, "cases.json"), "utf8"));

/** Compares levels with those of the suite, which a processor with fused multiply-adds wrote. */
function compare(results) {
  let expected = readFileSync(join(suite, "levels.bin"));
  assert.equal(results.length, cases.length);
  for (const [index, one] of cases.entries()) {
    const levels = results[index] && Buffer.from(results[index], "base64");
    // Depth networks run on tract, which the package leaves out.
    assert.equal(levels === null, one.depth_network !== null, one.name);
    const count = levels?.length ?? 3 * 36 * 48 * one.frames.length;
    const far = [...(levels ?? [])].map((level, i) => (level - expected[i] + one.levels) % one.levels).filter((by) => by !== 0);
    expected = expected.subarray(count);
    // Only the filters and Fourier transforms of the sweep use fused operations. No other level may differ.
    const fused = /sweep|auto|default|seeded/.test(one.method) || one.display.includes("offset_mm");
    assert.ok(far.length <= (fused ? count / 200 : 0) && far.every((by) => by === 1 || by === one.levels - 1),
      `${one.name}: ${far.length} of ${count} levels differ: ${[...new Set(far)]}`);
  }
  assert.equal(expected.length, 0);
}

test("the module that pages load first has less than a megabyte, gzip", (t) => {
  const bytes = gzipSync(readFileSync(join(BUILT, "phasefront/raw/phasefront_web_bg.wasm"))).length;
  t.diagnostic(`${bytes} bytes`);
  assert.ok(bytes < 1e6, `${bytes} bytes`);
});

for (const [name, start] of Object.entries(BROWSERS))
  describe(name, () => {
    let browser, plain, isolated, levels;
    before(async () => {
      browser = await start();
      ({ plain, isolated } = browser);
      levels = await browser.run(plain, "conformance.js");
    });
    after(() => browser.close());

    test("makes the levels of the conformance suite", () => compare(levels));

    for (const threads of [1, 3])
      test(`makes the same levels with the module on ${threads} threads`, async () => {
        assert.deepEqual(await browser.run(isolated, "threads.js", "inWorker", "conformance.js", threads), { result: levels });
      });

    for (const [isolates, threads] of [[false, undefined], [true, 1], [true, undefined], [true, 3]])
      test(`makes the same levels in a session's worker, isolated: ${isolates}, threads: ${threads}`, async () => {
        assert.deepEqual(await browser.run(isolates ? isolated : plain, "conformance.js", "inWorker", threads), levels);
      });

    test("makes the same levels with the module of WebGPU where there is none", async () => {
      assert.deepEqual(await browser.run(plain, "conformance.js", "inWorker", undefined, "webgpu"), levels);
    });

    test("refuses threads that it cannot have", async () => {
      for (const [address, folder, threads, said] of [
        [plain, "/phasefront", 2, "session: 2 threads are asked for, and this module has one"],
        [plain, "/phasefront/threads", 2, "session: threads share memory, which needs a page that is isolated"],
        [isolated, "/phasefront", 0, "setting: threads is 0"],
      ]) {
        const { error } = await browser.run(address, "threads.js", "inWorker", "conformance.js", threads, folder);
        assert.ok(error?.startsWith(said), error);
      }
      assert.match(await browser.run(isolated, "threads.js", "onPage"), /load the module in a worker/);
    });

    for (const module of ["border", "pictures", "allocations", "sessions", "page-frame"])
      test(`${module}.js`, async (t) => t.diagnostic(await browser.run(plain, `${module}.js`)));
  });
