import { PhasefrontError, bytesOf, guard, release, whole } from "./error.js";
import { RawFrame } from "./raw/phasefront_web.js";

/** How a colour image lies in memory. `nv12` has two planes, `yuv420` three, the others one. */
export type ColourFormat = "rgba" | "bgra" | "rgb" | "nv12" | "yuv420";

/**
 * What a depth image's numbers are: metres, inverse metres, millimetres; Android's DEPTH16; or normalized, 0 nearest,
 * the largest number farthest. But for the normalized ones, 0, negative numbers and what is not finite are no reading.
 */
export type DepthFormat =
  | "metres-f32"
  | "metres-f16"
  | "disparity-f32"
  | "disparity-f16"
  | "millimetres-u16"
  | "android-depth16"
  | "normalized-u8"
  | "normalized-u16";

/** What a confidence map's bytes are: 0 low, 1 medium, 2 high; or 0 none to 255 full. */
export type ConfidenceFormat = "low-medium-high" | "u8";

/** Bytes of one plane, and where its pixels lie in them. */
export interface Plane {
  /** Any typed array. */
  readonly data: ArrayBufferView;
  /** Bytes from one row to the next; rows without gaps unless it is said. */
  readonly rowStride?: number;
  /** Bytes from one pixel to the next in a row; pixels without gaps unless it is said. */
  readonly pixelStride?: number;
}

/** A colour image of one plane. An `ImageData` of a canvas is one. */
export interface PackedColour extends Plane {
  readonly width: number;
  readonly height: number;
  /** `rgba` unless it is said. */
  readonly format?: "rgba" | "bgra" | "rgb";
}

/** A colour image of luma and chroma, as a `VideoFrame` gives it. */
export interface PlanarColour {
  readonly width: number;
  readonly height: number;
  readonly format: "nv12" | "yuv420";
  /** In the format's order. */
  readonly planes: readonly Plane[];
  /** Between luma, chroma and colour; `bt601` unless it is said. */
  readonly matrix?: "bt601" | "bt709";
  /** Whether luma runs over 16 to 235, not 0 to 255. */
  readonly videoRange?: boolean;
}

/** A depth image. A grey picture in an `ImageData` is one with `pixelStride: 4`. */
export interface DepthImage extends Plane {
  readonly width: number;
  readonly height: number;
  /** Metres of a `Float32Array`, millimetres of a `Uint16Array`, normalized of bytes, unless it is said. */
  readonly format?: DepthFormat;
}

/** How sure the depth is: an image of the depth's size. */
export interface ConfidenceImage extends Plane {
  readonly width: number;
  readonly height: number;
  /** `u8` unless it is said. */
  readonly format?: ConfidenceFormat;
}

/** How a sensor's picture becomes the one that is shown: turned clockwise, then mirrored. */
export interface Orientation {
  readonly degrees: 0 | 90 | 180 | 270;
  readonly mirrored?: boolean;
}

/** The pinhole model of a camera, in pixels of its image before it is turned upright. */
export interface Intrinsics {
  readonly fx: number;
  readonly fy: number;
  readonly cx: number;
  readonly cy: number;
}

/** How the depth camera and the colour camera stand to each other. */
export interface Cameras {
  readonly colour: Intrinsics;
  readonly depth: Intrinsics;
  /** A point p of the depth camera is at R·p + t of the colour camera: R's 9 numbers row by row, and t in metres. */
  readonly pose?: { readonly rotation: readonly number[]; readonly translationM: readonly number[] };
}

/** What else is known of a frame. */
export interface FrameOptions {
  /** When it was taken, in nanoseconds of any clock that runs forward. Image sessions do not look at it. */
  readonly timestampNs?: bigint;
  readonly confidence?: ConfidenceImage;
  /** Upright unless it is said. */
  readonly orientation?: Orientation;
  /** Where colour and depth do not show the same field of view. */
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

/** Bytes and strides of a plane of `width` pixels of `pixel` bytes. */
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

/** Colour and depth of one moment. Arrays are read when a session processes the frame. */
export class Frame {
  constructor(
    readonly colour: PackedColour | PlanarColour,
    readonly depth: DepthImage,
    readonly options: FrameOptions = {},
  ) {}

  /** @internal In the module's memory; freed by who asks. */
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
