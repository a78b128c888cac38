import { bytesOf, guard, whole } from "./error.js";
import type { Hologram, OutputOptions, OutputSize } from "./hologram.js";
import { RawModulator } from "./raw/phasefront_web.js";
import { Target } from "./target.js";

/** A modulator: its display, the phases of its levels, and the images that its input takes. */
export class Modulator {
  readonly #raw: RawModulator;
  /** The target of holograms for the modulator. */
  readonly target: Target;
  /** The size of the images that its input takes. */
  readonly outputSize: OutputSize;

  private constructor(raw: RawModulator) {
    this.#raw = raw;
    this.target = Target.of(guard(() => raw.target()));
    this.outputSize = guard(() => raw.outputSize()) as OutputSize;
  }

  /** The names of the modulators that the module knows. */
  static get names(): string[] {
    return guard(() => RawModulator.names());
  }

  /**
   * Returns the modulator called `name`, for example `holoeye-pluto`.
   *
   * @throws PhasefrontError `display`: the name is unknown.
   */
  static named(name: string): Modulator {
    return new Modulator(guard(() => RawModulator.named(name)));
  }

  /**
   * Reads the text of a modulator's file, with keys such as packing and levels_turns.
   *
   * @throws PhasefrontError `display`: the text is not a modulator.
   */
  static fromToml(text: string): Modulator {
    return new Modulator(guard(() => RawModulator.fromToml(text)));
  }

  /**
   * Writes one of the images that its input takes of `hologram` into `to`.
   *
   * @throws PhasefrontError `setting`: there is no such image, it does not fit, or the hologram is for another modulator.
   */
  writeOutput(hologram: Hologram, to: Uint8Array | Uint8ClampedArray, options: OutputOptions = {}): void {
    const { width, pixelBytes } = this.outputSize;
    const index = whole("the image", options.image ?? 0);
    const stride = whole("the row stride", options.rowStride ?? width * pixelBytes);
    const bytes = bytesOf("the image", to, "setting");
    hologram.call((raw) => this.#raw.writeOutput(raw, index, bytes, stride));
  }

  /**
   * Writes the same image in the pixels of a screen that drives the modulator into `to`, for example the data of an
   * `ImageData` of the size {@link outputSize}. The red, green and blue of a grey image are its level.
   *
   * @throws PhasefrontError `setting`: as {@link writeOutput}, and for a modulator whose images have 16 bits.
   */
  writePixels(hologram: Hologram, to: Uint8Array | Uint8ClampedArray, options: OutputOptions = {}): void {
    const index = whole("the image", options.image ?? 0);
    const stride = whole("the row stride", options.rowStride ?? 4 * this.outputSize.width);
    const bytes = bytesOf("the image", to, "setting");
    hologram.call((raw) => this.#raw.writePixels(raw, index, bytes, stride));
  }
}
