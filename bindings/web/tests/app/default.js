// Lets the bundler find all files.
import { load } from "phasefront";
import { compare } from "./app.js";

void compare(load(), { threads: 1 }, { threads: 2 }, { backend: "webgpu" });
