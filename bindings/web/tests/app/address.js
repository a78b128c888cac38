// Passes the module's address, which the bundler resolves.
import { load } from "phasefront";
import { compare } from "./app.js";

const module = new URL("phasefront/raw/phasefront_web_bg.wasm", import.meta.url);
void compare(load(module), { threads: 1, module });
