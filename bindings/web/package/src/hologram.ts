import { PhasefrontError, guard, release, whole } from "./error.js";
import type { RawHologram } from "./raw/phasefront_web.js";

/** The time of each stage of a frame. */
export interface FrameTimes {
  readonly colourMs: number;
  readonly depthMs: number;
  /** The time from the frame to the midpoint hologram. */
  readonly methodMs: number;
  /** The time from the midpoint to the modulator. */
  readonly propagateMs: number;
  /** The time from the field to levels. */
  readonly encodeMs: number;
  readonly totalMs: number;
}

/** The metadata of a hologram. */
export interface HologramInfo {
  /** The timestamp of the frame. */
  readonly timestampNs: bigint;
  readonly width: number;
  readonly height: number;
  /** The number of colours of the levels, C: 3, or 1 with one laser. */
  readonly colours: number;
  /** The amplitude that full light represents. */
  readonly scale: number;
  /** The distances of the near and the far end of the volume in metres; null for normalized depth. */
  readonly rangeM: readonly [near: number, far: number] | null;
  /** The share of the depth image's pixels that had a usable reading. */
  readonly validDepth: number;
  /** The quality level; 0 is the best. */
  readonly qualityLevel: number;
  readonly times: FrameTimes;
}

/** The placement of a hologram on its modulator. */
export interface Placement {
  /** The layout of colours in images; `grey` has one image per colour with one byte per pixel. `rgb` by default. */
  readonly layout?: "rgb" | "rgba" | "bgra" | "grey";
  readonly flipX?: boolean;
  readonly flipY?: boolean;
  /** The offset to the right of the centre in pixels, before flips. */
  readonly shiftX?: number;
  /** The offset below the centre in pixels, before flips. */
  readonly shiftY?: number;
}

/** An image for the modulator's driver, at the modulator's resolution. */
export interface OutputImage {
  readonly width: number;
  readonly height: number;
  readonly pixelBytes: number;
  readonly data: Uint8Array;
}

/** The hologram of one frame. It uses the module's memory until it is closed or garbage-collected. */
export class Hologram {
  /** The metadata. */
  readonly info: HologramInfo;
  #raw: RawHologram | undefined;

  private constructor(raw: RawHologram) {
    this.#raw = raw;
    this.info = guard(() => raw.info()) as HologramInfo;
  }

  /** @internal */
  static of(raw: RawHologram): Hologram {
    return new Hologram(raw);
  }

  /** Returns a copy of the modulator levels, (C, H, W): red, green and blue, or those of the only laser. */
  get levels(): Uint8Array {
    return this.#call((raw) => raw.levels());
  }

  /**
   * Returns the z in mm of the scene point at (x, y) of the picture, for example to focus on it. Coordinates run from 0
   * to 1 from the upper left corner.
   */
  zAt(x: number, y: number): number {
    return this.#call((raw) => raw.zAt(x, y));
  }

  /**
   * Returns the view of an eye focused at `zMm`: rows of red, green, blue and alpha, as `new ImageData(pixels, width)`
   * takes them.
   *
   * @throws PhasefrontError `setting`: the image is empty or too large, or z is too far away.
   */
  preview(zMm: number, width: number, height: number): Uint8ClampedArray<ArrayBuffer> {
    const [w, h] = [whole("the width of a preview", width), whole("the height of a preview", height)];
    return this.#call((raw) => raw.preview(zMm, w, h)) as Uint8ClampedArray<ArrayBuffer>;
  }

  /**
   * Returns the view of an eye focused at `zMm` at full resolution: amplitudes where 1 is white, (C, H, W).
   *
   * @throws PhasefrontError `setting`: z is too far away.
   */
  refocus(zMm: number): Float32Array {
    return this.#call((raw) => raw.refocus(zMm));
  }

  /**
   * Returns the complex field that the levels produce behind the aperture at `zMm`, without the carrier; z = 0 is the
   * midpoint. The result has the real and imaginary part of each pixel, (C, H, W, 2).
   *
   * @throws PhasefrontError `setting`: z is too far away.
   */
  field(zMm = 0): Float32Array {
    return this.#call((raw) => raw.field(zMm));
  }

  /**
   * Returns the image with index `image` for the modulator's driver. All layouts except `grey` have one image.
   *
   * @throws PhasefrontError `setting`: the layout is unknown or does not have the image.
   */
  output(placement: Placement = {}, image = 0): OutputImage {
    const { layout = "rgb", flipX = false, flipY = false, shiftX = 0, shiftY = 0 } = placement;
    const flips = Uint8Array.of(Number(flipX), Number(flipY));
    const index = whole("the image", image);
    return this.#call((raw) => raw.output(layout, flips, Int32Array.of(shiftX, shiftY), index)) as OutputImage;
  }

  /** Frees the memory now. Closing twice does nothing. */
  close(): void {
    release(this.#raw);
    this.#raw = undefined;
  }

  #call<T>(call: (raw: RawHologram) => T): T {
    const raw = this.#raw;
    if (!raw) throw new PhasefrontError("session", "the hologram is closed; take what is needed of it before");
    return guard(() => call(raw));
  }
}
