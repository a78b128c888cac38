import { PhasefrontError, guard, release, whole } from "./error.js";
import type { RawHologram } from "./raw/phasefront_web.js";

/** How long each stage of a frame took. */
export interface FrameTimes {
  readonly colourMs: number;
  readonly depthMs: number;
  /** From the frame to the midpoint hologram. */
  readonly methodMs: number;
  /** From the midpoint to the modulator. */
  readonly propagateMs: number;
  /** From the field to levels. */
  readonly encodeMs: number;
  readonly totalMs: number;
}

/** What is known of a hologram. */
export interface HologramInfo {
  /** The frame's. */
  readonly timestampNs: bigint;
  readonly width: number;
  readonly height: number;
  /** How many colours its levels have, C: 3, or 1 of one laser. */
  readonly colours: number;
  /** The amplitude that full light stands for. */
  readonly scale: number;
  /** Metres at the near and the far end of the volume; null for normalized depth. */
  readonly rangeM: readonly [near: number, far: number] | null;
  /** The share of the depth image's pixels that had a usable reading. */
  readonly validDepth: number;
  /** The quality level that it was made at, 0 the best. */
  readonly qualityLevel: number;
  readonly times: FrameTimes;
}

/** How a hologram is put on its modulator. */
export interface Placement {
  /** How colours lie in images; `grey` is an image for each, a byte a pixel. `rgb` unless it is said. */
  readonly layout?: "rgb" | "rgba" | "bgra" | "grey";
  readonly flipX?: boolean;
  readonly flipY?: boolean;
  /** Pixels to the right of the middle, before flips. */
  readonly shiftX?: number;
  /** Pixels below the middle, before flips. */
  readonly shiftY?: number;
}

/** An image that the modulator's driver takes, of the modulator's resolution. */
export interface OutputImage {
  readonly width: number;
  readonly height: number;
  readonly pixelBytes: number;
  readonly data: Uint8Array;
}

/** The hologram of one frame. Its memory is the module's until it is closed, or collected as garbage. */
export class Hologram {
  /** What is known of it. */
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

  /** The modulator levels, (C, H, W): red, green, blue, or those of the one laser. A copy, made at each call. */
  get levels(): Uint8Array {
    return this.#call((raw) => raw.levels());
  }

  /** z of what is seen at (x, y) of the picture, each 0 to 1 from its upper left corner, in mm: where to focus. */
  zAt(x: number, y: number): number {
    return this.#call((raw) => raw.zAt(x, y));
  }

  /**
   * What an eye focused at `zMm` sees: rows of red, green, blue, alpha, as `new ImageData(pixels, width)` takes them.
   *
   * @throws PhasefrontError `setting`: an image that is empty or too large, or a z too far away.
   */
  preview(zMm: number, width: number, height: number): Uint8ClampedArray<ArrayBuffer> {
    const [w, h] = [whole("the width of a preview", width), whole("the height of a preview", height)];
    return this.#call((raw) => raw.preview(zMm, w, h)) as Uint8ClampedArray<ArrayBuffer>;
  }

  /**
   * What an eye focused at `zMm` sees of the whole hologram: amplitudes, of which 1 is white, (C, H, W).
   *
   * @throws PhasefrontError `setting`: a z too far away.
   */
  refocus(zMm: number): Float32Array {
    return this.#call((raw) => raw.refocus(zMm));
  }

  /**
   * The complex field that the levels make behind the aperture at `zMm`, 0 the midpoint, without the carrier: real and
   * imaginary part of each pixel, (C, H, W, 2).
   *
   * @throws PhasefrontError `setting`: a z too far away.
   */
  field(zMm = 0): Float32Array {
    return this.#call((raw) => raw.field(zMm));
  }

  /**
   * Image `image` of those that the modulator's driver takes. All layouts but `grey` have one.
   *
   * @throws PhasefrontError `setting`: a layout that is not known, or an image that it has not.
   */
  output(placement: Placement = {}, image = 0): OutputImage {
    const { layout = "rgb", flipX = false, flipY = false, shiftX = 0, shiftY = 0 } = placement;
    const flips = Uint8Array.of(Number(flipX), Number(flipY));
    const index = whole("the image", image);
    return this.#call((raw) => raw.output(layout, flips, Int32Array.of(shiftX, shiftY), index)) as OutputImage;
  }

  /** Gives its memory back now. Closing twice does nothing. */
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
