// Opens the page in a frame of this document, and waits for its first hologram.
export async function run() {
  const frame = document.createElement("iframe");
  Object.assign(frame, { src: "/page/index.html", width: 1000, height: 800 });
  document.body.append(frame);
  const text = (id) => frame.contentDocument.getElementById(id)?.textContent ?? "";
  for (let i = 0; i < 1200 && !text("wrong") && !text("times").includes("views"); i++)
    await new Promise((done) => setTimeout(done, 50));
  if (text("wrong") || frame.contentWindow.state?.frames !== 1)
    throw new Error(`the page: ${text("wrong")} ${text("times")}`);
  const canvas = frame.contentDocument.querySelector("#shown canvas");
  // The session's worker has the canvas, and the page shows what it drew a moment later.
  const copy = new OffscreenCanvas(640, 360).getContext("2d", { willReadFrequently: true });
  let values = 0;
  for (let i = 0; i < 100 && values < 50; i++) {
    await new Promise((done) => setTimeout(done, 50));
    copy.drawImage(canvas, 0, 0);
    values = new Set(copy.getImageData(0, 0, 640, 360).data).size;
  }
  if (canvas.width !== 640 || values < 50) throw new Error("the page shows no picture");
  const said = `the page: ${text("times")}; ${text("computed")}`;
  frame.remove();
  return said;
}
