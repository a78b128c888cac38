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
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  if (canvas.width !== 640 || new Set(data).size < 50) throw new Error("the page shows no picture");
  const said = `the page: ${text("times")}; ${text("computed")}`;
  frame.remove();
  return said;
}
