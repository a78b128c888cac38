// `node try.mjs RGB.ppm DEPTH.pgm WIDTH HEIGHT LEVELS` writes the levels of an image with the npm package in this
// folder.
import { readFileSync, writeFileSync } from "node:fs";
import { Frame, Session, load } from "phasefront";

const [rgb, depth, width, height, levels] = process.argv.slice(2);
const size = { width: Number(width), height: Number(height) };
// The pixels are at the end of the file.
const pixels = (path, bytes) => readFileSync(path).subarray(-bytes * size.width * size.height);

await load(readFileSync(new URL("node_modules/phasefront/raw/phasefront_web_bg.wasm", import.meta.url)));
const session = new Session({ target: size });
const frame = new Frame({ ...size, data: pixels(rgb, 3), format: "RGB" }, { ...size, data: pixels(depth, 1) });
writeFileSync(levels, session.process(frame).levels);
