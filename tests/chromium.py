"""Headless Chromium for tests of pages."""

import base64
import json
import os
import shutil
import subprocess
from pathlib import Path


# WebGPU with its canvases on SwiftShader, Chromium's driver in software.
GPU = ["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--use-gl=angle", "--use-angle=swiftshader",
       "--enable-unsafe-swiftshader", "--enable-features=Vulkan", "--use-vulkan=swiftshader", "--ignore-gpu-blocklist"]


class Browser:
    """Chromium, controlled through the pipe of its DevTools protocol: JSON messages, each ended by a zero byte. It has
    WebGPU if `gpu` says so."""

    def __init__(self, chromium, profile, *flags, gpu=False):
        theirs_in, self.out = os.pipe()
        self.read, theirs_out = os.pipe()
        # The protocol's pipes are file descriptors 3 and 4.
        def place():
            a, b = os.dup(theirs_in), os.dup(theirs_out)
            os.dup2(a, 3)
            os.dup2(b, 4)

        command = [chromium, "--headless", "--remote-debugging-pipe", "--hide-scrollbars", *(GPU if gpu else ["--disable-gpu"]),
                   "--disable-background-networking", "--no-first-run", f"--user-data-dir={profile}", *flags, "about:blank"]
        if os.geteuid() == 0:
            command.insert(1, "--no-sandbox")
        self.process = subprocess.Popen(command, preexec_fn=place, close_fds=False,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(theirs_in)
        os.close(theirs_out)
        self.buffer, self.last, self.session, self.events = b"", 0, None, []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Network"]:
            self.call(f"{domain}.enable")

    def message(self):
        while b"\0" not in self.buffer:
            more = os.read(self.read, 1 << 20)
            if not more:
                raise SystemExit("Chromium closed its pipe")
            self.buffer += more
        text, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **parameters):
        self.last += 1
        message = {"id": self.last, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.out, data):]
        while True:
            answer = self.message()
            if answer.get("id") != self.last:
                self.events.append(answer)
            elif "error" in answer:
                raise AssertionError(f"{method}: {answer['error']}")
            else:
                return answer["result"]

    def evaluate(self, script):
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def open(self, url, width=1280, height=900, phone=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=2 if phone else 1, mobile=phone)
        self.events.clear()
        self.call("Page.navigate", url=url)
        self.evaluate("new Promise((done) => document.readyState === 'complete' ? done() : addEventListener('load', done))")

    def box(self, selector):
        return self.evaluate(
            f"(() => {{ const b = document.querySelector({selector!r}).getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; }})()")

    def click(self, selector, x=0.5, y=0.5):
        self.evaluate(f"document.querySelector({selector!r}).scrollIntoView({{ block: 'center' }})")
        left, top, width, height = self.box(selector)
        for kind in ["mousePressed", "mouseReleased"]:
            self.call("Input.dispatchMouseEvent", type=kind, x=left + x * width, y=top + y * height, button="left", clickCount=1)

    def key(self, key):
        code = {"End": 35, "Home": 36, "ArrowLeft": 37, "ArrowRight": 39}.get(key, 0)
        for kind in ["keyDown", "keyUp"]:
            self.call("Input.dispatchKeyEvent", type=kind, key=key, text=key if len(key) == 1 else "", windowsVirtualKeyCode=code)

    def screenshot(self, path, full=False):
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"clip": {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}} if full else {}
        data = self.call("Page.captureScreenshot", format="jpeg", quality=82, captureBeyondViewport=full, **clip)["data"]
        path.write_bytes(base64.b64decode(data))

    def close(self):
        self.session = None
        self.call("Browser.close")
        self.process.wait(20)


def chromium():
    """Returns the path of Chromium. Installs it on Debian, and ends the test if there is none."""
    names = ["chromium", "chromium-browser", "google-chrome"]
    found = next(filter(None, map(shutil.which, names)), None)
    if not found:
        subprocess.run(["bash", "-c", ". tests/bindings.sh && install chromium"], cwd=Path(__file__).resolve().parents[1])
        found = shutil.which("chromium")
    if not found:
        raise SystemExit("Chromium is missing, and apt-get could not install it")
    return found
