/**
 * Converts RGB-D frames to phase-only 3D holograms in a browser.
 *
 * ```ts
 * import { Frame, Session, load } from "phasefront";
 *
 * await load();
 * const session = new Session({ target: { width: 640, height: 480 } });
 * const frame = new Frame(context.getImageData(0, 0, 640, 480), { width: 160, height: 120, data: metres });
 * const hologram = session.process(frame);
 * console.log(hologram.levels.length, hologram.info.times.totalMs);
 * ```
 *
 * Names give the unit of lengths. Planes are row-major, (H, W), stacks (C, H, W). Errors are of the class {@link
 * PhasefrontError}, whose message is one line that names the fault and the correct value.
 */

import { PhasefrontError, guard, ready } from "./error.js";
import init, { version as rawVersion } from "./raw/phasefront_web.js";
import { start, threadsToStart } from "./threads.js";

export type { Canvas, Size } from "./canvas.js";
export { PhasefrontError, type ErrorKind } from "./error.js";
export {
  Frame,
  type Cameras,
  type ColourFormat,
  type ConfidenceFormat,
  type ConfidenceImage,
  type DepthFormat,
  type DepthImage,
  type FrameOptions,
  type Intrinsics,
  type Orientation,
  type PackedColour,
  type PlanarColour,
  type Plane,
  type RgbEncoding,
} from "./frame.js";
export {
  Hologram,
  type FrameTimes,
  type HologramInfo,
  type Layout,
  type OutputOptions,
  type OutputSize,
  type Placement,
  type PreviewImage,
} from "./hologram.js";
export { Modulator } from "./modulator.js";
export { Network, type DeepPair, type NetworkInfo } from "./network.js";
export {
  Session,
  type Brightness,
  type Encoding,
  type Focus,
  type Method,
  type ProcessAsyncOptions,
  type Quality,
  type RunningMode,
  type QualityLevel,
  type SessionOptions,
  type Statistics,
} from "./session.js";
export { Target, displayFromToml, type Display, type FullDisplay } from "./target.js";

/**
 * The source of the module: an address, a response, its bytes, or a compiled module that a page passes to its workers.
 */
export type ModuleSource = string | URL | Request | Response | BufferSource | WebAssembly.Module;

/** Options of {@link load}. */
export interface LoadOptions {
  /**
   * The number of threads that compute, including the calling worker's. In `phasefront/threads` it is by default that of
   * the processor, at most 8; in `phasefront` and `phasefront/webgpu` it is 1.
   */
  readonly threads?: number;
}

let loading: Promise<void> | undefined;

/**
 * Loads the module from the folder of this file, or from `source`. Later calls wait for the first. With
 * `phasefront/threads`, call it in a worker of a page that is isolated from other origins.
 *
 * @throws PhasefrontError `session`: the module cannot be loaded, the browser has no WebAssembly SIMD, or threads cannot
 * be started here. `setting`: the number of threads is invalid.
 */
export function load(source?: ModuleSource | Promise<ModuleSource>, options: LoadOptions = {}): Promise<void> {
  loading ??= loaded(source, options.threads).then(ready, (error: unknown) => {
    loading = undefined;
    if (error instanceof PhasefrontError) throw error;
    const why = error instanceof Error ? error.message : String(error);
    throw new PhasefrontError("session", `the module cannot be loaded: ${why.replaceAll("\n", " ")}`);
  });
  return loading;
}

async function loaded(source: ModuleSource | Promise<ModuleSource> | undefined, asked?: number): Promise<void> {
  const threads = threadsToStart(asked);
  await init(source === undefined ? undefined : { module_or_path: source });
  await start(threads);
}

/** Returns the version of the library. */
export function version(): string {
  return guard(rawVersion);
}

/**
 * Reads the third-party notices of the module as Markdown from the folder of this file. An app must show them with its own
 * notices.
 *
 * @throws PhasefrontError `session`: the file cannot be fetched.
 */
export async function thirdPartyNotices(): Promise<string> {
  const file = new URL("./THIRD-PARTY.md", import.meta.url);
  const answer = await fetch(file).catch(() => undefined);
  if (!answer?.ok) throw new PhasefrontError("session", `the notices cannot be read: serve ${file.href} beside the module`);
  return answer.text();
}
