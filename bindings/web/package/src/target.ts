import { bytesOf, guard } from "./error.js";
import { RawTarget } from "./raw/phasefront_web.js";

/** A display. What is not said is the paper's: 1920×1080, 8 µm, 638/520/450 nm, a volume of 6 mm at the modulator. */
export interface Display {
  /** Pixels of the modulator along x. */
  width?: number;
  /** Pixels along y. */
  height?: number;
  /** From pixel to pixel, µm. */
  pitchUm?: number;
  /** Of the lasers red, green and blue, or of the one laser, nm. */
  wavelengthsNm?: number[];
  /** From the near to the far end of the volume, mm. */
  volumeDepthMm?: number;
  /** From the middle of the volume to the modulator, mm; positive toward the viewer. */
  offsetMm?: number;
  /** Bits of a level, 1 to 16. */
  bits?: number;
  /** Of the circular aperture in the Fourier plane, in shares of half the sampling frequency. */
  apertureRadius?: number;
}

/** A display in its TOML form; keys and ranges are the core's to check. */
function toml(display: Display): string {
  const number = (value: unknown): string =>
    Array.isArray(value) ? `[${value.map(number).join(", ")}]` : String(value).toLowerCase().replace("infinity", "inf");
  return Object.entries(display)
    .filter(([, value]) => value !== undefined)
    .map(([key, value]) => `${key.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`)} = ${number(value)}\n`)
    .join("");
}

/**
 * A display from its TOML form, as the command `phasefront` takes it.
 *
 * @throws PhasefrontError `display`: a text that is none, or a display that cannot be.
 */
export function displayFromToml(text: string): Required<Display> {
  return Target.fromToml(text).display;
}

/** What holograms are made for: a display, its modulator's response, its lasers' light, what corrects its optics. */
export class Target {
  /** @internal */
  readonly raw: RawTarget;

  private constructor(raw: RawTarget) {
    this.raw = raw;
  }

  /**
   * A display in its TOML form, with levels in equal steps of phase.
   *
   * @throws PhasefrontError `display`: a text that is none, or a display that cannot be.
   */
  static fromToml(text: string): Target {
    return new Target(guard(() => RawTarget.fromToml(text)));
  }

  /**
   * A display with levels in equal steps of phase, as many as its bits have.
   *
   * @throws PhasefrontError `display`: one that cannot be.
   */
  static ofDisplay(display: Display = {}): Target {
    return Target.fromToml(toml(display));
  }

  /**
   * A display whose modulator was calibrated as a whole: of 256 levels the one at i shows the phase 2πi/256.
   *
   * @throws PhasefrontError `display`: one that cannot be. `setting`: another number of levels.
   */
  static withLookUpTable(display: Display, levels: ArrayBufferView | ArrayBuffer): Target {
    const bytes = bytesOf("the look-up table", levels, "setting");
    return new Target(guard(() => RawTarget.fromToml(toml(display)).withLookUpTable(bytes)));
  }

  /**
   * A calibration's file, as `phasefront calibrate` packs it.
   *
   * @throws PhasefrontError `display`: bytes that are none, or a display that cannot be.
   */
  static fromBytes(file: ArrayBufferView | ArrayBuffer): Target {
    const bytes = bytesOf("the calibration", file, "setting");
    return new Target(guard(() => RawTarget.fromBytes(bytes)));
  }

  /** Its display. */
  get display(): Required<Display> {
    return guard(() => this.raw.display()) as Required<Display>;
  }
}
