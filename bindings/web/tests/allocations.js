// Counts what a frame allocates in the page: the bytes of new buffers of JavaScript, and by how much the module's memory
// grows. An image that the caller keeps is written without a buffer; only `levels` returns a copy.
import { Frame, Modulator, Session, load } from "/phasefront/phasefront.js";

const [WIDTH, HEIGHT] = [640, 480];
/** The bytes of the smallest image, the levels of one colour. */
const PLANE = WIDTH * HEIGHT;

let allocated = 0;
let memory;

const isBuffer = (value) =>
  value instanceof ArrayBuffer || (globalThis.SharedArrayBuffer && value instanceof SharedArrayBuffer);

/** Counts the bytes of all typed arrays and buffers that are not views of another buffer. */
function countBuffers() {
  const kinds = Object.getOwnPropertyNames(globalThis).filter((name) => /^(\w+Array|ArrayBuffer)$/.test(name));
  for (const name of kinds.filter((name) => name !== "Array")) {
    const kind = globalThis[name];
    globalThis[name] = new Proxy(kind, {
      construct(target, values, made) {
        const array = Reflect.construct(target, values, made);
        if (!isBuffer(values[0])) allocated += array.byteLength;
        return array;
      },
    });
  }
  // These make their copies without the constructors above.
  const arrays = Object.getPrototypeOf(Uint8Array.prototype);
  const copying = ["slice", "map", "filter", "toReversed", "toSorted", "with"].map((name) => [arrays, name]);
  for (const [of, name] of [...copying, [ArrayBuffer.prototype, "slice"], [Blob.prototype, "arrayBuffer"]]) {
    const call = of[name];
    if (!call) continue;
    of[name] = function (...values) {
      const made = call.apply(this, values);
      allocated += made.byteLength ?? 0;
      return made;
    };
  }
}

/** Keeps the memory of the module that is loaded after this call. */
function watchMemory() {
  for (const name of ["instantiate", "instantiateStreaming"]) {
    const instantiate = WebAssembly[name];
    WebAssembly[name] = async (...values) => {
      const made = await instantiate.apply(WebAssembly, values);
      memory = (made.instance ?? made).exports.memory;
      return made;
    };
  }
}

/** Runs all tests, and throws if one fails. */
export async function run() {
  watchMemory();
  await load();
  countBuffers();
  const said = [];
  /** Checks the bytes that `call` allocates in JavaScript. The first calls may grow memory that later ones use again. */
  const count = (what, most, call) => {
    for (let i = 0; i < 3; i++) call();
    let least = Infinity;
    const size = memory.buffer.byteLength;
    for (let i = 0; i < 3; i++) {
      const before = allocated;
      call();
      least = Math.min(least, allocated - before);
    }
    const grown = memory.buffer.byteLength - size;
    said.push(`${what} ${least}`);
    if (least > most || grown > 0) throw new Error(`${what}: ${least} bytes of buffers, the module grew by ${grown}`);
    return least;
  };

  const before = allocated;
  const colour = Uint8ClampedArray.from({ length: 4 * PLANE }, (_, i) => (i * 37) % 251);
  const depth = new Uint8Array(PLANE).map((_, i) => (i / 700) % 256);
  if (allocated - before < 5 * PLANE) throw new Error("allocations are not counted");
  const image = new ImageData(colour, WIDTH, HEIGHT);
  const modulator = Modulator.fromToml(`width = ${WIDTH}\nheight = ${HEIGHT}`);
  using session = new Session({ target: modulator.target, method: { kind: "sweep" } }, "video");
  let timestamp = 0;
  const process = () => {
    timestamp += 33000;
    return session.process(new Frame(image, { width: WIDTH, height: HEIGHT, data: depth }, { timestamp }));
  };
  count("process", PLANE - 1, () => process().close());
  using hologram = process();
  const levels = count("levels", 3 * PLANE, () => hologram.levels);
  if (levels !== 3 * PLANE) throw new Error(`levels of ${levels} bytes are no single copy`);
  const [pixels, rgb] = [new ImageData(WIDTH, HEIGHT), new Uint8Array(3 * PLANE)];
  count("writeOutput", PLANE - 1, () => hologram.writeOutput({ layout: "rgba" }, pixels.data));
  count("writePreview", PLANE - 1, () => hologram.writePreview(0, pixels));
  count("writeOutput of a modulator", PLANE - 1, () => modulator.writeOutput(hologram, rgb));
  count("writePixels of a modulator", PLANE - 1, () => modulator.writePixels(hologram, pixels.data));
  modulator.writeOutput(hologram, rgb);
  const wrong = pixels.data.findIndex((value, i) => value !== (i % 4 < 3 ? rgb[3 * (i >> 2) + (i % 4)] : 255));
  if (wrong >= 0) throw new Error(`byte ${wrong} of the pixels is not that of the image`);
  return `bytes of new buffers: ${said.join(", ")}`;
}
