import { PhasefrontError } from "./error.js";

/** A canvas of a page or of a worker. */
export type Canvas = HTMLCanvasElement | OffscreenCanvas;

/** The size of an image in pixels. */
export interface Size {
  readonly width: number;
  readonly height: number;
}

/** Gives a canvas the size of an image, which `write` makes, and shows the image on it. */
export function putPixels(canvas: Canvas, { width, height }: Size, write: (image: ImageData) => void): void {
  const context = (canvas as OffscreenCanvas).getContext("2d");
  if (!context)
    throw new PhasefrontError("setting", "the CPU draws now, and the canvas belongs to WebGPU; give it a new canvas");
  if (width === 0 || height === 0)
    throw new PhasefrontError("setting", `a picture of ${width}×${height}; each side must be at least 1`);
  const image = new ImageData(width, height);
  write(image);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  context.putImageData(image, 0, 0);
}
