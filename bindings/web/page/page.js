// Handles the page: dropped files, the camera, the slider, the screen of the hologram. A worker has the session.
import { Frame, WorkerSession } from "./phasefront/worker.js";

const at = (id) => document.getElementById(id);
const DEPTH_MM = 6;
const STEPS = Number(at("focus").max);

const state = { focus: STEPS / 2, source: "", frames: 0, method: "auto", width: 640, localSteps: 1, backend: "cpu" };
globalThis.state = state;

function say(error) {
  at("wrong").hidden = !error;
  at("wrong").textContent = error ? error.message : "";
}

let busy = 0;
function work(change) {
  busy += change;
  document.documentElement.setAttribute("aria-busy", String(busy > 0));
}

// Wraps `fulfil` so that only the newest request is fulfilled and those in between are skipped. The wrapper returns a
// promise that resolves when no request is left.
function newest(fulfil) {
  let running, next;
  async function run() {
    work(1);
    while (next) {
      const now = next;
      next = undefined;
      await fulfil(...now).then(() => say(), say);
    }
    work(-1);
    running = undefined;
  }
  return (...said) => {
    next = said;
    return (running ??= run());
  };
}

const zOf = (focus) => (0.5 - focus / STEPS) * DEPTH_MM;

let opened, planned, hologram, said;

const LABELS = { shown: "What an eye sees of the hologram", phases: "The phases of the hologram" };

// Draws to the canvas of the page that the session's worker has, or else to a new one.
const canvases = {};
async function draw(id, { width, height }, onto) {
  const canvas = (canvases[id] ??= Object.assign(document.createElement("canvas"), { width, height }));
  await onto(canvas);
  if (canvas.isConnected || canvases[id] !== canvas) return;
  canvas.style.setProperty("--aspect", width / height);
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", LABELS[id]);
  at(id).querySelector("canvas").replaceWith(canvas);
}

// A driver in software is taken only by its name: `?adapter=swiftshader`.
const adapter = new URLSearchParams(location.search).get("adapter") ?? undefined;

// The session of these options. A new one is opened if they change.
function sessionOf({ method, localSteps, width, height, video, backend }) {
  const wanted = JSON.stringify([method, localSteps, width, height, video, backend]);
  if (wanted === planned) return opened;
  opened?.then((session) => session.close(), () => {});
  hologram = canvases.shown = canvases.phases = undefined;
  const options = {
    target: { width, height },
    method: method === "auto" || method === "sweep" ? { kind: method } : { kind: "trained", network: method },
    localSteps,
    backend,
    adapter,
  };
  planned = wanted;
  opened = WorkerSession.open(options, video ? "video" : "image");
  opened.catch(() => {
    if (planned === wanted) planned = undefined;
  });
  return opened;
}

// Returns how often it was called for `calls` in the last second.
function rate(calls) {
  const now = performance.now();
  calls.push(now);
  while (calls[0] < now - 1000) calls.shift();
  return calls.length;
}

const frameTimes = [];
const viewTimes = [];
async function look() {
  const mine = hologram;
  if (!mine) return;
  const zMm = zOf(state.focus);
  at("focus").value = state.focus;
  at("z").textContent = `${zMm < 0 ? "−" : "+"}${Math.abs(zMm).toFixed(2)} mm`;
  const { width, height, times } = mine.info;
  const start = performance.now();
  try {
    await draw("shown", { width, height }, (canvas) => mine.drawPreview(zMm, canvas, { width, height }));
  } catch (error) {
    // A newer hologram has replaced it, and is looked at next.
    if (mine !== hologram) return;
    throw error;
  }
  at("times").textContent =
    `${width}×${height} in ${said.ms.toFixed(0)} ms: method ${times.methodMs.toFixed(0)}, ` +
    `propagation ${times.propagateMs.toFixed(0)}, encoding ${times.encodeMs.toFixed(0)}, depth and colour ${(times.depthMs + times.colourMs).toFixed(0)}; ` +
    `this view ${(performance.now() - start).toFixed(0)} ms; ` +
    `in the last second ${said.rate} holograms, ${rate(viewTimes)} views`;
}

// Views are not computed more often than the display shows them.
const view = newest(() => Promise.all([look(), new Promise(requestAnimationFrame)]));

// The focus on the subject: the nearest surface that fills a tenth of the middle half of a hologram.
async function subject(of) {
  const places = [];
  for (let y = 0.26; y < 0.75; y += 0.04) for (let x = 0.26; x < 0.75; x += 0.04) places.push(of.zAt(x, y));
  const nearestFirst = (await Promise.all(places)).sort((a, b) => b - a);
  const tenth = Math.ceil(nearestFirst.length / 10);
  const from = nearestFirst.findIndex((zMm, i) => zMm - nearestFirst[i + tenth - 1] < DEPTH_MM / 12);
  if (from < 0) return STEPS / 2;
  return Math.round((0.5 - nearestFirst[from + (tenth >> 1)] / DEPTH_MM) * STEPS);
}

let picture, stream;
async function show() {
  if (!picture) return;
  const { method, localSteps, width, backend } = state;
  const height = Math.round((width * picture.depth.height) / picture.depth.width);
  const opening = sessionOf({ method, localSteps, width, height, video: Boolean(stream), backend });
  const colour = pixels(picture.colour, width, height, true);
  // Depth is not interpolated, because a mean of two depths lies on neither surface.
  const depth = pixels(picture.depth, width, height, false);
  if (at("white").checked) depth.data = depth.data.map((value) => 255 - value);
  const session = await opening;
  const start = performance.now();
  const frame = new Frame(colour, { ...depth, pixelStride: 4, format: "normalized-u8" }, { timestamp: start * 1000 });
  const made = await session.process(frame, { transfer: [colour.data.buffer], onGpu: true });
  said = { ms: performance.now() - start, rate: rate(frameTimes) };
  hologram?.close();
  hologram = made;
  try {
    await draw("phases", { width, height }, (canvas) => made.drawLevels(canvas));
  } catch (error) {
    // The GPU was lost, and the CPU needs canvases of its own: the next frame has a new session.
    planned = undefined;
    throw error;
  }
  const { backend: name, backendWhy } = await session.statistics();
  at("computed").textContent = backend === "webgpu" ? `${name}: ${backendWhy}` : name;
  state.frames++;
  await look();
}
const refresh = newest(show);

// Crops the middle of a picture to the aspect ratio of `width` and `height`, and scales it to that size.
function pixels(source, width, height, smooth) {
  const across = Math.min(source.width, (source.height * width) / height);
  const down = (across * height) / width;
  const context = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  context.imageSmoothingEnabled = smooth;
  context.imageSmoothingQuality = "high";
  const [x, y] = [(source.width - across) / 2, (source.height - down) / 2];
  context.drawImage(source, x, y, across, down, 0, 0, width, height);
  return { width, height, data: context.getImageData(0, 0, width, height).data };
}

function read(file) {
  return createImageBitmap(file).catch(() => {
    throw new Error(`${file.name} is no picture that this browser reads`);
  });
}

function isGrey(image) {
  const { data } = pixels(image, 64, 64, false);
  for (let i = 0; i < data.length; i += 4) {
    if (Math.abs(data[i] - data[i + 1]) > 2 || Math.abs(data[i] - data[i + 2]) > 2) return false;
  }
  return true;
}

async function take(source, files) {
  stopCamera();
  if (files.length !== 2) throw new Error(`${files.length} files; give two: a colour picture and its depth picture`);
  const images = await Promise.all(files.map(read));
  const named = files.findIndex(({ name }) => /depth/i.test(name));
  const depth = named < 0 ? images.findIndex(isGrey) : named;
  if (depth < 0) throw new Error("both pictures are coloured; depth is a grey one, black near and white far");
  picture = { colour: images[1 - depth], depth: images[depth] };
  state.source = source;
}

const open = newest(async (source, files) => {
  await take(source, files);
  await show();
  if (hologram) await focus(await subject(hologram));
});

async function sample() {
  const files = ["scene_rgb.jpg", "scene_depth.png"].map(async (name) => {
    const response = await fetch(name);
    return new File([await response.blob()], name);
  });
  await open("sample", await Promise.all(files));
}

function stopCamera() {
  stream?.getTracks().forEach((track) => track.stop());
  stream = undefined;
  at("camera").setAttribute("aria-pressed", "false");
}

// Combines the camera's colour with the existing depth, because computers' cameras have none.
async function camera() {
  const was = stream;
  stopCamera();
  if (was || !picture) return;
  if (!navigator.mediaDevices) return say(new Error("the camera needs a page served by https, or from localhost"));
  try {
    stream = await navigator.mediaDevices.getUserMedia({ video: { width: 640, facingMode: "environment" } });
  } catch (error) {
    return say(new Error(`the camera cannot be opened: ${error.message}`));
  }
  const mine = stream;
  at("camera").setAttribute("aria-pressed", "true");
  state.source = "camera";
  const video = Object.assign(document.createElement("video"), { srcObject: mine, muted: true, playsInline: true });
  await video.play();
  while (stream === mine) {
    const colour = await createImageBitmap(video);
    if (stream !== mine) return;
    picture = { ...picture, colour };
    const before = state.frames;
    await refresh();
    if (stream === mine && state.frames === before) return stopCamera();
    await new Promise(requestAnimationFrame);
  }
}

function focus(to) {
  state.focus = Math.min(Math.max(to, 0), STEPS);
  return view();
}

let sweep;
function stop() {
  sweep = undefined;
  at("play").setAttribute("aria-pressed", "false");
}

// Moves the focus there and back, from one end to the other in 3.6 seconds.
async function play() {
  const was = sweep;
  stop();
  if (was) return;
  const mine = (sweep = {});
  at("play").setAttribute("aria-pressed", "true");
  let direction = STEPS / 3600;
  let last = await new Promise(requestAnimationFrame);
  while (sweep === mine) {
    const now = await new Promise(requestAnimationFrame);
    if (state.focus <= 0) direction = Math.abs(direction);
    if (state.focus >= STEPS) direction = -Math.abs(direction);
    focus(state.focus + direction * (now - last));
    last = now;
  }
}

// The screens of the computer, once the browser may tell them.
let screens = [];
async function findScreens() {
  ({ screens } = await getScreenDetails());
  at("screen").replaceChildren(
    ...screens.map(({ label, width, height }, i) => new Option(`${label || `Screen ${i + 1}`}, ${width}×${height}`, i)),
  );
  at("screen").parentElement.hidden = false;
  const other = screens.findIndex(({ isPrimary }) => !isPrimary);
  at("screen").value = Math.max(other, 0);
}

// Shows the hologram on the whole screen, one pixel of it on one of the screen.
async function fullScreen() {
  const screen = screens[at("screen").value];
  await at("stage").requestFullscreen({ navigationUI: "hide", ...(screen && { screen }) });
  const canvas = at("stage").querySelector("canvas");
  at("stage").style.setProperty("--width", `${canvas.width / devicePixelRatio}px`);
}

at("focus").addEventListener("input", () => {
  stop();
  focus(Number(at("focus").value));
});
at("play").addEventListener("click", play);
at("full").addEventListener("click", () => fullScreen().catch(say));
at("screens").hidden = !("getScreenDetails" in globalThis);
at("screens").addEventListener("click", () => findScreens().catch(say));
at("sample").addEventListener("click", sample);
at("camera").addEventListener("click", camera);
at("white").addEventListener("change", () => refresh());
at("files").addEventListener("change", () => open("files", [...at("files").files]));
for (const id of ["method", "width", "localSteps", "backend"]) {
  at(id).addEventListener("change", () => {
    state[id] = id === "method" || id === "backend" ? at(id).value : Number(at(id).value);
    refresh();
  });
}
at("shown").addEventListener("click", async ({ target, clientX, clientY }) => {
  if (target.localName !== "canvas" || !hologram) return;
  const box = target.getBoundingClientRect();
  const zMm = await hologram.zAt((clientX - box.left) / box.width, (clientY - box.top) / box.height);
  stop();
  focus(Math.round((0.5 - zMm / DEPTH_MM) * STEPS));
});
at("save").addEventListener("click", async () => {
  if (!hologram) return;
  // The worker has the canvas of the page, so the pixels of a copy are saved.
  const shown = at("phases").querySelector("canvas");
  const copy = new OffscreenCanvas(shown.width, shown.height);
  copy.getContext("2d").drawImage(shown, 0, 0);
  const blob = await copy.convertToBlob({ type: "image/png" });
  const link = Object.assign(document.createElement("a"), {
    href: URL.createObjectURL(blob),
    download: "hologram.png",
  });
  link.click();
  URL.revokeObjectURL(link.href);
});

addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("over");
});
addEventListener("dragleave", () => document.body.classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  document.body.classList.remove("over");
  open("files", [...event.dataTransfer.files]);
});
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const { tagName, type } = document.activeElement ?? {};
  if (event.key === " " && tagName !== "BUTTON" && tagName !== "SELECT" && type !== "checkbox") play();
  else if (type === "range" || tagName === "SELECT") return;
  else if (event.key === "ArrowLeft") {
    stop();
    focus(state.focus - 1);
  } else if (event.key === "ArrowRight") {
    stop();
    focus(state.focus + 1);
  } else if (event.key === "Home") {
    stop();
    focus(0);
  } else if (event.key === "End") {
    stop();
    focus(STEPS);
  } else return;
  event.preventDefault();
});

// The session opens while the sample comes.
sessionOf({ ...state, height: Math.round((state.width * 9) / 16), video: false });
await sample();
