// Runs the conformance suite in a browser and returns the levels of each case for the test to compare.
import { Frame, Network, Session, Target, displayFromToml, load } from "/phasefront/phasefront.js";

const bytes = async (path) => new Uint8Array(await (await fetch(path)).arrayBuffer());
const model = async (name) => Network.fromBytes(await bytes(`/models/${name}`));

async function targetOf(one) {
  if (one.calibration) return Target.fromBytes(await bytes(`/suite/${one.calibration}`));
  const display = displayFromToml(one.display);
  return one.lut ? Target.withLookUpTable(display, Uint8Array.from(one.lut)) : Target.ofDisplay(display);
}

async function methodOf(name) {
  const kinds = { network: "trained", auto: "auto" };
  if (name === "sweep") return { kind: "sweep" };
  return { kind: kinds[name] ?? "trained", network: name in kinds ? Network.builtIn() : await model(name) };
}

async function optionsOf(one) {
  const known = ["double-phase", "anti-alias", "band-limit"].includes(one.encoding);
  return {
    target: await targetOf(one),
    method: await methodOf(one.method),
    encoding: known ? { kind: one.encoding } : { kind: "deep", prefilter: await model(one.encoding) },
    brightness: one.brightness === null ? undefined : { kind: "fixed", scale: one.brightness },
    depthRange: one.range === null ? undefined : { nearM: one.range[0], farM: one.range[1] },
  };
}

function frameOf(said, memory) {
  const plane = ({ offset, length, row_stride, pixel_stride }) => ({
    data: memory.subarray(offset, offset + length),
    rowStride: row_stride,
    pixelStride: pixel_stride,
  });
  const image = ({ format, width, height, plane: of }) => ({ format, width, height, ...plane(of) });
  const { format, width, height, planes, matrix, video_range: videoRange } = said.colour;
  const colour =
    planes.length > 1
      ? { format, width, height, planes: planes.map(plane), matrix, videoRange }
      : { format, width, height, ...plane(planes[0]) };
  return new Frame(colour, image(said.depth), {
    timestampNs: BigInt(said.timestamp_ns),
    confidence: said.confidence ? image(said.confidence) : undefined,
    orientation: { degrees: said.rotation, mirrored: said.mirrored },
  });
}

/** Returns the levels of each case's frames in base64, or null for cases with a depth network. */
export async function run() {
  await load();
  const { cases } = await (await fetch("/suite/cases.json")).json();
  const memory = await bytes("/suite/frames.bin");
  const results = [];
  for (const one of cases) {
    if (one.depth_network !== null) {
      results.push(null);
      continue;
    }
    const session = new Session(await optionsOf(one), one.mode);
    let levels = "";
    for (const said of one.frames) {
      const hologram = session.process(frameOf(said, memory));
      for (const level of hologram.levels) levels += String.fromCharCode(level);
      hologram.close();
    }
    results.push(btoa(levels));
    session.close();
  }
  return results;
}
