/** The memory layout of a colour image, by the names of WebCodecs and `RGB`. */
export type ColourFormat = PackedColour["format"] | PlanarColour["format"];

/**
 * The meaning of a depth image's numbers: metres, inverse metres, millimetres, Android's DEPTH16; normalized, where 0 is
 * nearest and the largest number farthest; or relative inverse depth, as networks estimate it, which is larger where it
 * is nearer, on any scale. Except in normalized and relative formats, these mean that there is no reading: 0, negative
 * numbers, NaN, numbers of 10⁹ or more, the largest code of an integer format and the largest finite 16-bit float.
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
  /** The layout; `RGBA` by default. */
  readonly format?: "RGBA" | "RGBX" | "BGRA" | "BGRX" | "RGB";
  /** The colour space, as an `ImageData` or a `VideoFrame` says it; sRGB by default. */
  readonly colorSpace?: PredefinedColorSpace | VideoColorSpaceInit;
}

/** A colour image of luma and chroma, as a decoder makes it: `NV12` has two planes, `I420` three. */
export interface PlanarColour {
  readonly width: number;
  readonly height: number;
  readonly format: "NV12" | "I420";
  /** The planes in the order of the format. */
  readonly planes: readonly Plane[];
  /**
   * The matrix that converts luma and chroma to colour, `smpte170m` by default (that of BT.601, as `bt470bg`),
   * `bt709` or `bt2020-ncl`;
   * whether luma ranges from 0 to 255, as by default, or from 16 to 235; and the primaries and the transfer of red, green
   * and blue, sRGB's by default.
   */
  readonly colorSpace?: VideoColorSpaceInit;
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
  /**
   * The capture time in microseconds of any monotonic clock; by default that of a `VideoFrame`. Image sessions ignore it.
   */
  readonly timestamp?: number;
  readonly confidence?: ConfidenceImage;
  /** The orientation; by default upright, or that of a `VideoFrame`. It is that of the colour and of the depth. */
  readonly orientation?: Orientation;
  /** The cameras, if colour and depth have different fields of view. */
  readonly cameras?: Cameras;
  /** The meaning of red, green and blue; by default what the image says of it by its `colorSpace`, else `srgb`. */
  readonly encoding?: RgbEncoding;
}

/**
 * The meaning of red, green and blue: `srgb`, which is also that of BT.709 video; `display-p3`, that of a phone's
 * pictures; BT.2020 with the curve of sRGB (`bt2020`), hybrid log-gamma or perceptual quantization; or `amplitude`, the
 * amplitudes of the lasers, as in the paper and its data sets.
 */
export type RgbEncoding = "srgb" | "display-p3" | "bt2020" | "bt2020-hlg" | "bt2020-pq" | "amplitude";

/** The colour and depth of one moment. Images are read when a session processes the frame. */
export class Frame {
  /**
   * `colour` may be a `VideoFrame` of a camera or a decoder, or an `ImageBitmap`; the caller closes it after the session
   * has processed the frame. Only asynchronous calls take a `VideoFrame`.
   */
  constructor(
    readonly colour: PackedColour | PlanarColour | VideoFrame | ImageBitmap,
    readonly depth: DepthImage,
    readonly options: FrameOptions = {},
  ) {}
}
