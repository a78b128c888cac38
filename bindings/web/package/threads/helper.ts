// A worker that computes as one thread of the worker that made it.
import init, { help } from "./raw/phasefront_web.js";

addEventListener(
  "message",
  async ({ data: [module, memory] }: MessageEvent<[WebAssembly.Module, WebAssembly.Memory]>) => {
    const shared = { module_or_path: module, memory };
    await init(shared);
    postMessage("ready");
    help();
  },
  { once: true },
);
