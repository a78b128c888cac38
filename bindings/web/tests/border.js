// Tests that the API refuses each fault with its kind and the start of its one-line message, and that later calls still
// work.
import { Frame, Modulator, Network, PhasefrontError, Session, Target, load, thirdPartyNotices, version } from "/phasefront/phasefront.js";

const bytes = (n) => new Uint8Array(n).fill(90);
const colour = (width = 16, height = 12) => ({ width, height, data: bytes(4 * width * height) });
const depth = (width = 16, height = 12) => ({ width, height, data: bytes(width * height) });
const target = { width: 16, height: 12 };

function refused(kind, start, call) {
  try {
    call();
  } catch (error) {
    if (
      error instanceof PhasefrontError &&
      error.kind === kind &&
      error.message.includes(start) &&
      !error.message.includes("\n")
    )
      return;
    throw new Error(`${kind} ${start}: ${error.kind} ${error.message}`);
  }
  throw new Error(`not refused: ${start}`);
}

/** Tests that a session warns once on the console of depth that an app enlarged. */
function warns() {
  const size = { width: 160, height: 120 };
  const near = (x, y, i) => (x - ((29 + 37 * i) % 160)) ** 2 + (y - ((31 + 53 * i) % 120)) ** 2 < 30 + 40 * (i % 7);
  const discs = [...Array(24).keys()].reverse();
  const levels = Uint8Array.from({ length: 160 * 120 }, (_, at) => {
    const [x, y] = [at % 160, Math.floor(at / 160)].map((place) => 4 * Math.floor(place / 4) + 2);
    return 9 * (discs.find((i) => near(x, y, i)) ?? 24);
  });
  const data = Uint8Array.from({ length: 4 * levels.length }, (_, i) => levels[i >> 2]);
  const said = [];
  const { warn } = console;
  console.warn = (text) => said.push(text);
  try {
    const session = new Session({ target: size, method: { kind: "sweep" } }, "video");
    for (const timestamp of [1, 2, 3]) session.process(new Frame({ ...size, data }, { ...size, data: levels }, { timestamp })).close();
    session.close();
  } finally {
    console.warn = warn;
  }
  if (said.length !== 1 || !said[0].includes("enlarged 4 times (nearest) from 40×30")) throw new Error(`warned: ${said}`);
}

/** Runs all tests and throws if one fails. */
export async function run() {
  refused("session", "not loaded", () => version());
  await load();
  warns();
  const session = new Session({ target });
  const video = new Session({ target }, "video");
  refused("display", "width", () => Target.ofDisplay({ width: 0 }));
  refused("display", "depht", () => Target.ofDisplay({ depht: 1 }));
  refused("display", "pitch_um", () => Target.ofDisplay({ pitchUm: NaN }));
  refused("setting", "look-up table has 3 levels", () => Target.withLookUpTable({}, bytes(3)));
  refused("network", "", () => Network.fromBytes(bytes(100)));
  refused("network", "no 'rgbd-9' is built in", () => Network.builtIn("rgbd-9"));
  refused("setting", "no mode 'live'", () => new Session({ target }, "live"));
  refused("setting", "no mode 'film'", () => new Session({ target }, "film"));
  refused("setting", "no method 'magic'", () => new Session({ target, method: { kind: "magic" } }));
  refused("setting", "no encoding 'triple-phase'", () => new Session({ target, encoding: { kind: "triple-phase" } }));
  refused("setting", "fixed with its scale", () => new Session({ target, brightness: { kind: "fixed" } }));
  refused("setting", "most_pixels", () => new Session({ target: { width: 8192, height: 8192 } }));
  refused("frame", "no colour format 'cmyk'", () =>
    session.process(new Frame({ ...colour(), format: "cmyk" }, depth())),
  );
  refused("frame", "", () => session.process(new Frame({ ...colour(), data: bytes(7) }, depth())));
  refused("frame", "is -16; a whole number", () => session.process(new Frame({ ...colour(), width: -16 }, depth())));
  refused("frame", "say its format", () =>
    session.process(new Frame(colour(), { ...depth(), data: new Int8Array(192) })),
  );
  refused("frame", "aspect ratios differ", () => session.process(new Frame(colour(), depth(12, 12))));
  refused("frame", "8 are right, or 20", () => {
    const camera = { fx: 1, fy: 1, cx: 1, cy: 1 };
    const pose = { rotation: [1], translationM: [] };
    session.process(new Frame(colour(), depth(), { cameras: { colour: camera, depth: camera, pose } }));
  });
  video.process(new Frame(colour(), depth(), { timestamp: 9 })).close();
  refused("timestamp", "", () => video.process(new Frame(colour(), depth(), { timestamp: 8 })));

  const hologram = session.process(new Frame(colour(), depth()));
  const view = new ImageData(10, 8);
  refused("setting", "", () => hologram.writePreview(0, { width: 0, height: 8, data: view.data }));
  refused("setting", "", () => hologram.writePreview(1e9, view));
  refused("setting", "8 rows", () => hologram.writePreview(0, { width: 10, height: 8, data: new Uint8Array(9) }));
  hologram.writePreview(0, view);
  // Blue first, with gaps between rows, which stay as they are.
  const gaps = new Uint8Array(45 * 8).fill(7);
  hologram.writePreview(0, { width: 10, height: 8, data: gaps, layout: "bgra", rowStride: 45 });
  if (gaps[0] !== view.data[2] || gaps[3] !== 255 || gaps[40] !== 7 || gaps[47] !== view.data[40])
    throw new Error(`${gaps}`);
  const grey = new Uint8Array(16 * 12);
  refused("setting", "no layout 'cyan'", () => hologram.writeOutput({ layout: "cyan" }, grey));
  refused("setting", "12 rows", () => hologram.writeOutput({}, grey));
  refused("setting", "no image 3", () => hologram.writeOutput({ layout: "grey" }, grey, { image: 3 }));
  const { info, levels } = hologram;
  hologram.writeOutput({ layout: "grey" }, grey, { image: 1 });
  const words = new Uint16Array(16 * 12);
  hologram.writeOutput({ layout: "grey16" }, new Uint8Array(words.buffer), { image: 1 });
  const same = grey.every((level, i) => level === levels[16 * 12 + i] && words[i] === level << 8);
  if (levels.length !== 3 * 16 * 12 || !same || info.rangeM !== null || info.times.totalMs <= 0)
    throw new Error(JSON.stringify(info));
  // The view is the amplitude of the field, where 1 is white.
  const [seen, field] = [hologram.refocus(1), hologram.field(1)];
  const worst = Math.max(
    ...seen.map((amplitude, i) => Math.abs(amplitude - Math.hypot(field[2 * i], field[2 * i + 1]))),
  );
  if (seen.length !== levels.length || field.length !== 2 * levels.length || !(worst < 1e-5))
    throw new Error(`${worst} apart`);
  refused("setting", "", () => hologram.field(1e9));
  refused("display", "holoeye-pluto", () => Modulator.named("pluto"));
  const modulator = Modulator.fromToml('width = 16\nheight = 12\npacking = "grey"\nflip_x = true');
  const { images, pixelBytes } = modulator.outputSize;
  modulator.writeOutput(hologram, grey, { image: 1 });
  if (images !== 3 || pixelBytes !== 1 || grey[0] !== levels[16 * 12 + 15]) throw new Error(`${images} ${grey}`);
  refused("setting", "lasers", () => Modulator.named("ti-plm-p47").writeOutput(hologram, grey));
  const elsewhere = await Session.open({ target, backend: "webgpu" }).catch(({ kind, message }) => `${kind}: ${message}`);
  if (!elsewhere.startsWith?.("setting: this module has no WebGPU; import from phasefront/webgpu"))
    throw new Error(`${elsewhere}`);
  hologram.close();
  hologram.close();
  refused("session", "hologram is closed", () => hologram.levels);
  session.close();
  refused("session", "closed", () => session.process(new Frame(colour(), depth())));
  const pair = Network.builtInPair();
  const deep = new Session({
    target,
    method: { kind: "trained", network: pair.hologram },
    encoding: { kind: "deep", prefilter: pair.prefilter },
  });
  deep.process(new Frame(colour(), depth()));
  const said = version();
  const notices = await thirdPartyNotices();
  if (!notices.startsWith("# Third-party notices")) throw new Error(`notices: ${notices.slice(0, 40)}`);

  // The largest hologram for a distant modulator needs more memory than a module can have. That ends the module cleanly:
  // this call and every later one report it.
  const huge = { target: { width: 8192, height: 8192, offsetMm: 6 }, method: { kind: "sweep" }, mostPixels: 2 ** 32 - 1 };
  refused("internal", "the module cannot go on", () => new Session(huge).process(new Frame(colour(), depth())));
  refused("internal", "the module cannot go on", () => version());
  return said;
}
