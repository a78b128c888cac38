import { PhasefrontError, bytesOf, guard, release, whole } from "./error.js";
import { RawFrame } from "./raw/phasefront_web.js";

/** The memory layout of a colour image. `nv12` has two planes, `yuv420` three, the others one. */
export type ColourFormat = "rgba" | "bgra" | "rgb" | "nv12" | "yuv420";

/**
 * The meaning of a depth image's numbers: metres, inverse metres, millimetres, Android's DEPTH16; normalized, where 0 is
 * nearest and the largest number farthest; or relative inverse depth, as networks estimate it, which is larger where it
 * is nearer, on any scale. Except in normalized and relative formats, 0, negative and non-finite numbers mean that there
 * is no reading.
 */
export type DepthFormat =
  | "metres-f32"
  | "metres-f16"
  | "disparity-f32"
  | "disparity-f16"
  | "millimetres-u16"
  | "android-depth16"
  | "normalized-u8"
  | "normalized-u16"
  | "relative-f32"
  | "relative-f16";

/** The meaning of a confidence map's bytes: 0 low, 1 medium, 2 high; or 0 none to 255 full. */
export type ConfidenceFormat = "low-medium-high" | "u8";

/** The bytes of one plane and the layout of its pixels. */
export interface Plane {
  /** The bytes: any typed array. */
  readonly data: ArrayBufferView;
  /** Bytes from one row to the next. By default rows have no gaps. */
  readonly rowStride?: number;
  /** Bytes from one pixel to the next in a row. By default pixels have no gaps. */
  readonly pixelStride?: number;
}

/** A colour image with one plane, for example a canvas's `ImageData`. */
export interface PackedColour extends Plane {
  readonly width: number;
  readonly height: number;
  /** The layout; `rgba` by default. */
  readonly format?: "rgba" | "bgra" | "rgb";
}

/** A colour image of luma and chroma, as in a `VideoFrame`. */
export interface PlanarColour {
  readonly width: number;
  readonly height: number;
  readonly format: "nv12" | "yuv420";
  /** The planes in the order of the format. */
  readonly planes: readonly Plane[];
  /** The matrix that converts luma and chroma to colour; `bt601` by default. */
  readonly matrix?: "bt601" | "bt709";
  /** Whether luma ranges from 16 to 235 instead of 0 to 255. */
  readonly videoRange?: boolean;
}

/** A depth image. A grey picture in an `ImageData` is a depth image with `pixelStride: 4`. */
export interface DepthImage extends Plane {
  readonly width: number;
  readonly height: number;
  /** The format. By default a `Float32Array` has metres, a `Uint16Array` millimetres, and bytes are normalized. */
  readonly format?: DepthFormat;
}

/** The confidence of the depth, an image of the same size. */
export interface ConfidenceImage extends Plane {
  readonly width: number;
  readonly height: number;
  /** The format; `u8` by default. */
  readonly format?: ConfidenceFormat;
}

/** The orientation of the displayed picture relative to the sensor's: rotated clockwise, then mirrored. */
export interface Orientation {
  readonly degrees: 0 | 90 | 180 | 270;
  readonly mirrored?: boolean;
}

/** The pinhole model of a camera, in pixels of its image before rotation. */
export interface Intrinsics {
  readonly fx: number;
  readonly fy: number;
  readonly cx: number;
  readonly cy: number;
}

/** The relation of the depth camera and the colour camera. */
export interface Cameras {
  readonly colour: Intrinsics;
  readonly depth: Intrinsics;
  /**
   * The pose: a point p in depth camera coordinates is R·p + t in colour camera coordinates. R has 9 numbers, row by
   * row; t is in metres.
   */
  readonly pose?: { readonly rotation: readonly number[]; readonly translationM: readonly number[] };
}

/** The optional properties of a frame. */
export interface FrameOptions {
  /** The capture time in nanoseconds of any monotonic clock. Image sessions ignore it. */
  readonly timestampNs?: bigint;
  readonly confidence?: ConfidenceImage;
  /** The orientation; upright by default. */
  readonly orientation?: Orientation;
  /** The cameras, if colour and depth have different fields of view. */
  readonly cameras?: Cameras;
}

const COLOUR_BYTES = { rgba: [4], bgra: [4], rgb: [3], nv12: [1, 2], yuv420: [1, 1, 1] } as const;
const CONFIDENCE_BYTES = 1;

function depthBytes(format: DepthFormat): number {
  return format.endsWith("f32") ? 4 : format.endsWith("u8") ? 1 : 2;
}

function depthFormat(depth: DepthImage): DepthFormat {
  if (depth.format !== undefined) return depth.format;
  if (depth.data instanceof Float32Array) return "metres-f32";
  if (depth.data instanceof Uint16Array) return "millimetres-u16";
  if (depth.data instanceof Uint8Array || depth.data instanceof Uint8ClampedArray) return "normalized-u8";
  throw new PhasefrontError(
    "frame",
    "frame: depth is no Float32Array (metres), Uint16Array (millimetres) or Uint8Array (normalized); say its format",
  );
}

/** Returns the bytes and strides of a plane of `width` pixels of `pixel` bytes. */
function strides(what: string, plane: Plane, width: number, pixel: number): [Uint8Array, number, number] {
  const pixelStride = whole(`frame: the pixel stride of ${what}`, plane.pixelStride ?? pixel, "frame");
  const rowStride = whole(`frame: the row stride of ${what}`, plane.rowStride ?? width * pixelStride, "frame");
  return [bytesOf(`frame: ${what}`, plane.data, "frame"), rowStride, pixelStride];
}

function size(what: string, image: { readonly width: number; readonly height: number }): [number, number] {
  return [
    whole(`frame: the width of ${what}`, image.width, "frame"),
    whole(`frame: the height of ${what}`, image.height, "frame"),
  ];
}

/** The colour and depth of one moment. Arrays are read when a session processes the frame. */
export class Frame {
  constructor(
    readonly colour: PackedColour | PlanarColour,
    readonly depth: DepthImage,
    readonly options: FrameOptions = {},
  ) {}

  /** @internal Copies the frame into the module's memory. The caller frees it. */
  toRaw(): RawFrame {
    const { colour, depth, options } = this;
    const format: ColourFormat = colour.format ?? "rgba";
    const planes = "planes" in colour ? colour.planes : [colour];
    const pixels = COLOUR_BYTES[format] ?? [];
    const [width, height] = size("colour", colour);
    const [matrix, videoRange] =
      "planes" in colour ? [colour.matrix ?? "bt601", colour.videoRange ?? false] : ["bt601", false];
    const raw = guard(
      () => new RawFrame(options.timestampNs ?? 0n, format, width, height, matrix === "bt709", videoRange),
    );
    try {
      planes.forEach((plane, index) => {
        const across = index === 0 ? width : Math.ceil(width / 2);
        const parts = strides("colour", plane, across, pixels[index] ?? 1);
        guard(() => raw.colourPlane(...parts));
      });
      const of = depthFormat(depth);
      const parts = strides("depth", depth, depth.width, depthBytes(of));
      guard(() => raw.depth(of, ...size("depth", depth), ...parts));
      this.describe(raw);
    } catch (error) {
      release(raw);
      throw error;
    }
    return raw;
  }

  private describe(raw: RawFrame): void {
    const { confidence, orientation, cameras } = this.options;
    if (confidence) {
      const parts = strides("confidence", confidence, confidence.width, CONFIDENCE_BYTES);
      guard(() => raw.confidence(confidence.format ?? "u8", ...size("confidence", confidence), ...parts));
    }
    if (orientation) guard(() => raw.orientation(orientation.degrees, orientation.mirrored ?? false));
    if (cameras) {
      const of = ({ fx, fy, cx, cy }: Intrinsics) => [fx, fy, cx, cy];
      const pose = cameras.pose ? [...cameras.pose.rotation, ...cameras.pose.translationM] : [];
      const numbers = Float64Array.of(...of(cameras.colour), ...of(cameras.depth), ...pose);
      guard(() => raw.cameras(numbers));
    }
  }
}
