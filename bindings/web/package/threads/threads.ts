import { PhasefrontError, whole } from "./error.js";
import { ofThisModule, startThreads } from "./raw/phasefront_web.js";

/** The most threads that are started unasked. */
const MOST = 8;

function session(message: string): PhasefrontError {
  return new PhasefrontError("session", message);
}

/** Returns the number of threads to start, and checks that they can be started here. */
export function threadsToStart(asked: number | undefined): number {
  if (typeof document !== "undefined")
    throw session("threads wait for each other, which a page's own thread may not do; load the module in a worker");
  if (!globalThis.crossOriginIsolated)
    throw session(
      "threads share memory, which needs a page that is isolated: serve it with Cross-Origin-Opener-Policy: same-origin " +
        "and Cross-Origin-Embedder-Policy: require-corp",
    );
  const threads = whole("threads", asked ?? Math.min(navigator.hardwareConcurrency, MOST));
  if (threads === 0) throw new PhasefrontError("setting", "threads is 0; 1 or more is right");
  return threads;
}

/** Starts `threads` threads: the calling one, and workers. */
export async function start(threads: number): Promise<void> {
  const helper = () =>
    new Promise<void>((done, fail) => {
      const worker = new Worker(new URL("./helper.js", import.meta.url), { type: "module" });
      worker.onmessage = () => done();
      worker.onerror = ({ message }) => fail(new Error(`a thread cannot start: ${message}`));
      worker.postMessage(ofThisModule());
    });
  await Promise.all(Array.from({ length: threads - 1 }, helper));
  startThreads(threads);
}
