// For bundlers that do not know `new URL(…, import.meta.url)`: modules are imports, workers entries of their own.
import { load } from "phasefront";
import module from "phasefront/raw/phasefront_web_bg.wasm";
import gpuModule from "phasefront/webgpu/raw/phasefront_web_bg.wasm";
import { compare } from "./app.js";

const worker = new Worker("session-worker.js", { type: "module" });
const gpuWorker = new Worker("gpu-worker.js", { type: "module" });
const onGpu = { backend: "webgpu", module: gpuModule, worker: gpuWorker };
void compare(load(module), { threads: 1, module, worker }, onGpu);
