// Prints how long the page takes to its first hologram, in ms: the median of several loads in Chromium, each in a profile of
// its own, with the smallest and the largest. `node start.js [LOADS]`.
import puppeteer from "puppeteer-core";
import { SANDBOX, serveBuilt } from "./support.js";

/** Runs in the page before its scripts: notes when the session's worker was asked for what, and when it answered. */
function note() {
  const calls = (globalThis.calls = []);
  globalThis.Worker = class extends Worker {
    #asked = new Map();
    constructor(...said) {
      super(...said);
      calls.push({ call: "worker", start: performance.now() });
      this.addEventListener("message", ({ data: { id } }) => {
        if (this.#asked.has(id)) this.#asked.get(id).end = performance.now();
      });
    }
    postMessage(said, moved) {
      const asked = { call: said.call, start: performance.now() };
      calls.push(asked);
      this.#asked.set(said.id, asked);
      super.postMessage(said, moved);
    }
  };
}

/** Loads the page once and returns its times. */
async function load(address) {
  const browser = await puppeteer.launch({ executablePath: "/usr/bin/chromium", args: ["--disable-gpu", ...SANDBOX] });
  try {
    const page = await browser.newPage();
    await page.evaluateOnNewDocument(note);
    await page.goto(`${address}/page/index.html`);
    await page.waitForFunction("document.getElementById('times').textContent || document.getElementById('wrong').textContent");
    const { calls, wrong } = await page.evaluate("({ calls, wrong: document.getElementById('wrong').textContent })");
    if (wrong) throw new Error(wrong);
    const first = (name) => calls.find(({ call }) => call === name);
    const took = (name) => (first(name) ? first(name).end - first(name).start : 0);
    return {
      "to the session's worker": first("worker").start,
      "the worker's scripts, module and session": took("open"),
      "warming up": took("warmUp"),
      "to the frame": first("process").start,
      "the frame": took("process"),
      "the hologram": first("drawLevels").end,
      "the first view": first("drawPreview").end,
    };
  } finally {
    await browser.close();
  }
}

const address = await serveBuilt();
const loads = [];
for (let i = 0; i < Number(process.argv[2] ?? 9); i++) loads.push(await load(address));
console.table(Object.fromEntries(Object.keys(loads[0]).map((name) => {
  const all = loads.map((load) => Math.round(load[name])).sort((a, b) => a - b);
  return [name, { median: all[all.length >> 1], smallest: all[0], largest: all.at(-1) }];
})));
