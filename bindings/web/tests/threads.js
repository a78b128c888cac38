// Loads the package in workers with threads of their own.

/** Returns what `run` of a module of tests returns in a worker with `threads` threads, as `result`, or its `error`. */
export function inWorker(path, threads, folder = "/phasefront") {
  return new Promise((done) => {
    const worker = new Worker("/tests/worker.js", { type: "module" });
    worker.onmessage = ({ data }) => {
      worker.terminate();
      done(data);
    };
    worker.onerror = ({ message }) => done({ error: message });
    worker.postMessage({ from: `${folder}/phasefront.js`, path: `/tests/${path}`, threads });
  });
}

/** Returns the error of loading the package on this page. */
export async function onPage() {
  const { load } = await import("/phasefront/phasefront.js");
  return load().catch((error) => error.message);
}
