// Runs the conformance suite in a browser and returns the levels of each case for the test to compare.
import { Frame, Network, Session, Target, displayFromToml, load } from "/phasefront/phasefront.js";
import { WorkerSession } from "/package/worker.js";

const bytes = async (path) => new Uint8Array(await (await fetch(path)).arrayBuffer());
const model = (name) => bytes(`/models/${name}`);

/** How a session of this thread takes networks and targets, and makes levels. */
const HERE = {
  open: (options, mode) => new Session(options, mode),
  network: (source) => (typeof source === "string" ? Network.builtIn(source) : Network.fromBytes(source)),
  target({ calibration, display, lookUpTable }) {
    if (calibration) return Target.fromBytes(calibration);
    return lookUpTable ? Target.withLookUpTable(displayFromToml(display), lookUpTable) : Target.fromToml(display);
  },
  levels(session, frame) {
    using hologram = session.process(frame);
    return hologram.levels;
  },
};

/** The same of a session in a worker of its own. */
const elsewhere = (settings, backend) => ({
  open: (options, mode) => WorkerSession.open({ ...options, backend }, mode, settings),
  network: (source) => source,
  target: ({ display, ...others }) =>
    "calibration" in others ? others : "lookUpTable" in others ? { display, ...others } : display,
  async levels(session, frame) {
    using hologram = await session.process(frame);
    return await hologram.levels();
  },
});

async function targetOf(one, api) {
  if (one.calibration) return api.target({ calibration: await bytes(`/suite/${one.calibration}`) });
  return api.target({ display: one.display, ...(one.lut && { lookUpTable: Uint8Array.from(one.lut) }) });
}

async function methodOf(name, api) {
  const kinds = { network: "trained", auto: "auto" };
  if (name === "default") return undefined;
  if (name === "sweep") return { kind: "sweep" };
  return { kind: kinds[name] ?? "trained", network: api.network(name in kinds ? "rgbd-8" : await model(name)) };
}

async function optionsOf(one, api) {
  const known = ["double-phase", "anti-alias", "band-limit"].includes(one.encoding);
  return {
    target: await targetOf(one, api),
    method: await methodOf(one.method, api),
    encoding: known ? { kind: one.encoding } : { kind: "deep", prefilter: api.network(await model(one.encoding)) },
    brightness: one.brightness === null ? undefined : { kind: "fixed", scale: one.brightness },
    focus: one.focus_steps === null ? undefined : { kind: "natural", steps: one.focus_steps },
    depthRange: one.range === null ? undefined : { nearM: one.range[0], farM: one.range[1] },
  };
}

const FORMATS = { rgba: "RGBA", bgra: "BGRA", rgb: "RGB", nv12: "NV12", yuv420: "I420" };
const MATRICES = { bt601: "smpte170m", bt709: "bt709" };

function frameOf(said, memory) {
  const plane = ({ offset, length, row_stride, pixel_stride }) => ({
    data: memory.subarray(offset, offset + length),
    rowStride: row_stride,
    pixelStride: pixel_stride,
  });
  const image = ({ format, width, height, plane: of }) => ({ format, width, height, ...plane(of) });
  const { width, height, planes, matrix, video_range: video, encoding } = said.colour;
  const format = FORMATS[said.colour.format];
  const colorSpace = { matrix: MATRICES[matrix], fullRange: !video };
  const colour =
    planes.length > 1
      ? { format, width, height, planes: planes.map(plane), colorSpace }
      : { format, width, height, ...plane(planes[0]) };
  return new Frame(colour, image(said.depth), {
    timestamp: said.timestamp_ns / 1000,
    confidence: said.confidence ? image(said.confidence) : undefined,
    orientation: { degrees: said.rotation, mirrored: said.mirrored },
    encoding,
  });
}

async function suite(api) {
  const { cases } = await (await fetch("/suite/cases.json")).json();
  const memory = await bytes("/suite/frames.bin");
  const results = [];
  for (const one of cases) {
    if (one.depth_network !== null) {
      results.push(null);
      continue;
    }
    using session = await api.open(await optionsOf(one, api), one.mode);
    let levels = "";
    for (const said of one.frames)
      for (const level of await api.levels(session, frameOf(said, memory))) levels += String.fromCharCode(level);
    results.push(btoa(levels));
  }
  return results;
}

/** Returns the levels of each case's frames in base64, or null for cases with a depth network. */
export async function run() {
  await load();
  return suite(HERE);
}

/** Returns the levels that sessions make in a worker of their own with `threads` threads, or on another backend. */
export function inWorker(threads, backend) {
  return suite(elsewhere({ threads }, backend));
}
