// For bundlers that do not know `new URL(…, import.meta.url)`: the module is an import, the worker an entry of its own.
import { load } from "phasefront";
import module from "phasefront/raw/phasefront_web_bg.wasm";
import { compare } from "./app.js";

const worker = new Worker("session-worker.js", { type: "module" });
void compare(load(module), { threads: 1, module, worker });
