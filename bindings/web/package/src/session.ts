/// <reference lib="esnext.disposable" preserve="true" />
import { PhasefrontError, guard, guardAsync, release, whole } from "./error.js";
import type { Frame } from "./frame.js";
import { Hologram, type FrameTimes } from "./hologram.js";
import type { Network } from "./network.js";
import { rawFrame, rawFrameAsync } from "./raw-frame.js";
import { RawMethod, RawOptions, RawSession } from "./raw/phasefront_web.js";
import { Target, type Display } from "./target.js";

/**
 * The running mode of a session. `image` processes each frame independently; `video` smooths depth and brightness over
 * time and requires increasing timestamps. There is no live mode, because it needs its own thread.
 */
export type RunningMode = "image" | "video";

/**
 * The method that computes holograms: a trained network; the plane sweep, for any display; or an automatic choice by
 * each frame's depth. Without a network, the automatic choice takes the built-in one, or the plane sweep alone if that
 * network was not trained for the display.
 */
export type Method<N = Network> =
  | { readonly kind: "trained"; readonly network: N }
  | { readonly kind: "sweep" }
  | { readonly kind: "auto"; readonly network?: N };

/** The encoding of the field as phases. Omitted values are those of the publication. */
export type Encoding<N = Network> =
  | { readonly kind: "double-phase" }
  | { readonly kind: "anti-alias"; readonly sigma?: number; readonly width?: number }
  | { readonly kind: "band-limit"; readonly k?: number }
  | { readonly kind: "deep"; readonly prefilter: N };

/**
 * The amplitude that full light represents: near the frame's largest and smoothed over time; the frame's largest; or a
 * fixed value.
 */
export type Brightness =
  { readonly kind: "smoothed" } | { readonly kind: "frame-max" } | { readonly kind: "fixed"; readonly scale: number };

/**
 * How what is out of focus looks: `coherent`, as a laser shows it, with halos and rings; or `natural`, soft, as in the
 * world. The steps of natural focus follow the method, 0 to 1000, each of two transforms for each plane and colour: 30
 * bring most of the gain in stills. Without steps, as live frames need it, the method `auto` without a network takes the
 * built-in network for natural focus.
 */
export type Focus = { readonly kind: "coherent" } | { readonly kind: "natural"; readonly steps?: number };

/** Whether the session changes its quality level by itself or keeps a fixed one; 0 is the best. */
export type Quality = { readonly kind: "adaptive" } | { readonly kind: "fixed"; readonly qualityLevel: number };

/** A quality level. A hologram smaller than the modulator is displayed in its centre. */
export interface QualityLevel<N = Network> {
  readonly method: Method<N>;
  readonly width: number;
  readonly height: number;
  /** The session's value by default. */
  readonly localSteps?: number;
  /** The session's value by default. */
  readonly midpointSteps?: number;
  /** The number of steps of natural focus, in a session with natural focus; the session's value by default. */
  readonly focusSteps?: number;
}

/** The options of a session. Omitted options have their defaults. `N` are its networks, `T` is its target. */
export interface SessionOptions<N = Network, T = Target | Display> {
  /** The target of the holograms; the paper's display by default. */
  readonly target?: T;
  /** The method; by default the automatic choice with the built-in network. */
  readonly method?: Method<N>;
  /** The quality levels, best first; by default only `method` at the modulator's resolution. */
  readonly qualityLevels?: readonly QualityLevel<N>[];
  /** The choice of the quality level; `adaptive` by default. */
  readonly quality?: Quality;
  /**
   * The target rate in frames per second. Without it the session takes every frame and does not adapt its quality
   * level.
   */
  readonly targetRateHz?: number;
  /** The encoding; `anti-alias` by default. */
  readonly encoding?: Encoding<N>;
  /** The brightness; `smoothed` by default. */
  readonly brightness?: Brightness;
  /** The share of full light below which phases are pulled to 0; by default that of the encoding. */
  readonly darkThreshold?: number;
  /** The number of local correction steps, 0 to 8; by default that of the encoding. */
  readonly localSteps?: number;
  /** The number of correction steps at the midpoint, 0 to 100, each of four transforms per colour; 0 by default. */
  readonly midpointSteps?: number;
  /** How what is out of focus looks; `coherent` by default. */
  readonly focus?: Focus;
  /** The depths in metres at the ends of the volume; by default the 1st and 99th percentile of the readings. */
  readonly depthRange?: { readonly nearM: number; readonly farM: number };
  /** The confidence, 0 to 1, below which readings are ignored. */
  readonly leastConfidence?: number;
  /**
   * Whether what stands still in a video keeps its wave on the CPU: a frame computes only the parts where colour or depth
   * have changed by more than a camera's noise. True by default.
   */
  readonly keepStanding?: boolean;
  /** The maximum number of pixels of a quality level and of the modulator. */
  readonly mostPixels?: number;
  /**
   * The processor that computes frames; `cpu` by default. For `webgpu`, import from `phasefront/webgpu` and make the
   * session with {@link Session.open}, or run it in a worker. If the browser's GPU is missing, refused, too small, lost
   * or wrong, the CPU computes; {@link Statistics} tells why.
   */
  readonly backend?: "cpu" | "webgpu";
  /**
   * A part of the name of the adapter that `webgpu` needs. Without it, adapters in software are refused, because they
   * are slower than the CPU.
   */
  readonly adapter?: string;
}

/** The options of {@link Session.processAsync}. */
export interface ProcessAsyncOptions {
  /**
   * Lets the levels stay on the GPU, if it computes the frame. They are then drawn to canvases, and the functions that
   * read them throw. The CPU does the same without it.
   */
  readonly onGpu?: boolean;
}

/** The statistics of a session. Rates and times are means over the last 30 holograms. */
export interface Statistics {
  readonly submitted: number;
  readonly processed: number;
  readonly failed: number;
  readonly refused: number;
  readonly rateHz: number;
  readonly times: FrameTimes;
  /** The backend that computes the frames. */
  readonly backend: string;
  readonly backendWhy: string;
  readonly qualityLevel: number;
}

function rawMethod(method: Method): RawMethod {
  switch (method.kind) {
    case "trained":
      return RawMethod.trained(method.network.raw);
    case "auto":
      return method.network ? RawMethod.autoWith(method.network.raw) : RawMethod.auto();
    case "sweep":
      return RawMethod.sweep();
    default: {
      const { kind } = method as { kind: string };
      throw new PhasefrontError("setting", `there is no method '${kind}'; there are trained, sweep, auto`);
    }
  }
}

/** Sets the `encoding` before its corrections. */
function setEncoder(raw: RawOptions, options: SessionOptions): void {
  const { encoding, brightness } = options;
  if (encoding?.kind === "deep") raw.deep(encoding.prefilter.raw);
  else if (encoding?.kind === "anti-alias") raw.encoding(encoding.kind, encoding.sigma, encoding.width);
  else if (encoding?.kind === "band-limit") raw.encoding(encoding.kind, encoding.k);
  else if (encoding) raw.encoding(encoding.kind);
  if (brightness) raw.brightness(brightness.kind, brightness.kind === "fixed" ? brightness.scale : undefined);
  raw.corrections(options.darkThreshold, options.localSteps, options.midpointSteps);
}

function qualityLevel(quality: Quality): number | undefined {
  return quality.kind === "fixed" ? whole("the quality level", quality.qualityLevel) : undefined;
}

/** Returns the steps of natural focus, or undefined for coherent focus. */
function naturalSteps(focus?: Focus): number | undefined {
  if (focus?.kind === "natural") return focus.steps === undefined ? 0 : whole("the steps of natural focus", focus.steps);
  if (focus === undefined || focus.kind === "coherent") return undefined;
  const { kind } = focus as { kind: string };
  throw new PhasefrontError("setting", `there is no focus '${kind}'; there are coherent, natural`);
}

function rawOptions(options: SessionOptions): RawOptions {
  const target = options.target instanceof Target ? options.target : Target.ofDisplay(options.target);
  return guard(() => {
    const raw = new RawOptions(target.raw, rawMethod(options.method ?? { kind: "auto" }), naturalSteps(options.focus));
    setEncoder(raw, options);
    if (options.depthRange) raw.depthRange(options.depthRange.nearM, options.depthRange.farM);
    if (options.leastConfidence !== undefined) raw.leastConfidence(options.leastConfidence);
    if (options.keepStanding !== undefined) raw.keepStanding(options.keepStanding);
    if (options.targetRateHz !== undefined) raw.targetRateHz(options.targetRateHz);
    if (options.mostPixels !== undefined) raw.mostPixels(whole("mostPixels", options.mostPixels));
    if (options.qualityLevels) {
      raw.clearQualityLevels();
      for (const { method, width, height, localSteps, midpointSteps, focusSteps } of options.qualityLevels) {
        const [w, h] = [whole("the width of a quality level", width), whole("the height of a quality level", height)];
        raw.pushQualityLevel(rawMethod(method), w, h, localSteps, midpointSteps, focusSteps);
      }
    }
    if (options.quality) raw.quality(qualityLevel(options.quality));
    if (options.backend === "webgpu") raw.webgpu(options.adapter);
    return raw;
  });
}

/**
 * Makes holograms of frames. Calls compute on the calling thread; run the session in a worker to keep the page
 * responsive.
 */
export class Session {
  #raw: RawSession | undefined;
  /** The frames that wait for the GPU, one after another; undefined if frames are computed at once. */
  #waiting: Promise<unknown> | undefined;

  /**
   * @throws PhasefrontError if the options are invalid or cannot be planned for, or need {@link Session.open}.
   */
  constructor(options?: SessionOptions, mode?: RunningMode);
  constructor(options: SessionOptions | RawSession = {}, mode: RunningMode = "image") {
    if (options instanceof RawSession) {
      this.#raw = options;
      this.#waiting = Promise.resolve();
      return;
    }
    if (options.backend === "webgpu")
      throw new PhasefrontError("setting", "a session on WebGPU waits for its adapter; make it with Session.open");
    const raw = rawOptions(options);
    try {
      this.#raw = guard(() => new RawSession(raw, mode));
    } finally {
      release(raw);
    }
  }

  /**
   * Makes a session as the constructor does, on any backend.
   *
   * @throws PhasefrontError if the options are invalid or cannot be planned for.
   */
  static async open(options: SessionOptions = {}, mode: RunningMode = "image"): Promise<Session> {
    if (options.backend !== "webgpu") return new Session(options, mode);
    const raw = rawOptions(options);
    try {
      const opened: unknown = await guardAsync(() => RawSession.open(raw, mode));
      return new Session(opened as SessionOptions);
    } finally {
      release(raw);
    }
  }

  /**
   * Returns the hologram of a frame, on any backend. Calls of one session are computed one after another.
   *
   * @throws PhasefrontError in the cases of {@link process}.
   */
  processAsync(frame: Frame, { onGpu = false }: ProcessAsyncOptions = {}): Promise<Hologram> {
    const compute = async () => {
      const session = this.#open();
      const raw = await rawFrameAsync(frame);
      try {
        return Hologram.of(await guardAsync(() => session.processAsync(raw, onGpu)));
      } finally {
        release(raw);
      }
    };
    const made = (this.#waiting ?? Promise.resolve()).then(compute);
    this.#waiting &&= made.catch(() => {});
    return made;
  }

  /**
   * Returns the hologram of a frame. A session on WebGPU has {@link processAsync} instead.
   *
   * @throws PhasefrontError `frame`: the frame is not usable. `timestamp`: the frame is late in a video session.
   * `session`: the session is closed. The frames that follow are not affected.
   */
  process(frame: Frame): Hologram {
    const session = this.#openNow();
    const raw = rawFrame(frame);
    try {
      return Hologram.of(guard(() => session.process(raw)));
    } finally {
      release(raw);
    }
  }

  /**
   * Runs an empty frame through the stages, so that the first real frame is as fast as the others. A session on WebGPU
   * did that when it was made.
   */
  warmUp(): void {
    if (this.#waiting) return;
    const session = this.#open();
    guard(() => session.warmUp());
  }

  /**
   * Forgets all previous frames, including one being computed; the next frame, with any timestamp, counts as the first.
   */
  reset(): void {
    const session = this.#open();
    guard(() => session.reset());
  }

  /**
   * Allows or forbids changes of the quality level.
   *
   * @throws PhasefrontError `setting`: the session does not have the quality level.
   */
  setQuality(quality: Quality): void {
    const session = this.#open();
    guard(() => session.setQuality(qualityLevel(quality)));
  }

  /** The statistics so far. */
  get statistics(): Statistics {
    const session = this.#open();
    return guard(() => session.statistics()) as Statistics;
  }

  /** Stops taking frames and frees the memory. Holograms stay valid. Closing twice does nothing. */
  close(): void {
    const raw = this.#raw;
    this.#raw = undefined;
    if (this.#waiting) void this.#waiting.then(() => release(raw));
    else release(raw);
  }

  /** Does as {@link close} does, where a `using` declaration goes out of scope. */
  [Symbol.dispose](): void {
    this.close();
  }

  #openNow(): RawSession {
    if (this.#waiting)
      throw new PhasefrontError("setting", "a session on WebGPU does not answer at once; await processAsync");
    return this.#open();
  }

  #open(): RawSession {
    if (!this.#raw) throw new PhasefrontError("session", "session: it is closed; make a new one");
    return this.#raw;
  }
}
