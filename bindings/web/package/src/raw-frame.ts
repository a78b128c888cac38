import { PhasefrontError, bytesOf, guard, release, whole } from "./error.js";
import type {
  DepthFormat,
  DepthImage,
  Frame,
  FrameOptions,
  Intrinsics,
  PackedColour,
  PlanarColour,
  Plane,
  RgbEncoding,
} from "./frame.js";
import { RawFrame } from "./raw/phasefront_web.js";

/** The bytes of a pixel in each plane. */
const COLOUR_BYTES = { RGBA: [4], RGBX: [4], BGRA: [4], BGRX: [4], RGB: [3], NV12: [1, 2], I420: [1, 1, 1] } as const;
/** The matrices of luma and chroma that the module knows. */
const MATRICES: readonly string[] = ["smpte170m", "bt470bg", "bt709", "bt2020-ncl"];
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

/** Copies a frame into the module's memory. The caller frees it. */
export function rawFrame({ colour, depth, options }: Frame): RawFrame {
  if (isVideoFrame(colour))
    throw new PhasefrontError("frame", "frame: a VideoFrame is copied by the browser later; await processAsync");
  return rawFrameOf(isBitmap(colour) ? ofBitmap(colour) : colour, depth, options);
}

/** Does as {@link rawFrame} does, and waits for the copy of a `VideoFrame`. */
export async function rawFrameAsync(frame: Frame): Promise<RawFrame> {
  const { colour, depth, options } = frame;
  if (!isVideoFrame(colour)) return rawFrame(frame);
  const { timestamp, rotation, flip } = colour as VideoFrame & { rotation?: number; flip?: boolean };
  const orientation = { degrees: rotation ?? 0, mirrored: flip ?? false } as NonNullable<FrameOptions["orientation"]>;
  return rawFrameOf(await ofVideoFrame(colour), depth, { timestamp, orientation, ...options });
}

function isVideoFrame(colour: object): colour is VideoFrame {
  return typeof VideoFrame !== "undefined" && colour instanceof VideoFrame;
}

function isBitmap(colour: object): colour is ImageBitmap {
  return typeof ImageBitmap !== "undefined" && colour instanceof ImageBitmap;
}

function ofBitmap(bitmap: ImageBitmap): PackedColour {
  const { width, height } = bitmap;
  if (width === 0) throw new PhasefrontError("frame", "frame: the ImageBitmap is closed; close it after the frame");
  const context = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  context!.drawImage(bitmap, 0, 0);
  return context!.getImageData(0, 0, width, height);
}

/** Copies a video frame's planes as they are, or as RGBA if the module does not know their format or colour space. */
async function ofVideoFrame(frame: VideoFrame): Promise<PackedColour | PlanarColour> {
  if (frame.visibleRect === null)
    throw new PhasefrontError("frame", "frame: the VideoFrame is closed; close it after the frame");
  const { width, height } = frame.visibleRect;
  const [matrix, fullRange] = [frame.colorSpace.matrix ?? "bt709", frame.colorSpace.fullRange ?? false];
  const packed = frame.format !== null && /^(RGB|BGR)/.test(frame.format);
  const known = frame.format !== null && frame.format in COLOUR_BYTES && (packed || MATRICES.includes(matrix));
  const convert = known ? {} : ({ format: "RGBA", colorSpace: "srgb" } as const);
  const data = new Uint8Array(frame.allocationSize(convert));
  const layout = await frame.copyTo(data, convert).catch((error: Error) => {
    const what = `a VideoFrame of format ${frame.format} and matrix ${matrix}`;
    throw new PhasefrontError("frame", `frame: the browser cannot copy ${what}: ${error.message}`);
  });
  const planes = layout.map(({ offset, stride }) => ({ data: data.subarray(offset), rowStride: stride }));
  const format = known ? frame.format : "RGBA";
  if (!known) return { width, height, format, ...planes[0]! } as PackedColour;
  const { primaries, transfer } = frame.colorSpace;
  const colorSpace = { matrix, fullRange, primaries, transfer };
  if (packed) return { width, height, format, ...planes[0]!, colorSpace } as PackedColour;
  return { width, height, format, planes, colorSpace } as PlanarColour;
}

function rawFrameOf(colour: PackedColour | PlanarColour, depth: DepthImage, options: FrameOptions): RawFrame {
  const { format = "RGBA" } = colour;
  const planes = "planes" in colour ? colour.planes : [colour];
  const pixels = COLOUR_BYTES[format] ?? [];
  const [width, height] = size("colour", colour);
  const space = colour.colorSpace;
  const { matrix, fullRange } = ("planes" in colour && colour.colorSpace) || {};
  const ns = nanoseconds(options.timestamp ?? 0);
  const raw = guard(() => new RawFrame(ns, format, width, height, matrix ?? "smpte170m", fullRange === false));
  try {
    planes.forEach((plane, index) => {
      const across = index === 0 ? width : Math.ceil(width / 2);
      const parts = strides("colour", plane, across, pixels[index] ?? 1);
      guard(() => raw.colourPlane(...parts));
    });
    const of = depthFormat(depth);
    const parts = strides("depth", depth, depth.width, depthBytes(of));
    guard(() => raw.depth(of, ...size("depth", depth), ...parts));
    guard(() => raw.encoding(options.encoding ?? encodingOf(space)));
    describe(raw, options);
  } catch (error) {
    release(raw);
    throw error;
  }
  return raw;
}

/** Returns the meaning of the colours of an image that says `space` of them. */
function encodingOf(space: PackedColour["colorSpace"]): RgbEncoding {
  if (typeof space !== "object") return space === "display-p3" ? "display-p3" : "srgb";
  const [primaries, transfer] = [space.primaries as string, space.transfer as string];
  if (primaries === "smpte432") return "display-p3";
  if (primaries !== "bt2020") return "srgb";
  return transfer === "hlg" ? "bt2020-hlg" : transfer === "pq" ? "bt2020-pq" : "bt2020";
}

function nanoseconds(timestamp: number): bigint {
  if (Number.isFinite(timestamp) && timestamp >= 0 && timestamp < 2 ** 54) return BigInt(Math.round(timestamp * 1000));
  throw new PhasefrontError("timestamp", `timestamp is ${timestamp}; microseconds from 0 are right`);
}

function describe(raw: RawFrame, { confidence, orientation, cameras }: FrameOptions): void {
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
