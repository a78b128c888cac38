/**
 * Runs a session in a worker of its own, so that the page stays responsive. The calls are those of `phasefront`, with
 * results that come later. Nothing has to be loaded before.
 *
 * ```ts
 * import { Frame, WorkerSession } from "phasefront/worker";
 *
 * const session = await WorkerSession.open({ target: { width: 640, height: 480 } });
 * const hologram = await session.process(new Frame(picture, { width: 160, height: 120, data: metres }));
 * context.putImageData(await hologram.preview(0, { width: 640, height: 480 }), 0, 0);
 * hologram.close();
 * ```
 */

/// <reference lib="esnext.disposable" preserve="true" />
import type { Canvas, Size } from "./canvas.js";
import { PhasefrontError } from "./error.js";
import type { Frame } from "./frame.js";
import type { HologramInfo, Layout, OutputSize, Placement } from "./hologram.js";
import type { Calls, PageCanvas, Reply } from "./session-worker.js";
import type { ProcessAsyncOptions, Quality, RunningMode, SessionOptions, Statistics } from "./session.js";
import type { Display } from "./target.js";

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
} from "./frame.js";
export type { FrameTimes, HologramInfo, Layout, OutputSize, Placement } from "./hologram.js";
export type { Brightness, Encoding, Method, Quality, QualityLevel, RunningMode, Statistics } from "./session.js";
export type { Display } from "./target.js";

/** A file's bytes. */
export type Bytes = ArrayBuffer | ArrayBufferView;

/**
 * A network of a worker's session: the name of a built-in one, the bytes of an `.onnx` file, or one of the built-in
 * pair.
 */
export type NetworkSource = string | Bytes | { readonly pair: "hologram" | "prefilter" };

/**
 * A target of a worker's session: a display or its TOML, alone or with the modulator's look-up table, the bytes of a
 * calibration, or the name of a modulator in the catalogue.
 */
export type TargetSource =
  | Display
  | string
  | { readonly display: Display | string; readonly lookUpTable: Bytes }
  | { readonly calibration: Bytes }
  | { readonly modulator: string };

/** The options of a worker's session, which has its networks and its target by name or as files. */
export type WorkerSessionOptions = SessionOptions<NetworkSource, TargetSource>;

/** The settings of a session's worker. */
export interface WorkerSettings {
  /**
   * The number of threads that compute. By default that of the processor, at most 8, if the page is isolated from other
   * origins and the CPU computes; otherwise 1. More than one load the module of `phasefront/threads`, and `backend:
   * "webgpu"` that of `phasefront/webgpu`.
   */
  readonly threads?: number;
  /** The module, if your bundler moves it: its address, or the compiled module. */
  readonly module?: string | URL | WebAssembly.Module;
  /**
   * The worker, if your bundler has none for `new Worker(new URL(…, import.meta.url))`: it runs `phasefront/session-worker`,
   * or with `backend: "webgpu"` `phasefront/webgpu/session-worker`.
   */
  readonly worker?: Worker;
  /** Aborts opening, and ends the worker. */
  readonly signal?: AbortSignal;
}

/** The options of {@link WorkerSession.process}. */
export interface ProcessOptions extends ProcessAsyncOptions {
  /**
   * Aborts the frame: the promise rejects with the signal's reason. A frame that waits is not computed; one that is being
   * computed ends, and its hologram is freed.
   */
  readonly signal?: AbortSignal;
  /** The buffers and the `VideoFrame` or `ImageBitmap` to move into the worker instead of copying them. */
  readonly transfer?: Transferable[];
}

/** The modules: for one thread of the CPU, for several, and for WebGPU. */
type Module = "plain" | "threads" | "webgpu";

function start(module: Module): Worker {
  // Bundlers find the files by these expressions.
  switch (module) {
    case "plain":
      return new Worker(new URL("./session-worker.js", import.meta.url), { type: "module" });
    case "threads":
      return new Worker(new URL("./threads/session-worker.js", import.meta.url), { type: "module" });
    case "webgpu":
      return new Worker(new URL("./webgpu/session-worker.js", import.meta.url), { type: "module" });
  }
}

function address(module: Module): URL {
  switch (module) {
    case "plain":
      return new URL("./raw/phasefront_web_bg.wasm", import.meta.url);
    case "threads":
      return new URL("./threads/raw/phasefront_web_bg.wasm", import.meta.url);
    case "webgpu":
      return new URL("./webgpu/raw/phasefront_web_bg.wasm", import.meta.url);
  }
}

/**
 * Returns the module of a worker that {@link start} makes, compiled while the worker's scripts load, or undefined if that
 * fails: the worker then loads it, and says what is wrong.
 */
async function compiled(module: Module): Promise<WebAssembly.Module | undefined> {
  try {
    return await WebAssembly.compileStreaming(fetch(address(module)));
  } catch {
    return undefined;
  }
}

/** A session in a worker of its own. The worker ends when the session is closed, and with the page. */
export class WorkerSession {
  readonly #worker: Worker;
  readonly #waiting = new Map<number, { done: (answer: unknown) => void; fail: (error: unknown) => void }>();
  #last = 0;
  #turn: Promise<unknown> = Promise.resolve();
  #ended: unknown;
  /** The canvases that were moved to the worker. */
  readonly #canvases = new WeakMap<Canvas, number>();
  #lastCanvas = 0;
  /** Frees holograms that the page has forgotten. */
  readonly #forgotten = new FinalizationRegistry<number>((hologram) => this.#free(hologram));

  private constructor(worker: Worker) {
    this.#worker = worker;
    worker.onmessage = ({ data: { id, answer, error } }: MessageEvent<Reply>) => {
      const waiting = this.#waiting.get(id);
      this.#waiting.delete(id);
      if (error === undefined) return waiting?.done(answer);
      const { kind, message } = error;
      const said = kind === undefined ? error.error : new PhasefrontError(kind, message);
      waiting?.fail(said);
      // A module that panicked computes nothing any more.
      if (kind === "internal") this.#end(said);
    };
    worker.onerror = (event) => {
      event.preventDefault();
      // An event without a message says that the script could not be loaded, and the browser keeps from the page why.
      const why = event.message
        ? `its worker has ended: ${event.message}`
        : "the script of its worker, session-worker, could not be loaded; the browser's list of requests has its address: " +
          "403 from Vite's server means that the package lies outside of the project, so install the packed one, and 404 that " +
          "a bundler moved the script, so pass the setting worker";
      this.#end(new PhasefrontError("session", `session: ${why}`));
    };
  }

  /**
   * Starts a worker and makes a session in it.
   *
   * @throws PhasefrontError if the options are invalid or cannot be planned for, or the worker or its threads cannot
   * start.
   */
  static async open(
    options: WorkerSessionOptions = {},
    mode: RunningMode = "image",
    settings: WorkerSettings = {},
  ): Promise<WorkerSession> {
    const { signal } = settings;
    signal?.throwIfAborted();
    const gpu = options.backend === "webgpu";
    const threads = settings.threads ?? (globalThis.crossOriginIsolated && !gpu ? undefined : 1);
    if (threads !== 1 && gpu)
      throw new PhasefrontError("setting", "a module with threads has no WebGPU; leave out threads or backend");
    const module = gpu ? "webgpu" : threads === 1 ? "plain" : "threads";
    const session = new WorkerSession(settings.worker ?? start(module));
    try {
      const source = await until(signal, session.#source(settings, module));
      await until(signal, session.#ask("open", [options, mode, { threads, source }]));
    } catch (error) {
      session.close();
      throw error;
    }
    return session;
  }

  /** Returns the module that the worker takes, or undefined if it loads its own. */
  #source({ module, worker }: WorkerSettings, started: Module): Promise<string | WebAssembly.Module | undefined> {
    if (module === undefined) return worker ? Promise.resolve(undefined) : compiled(started);
    return Promise.resolve(module instanceof WebAssembly.Module ? module : new URL(module, location.href).href);
  }

  /**
   * Returns the hologram of a frame. Frames are computed one after another; an array is read when its frame's turn comes,
   * so wait for the hologram before you write into it again.
   *
   * @throws PhasefrontError `frame`: the frame is not usable. `timestamp`: the frame is late in a video session.
   * `session`: the session is closed. The frames that follow are not affected. The reason of `signal`, if it aborts.
   */
  process(frame: Frame, options: ProcessOptions = {}): Promise<WorkerHologram> {
    const { signal, transfer, onGpu } = options;
    const { colour, depth, options: said } = frame;
    const made = this.#turn.then(async () => {
      signal?.throwIfAborted();
      const { hologram, info } = await this.#ask("process", [{ colour, depth, options: said }, { onGpu }], transfer);
      if (!signal?.aborted) return this.#hologram(hologram, info);
      this.#free(hologram);
      throw signal.reason;
    });
    this.#turn = made.catch(() => {});
    return until(signal, made);
  }

  #hologram(id: number, info: HologramInfo): WorkerHologram {
    const hologram = WorkerHologram.of(
      info,
      (call, said, transfer) => this.#ask(call, [id, ...said] as never, transfer),
      (canvas) => this.#canvas(canvas),
      () => {
        this.#forgotten.unregister(hologram);
        this.#free(id);
      },
    );
    this.#forgotten.register(hologram, id, hologram);
    return hologram;
  }

  /** Returns the canvas as the worker knows it, and what is to be moved to the worker. */
  #canvas(canvas: Canvas): [PageCanvas, Transferable[]] {
    const known = this.#canvases.get(canvas);
    if (known !== undefined) return [{ canvas: known }, []];
    const moved = offscreen(canvas);
    this.#canvases.set(canvas, ++this.#lastCanvas);
    return [{ canvas: this.#lastCanvas, moved }, [moved]];
  }

  /** Runs an empty frame through the stages, so that the first real frame is as fast as the others. */
  warmUp(): Promise<void> {
    return this.#ask("warmUp", []);
  }

  /** Forgets all previous frames; the next frame, with any timestamp, counts as the first. */
  reset(): Promise<void> {
    return this.#ask("reset", []);
  }

  /**
   * Allows or forbids changes of the quality level.
   *
   * @throws PhasefrontError `setting`: the session does not have the quality level.
   */
  setQuality(quality: Quality): Promise<void> {
    return this.#ask("setQuality", [quality]);
  }

  /** Returns the statistics so far. */
  statistics(): Promise<Statistics> {
    return this.#ask("statistics", []);
  }

  /** Ends the worker, also while it computes, and frees its holograms. Closing twice does nothing. */
  close(): void {
    this.#end(new PhasefrontError("session", "session: it is closed; make a new one"));
  }

  /** Does as {@link close} does, where a `using` declaration goes out of scope. */
  [Symbol.dispose](): void {
    this.close();
  }

  /** Ends the worker. Calls that wait, and later ones, throw `why`. */
  #end(why: unknown): void {
    if (this.#ended) return;
    this.#ended = why;
    this.#worker.terminate();
    for (const { fail } of this.#waiting.values()) fail(why);
    this.#waiting.clear();
  }

  #free(hologram: number): void {
    if (!this.#ended) this.#worker.postMessage({ id: 0, call: "free", said: [hologram] });
  }

  #ask<K extends keyof Calls>(
    call: K,
    said: Parameters<Calls[K]>,
    transfer: Transferable[] = [],
  ): Promise<Awaited<ReturnType<Calls[K]>>> {
    return new Promise((done, fail) => {
      if (this.#ended) return fail(this.#ended);
      const id = ++this.#last;
      this.#worker.postMessage({ id, call, said }, transfer);
      this.#waiting.set(id, { done: done as (answer: unknown) => void, fail });
    });
  }
}

function offscreen(canvas: Canvas): OffscreenCanvas {
  if (canvas instanceof OffscreenCanvas) return canvas;
  try {
    return canvas.transferControlToOffscreen();
  } catch {
    throw new PhasefrontError("setting", "the canvas has a context or belongs to another session; give a new canvas");
  }
}

/** Returns the result of `made`, or throws the reason of `signal` as soon as it aborts. */
async function until<T>(signal: AbortSignal | undefined, made: Promise<T>): Promise<T> {
  if (!signal) return made;
  let abort: () => void = () => {};
  const aborted = new Promise<never>((_, fail) => {
    abort = () => fail(signal.reason);
    if (signal.aborted) abort();
    signal.addEventListener("abort", abort);
  });
  try {
    return await Promise.race([made, aborted]);
  } finally {
    signal.removeEventListener("abort", abort);
  }
}

/** The calls whose first argument is a hologram. */
type Ask = <K extends Exclude<keyof Calls, "open" | "process" | "warmUp" | "reset" | "setQuality" | "statistics" | "free">>(
  call: K,
  said: Parameters<Calls[K]> extends [number, ...infer Rest] ? Rest : never,
  transfer?: Transferable[],
) => Promise<Awaited<ReturnType<Calls[K]>>>;

type Known = (canvas: Canvas) => [PageCanvas, Transferable[]];

/**
 * The hologram of one frame, in its session's worker. It uses memory until it is closed, garbage-collected, or its session
 * is closed. Results are moved to the caller without a copy. Every call throws an error of kind `session` if the hologram
 * or its session is closed.
 */
export class WorkerHologram {
  /** The metadata. */
  readonly info: HologramInfo;
  readonly #ask: Ask;
  readonly #canvas: Known;
  #close: (() => void) | undefined;

  private constructor(info: HologramInfo, ask: Ask, canvas: Known, close: () => void) {
    this.info = info;
    this.#ask = ask;
    this.#canvas = canvas;
    this.#close = close;
  }

  /** @internal */
  static of(info: HologramInfo, ask: Ask, canvas: Known, close: () => void): WorkerHologram {
    return new WorkerHologram(info, ask, canvas, close);
  }

  /** Returns the modulator levels, (C, H, W): red, green and blue, or those of the only laser. */
  levels(): Promise<Uint8Array<ArrayBuffer>> {
    return this.#ask("levels", []);
  }

  /**
   * Returns the z in mm of the scene point at (x, y) of the picture, for example to focus on it. Coordinates run from 0
   * to 1 from the upper left corner.
   */
  zAt(x: number, y: number): Promise<number> {
    return this.#ask("zAt", [x, y]);
  }

  /**
   * Returns the view of an eye focused at `zMm` as an image of `size`.
   *
   * @throws PhasefrontError `setting`: the image is empty or too large, or z is too far away.
   */
  async preview(zMm: number, { width, height }: Size): Promise<ImageData> {
    return new ImageData(await this.#ask("preview", [zMm, { width, height }]), width, height);
  }

  /**
   * Returns the view of an eye focused at `zMm` at full resolution: amplitudes where 1 is white, (C, H, W).
   *
   * @throws PhasefrontError `setting`: z is too far away.
   */
  refocus(zMm: number): Promise<Float32Array<ArrayBuffer>> {
    return this.#ask("refocus", [zMm]);
  }

  /**
   * Returns the complex field that the levels produce behind the aperture at `zMm`, without the carrier; z = 0 is the
   * midpoint. The result has the real and imaginary part of each pixel, (C, H, W, 2).
   *
   * @throws PhasefrontError `setting`: z is too far away.
   */
  field(zMm = 0): Promise<Float32Array<ArrayBuffer>> {
    return this.#ask("field", [zMm]);
  }

  /**
   * Returns the size of the images of `layout` for the modulator. All layouts except `grey` and `grey16` have one.
   *
   * @throws PhasefrontError `setting`: the layout is unknown.
   */
  outputSize(layout: Layout): Promise<OutputSize> {
    return this.#ask("outputSize", [layout]);
  }

  /**
   * Returns one of the images for the modulator's driver, without gaps between rows.
   *
   * @throws PhasefrontError `setting`: the layout is unknown or does not have the image.
   */
  output(placement: Placement = {}, image = 0): Promise<Uint8ClampedArray<ArrayBuffer>> {
    return this.#ask("output", [placement, image]);
  }

  /**
   * Draws the modulator's image to a canvas, which the first drawing moves to the worker and which takes the image's size.
   * If the levels stayed on the GPU, they go to the canvas without a copy to the CPU.
   *
   * @throws PhasefrontError `setting`: the canvas has a context or belongs to another session.
   */
  async drawLevels(canvas: Canvas): Promise<void> {
    const [to, moved] = this.#canvas(canvas);
    await this.#ask("drawLevels", [to], moved);
  }

  /**
   * Draws the view of an eye focused at `zMm` to a canvas, in `size` or that of the canvas, as {@link drawLevels} does.
   *
   * @throws PhasefrontError in the cases of {@link preview} and {@link drawLevels}.
   */
  async drawPreview(zMm: number, canvas: Canvas, { width, height }: Size = canvas): Promise<void> {
    const [to, moved] = this.#canvas(canvas);
    await this.#ask("drawPreview", [zMm, to, { width, height }], moved);
  }

  /** Frees the memory. Closing twice does nothing. */
  close(): void {
    this.#close?.();
    this.#close = undefined;
  }

  /** Does as {@link close} does, where a `using` declaration goes out of scope. */
  [Symbol.dispose](): void {
    this.close();
  }
}
