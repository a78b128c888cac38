// Checks the public types. This file is compiled but not run.
import { Frame, Network, Session, Target, load, type Display, type RgbEncoding, type SessionOptions } from "phasefront";

const display: Display = { width: 640, height: 480, wavelengthsNm: [532] };
const options: SessionOptions = {
  target: Target.ofDisplay(display),
  qualityLevels: [{ method: { kind: "trained", network: Network.builtIn() }, width: 640, height: 480 }],
  encoding: { kind: "anti-alias", sigma: 0.7, width: 3 },
  quality: { kind: "fixed", qualityLevel: 0 },
};

export async function show(context: CanvasRenderingContext2D, metres: Float32Array): Promise<ImageData> {
  await load();
  const session = new Session(options, "video");
  const frame = new Frame(
    context.getImageData(0, 0, 640, 480),
    { width: 160, height: 120, data: metres },
    { timestamp: 1 },
  );
  const hologram = session.process(frame);
  const near: number | undefined = hologram.info.rangeM?.[0];
  const encoding: RgbEncoding = hologram.info.encoding;
  console.log(near, encoding, hologram.levels.byteLength, session.statistics.times.totalMs);
  const view = new ImageData(640, 480);
  hologram.writePreview(hologram.zAt(0.5, 0.5), view);
  return view;
}

// @ts-expect-error: there is no mode `live`
new Session(options, "live");
// @ts-expect-error: an encoding is an object with a kind
new Session({ encoding: "anti-alias" });
// @ts-expect-error: networks are created by name or from bytes
new Network();
// @ts-expect-error: `raw` is internal
Network.builtIn().raw;
