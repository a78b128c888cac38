// Prints the times of times.js in Chromium, without threads, with one and with one for each core.
import { cpus } from "node:os";
import { BROWSERS } from "./support.js";

const browser = await BROWSERS.Chromium();
for (const [where, count] of [["plain", 1], ["isolated", 1], ["isolated", cpus().length]]) {
  const { result, error } = await browser.run(browser[where], "threads.js", "inWorker", "times.js", count);
  console.log(`${where === "plain" ? "without threads" : `${count} threads`}:`, error ?? "");
  console.table(result);
}
await browser.close();
