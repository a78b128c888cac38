// The worker of a `WorkerSession`: its session, and the holograms that the page has not closed.
import type { Size } from "./canvas.js";
import { PhasefrontError, whole, type ErrorKind } from "./error.js";
import { Frame } from "./frame.js";
import { Hologram, type HologramInfo, type Layout, type OutputSize, type Placement } from "./hologram.js";
import { Modulator } from "./modulator.js";
import { Network } from "./network.js";
import { load } from "./phasefront.js";
import { Session, type Encoding, type Method, type Quality, type RunningMode, type SessionOptions } from "./session.js";
import type { ProcessAsyncOptions, Statistics } from "./session.js";
import { Target, displayFromToml, type Display } from "./target.js";
import type { NetworkSource, TargetSource, WorkerSessionOptions } from "./worker.js";

/** What the worker answers to a call: the result or an error, which without a kind is no fault that Phasefront names. */
export interface Reply {
  readonly id: number;
  readonly answer?: unknown;
  readonly error?: { readonly kind?: ErrorKind; readonly message: string; readonly error?: unknown };
}

/** A canvas that the page shows, by a number. It is moved to the worker with the first drawing. */
export interface PageCanvas {
  readonly canvas: number;
  readonly moved?: OffscreenCanvas;
}

let session: Session | undefined;
const holograms = new Map<number, Hologram>();
const canvases = new Map<number, OffscreenCanvas>();
let last = 0;

function opened(): Session {
  if (!session) throw new PhasefrontError("session", "session: it is not open");
  return session;
}

function hologram(id: number): Hologram {
  const found = holograms.get(id);
  if (!found) throw new PhasefrontError("session", "the hologram is closed; take what is needed of it before");
  return found;
}

function canvasOf({ canvas, moved }: PageCanvas): OffscreenCanvas {
  if (moved) canvases.set(canvas, moved);
  return canvases.get(canvas) as OffscreenCanvas;
}

function network(source: NetworkSource): Network {
  if (typeof source === "string") return Network.builtIn(source);
  return "pair" in source ? Network.builtInPair()[source.pair] : Network.fromBytes(source);
}

function target(source: TargetSource): Target | Display {
  if (typeof source === "string") return Target.fromToml(source);
  if ("modulator" in source) return Modulator.named(source.modulator).target;
  if ("calibration" in source) return Target.fromBytes(source.calibration);
  if (!("lookUpTable" in source)) return source;
  const { display, lookUpTable } = source;
  return Target.withLookUpTable(typeof display === "string" ? displayFromToml(display) : display, lookUpTable);
}

function method(said: Method<NetworkSource>): Method {
  switch (said.kind) {
    case "trained":
      return { ...said, network: network(said.network) };
    case "auto":
      return said.network === undefined ? { kind: "auto" } : { ...said, network: network(said.network) };
    default:
      return said;
  }
}

function encoding(said: Encoding<NetworkSource>): Encoding {
  return said.kind === "deep" ? { ...said, prefilter: network(said.prefilter) } : said;
}

function sessionOptions(said: WorkerSessionOptions): SessionOptions {
  const { target: display, method: of, encoding: encoder, qualityLevels: levels, ...others } = said;
  return {
    ...others,
    ...(display && { target: target(display) }),
    ...(of && { method: method(of) }),
    ...(encoder && { encoding: encoding(encoder) }),
    ...(levels && { qualityLevels: levels.map((level) => ({ ...level, method: method(level.method) })) }),
  };
}

const calls = {
  async open(
    options: WorkerSessionOptions,
    mode: RunningMode,
    { threads, source }: { threads: number | undefined; source: string | WebAssembly.Module | undefined },
  ): Promise<void> {
    await load(source, { threads });
    session = await Session.open(sessionOptions(options), mode);
  },

  async process(
    { colour, depth, options }: Frame,
    { onGpu }: ProcessAsyncOptions,
  ): Promise<{ hologram: number; info: HologramInfo }> {
    try {
      const made = await opened().processAsync(new Frame(colour, depth, options), { onGpu });
      holograms.set(++last, made);
      return { hologram: last, info: made.info };
    } finally {
      // The worker's own copy of a VideoFrame or an ImageBitmap.
      if ("close" in colour) colour.close();
    }
  },

  warmUp: (): void => opened().warmUp(),
  reset: (): void => opened().reset(),
  setQuality: (quality: Quality): void => opened().setQuality(quality),
  statistics: (): Statistics => opened().statistics,

  levels: (id: number) => hologram(id).levels as Uint8Array<ArrayBuffer>,
  zAt: (id: number, x: number, y: number): number => hologram(id).zAt(x, y),
  refocus: (id: number, zMm: number) => hologram(id).refocus(zMm) as Float32Array<ArrayBuffer>,
  field: (id: number, zMm: number) => hologram(id).field(zMm) as Float32Array<ArrayBuffer>,
  outputSize: (id: number, layout: Layout): OutputSize => hologram(id).outputSize(layout),

  preview(id: number, zMm: number, { width, height }: Size) {
    const [w, h] = [whole("the width of a preview", width), whole("the height of a preview", height)];
    const data = new Uint8ClampedArray(4 * w * h);
    hologram(id).writePreview(zMm, { width, height, data });
    return data;
  },

  output(id: number, placement: Placement, image: number) {
    const { width, height, pixelBytes } = hologram(id).outputSize(placement.layout ?? "rgb");
    const data = new Uint8ClampedArray(width * height * pixelBytes);
    hologram(id).writeOutput(placement, data, { image });
    return data;
  },

  drawLevels: (id: number, to: PageCanvas): Promise<void> => hologram(id).drawLevels(canvasOf(to)),
  drawPreview(id: number, zMm: number, to: PageCanvas, size: Size): Promise<void> {
    return hologram(id).drawPreview(zMm, canvasOf(to), size);
  },

  free(id: number): void {
    holograms.get(id)?.close();
    holograms.delete(id);
  },
};

/** The calls that the worker answers. */
export type Calls = typeof calls;

addEventListener("message", async ({ data: { id, call, said } }: MessageEvent) => {
  const reply = (reply: Reply, moved: Transferable[] = []) => postMessage(reply, { transfer: moved });
  try {
    const answer: unknown = await (calls[call as keyof Calls] as (...said: unknown[]) => unknown)(...said);
    reply({ id, answer }, ArrayBuffer.isView(answer) ? [answer.buffer as ArrayBuffer] : []);
  } catch (error) {
    const kind = error instanceof PhasefrontError ? error.kind : undefined;
    const message = error instanceof Error ? error.message : String(error);
    reply({ id, error: { kind, message, error: kind ? undefined : error } });
  }
});
