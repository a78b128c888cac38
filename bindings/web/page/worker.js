// Runs the session in a worker, so that the page stays responsive while a frame is computed.
import { Frame, Network, Session, load } from "./phasefront/phasefront.js";

const METHODS = {
  "rgbd-8": () => ({ kind: "trained", network: Network.builtIn("rgbd-8") }),
  "rgbd-15": () => ({ kind: "trained", network: Network.builtIn("rgbd-15") }),
  sweep: () => ({ kind: "sweep" }),
};

let session, planned, hologram;

async function plan({ method, localSteps, width, height, video, backend }) {
  const wanted = JSON.stringify([method, localSteps, width, height, video, backend]);
  if (wanted === planned) return;
  session?.close();
  session = planned = undefined;
  session = await Session.open(
    { target: { width, height }, method: METHODS[method](), localSteps, backend },
    video ? "video" : "image",
  );
  session.warmUp();
  planned = wanted;
}

const answers = {
  async load() {
    await load();
  },

  async frame({ options, colour, depth, timestampNs }) {
    await plan(options);
    const start = performance.now();
    const made = await session.processAsync(
      new Frame(colour, { ...depth, pixelStride: 4, format: "normalized-u8" }, { timestampNs }),
    );
    const ms = performance.now() - start;
    hologram?.close();
    hologram = made;
    const { width, height } = hologram.outputSize("rgba");
    const levels = new Uint8ClampedArray(4 * width * height);
    hologram.writeOutput({ layout: "rgba" }, levels);
    const { backend, backendWhy } = session.statistics;
    return { ms, times: hologram.info.times, backend, backendWhy, width, height, levels };
  },

  view({ zMm }) {
    const { width, height } = hologram.info;
    const start = performance.now();
    const pixels = new Uint8ClampedArray(4 * width * height);
    hologram.writePreview(zMm, { width, height, data: pixels });
    return { ms: performance.now() - start, width, height, pixels };
  },

  focus({ x, y }) {
    return { zMm: hologram.zAt(x, y) };
  },
};

addEventListener("message", async ({ data: { id, kind, ...said } }) => {
  try {
    const answer = (await answers[kind](said)) ?? {};
    const memory = [answer.levels?.buffer, answer.pixels?.buffer].filter(Boolean);
    postMessage({ id, answer }, memory);
  } catch (error) {
    postMessage({ id, error: error.message });
  }
});
