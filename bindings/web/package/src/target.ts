import { bytesOf, guard } from "./error.js";
import { RawTarget } from "./raw/phasefront_web.js";

/** A display. The defaults are the paper's: 1920×1080, 8 µm, 638/520/450 nm, a volume of 6 mm at the modulator. */
export interface Display {
  /** The width of the modulator in pixels. */
  width?: number;
  /** The height of the modulator in pixels. */
  height?: number;
  /** The pixel pitch in µm. */
  pitchUm?: number;
  /** The wavelengths of the red, green and blue lasers, or of the only laser, in nm. */
  wavelengthsNm?: number[];
  /** The distance from the near to the far end of the volume in mm. */
  volumeDepthMm?: number;
  /** The distance from the centre of the volume to the modulator in mm, positive toward the viewer. */
  offsetMm?: number;
  /** The number of bits of a level, 1 to 16. */
  bits?: number;
  /** The radius of the circular aperture in the Fourier plane, relative to half the sampling frequency. */
  apertureRadius?: number;
  /**
   * The chromaticity x, y of the light of all lasers. At most one of `white`, `powers` and `primaries` may be given;
   * without one, all lasers together are taken for D65.
   */
  white?: number[];
  /** The radiant powers of red, green and blue, on any scale. */
  powers?: number[];
  /** X, Y and Z of red, of green and of blue, on any scale. */
  primaries?: number[][];
}

type Balance = "white" | "powers" | "primaries";

/** A display with all its values; what balances its lasers is there if it is known. */
export type FullDisplay = Required<Omit<Display, Balance>> & Pick<Display, Balance>;

/** Converts a display to TOML. The core checks keys and ranges. */
function toml(display: Display): string {
  const number = (value: unknown): string =>
    Array.isArray(value) ? `[${value.map(number).join(", ")}]` : String(value).toLowerCase().replace("infinity", "inf");
  return Object.entries(display)
    .filter(([, value]) => value !== undefined)
    .map(([key, value]) => `${key.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`)} = ${number(value)}\n`)
    .join("");
}

/**
 * Parses a display from TOML, in the format of the command `phasefront`.
 *
 * @throws PhasefrontError `display`: the text is not a display, or the display is invalid.
 */
export function displayFromToml(text: string): FullDisplay {
  return Target.fromToml(text).display;
}

/** The target of a hologram: a display with its modulator response, laser light and correction of the optics. */
export class Target {
  /** @internal */
  readonly raw: RawTarget;

  private constructor(raw: RawTarget) {
    this.raw = raw;
  }

  /** @internal */
  static of(raw: RawTarget): Target {
    return new Target(raw);
  }

  /**
   * Creates a target from a display in TOML, with levels in equal phase steps.
   *
   * @throws PhasefrontError `display`: the text is not a display, or the display is invalid.
   */
  static fromToml(text: string): Target {
    return new Target(guard(() => RawTarget.fromToml(text)));
  }

  /**
   * Creates a target from a display, with levels in equal phase steps and as many levels as its bits allow.
   *
   * @throws PhasefrontError `display`: the display is invalid.
   */
  static ofDisplay(display: Display = {}): Target {
    return Target.fromToml(toml(display));
  }

  /**
   * Creates a target with a global calibration of the modulator: the i-th of 256 levels gives the phase 2πi/256.
   *
   * @throws PhasefrontError `display`: the display is invalid. `setting`: the number of levels is not 256.
   */
  static withLookUpTable(display: Display, levels: ArrayBufferView | ArrayBuffer): Target {
    const bytes = bytesOf("the look-up table", levels, "setting");
    return new Target(guard(() => RawTarget.fromToml(toml(display)).withLookUpTable(bytes)));
  }

  /**
   * Reads a calibration file of `phasefront calibrate`.
   *
   * @throws PhasefrontError `display`: the bytes are not a calibration, or the display is invalid.
   */
  static fromBytes(file: ArrayBufferView | ArrayBuffer): Target {
    const bytes = bytesOf("the calibration", file, "setting");
    return new Target(guard(() => RawTarget.fromBytes(bytes)));
  }

  /** The display of the target. */
  get display(): FullDisplay {
    return guard(() => this.raw.display()) as FullDisplay;
  }
}
