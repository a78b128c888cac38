// Measures the time of a 640×480 RGBA frame with a 160×120 depth in metres: the best of 20 for each stage, in ms.
import { Frame, Network, Session, load } from "/phasefront/phasefront.js";

const [WIDTH, HEIGHT] = [640, 480];

/** Returns frame `i` of a ball in front of a striped wall, which `moves` or stands. */
export function frame(i = 0, moves = false) {
  const data = new Uint8Array(4 * WIDTH * HEIGHT);
  for (let y = 0; y < HEIGHT; y++) {
    for (let x = 0; x < WIDTH; x++) {
      const stripe = Math.floor((x / WIDTH) * 9 + (y / HEIGHT) * 4) % 2 ? 200 : 60;
      data.set([0.3 * stripe, stripe, (255 * x) / WIDTH, 255], 4 * (y * WIDTH + x));
    }
  }
  const metres = Float32Array.from({ length: 160 * 120 }, (_, at) => {
    const [x, y] = [at % 160, Math.floor(at / 160)];
    const r = Math.hypot(x - 70 - (moves ? 2 * i : 0), y - 60) / 30;
    return r < 1 ? 0.6 - 0.15 * Math.sqrt(1 - r * r) : 1.2 + (0.5 * x) / 160;
  });
  const timestamp = moves ? 33_000 * (i + 1) : undefined;
  return new Frame({ width: WIDTH, height: HEIGHT, data }, { width: 160, height: 120, data: metres }, { timestamp });
}

/** Returns the best times by method. */
export async function run() {
  await load();
  const results = {};
  const target = { width: WIDTH, height: HEIGHT };
  const all = {
    automatic: { target },
    "rgbd-15": { target, method: { kind: "trained", network: Network.builtIn("rgbd-15") } },
    sweep: { target, method: { kind: "sweep" } },
    "automatic, 6 mm away": { target: { ...target, offsetMm: 6 } },
    "natural focus": { target, focus: { kind: "natural" } },
    "automatic, video of a moving ball": { target },
    "natural focus, video of a moving ball": { target, focus: { kind: "natural" } },
  };
  for (const [name, options] of Object.entries(all)) {
    const moves = name.includes("video");
    const session = new Session(options, moves ? "video" : "image");
    const view = new ImageData(WIDTH, HEIGHT);
    const best = { frameMs: Infinity, previewMs: Infinity };
    for (let i = 0; i < 20; i++) {
      const said = frame(i, moves);
      const before = performance.now();
      const hologram = session.process(said);
      const made = performance.now();
      hologram.writePreview(-2 + i / 5, view);
      best.previewMs = Math.min(best.previewMs, performance.now() - made);
      best.frameMs = Math.min(best.frameMs, made - before);
      for (const [stage, ms] of Object.entries(hologram.info.times))
        best[stage] = Math.min(best[stage] ?? Infinity, ms);
      hologram.close();
    }
    session.close();
    results[name] = best;
  }
  return results;
}
