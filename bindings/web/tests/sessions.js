// Tests sessions in workers of their own: errors, aborting, the end of the worker, and levels on WebGPU.
import { Frame, PhasefrontError, WorkerSession } from "/package/worker.js";

const target = { width: 64, height: 48 };

/** Returns a frame with detail everywhere. */
export function frame(options) {
  const data = Uint8Array.from({ length: 4 * 64 * 48 }, (_, i) => (i * 37 + (i >> 7) * 11) % 256);
  const depth = Uint8Array.from({ length: 64 * 48 }, (_, i) => (i * 5) % 256);
  return new Frame({ width: 64, height: 48, data }, { width: 64, height: 48, data: depth }, options);
}

async function refused(kind, start, promise) {
  const error = await promise.then(
    () => new Error("not refused"),
    (error) => error,
  );
  const right = error instanceof PhasefrontError && error.kind === kind && error.message.includes(start);
  if (!right || error.message.includes("\n")) throw new Error(`${kind} ${start}: ${error.kind} ${error.message}`);
}

function equal(a, b, what) {
  if (a.length !== b.length || a.length === 0 || !a.every((value, i) => value === b[i]))
    throw new Error(`${what} differ`);
}

/** Tests that results are those of the same hologram, and that closed ones are refused. */
async function results(session) {
  const hologram = await session.process(frame());
  const [levels, output] = [await hologram.levels(), await hologram.output({ layout: "grey" }, 1)];
  equal(levels.subarray(64 * 48, 2 * 64 * 48), output, "levels and output");
  const view = await hologram.preview(await hologram.zAt(0.5, 0.5), { width: 32, height: 24 });
  const [seen, field] = [await hologram.refocus(1), await hologram.field(1)];
  const sizes = [view.width, seen.length, field.length, (await hologram.outputSize("rgba")).width];
  if (sizes.join() !== [32, levels.length, 2 * levels.length, 64].join()) throw new Error(`sizes ${sizes}`);
  await refused("setting", "no layout 'cyan'", hologram.output({ layout: "cyan" }));
  await refused("setting", "the width of a preview is -1", hologram.preview(0, { width: -1, height: 8 }));
  hologram.close();
  await refused("session", "hologram is closed", hologram.levels());
}

/** Tests that aborted frames are left out, and that the others are computed. */
async function aborts(session) {
  const before = (await session.statistics()).processed;
  const [waits, computes] = [new AbortController(), new AbortController()];
  const first = session.process(frame(), { signal: computes.signal });
  const second = session.process(frame(), { signal: waits.signal });
  const third = session.process(frame());
  waits.abort();
  const reasons = [await second.catch((error) => error.name)];
  computes.abort(new Error("enough"));
  reasons.push(await first.catch((error) => error.message));
  reasons.push(await session.process(frame(), { signal: AbortSignal.abort() }).catch((error) => error.name));
  (await third).close();
  const count = (await session.statistics()).processed - before;
  if (reasons.join() !== "AbortError,enough,AbortError" || count !== 2) throw new Error(`${reasons} ${count}`);
  const settings = { signal: AbortSignal.abort(new Error("too late")) };
  const late = await WorkerSession.open({ target }, "image", settings).catch((error) => error.message);
  if (late !== "too late") throw new Error(`${late}`);
}

/** Returns whether a worker of /tests/held.js lives; it holds a lock of this name. */
async function lives(name) {
  const { held, pending } = await navigator.locks.query();
  return [...held, ...pending].some((lock) => lock.name === name);
}

async function until(check, what) {
  for (let i = 0; i < 400; i++) {
    if (await check()) return;
    await new Promise((done) => setTimeout(done, 25));
  }
  throw new Error(`in vain: ${what}`);
}

/** Tests that a worker ends when its session is closed, also while it computes, and with its page. */
async function ends() {
  const worker = new Worker("/tests/held.js?closed", { type: "module" });
  const session = await WorkerSession.open({ target }, "image", { worker });
  await until(() => lives("?closed"), "the worker starts");
  const computing = session.process(frame());
  await session.statistics();
  session.close();
  session.close();
  await refused("session", "closed", computing);
  await refused("session", "closed", session.process(frame()));
  await until(async () => !(await lives("?closed")), "the worker ends with its session");

  const page = document.createElement("iframe");
  page.src = "/tests/held.html";
  document.body.append(page);
  await until(() => lives("?page"), "the page opens a session");
  page.remove();
  await until(async () => !(await lives("?page")), "the worker ends with its page");
}

/** Runs all tests, and throws if one fails. */
export async function run() {
  await refused(
    "network",
    "no 'rgbd-9' is built in",
    WorkerSession.open({ target, method: { kind: "trained", network: "rgbd-9" } }),
  );
  await refused("display", "pluto", WorkerSession.open({ target: { modulator: "pluto" } }));
  await refused("setting", "no mode 'live'", WorkerSession.open({ target }, "live"));
  await refused("setting", "no WebGPU", WorkerSession.open({ target, backend: "webgpu" }, "image", { threads: 2 }));
  await refused(
    "session",
    "cannot be loaded",
    WorkerSession.open({ target }, "image", { module: "/tests/nothing.wasm" }),
  );
  const missing = new Worker("/tests/nothing.js", { type: "module" });
  await refused("session", "could not be loaded", WorkerSession.open({ target }, "image", { worker: missing }));

  const session = await WorkerSession.open({ target, method: { kind: "auto", network: "rgbd-8" } }, "video");
  await session.warmUp();
  (await session.process(frame({ timestamp: 9 }))).close();
  await refused("timestamp", "", session.process(frame({ timestamp: 8 })));
  await session.reset();
  (await session.process(frame({ timestamp: 8 }))).close();
  await refused("setting", "", session.setQuality({ kind: "fixed", qualityLevel: 7 }));
  const { colour, depth } = frame();
  await refused(
    "frame",
    "aspect ratios differ",
    session.process(new Frame(colour, { ...depth, height: 12 }, { timestamp: 10 })),
  );
  session.close();

  const images = await WorkerSession.open({ target });
  await results(images);
  await aborts(images);
  // Frames whose memory is moved are detached here, and frames of a pair of networks are made in the worker.
  const moved = frame();
  (await images.process(moved, { transfer: [moved.colour.data.buffer] })).close();
  if (moved.colour.data.length !== 0) throw new Error("the frame was copied");
  images.close();
  const deep = await WorkerSession.open({
    target,
    method: { kind: "trained", network: { pair: "hologram" } },
    encoding: { kind: "deep", prefilter: { pair: "prefilter" } },
  });
  (await deep.process(frame())).close();
  deep.close();
  await ends();

  // A module that runs out of memory ends its worker; another worker is not affected.
  const huge = { target: { width: 8192, height: 8192, offsetMm: 6 }, method: { kind: "sweep" }, mostPixels: 2 ** 32 - 1 };
  const full = await WorkerSession.open(huge);
  await refused("internal", "the module cannot go on", full.process(frame()));
  const again = await WorkerSession.open({ target });
  (await again.process(frame())).close();
  again.close();
  return "sessions in workers refuse, abort and end as they should";
}

/** Waits until no byte that the page shows on `canvas` is farther than `most` from that of `image`. */
async function shows(canvas, { width, height, data }, most) {
  const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  const check = () => {
    copy.drawImage(canvas, 0, 0);
    return copy.getImageData(0, 0, width, height).data.every((byte, i) => Math.abs(byte - data[i]) <= most);
  };
  await until(check, "a canvas shows what the worker drew");
}

/** Compares the levels of WebGPU in a worker with those of the page. */
export async function onWebgpu() {
  const { Session, load } = await import("/phasefront/webgpu/phasefront.js");
  await load();
  const options = {
    target: { ...target, volumeDepthMm: 1.5 },
    method: { kind: "sweep" },
    backend: "webgpu",
    adapter: "swiftshader",
  };
  const session = await WorkerSession.open(options);
  const hologram = await session.process(frame());
  const { backend, backendWhy } = await session.statistics();
  if (!backend.includes("swiftshader")) throw new Error(`${backend}: ${backendWhy}`);
  using here = await Session.open(options);
  using same = await here.processAsync(frame());
  equal(await hologram.levels(), same.levels, "levels on WebGPU");

  // What the worker draws stays on the GPU, and the page shows it a moment later.
  const kept = await session.process(frame(), { onGpu: true });
  const { width, height } = kept.info;
  const [levels, view] = [0, 1].map(() => document.body.appendChild(document.createElement("canvas")));
  const images = [0, 1].map(() => new ImageData(width, height));
  same.writeOutput({ layout: "rgba" }, images[0].data);
  same.writePreview(0.5, images[1]);
  await kept.drawLevels(levels);
  await shows(levels, images[0], 0);
  await kept.drawPreview(0.5, view, { width, height });
  await shows(view, images[1], 1);
  same.writePreview(-0.5, images[1]);
  await kept.drawPreview(-0.5, view, { width, height });
  await shows(view, images[1], 1);
  await refused("setting", "stayed on the GPU", kept.levels());
  const taken = document.createElement("canvas");
  taken.getContext("2d");
  await refused("setting", "a new canvas", kept.drawLevels(taken));
  session.close();
  const other = await WorkerSession.open({ ...options, backend: "cpu" });
  const again = await other.process(frame(), { onGpu: true });
  await refused("setting", "a new canvas", again.drawLevels(levels));
  other.close();
  return [`a worker makes the same levels on ${backend}, and draws them and views`];
}
