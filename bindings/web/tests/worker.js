// Runs a function of a module of tests in a worker, and sends what it returns. Loads the package with the threads asked for.
addEventListener("message", async ({ data: { from, path, threads } }) => {
  try {
    const { load } = await import(from);
    await load(undefined, { threads });
    postMessage({ result: await (await import(path)).run() });
  } catch (error) {
    postMessage({ error: `${error.kind}: ${error.message}` });
  }
});
