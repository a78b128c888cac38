// Compares frames from a `VideoFrame` and an `ImageBitmap` with those from their pixels.
import { Frame, PhasefrontError, Session, load } from "/phasefront/phasefront.js";
import { WorkerSession } from "/package/worker.js";

const [WIDTH, HEIGHT] = [64, 48];
const DEPTH = {
  width: WIDTH,
  height: HEIGHT,
  data: Uint8Array.from({ length: WIDTH * HEIGHT }, (_, i) => (i * 5) % 256),
};
const target = { width: WIDTH, height: HEIGHT };

/** The sizes in bytes of each format's planes, and the rows of each. */
const PLANES = {
  RGBA: [[4, 1]],
  RGBX: [[4, 1]],
  BGRA: [[4, 1]],
  BGRX: [[4, 1]],
  NV12: [
    [1, 1],
    [1, 0.5],
  ],
  I420: [
    [1, 1],
    [0.5, 0.5],
    [0.5, 0.5],
  ],
  I422: [
    [1, 1],
    [0.5, 1],
    [0.5, 1],
  ],
};

/** Returns a video frame and its planes. Alpha is full. */
function picture(format, { colorSpace, ...init } = {}) {
  let offset = 0;
  const planes = PLANES[format].map(([across, down]) => {
    const plane = { offset, rowStride: across * WIDTH };
    offset += across * WIDTH * down * HEIGHT;
    return plane;
  });
  const data = Uint8Array.from({ length: offset }, (_, i) => 40 + ((i * 3 + (i >> 6) * 7) % 170));
  if (format.endsWith("A")) for (let i = 3; i < offset; i += 4) data[i] = 255;
  const said = { format, codedWidth: WIDTH, codedHeight: HEIGHT, timestamp: 5000, colorSpace, ...init };
  return {
    video: new VideoFrame(data, said),
    planes: planes.map(({ offset, ...plane }) => ({ ...plane, data: data.subarray(offset) })),
  };
}

function equal(a, b, what) {
  if (a.length !== b.length || a.length === 0) throw new Error(`${what}: ${a.length} and ${b.length} levels`);
  const count = a.reduce((count, level, i) => count + (level !== b[i]), 0);
  if (count) throw new Error(`${what}: ${count} of ${a.length} levels differ`);
}

async function refused(start, call) {
  const error = await (async () => call())().catch((error) => error);
  if (error instanceof PhasefrontError && error.kind === "frame" && error.message.includes(start)) return;
  throw new Error(`not refused: ${start}: ${error}`);
}

/** Runs all tests, and throws if one fails. */
export async function run() {
  await load();
  using session = new Session({ target });
  const levels = async (frame) => {
    using hologram = await session.processAsync(frame);
    return [hologram.levels, hologram.info];
  };
  const spaces = [
    { matrix: "smpte170m", fullRange: false },
    { matrix: "bt709", fullRange: true },
    { matrix: "bt2020-ncl", fullRange: false },
  ];
  const yuv = ["NV12", "I420"].flatMap((format) => spaces.map((colorSpace) => [format, colorSpace]));
  const seen = new Set();
  for (const [format, colorSpace] of [["RGBA"], ["RGBX"], ["BGRA"], ["BGRX"], ...yuv]) {
    const { video, planes } = picture(format, { colorSpace });
    const size = { width: WIDTH, height: HEIGHT, format };
    const packed = planes.length === 1;
    const plain = new Frame(packed ? { ...size, ...planes[0] } : { ...size, planes, colorSpace }, DEPTH);
    const [made, info] = await levels(new Frame(video, DEPTH));
    equal(made, (await levels(plain))[0], `${format} ${JSON.stringify(colorSpace)}`);
    if (info.timestamp !== 5000) throw new Error(`timestamp ${info.timestamp}`);
    seen.add(made.join());
    video.close();
  }
  // The formats without alpha have the pixels of the others.
  if (seen.size !== 8) throw new Error(`${seen.size} different pictures`);

  // A video frame says what its colours mean.
  for (const [encoding, primaries, transfer] of [
    ["srgb", "bt709", "bt709"],
    ["display-p3", "smpte432", "iec61966-2-1"],
    ["bt2020-hlg", "bt2020", "hlg"],
    ["bt2020-pq", "bt2020", "pq"],
  ]) {
    const colorSpace = { primaries, transfer, matrix: "bt709", fullRange: true };
    const { video, planes } = picture("I420", { colorSpace });
    const { matrix, fullRange } = colorSpace;
    const plain = { width: WIDTH, height: HEIGHT, format: "I420", planes, colorSpace: { matrix, fullRange } };
    const [made] = await levels(new Frame(video, DEPTH));
    equal(made, (await levels(new Frame(plain, DEPTH, { encoding })))[0], encoding);
    video.close();
  }

  // A part of a picture is that part.
  const { video, planes } = picture("I420", {
    visibleRect: { x: 16, y: 12, width: 32, height: 24 },
    colorSpace: spaces[1],
  });
  const parts = planes.map(({ data, rowStride }, i) => ({
    data: data.subarray(i ? 6 * rowStride + 8 : 12 * rowStride + 16),
    rowStride,
  }));
  const part = { width: 32, height: 24, format: "I420", planes: parts, colorSpace: spaces[1] };
  const [[cropped], [wanted]] = [await levels(new Frame(video, DEPTH)), await levels(new Frame(part, DEPTH))];
  equal(cropped, wanted, "a part");

  // A bitmap and a canvas are the same picture, at once too.
  const pixels = new ImageData(Uint8ClampedArray.from(picture("RGBA").planes[0].data), WIDTH);
  const bitmap = await createImageBitmap(pixels);
  const [direct] = await levels(new Frame(pixels, DEPTH));
  equal((await levels(new Frame(bitmap, DEPTH)))[0], direct, "a bitmap");
  using now = session.process(new Frame(bitmap, DEPTH));
  equal(now.levels, direct, "a bitmap at once");

  // A worker takes both, copied or moved, and the copy leaves the caller's as it is.
  const remote = await WorkerSession.open({ target });
  const elsewhere = async (...said) => {
    using hologram = await remote.process(...said);
    return await hologram.levels();
  };
  equal(await elsewhere(new Frame(video, DEPTH)), cropped, "a copied VideoFrame in a worker");
  equal(await elsewhere(new Frame(video, DEPTH), { transfer: [video] }), cropped, "a moved VideoFrame in a worker");
  equal(await elsewhere(new Frame(bitmap, DEPTH), { transfer: [bitmap] }), direct, "a moved bitmap in a worker");
  if (video.format !== null || bitmap.width !== 0) throw new Error("they were copied");
  remote.close();

  // What the module does not know, the browser converts. Firefox makes no frame with chroma of another size.
  const colorSpace = { matrix: "bt2020-ncl", primaries: "bt2020", transfer: "bt709" };
  const unknown = navigator.userAgent.includes("Firefox") ? "BGRX" : "I422";
  const other = picture(unknown, { colorSpace }).video;
  const [converted] = await levels(new Frame(other, DEPTH));
  if (converted.length !== 3 * WIDTH * HEIGHT) throw new Error("not converted");

  await refused("await processAsync", () => session.process(new Frame(other, DEPTH)));
  other.close();
  await refused("is closed", () => session.processAsync(new Frame(other, DEPTH)));
  await refused("is closed", () => session.process(new Frame(bitmap, DEPTH)));
  await refused("no matrix 'rgb'", () => session.process(new Frame({ ...part, colorSpace: { matrix: "rgb" } }, DEPTH)));
  return "video frames and bitmaps are what their pixels are";
}
