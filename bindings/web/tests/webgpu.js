// Compares the levels of a session on WebGPU with those of the CPU, and tests what happens if there is no such GPU.
import { Frame, Modulator, Network, PhasefrontError, Session, load } from "/phasefront/webgpu/phasefront.js";

const ADAPTER = "swiftshader";

/** Returns a frame with detail everywhere and steps and ramps in depth. */
function frame(width, height, time = 0) {
  const data = new Uint8Array(4 * width * height);
  const depth = new Uint16Array(width * height);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const at = y * width + x;
      for (let c = 0; c < 3; c++) data[4 * at + c] = (c * 70 + x * 3 + y * 5 + 9 * time) % 256;
      depth[at] = 600 + (((x >> 3) * 409 + (y >> 3) * 57 + 40 * time) % 900);
    }
  }
  return new Frame({ width, height, data }, { width, height, data: depth }, { timestamp: (1 + time) * 33000 });
}

/** Returns the mean of |exp(iφ) − exp(iφ')| for the levels of two holograms in equal phase steps. */
function apart(a, b) {
  if (a.length !== b.length || a.length === 0) throw new Error(`${a.length} levels for ${b.length}`);
  let sum = 0;
  for (let i = 0; i < a.length; i++) sum += 2 * Math.abs(Math.sin(((a[i] - b[i]) * Math.PI) / 256));
  return sum / a.length;
}

async function network(name) {
  return Network.fromBytes(new Uint8Array(await (await fetch(`/models/${name}`)).arrayBuffer()));
}

/** The depth of a small volume, which needs few pixels of black border around a frame: drivers in software are slow. */
const SHALLOW = { volumeDepthMm: 1.5 };

/** Returns the cases: size, options, mode, and the bound that the native tests of the GPU state. */
async function cases() {
  const trained = (network) => ({ kind: "trained", network });
  const pair = Network.builtInPair();
  const sweep = { kind: "sweep" };
  const [maximal, anti] = [{ kind: "frame-max" }, { kind: "anti-alias" }];
  const plain = { localSteps: 0, darkThreshold: 0 };
  return {
    "sweep at the midpoint": [
      61,
      47,
      { method: sweep, encoding: anti, brightness: maximal, ...plain, display: SHALLOW },
      "image",
      0.002,
    ],
    "sweep, 3 mm away": [
      47,
      61,
      {
        method: sweep,
        encoding: { kind: "band-limit" },
        brightness: maximal,
        ...plain,
        display: { ...SHALLOW, offsetMm: 3 },
      },
      "image",
      0.002,
    ],
    "sweep of a video with the defaults": [80, 60, { method: sweep, display: SHALLOW }, "video", 0.002],
    "network in int8, 6 mm away": [
      61,
      47,
      { brightness: maximal, encoding: anti, ...plain, display: { offsetMm: 6 } },
      "image",
      0.002,
    ],
    "network in f32": [
      61,
      47,
      { method: trained(await network("rgbd-8.onnx")), brightness: maximal, encoding: anti, ...plain },
      "image",
      0.002,
    ],
    "pair with its pre-filter": [
      61,
      47,
      {
        method: trained(pair.hologram),
        encoding: { kind: "deep", prefilter: pair.prefilter },
      },
      "image",
      0.02,
    ],
  };
}

/** Returns the levels of two frames, data about the last, and the statistics. */
async function levels(session, width, height) {
  const all = [];
  let info;
  for (let time = 0; time < 2; time++) {
    const hologram = await session.processAsync(frame(width, height, time));
    all.push(...hologram.levels);
    info = hologram.info;
    hologram.close();
  }
  const { backend, backendWhy } = session.statistics;
  session.close();
  return { all, info, backend, backendWhy };
}

/** Compares WebGPU with the CPU and returns a line for each case. */
export async function run() {
  await load();
  const lines = [];
  for (const [name, [width, height, { display, ...said }, mode, bound]] of Object.entries(await cases())) {
    const options = { target: { width, height, ...display }, depthRange: { nearM: 0.6, farM: 1.5 }, ...said };
    const cpu = await levels(new Session(options, mode), width, height);
    const open = Session.open({ ...options, backend: "webgpu", adapter: ADAPTER }, mode);
    const gpu = await levels(await open, width, height);
    if (!gpu.backend.includes(ADAPTER)) throw new Error(`${name}: ${gpu.backend}: ${gpu.backendWhy}`);
    const far = apart(gpu.all, cpu.all);
    const scale = Math.abs(gpu.info.scale / cpu.info.scale - 1);
    const { methodMs, propagateMs, encodeMs, totalMs } = gpu.info.times;
    const stages = [methodMs, propagateMs, encodeMs].map((ms) => ms.toFixed(1)).join(", ");
    lines.push(`${name}: ${far.toFixed(6)} apart, ${bound} allowed; ${gpu.backend}; ${stages} ms`);
    // This adapter has time stamps. A sweep propagates by itself.
    const propagates = display?.offsetMm && said.method?.kind !== "sweep";
    const timed = methodMs > 0 && encodeMs > 0 && (propagateMs > 0 || !propagates);
    if (!timed || methodMs + propagateMs + encodeMs > totalMs + 1e-6) throw new Error(`${lines.at(-1)} of ${totalMs}`);
    if (!(far < bound && scale < bound)) throw new Error(`${lines.at(-1)}; scales ${scale}`);
  }
  return lines;
}

const SWEEP = {
  target: { width: 61, height: 47, ...SHALLOW },
  method: { kind: "sweep" }, backend: "webgpu", adapter: ADAPTER };

/** Opens a session that must fall back to the CPU with a reason that contains `why`, and returns the reason. */
async function fallsBack(options, why) {
  const cpu = await levels(new Session({ ...options, backend: "cpu" }), 61, 47);
  const session = await Session.open(options);
  const found = await levels(session, 61, 47);
  const said = `${found.backend}: ${found.backendWhy}`;
  const same = found.all.every((level, i) => level === cpu.all[i]);
  if (!same || !said.startsWith("simd128: ") || !said.includes(why) || said.includes("\n"))
    throw new Error(`${why}: ${same} ${said}`);
  return said;
}

/** Returns the bytes that a canvas shows. */
function shown(canvas) {
  const { width, height } = canvas;
  const copy = new OffscreenCanvas(width, height).getContext("2d");
  copy.drawImage(canvas, 0, 0);
  return copy.getImageData(0, 0, width, height).data;
}

/** Throws unless no byte of `canvas` is farther than `most` from that of `image`. */
function same(what, canvas, { width, height, data }, most = 0) {
  if (canvas.width !== width || canvas.height !== height) throw new Error(`${what}: ${canvas.width}×${canvas.height}`);
  const far = shown(canvas).reduce((far, byte, i) => Math.max(far, Math.abs(byte - data[i])), 0);
  if (far > most) throw new Error(`${what}: ${far} apart`);
  return `${what}: ${far} of 255 apart`;
}

/** Returns the image that a hologram writes for its modulator. */
function outputOf(hologram) {
  const { width, height } = hologram.outputSize("rgba");
  const image = new ImageData(width, height);
  hologram.writeOutput({ layout: "rgba" }, image.data);
  return image;
}

async function kindOf(call) {
  const error = await (async () => call())().catch((error) => error);
  return `${error?.kind}: ${error?.message}`;
}

/** Compares what holograms draw to canvases on the GPU and on the CPU with what they write into images. */
export async function canvases() {
  await load();
  const lines = [];
  const target = { width: 61, height: 47, ...SHALLOW, offsetMm: 1 };
  const level = { method: { kind: "sweep" }, width: 40, height: 30 };
  for (const options of [
    { ...SWEEP, target, backend: "cpu" },
    { ...SWEEP, target },
    { ...SWEEP, target, qualityLevels: [level] },
  ]) {
    const session = await Session.open(options);
    const read = await session.processAsync(frame(61, 47));
    const kept = await session.processAsync(frame(61, 47), { onGpu: true });
    // What the document shows cannot be read any more after it was shown.
    const element = document.createElement("canvas");
    const [offscreen, eye] = [new OffscreenCanvas(5, 7), new OffscreenCanvas(31, 23)];
    const backend = session.statistics.backend;
    for (const canvas of [element, offscreen, element]) {
      await kept.drawLevels(canvas);
      lines.push(same(`levels of ${backend}`, canvas, outputOf(read)));
      // A page may change the size of its canvas.
      canvas.width = 9;
    }
    for (const zMm of [-0.7, 1, 0.7]) {
      await kept.drawPreview(zMm, eye);
      const view = new ImageData(31, 23);
      read.writePreview(zMm, view);
      lines.push(same(`view at ${zMm} mm of ${backend}`, eye, view, 1));
    }
    const large = new ImageData(100, 80);
    read.writePreview(0, large);
    await kept.drawPreview(0, eye, large);
    lines.push(same(`large view of ${backend}`, eye, large, 1));
    if (Math.abs(kept.zAt(0.5, 0.5) - read.zAt(0.5, 0.5)) > 1e-9) throw new Error("zAt");

    const [flat, other] = [new OffscreenCanvas(8, 8), options.backend === "cpu" ? "webgpu" : "2d"];
    flat.getContext(other);
    const refused = [
      await kindOf(() => kept.drawLevels(flat)),
      await kindOf(() => kept.drawPreview(0, flat)),
      await kindOf(() => kept.drawPreview(0, new OffscreenCanvas(0, 8))),
      await kindOf(() => kept.drawPreview(1e9, eye)),
    ];
    const pluto = Modulator.named("holoeye-pluto");
    const readings = [
      () => kept.levels,
      () => kept.refocus(0),
      () => kept.field(),
      () => outputOf(kept),
      () => pluto.writeOutput(kept, new Uint8Array(1)),
    ];
    for (const call of options.backend === "cpu" ? [] : readings) {
      refused.push(await kindOf(call));
      if (!refused.at(-1).includes("stayed on the GPU")) throw new Error(refused.at(-1));
    }
    for (const why of refused)
      if (!why.startsWith("setting: ") || why.includes("\n")) throw new Error(`not refused: ${why}`);
    lines.push(...refused);
    // Closing waits for what is being drawn.
    const drawn = kept.drawLevels(element);
    kept.close();
    await drawn;
    lines.push(await kindOf(() => kept.drawLevels(element)));
    if (!lines.at(-1).startsWith("session: ")) throw new Error(lines.at(-1));
    read.close();
    session.close();
  }
  return lines;
}

/** Tests adapters that are missing, in software, too small and lost, and the misuse of sessions. */
export async function refusals() {
  await load();
  const lines = [];
  const { adapter, ...hardware } = SWEEP;
  lines.push(await fallsBack(hardware, "only drivers in software answer"));
  lines.push(await fallsBack({ ...SWEEP, adapter: "no such card" }, "none is called 'no such card'"));
  const { requestAdapter } = GPU.prototype;
  GPU.prototype.requestAdapter = async () => null;
  lines.push(await fallsBack(SWEEP, "the browser gives no WebGPU adapter"));
  GPU.prototype.requestAdapter = requestAdapter;
  const { requestDevice } = GPUAdapter.prototype;
  GPUAdapter.prototype.requestDevice = async () => {
    throw new Error("not today");
  };
  lines.push(await fallsBack(SWEEP, "not today"));
  GPUAdapter.prototype.requestDevice = requestDevice;
  // An adapter with the least that WebGPU guarantees, which frames of this size outgrow.
  const limits = Object.getOwnPropertyDescriptor(GPUSupportedLimits.prototype, "maxStorageBufferBindingSize");
  Object.defineProperty(GPUSupportedLimits.prototype, "maxStorageBufferBindingSize", { ...limits, get: () => 2 ** 27 });
  const large = { ...SWEEP, target: { width: 4096, height: 3072 }, mostPixels: 2 ** 26 };
  const small = await Session.open(large);
  lines.push(`${small.statistics.backend}: ${small.statistics.backendWhy}`);
  if (!lines.at(-1).startsWith("simd128: ") || !lines.at(-1).includes("too large for")) throw new Error(lines.at(-1));
  small.close();
  Object.defineProperty(GPUSupportedLimits.prototype, "maxStorageBufferBindingSize", limits);

  // Each device is lost as soon as it is used: after three losses the CPU goes on.
  const devices = [];
  GPUAdapter.prototype.requestDevice = async function (...said) {
    devices.push(await requestDevice.apply(this, said));
    return devices.at(-1);
  };
  const session = await Session.open(SWEEP);
  const first = await session.processAsync(frame(61, 47));
  const before = first.levels;
  first.close();
  devices.at(-1).destroy();
  let lost = 0;
  let again;
  while (!again) {
    try {
      again = await session.processAsync(frame(61, 47));
    } catch (error) {
      if (!(error instanceof PhasefrontError) || error.kind !== "session" || ++lost > 1) throw error;
    }
  }
  if (!before.every((level, i) => level === again.levels[i]) || devices.length < 2) throw new Error("lost levels");
  again.close();
  lines.push(`${session.statistics.backend}: ${session.statistics.backendWhy}`);
  if (!lines.at(-1).includes("opened again after")) throw new Error(lines.at(-1));
  GPUAdapter.prototype.requestDevice = async () => {
    throw new Error("gone");
  };
  devices.at(-1).destroy();
  // The loss is told after a moment.
  await new Promise((done) => setTimeout(done, 100));
  const without = await session.processAsync(frame(61, 47));
  lines.push(`${session.statistics.backend}: ${session.statistics.backendWhy}`);
  if (!lines.at(-1).startsWith("simd128: ") || apart(without.levels, before) > 0.002) throw new Error(lines.at(-1));
  without.close();
  session.close();
  GPUAdapter.prototype.requestDevice = requestDevice;

  for (const call of [() => new Session(SWEEP), async () => (await Session.open(SWEEP)).process(frame(61, 47))]) {
    const error = await (async () => call())().catch((error) => error);
    if (error?.kind !== "setting") throw new Error(`not refused: ${error}`);
  }
  // Frames that are handed over at once are computed one after another, and a session may be closed at once.
  const busy = await Session.open(SWEEP, "video");
  const both = [busy.processAsync(frame(61, 47, 0)), busy.processAsync(frame(61, 47, 1))];
  for (const hologram of await Promise.all(both)) hologram.close();
  busy.close();
  return lines;
}
