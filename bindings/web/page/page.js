// Handles the page: dropped files, the camera, the slider. The worker owns the session.
const at = (id) => document.getElementById(id);
const DEPTH_MM = 6;
const STEPS = Number(at("focus").max);

const state = { focus: STEPS / 2, source: "", frames: 0, method: "rgbd-8", width: 640, localSteps: 1, backend: "cpu" };
globalThis.state = state;

const worker = new Worker("worker.js", { type: "module" });
const waiting = new Map();
let last = 0;
worker.addEventListener("message", ({ data: { id, answer, error } }) => {
  const { done, fail } = waiting.get(id);
  waiting.delete(id);
  if (error === undefined) done(answer);
  else fail(new Error(error));
});

worker.addEventListener("error", () => say(new Error("the worker cannot start; is a file of the page missing?")));

function ask(kind, said = {}) {
  return new Promise((done, fail) => {
    waiting.set(++last, { done, fail });
    worker.postMessage({ id: last, kind, ...said });
  });
}

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

function draw(id, width, height, pixels) {
  const canvas = at(id).querySelector("canvas");
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  // Keep the controls in sight.
  canvas.style.maxWidth = `calc(72vh * ${width / height})`;
  canvas.getContext("2d").putImageData(new ImageData(new Uint8ClampedArray(pixels.buffer), width), 0, 0);
}

let made;
async function look() {
  if (!state.frames) return;
  const zMm = zOf(state.focus);
  at("focus").value = state.focus;
  at("z").textContent = `${zMm < 0 ? "−" : "+"}${Math.abs(zMm).toFixed(2)} mm`;
  const { ms, width, height, pixels } = await ask("view", { zMm });
  draw("shown", width, height, pixels);
  const { times } = made;
  at("times").textContent =
    `${made.width}×${made.height} in ${made.ms.toFixed(0)} ms: method ${times.methodMs.toFixed(0)}, ` +
    `encoding ${times.encodeMs.toFixed(0)}, depth and colour ${(times.depthMs + times.colourMs).toFixed(0)}; ` +
    `this view ${ms.toFixed(0)} ms; ${made.backend || "plane sweep"}` +
    (state.backend === "webgpu" ? `: ${made.backendWhy}` : "");
}
const view = newest(look);

let picture, stream;
async function show() {
  if (!picture) return;
  const { method, localSteps, width, backend } = state;
  const height = Math.round((width * picture.depth.height) / picture.depth.width);
  const options = { method, localSteps, width, height, video: Boolean(stream), backend };
  const colour = pixels(picture.colour, width, height, true);
  // Depth is not interpolated, because a mean of two depths lies on neither surface.
  const depth = pixels(picture.depth, width, height, false);
  if (at("white").checked) depth.data = depth.data.map((value) => 255 - value);
  const timestampNs = BigInt(Math.round(performance.now() * 1e6));
  made = await ask("frame", { options, colour, depth, timestampNs });
  draw("phases", made.width, made.height, made.levels);
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
  const grey = images.findIndex(isGrey);
  if (named < 0 && grey < 0)
    throw new Error("both pictures are coloured; depth is a grey one, black near and white far");
  const depth = named < 0 ? grey : named;
  picture = { colour: images[1 - depth], depth: images[depth] };
  state.source = source;
}

const open = newest(async (source, files) => {
  await take(source, files);
  await show();
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

let sweep = 0;
function stop() {
  clearInterval(sweep);
  sweep = 0;
  at("play").setAttribute("aria-pressed", "false");
}

function play() {
  const was = sweep;
  stop();
  if (was) return;
  let step = 1;
  at("play").setAttribute("aria-pressed", "true");
  sweep = setInterval(() => {
    if (state.focus + step < 0 || state.focus + step > STEPS) step = -step;
    focus(state.focus + step);
  }, 60);
}

at("focus").addEventListener("input", () => {
  stop();
  focus(Number(at("focus").value));
});
at("play").addEventListener("click", play);
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
at("shown")
  .querySelector("canvas")
  .addEventListener("click", async (event) => {
    const box = event.currentTarget.getBoundingClientRect();
    const { zMm } = await ask("focus", {
      x: (event.clientX - box.left) / box.width,
      y: (event.clientY - box.top) / box.height,
    });
    stop();
    focus(Math.round((0.5 - zMm / DEPTH_MM) * STEPS));
  });
at("save").addEventListener("click", async () => {
  const canvas = at("phases").querySelector("canvas");
  const blob = await new Promise((done) => canvas.toBlob(done, "image/png"));
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

work(1);
await ask("load").then(sample, say);
work(-1);
