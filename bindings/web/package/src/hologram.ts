/// <reference lib="esnext.disposable" preserve="true" />
import { putPixels, type Canvas, type Size } from "./canvas.js";
import type { RgbEncoding } from "./frame.js";
import { PhasefrontError, bytesOf, guard, guardAsync, release, whole } from "./error.js";
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
  /** The timestamp of the frame in microseconds. */
  readonly timestamp: number;
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
  /**
   * The meaning of the frame's colours. Views are in sRGB unless these are amplitudes, as which views show them.
   */
  readonly encoding: RgbEncoding;
}

/**
 * The layout of colours in images: bytes red, green, blue; with alpha 255; 32-bit words with 10 bits of each colour; or
 * one image per colour with bytes or 16-bit words. Words are little-endian.
 */
export type Layout = "rgb" | "rgba" | "bgra" | "rgb10" | "grey" | "grey16";

/** The placement of a hologram on its modulator. */
export interface Placement {
  /** The layout; `rgb` by default. */
  readonly layout?: Layout;
  readonly flipX?: boolean;
  readonly flipY?: boolean;
  /** The offset to the right of the centre in pixels, before flips. */
  readonly shiftX?: number;
  /** The offset below the centre in pixels, before flips. */
  readonly shiftY?: number;
}

/** The images that a modulator's input takes. */
export interface OutputSize {
  readonly width: number;
  readonly height: number;
  /** The bytes of a pixel. */
  readonly pixelBytes: number;
  /** The number of images: one, or one for each colour. */
  readonly images: number;
}

/** A view's pixels, for example an `ImageData` that is used again for each frame. */
export interface PreviewImage {
  readonly width: number;
  readonly height: number;
  readonly data: Uint8Array | Uint8ClampedArray;
  /** The layout; `rgba` by default. */
  readonly layout?: "rgb" | "rgba" | "bgra";
  /** Bytes from one row to the next. By default rows have no gaps. */
  readonly rowStride?: number;
}

/** The choice of an image of several, and its rows. */
export interface OutputOptions {
  /** The index of the image; 0 by default. */
  readonly image?: number;
  /** Bytes from one row to the next. By default rows have no gaps. */
  readonly rowStride?: number;
}

/** A hologram whose levels stayed on the GPU. Only the module with WebGPU has these functions. */
type RawOnGpu = RawHologram & {
  paintLevels(canvas: Canvas): Promise<void>;
  paintPreview(zMm: number, width: number, height: number, canvas: Canvas): Promise<void>;
};

/** The hologram of one frame. It uses the module's memory until it is closed or garbage-collected. */
export class Hologram {
  /** The metadata. */
  readonly info: HologramInfo;
  #raw: RawHologram | undefined;
  /** The drawings on the GPU, after which the memory can be freed. */
  #drawing: Promise<unknown> | undefined;

  private constructor(raw: RawHologram) {
    this.#raw = raw;
    this.info = guard(() => raw.info()) as HologramInfo;
  }

  /** @internal */
  static of(raw: RawHologram): Hologram {
    return new Hologram(raw);
  }

  /**
   * Returns a copy of the modulator levels, (C, H, W): red, green and blue, or those of the only laser.
   *
   * @throws PhasefrontError `setting`: the levels stayed on the GPU.
   */
  get levels(): Uint8Array {
    return this.call((raw) => raw.levels());
  }

  /**
   * Returns the z in mm of the scene point at (x, y) of the picture, for example to focus on it. Coordinates run from 0
   * to 1 from the upper left corner.
   */
  zAt(x: number, y: number): number {
    return this.call((raw) => raw.zAt(x, y));
  }

  /**
   * Writes the view of an eye focused at `zMm` into the pixels of `image`, for example of an `ImageData`.
   *
   * @throws PhasefrontError `setting`: the image is empty or too small, or z is too far away.
   */
  writePreview(zMm: number, image: PreviewImage): void {
    const [w, h] = [whole("the width of a preview", image.width), whole("the height of a preview", image.height)];
    const { layout = "rgba" } = image;
    const stride = whole("the row stride", image.rowStride ?? w * (layout === "rgb" ? 3 : 4));
    const bytes = bytesOf("the image", image.data, "setting");
    this.call((raw) => raw.writePreview(zMm, w, h, layout, bytes, stride));
  }

  /**
   * Returns the view of an eye focused at `zMm` at full resolution: amplitudes where 1 is white, (C, H, W).
   *
   * @throws PhasefrontError `setting`: z is too far away.
   */
  refocus(zMm: number): Float32Array {
    return this.call((raw) => raw.refocus(zMm));
  }

  /**
   * Returns the complex field that the levels produce behind the aperture at `zMm`, without the carrier; z = 0 is the
   * midpoint. The result has the real and imaginary part of each pixel, (C, H, W, 2).
   *
   * @throws PhasefrontError `setting`: z is too far away.
   */
  field(zMm = 0): Float32Array {
    return this.call((raw) => raw.field(zMm));
  }

  /**
   * Returns the size of the images of `layout` for the modulator. All layouts except `grey` and `grey16` have one.
   *
   * @throws PhasefrontError `setting`: the layout is unknown.
   */
  outputSize(layout: Layout): OutputSize {
    return this.call((raw) => raw.outputSize(layout)) as OutputSize;
  }

  /**
   * Writes one of the images for the modulator's driver into `to`, for example the data of an `ImageData` with the layout
   * `rgba`.
   *
   * @throws PhasefrontError `setting`: the layout is unknown or does not have the image, or the image does not fit.
   */
  writeOutput(placement: Placement, to: Uint8Array | Uint8ClampedArray, options: OutputOptions = {}): void {
    const { layout = "rgb", flipX = false, flipY = false, shiftX = 0, shiftY = 0 } = placement;
    const size = this.outputSize(layout);
    const flips = Uint8Array.of(Number(flipX), Number(flipY));
    const index = whole("the image", options.image ?? 0);
    const stride = whole("the row stride", options.rowStride ?? size.width * size.pixelBytes);
    const bytes = bytesOf("the image", to, "setting");
    this.call((raw) => raw.writeOutput(layout, flips, Int32Array.of(shiftX, shiftY), index, bytes, stride));
  }

  /**
   * Draws the modulator's image to a canvas, which takes its size. If the levels stayed on the GPU, they go to the canvas
   * without a copy to the CPU. The GPU and the CPU cannot draw to the same canvas.
   *
   * @throws PhasefrontError `setting`: the canvas has another context. `session`: the GPU was lost.
   */
  async drawLevels(canvas: Canvas): Promise<void> {
    if (this.call((raw) => raw.onGpu())) return this.#draw((raw) => raw.paintLevels(canvas));
    putPixels(canvas, this.outputSize("rgba"), ({ data }) => this.writeOutput({ layout: "rgba" }, data));
  }

  /**
   * Draws the view of an eye focused at `zMm` to a canvas, in `size` or that of the canvas, as {@link drawLevels} does.
   *
   * @throws PhasefrontError in the cases of {@link writePreview} and {@link drawLevels}.
   */
  async drawPreview(zMm: number, canvas: Canvas, size: Size = canvas): Promise<void> {
    const [w, h] = [whole("the width of a preview", size.width), whole("the height of a preview", size.height)];
    if (this.call((raw) => raw.onGpu())) return this.#draw((raw) => raw.paintPreview(zMm, w, h, canvas));
    putPixels(canvas, size, (image) => this.writePreview(zMm, image));
  }

  #draw(call: (raw: RawOnGpu) => Promise<void>): Promise<void> {
    const drawn = this.call((raw) => guardAsync(() => call(raw as RawOnGpu)));
    this.#drawing = Promise.allSettled([this.#drawing, drawn]);
    return drawn;
  }

  /** Frees the memory, after what is being drawn. Closing twice does nothing. */
  close(): void {
    const raw = this.#raw;
    this.#raw = undefined;
    if (this.#drawing) void this.#drawing.then(() => release(raw));
    else release(raw);
  }

  /** Does as {@link close} does, where a `using` declaration goes out of scope. */
  [Symbol.dispose](): void {
    this.close();
  }

  /** @internal */
  call<T>(call: (raw: RawHologram) => T): T {
    const raw = this.#raw;
    if (!raw) throw new PhasefrontError("session", "the hologram is closed; take what is needed of it before");
    return guard(() => call(raw));
  }
}
