import { bytesOf, guard } from "./error.js";
import { RawNetwork } from "./raw/phasefront_web.js";

/** The properties of a network. */
export interface NetworkInfo {
  /** The number of layers. */
  readonly layers: number;
  /** The number of filters in each hidden layer. */
  readonly filters: number;
  /**
   * The number format of the layers: `f32` or `int8`, or `own` for a network of another form, which runs in the formats
   * that its file names.
   */
  readonly precision: string;
  /** The pixel pitch that the network was trained for, in µm. */
  readonly pitchUm: number;
  /** The depth of the volume that the network was trained for, in mm. */
  readonly volumeDepthMm: number;
}

/** A trained network. It is immutable and can be shared by sessions. */
export class Network {
  /** @internal */
  readonly raw: RawNetwork;

  private constructor(raw: RawNetwork) {
    this.raw = raw;
  }

  /**
   * Loads a network from the bytes of an `.onnx` file.
   *
   * @throws PhasefrontError `network`: the file is not a hologram network, or the kernels do not support it.
   */
  static fromBytes(onnx: ArrayBuffer | ArrayBufferView): Network {
    const bytes = bytesOf("the network", onnx, "network");
    return new Network(guard(() => RawNetwork.fromBytes(bytes)));
  }

  /**
   * Returns the built-in int8 network called `name`: `rgbd-8` or `rgbd-15`.
   *
   * @throws PhasefrontError `network`: the name is unknown.
   */
  static builtIn(name = "rgbd-8"): Network {
    return new Network(guard(() => RawNetwork.builtIn(name)));
  }

  /**
   * Returns the hologram network and the pre-filter that was trained with it, for a modulator in the middle of the
   * volume. A network without a pre-filter displays more, at any offset.
   */
  static builtInPair(): DeepPair {
    const [hologram, prefilter] = guard(() => RawNetwork.builtInPair()).map((raw) => new Network(raw));
    return { hologram: hologram!, prefilter: prefilter! };
  }

  /** The properties of the network. */
  get info(): NetworkInfo {
    return guard(() => this.raw.info()) as NetworkInfo;
  }
}

/** The two networks of deep double phase. */
export interface DeepPair {
  /** The network that computes the hologram. */
  readonly hologram: Network;
  /** The network that pre-filters it for the encoding `{ kind: "deep", prefilter }`. */
  readonly prefilter: Network;
}
