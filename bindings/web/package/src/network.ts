import { bytesOf, guard } from "./error.js";
import { RawNetwork } from "./raw/phasefront_web.js";

/** What a network is. */
export interface NetworkInfo {
  /** Layers of its chain. */
  readonly layers: number;
  /** Filters of its hidden layers. */
  readonly filters: number;
  /** Numbers that it computes in. */
  readonly precision: string;
  /** The pixel pitch that it was trained for, µm. */
  readonly pitchUm: number;
  /** The volume's depth that it was trained for, mm. */
  readonly volumeDepthMm: number;
}

/** A trained network. Immutable; sessions share it. */
export class Network {
  /** @internal */
  readonly raw: RawNetwork;

  private constructor(raw: RawNetwork) {
    this.raw = raw;
  }

  /**
   * A network from the bytes of an `.onnx` file.
   *
   * @throws PhasefrontError `network`: what is no hologram network, or one that the kernels do not take.
   */
  static fromBytes(onnx: ArrayBuffer | ArrayBufferView): Network {
    const bytes = bytesOf("the network", onnx, "network");
    return new Network(guard(() => RawNetwork.fromBytes(bytes)));
  }

  /**
   * The int8 network of this name that is in the module: `rgbd-8` or `rgbd-15`.
   *
   * @throws PhasefrontError `network`: another name.
   */
  static builtIn(name = "rgbd-8"): Network {
    return new Network(guard(() => RawNetwork.builtIn(name)));
  }

  /**
   * The hologram network and the pre-filter that was trained with it, for a modulator at `offsetMm`: 0, 6 or 12.
   *
   * @throws PhasefrontError `network`: an offset that no pair was trained for.
   */
  static builtInPair(offsetMm: number): DeepPair {
    const [hologram, prefilter] = guard(() => RawNetwork.builtInPair(offsetMm)).map((raw) => new Network(raw));
    return { hologram: hologram!, prefilter: prefilter! };
  }

  /** What it is. */
  get info(): NetworkInfo {
    return guard(() => this.raw.info()) as NetworkInfo;
  }
}

/** The two networks of deep double phase. */
export interface DeepPair {
  /** Makes the hologram. */
  readonly hologram: Network;
  /** Prepares it for its encoding: `{ kind: "deep", prefilter }`. */
  readonly prefilter: Network;
}
