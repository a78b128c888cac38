// Compares the levels of WebGPU with those of the CPU outside of browsers, in Node with Dawn:
// `node dawn.js PACKAGE MODELS DAWN`, the folders of the package and of the networks, and Dawn's module.
import { readFile } from "node:fs/promises";
import { register } from "node:module";
import { pathToFileURL } from "node:url";

const [, , folder, models, dawn] = process.argv;
const { create, globals } = await import(pathToFileURL(dawn));
// What a worker of a browser has.
Object.assign(globalThis, globals, { WorkerGlobalScope: class {} });
Object.defineProperty(globalThis, "navigator", { value: { gpu: create([]) } });
globalThis.fetch = async (path) => new Response(await readFile(path.replace("/models", models)));

// The tests import the package from a server's root.
const at = `${pathToFileURL(folder)}/`;
const hook = `export function resolve(name, context, next) {
  return next(name.startsWith("/phasefront/") ? ${JSON.stringify(at)} + name.slice(12) : name, context);
}`;
register(`data:text/javascript,${encodeURIComponent(hook)}`);
const { load } = await import(`${at}webgpu/phasefront.js`);
await load(await readFile(`${folder}/webgpu/raw/phasefront_web_bg.wasm`));
const { run } = await import("./webgpu.js");
for (const line of await run()) console.log(`Dawn: ${line}`);
// Dawn keeps Node alive.
process.exit(0);
