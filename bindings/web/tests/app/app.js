// An app that is built by bundlers: compares the levels of the page, a worker, and threads.
import { Frame, Session } from "phasefront";
import { WorkerSession } from "phasefront/worker";

const [width, height] = [64, 48];
const data = Uint8Array.from({ length: 4 * width * height }, (_, i) => (i * 37 + (i >> 7) * 11) % 256);
const depth = Uint8Array.from({ length: width * height }, (_, i) => (i * 5) % 256);
const frame = new Frame({ width, height, data }, { width, height, data: depth });
const options = { target: { width, height } };

/**
 * Makes levels here and in workers of each of these settings and backends, and tells the test whether they are equal. The
 * test's browser has no GPU, so that the CPU computes.
 */
export async function compare(loaded, ...cases) {
  try {
    await loaded;
    const here = new Session(options).process(frame).levels;
    for (const { backend, ...settings } of cases) {
      const session = await WorkerSession.open({ ...options, backend }, "image", settings);
      const levels = await (await session.process(frame)).levels();
      session.close();
      if (levels.length !== here.length || !levels.every((level, i) => level === here[i]))
        throw new Error(`${JSON.stringify({ backend, ...settings })} makes other levels`);
    }
    globalThis.answer = `${here.length} levels`;
  } catch (error) {
    globalThis.answer = `${error.name}: ${error.message}`;
  }
}
