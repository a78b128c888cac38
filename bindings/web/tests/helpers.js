// Functions for tests of the page, which run in it: its state once it is idle, and the images on its canvases.
window.still = async () => {
  let was = "";
  for (let i = 0; i < 1000; i++) {
    await new Promise((done) => setTimeout(done, 60));
    const now = JSON.stringify(state) + document.documentElement.getAttribute("aria-busy");
    if (now === was && now.endsWith("false")) return { ...state, wrong: document.getElementById("wrong").textContent };
    was = now;
  }
  throw new Error(`the page does not come to rest: ${was}`);
};
window.pixels = (id) => {
  // The worker has the canvas of the page.
  const canvas = document.querySelector(`#${id} canvas`);
  const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
  copy.drawImage(canvas, 0, 0);
  return copy.getImageData(0, 0, canvas.width, canvas.height);
};
// How sharp a part of a picture is: mean squares of differences along x.
window.sharpness = ([x0, y0, x1, y1]) => {
  const { width, height, data } = pixels("shown");
  let sum = 0, count = 0;
  for (let y = Math.round(y0 * height); y < y1 * height; y++)
    for (let x = Math.round(x0 * width); x < x1 * width - 1; x++, count++)
      sum += (data[4 * (y * width + x) + 1] - data[4 * (y * width + x) + 5]) ** 2;
  return sum / count;
};
window.drop = async (...pictures) => {
  const files = new DataTransfer();
  for (const [name, url] of pictures) files.items.add(new File([await (await fetch(url)).blob()], name));
  dispatchEvent(new DragEvent("drop", { dataTransfer: files, cancelable: true }));
};
// Chooses a setting of the page.
window.choose = (name, value) => {
  const setting = document.getElementById(name);
  setting.value = value;
  setting.dispatchEvent(new Event("change"));
  return still();
};
window.textOf = (id) => document.getElementById(id).textContent;
