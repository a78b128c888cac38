import { PhasefrontError, guard, release, whole } from "./error.js";
import type { Frame } from "./frame.js";
import { Hologram, type FrameTimes } from "./hologram.js";
import type { Network } from "./network.js";
import { RawMethod, RawOptions, RawSession } from "./raw/phasefront_web.js";
import { Target, type Display } from "./target.js";

/**
 * How a session runs. `image` answers each frame by itself; `video` smooths depth and brightness over time,
 * and timestamps must rise. A live stream needs a thread of its own, which there is not here.
 */
export type RunningMode = "image" | "video";

/** What makes holograms: a trained network; the plane sweep, for any display; or what suits each frame's depth. */
export type Method =
  | { readonly kind: "trained"; readonly network: Network }
  | { readonly kind: "sweep" }
  | { readonly kind: "auto"; readonly network: Network };

/** How the field becomes phases; what is not said of an encoding is as published. */
export type Encoding =
  | { readonly kind: "double-phase" }
  | { readonly kind: "anti-alias"; readonly sigma?: number; readonly width?: number }
  | { readonly kind: "band-limit"; readonly k?: number }
  | { readonly kind: "deep"; readonly prefilter: Network };

/** Which amplitude full light stands for: near the frame's largest, moving smoothly; the largest; or this one. */
export type Brightness =
  { readonly kind: "smoothed" } | { readonly kind: "frame-max" } | { readonly kind: "fixed"; readonly scale: number };

/** Whether the session changes its quality level by itself, or stays at one, 0 the best. */
export type Quality = { readonly kind: "adaptive" } | { readonly kind: "fixed"; readonly qualityLevel: number };

/** One quality. A hologram smaller than the modulator is shown in its middle. */
export interface QualityLevel {
  readonly method: Method;
  readonly width: number;
  readonly height: number;
  /** The session's unless it is said. */
  readonly localSteps?: number;
  /** The session's unless it is said. */
  readonly midpointSteps?: number;
}

/** What a session makes, and how; what is left out has its default. */
export interface SessionOptions {
  /** What holograms are for: the paper's display unless it is said. */
  readonly target?: Target | Display;
  /** The built-in network where it was trained for the display, else the plane sweep, unless it is said. */
  readonly method?: Method;
  /** Qualities, the best first; `method` at the modulator's resolution unless it is said. */
  readonly qualityLevels?: readonly QualityLevel[];
  /** `adaptive` unless it is said. */
  readonly quality?: Quality;
  /** Frames a second that are aimed at; without it the session takes every frame and never steps. */
  readonly targetRateHz?: number;
  /** `anti-alias` unless it is said. */
  readonly encoding?: Encoding;
  /** `smoothed` unless it is said. */
  readonly brightness?: Brightness;
  /** The share of full light below which phases are drawn to 0; what suits the encoding unless it is said. */
  readonly darkThreshold?: number;
  /** Steps of correction, 0 to 8; what suits the encoding unless it is said. */
  readonly localSteps?: number;
  /** Steps of correction at the midpoint, 0 to 100, each of four transforms a colour; 0 unless it is said. */
  readonly midpointSteps?: number;
  /** Metres at the ends of the volume; the readings' 1st and 99th percentile unless it is said. */
  readonly depthRange?: { readonly nearM: number; readonly farM: number };
  /** Readings less sure than this, 0 to 1, are none. */
  readonly leastConfidence?: number;
  /** Most pixels of a quality level and of the modulator. */
  readonly mostPixels?: number;
}

/** What a session has done so far. Rates and times are means of the last 30 holograms. */
export interface Statistics {
  readonly submitted: number;
  readonly processed: number;
  readonly failed: number;
  readonly refused: number;
  readonly rateHz: number;
  readonly times: FrameTimes;
  /** What runs the frames. */
  readonly backend: string;
  readonly backendWhy: string;
  readonly qualityLevel: number;
}

function rawMethod(method: Method): RawMethod {
  switch (method.kind) {
    case "trained":
      return RawMethod.trained(method.network.raw);
    case "auto":
      return RawMethod.auto(method.network.raw);
    case "sweep":
      return RawMethod.sweep();
    default: {
      const { kind } = method as { kind: string };
      throw new PhasefrontError("setting", `there is no method '${kind}'; there are trained, sweep, auto`);
    }
  }
}

/** Sets `encoding` before all that corrects it. */
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

function rawOptions(options: SessionOptions): RawOptions {
  const target = options.target instanceof Target ? options.target : Target.ofDisplay(options.target);
  return guard(() => {
    const raw = options.method
      ? RawOptions.withMethod(target.raw, rawMethod(options.method))
      : RawOptions.withDefaults(target.raw);
    setEncoder(raw, options);
    if (options.depthRange) raw.depthRange(options.depthRange.nearM, options.depthRange.farM);
    if (options.leastConfidence !== undefined) raw.leastConfidence(options.leastConfidence);
    if (options.targetRateHz !== undefined) raw.targetRateHz(options.targetRateHz);
    if (options.mostPixels !== undefined) raw.mostPixels(whole("mostPixels", options.mostPixels));
    if (options.qualityLevels) {
      raw.clearQualityLevels();
      for (const { method, width, height, localSteps, midpointSteps } of options.qualityLevels) {
        const [w, h] = [whole("the width of a quality level", width), whole("the height of a quality level", height)];
        raw.pushQualityLevel(rawMethod(method), w, h, localSteps, midpointSteps);
      }
    }
    if (options.quality) raw.quality(qualityLevel(options.quality));
    return raw;
  });
}

/**
 * Frames in, holograms out. A call computes on the thread that makes it, so that a page stays live where its session
 * lives in a worker.
 */
export class Session {
  #raw: RawSession | undefined;

  /**
   * @throws PhasefrontError for options that cannot be meant or planned for.
   */
  constructor(options: SessionOptions = {}, mode: RunningMode = "image") {
    const raw = rawOptions(options);
    try {
      this.#raw = guard(() => new RawSession(raw, mode));
    } finally {
      release(raw);
    }
  }

  /**
   * The hologram of a frame.
   *
   * @throws PhasefrontError `frame`: one that is not usable. `timestamp`: a late one in a video session. `session`: a
   * closed session. None of them harms the frames that follow.
   */
  process(frame: Frame): Hologram {
    const session = this.#open();
    const raw = frame.toRaw();
    try {
      return Hologram.of(guard(() => session.process(raw)));
    } finally {
      release(raw);
    }
  }

  /** Runs an empty frame through the stages, so that the first real one is as fast as the others. */
  warmUp(): void {
    const session = this.#open();
    guard(() => session.warmUp());
  }

  /** Forgets all frames so far, one in the making too; the next, of any timestamp, is the first again. */
  reset(): void {
    const session = this.#open();
    guard(() => session.reset());
  }

  /**
   * Allows or forbids changes of the quality level.
   *
   * @throws PhasefrontError `setting`: a quality level that the session does not have.
   */
  setQuality(quality: Quality): void {
    const session = this.#open();
    guard(() => session.setQuality(qualityLevel(quality)));
  }

  /** What the session has done so far. */
  get statistics(): Statistics {
    const session = this.#open();
    return guard(() => session.statistics()) as Statistics;
  }

  /** Takes no more frames and gives the memory back. Holograms stay as they are. Closing twice does nothing. */
  close(): void {
    release(this.#raw);
    this.#raw = undefined;
  }

  #open(): RawSession {
    if (!this.#raw) throw new PhasefrontError("session", "session: it is closed; make a new one");
    return this.#raw;
  }
}
