// Runs a WebAssembly program for Cargo: `node wasi.cjs PROGRAM [ARGUMENT…]`.
const { readFileSync } = require("node:fs");
const { WASI } = require("node:wasi");

const wasi = new WASI({ version: "preview1", args: process.argv.slice(2), env: process.env });
const module_ = new WebAssembly.Module(readFileSync(process.argv[2]));
process.exitCode = wasi.start(new WebAssembly.Instance(module_, wasi.getImportObject()));
