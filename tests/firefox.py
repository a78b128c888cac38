"""Headless Firefox for tests of pages. The pages fetch what they evaluate from the test's own server, because workers of
workers sometimes do not start in a Firefox that WebDriver BiDi controls.
"""

import http.server
import json
import os
import queue
import shutil
import subprocess
from pathlib import Path

# Clocks are otherwise coarser than the time of a small frame.
PREFERENCES = {"privacy.reduceTimerPrecision": False, "datareporting.policy.dataSubmissionEnabled": False}
# The page of a test, which evaluates one script after another.
PAGE = """<!doctype html>
<meta charset="utf-8">
<title>Evaluates what the test sends</title>
<link rel="icon" href="data:,">
<body>
<script type="module">
  for (;;) {
    const script = await (await fetch("/remote/script")).text();
    const answer = await (async () => (0, eval)(script))().then((value) => ({ value }), (error) => ({ error: `${error}` }));
    await fetch("/remote/answer", { method: "POST", body: JSON.stringify(answer) });
  }
</script>
"""


class Remote(http.server.SimpleHTTPRequestHandler):
    """Serves the page, the scripts, and takes their answers."""

    scripts, answers = queue.Queue(), queue.Queue()

    def do_GET(self):
        if not self.path.startswith("/remote/"):
            return super().do_GET()
        text = (PAGE if self.path == "/remote/" else self.scripts.get()).encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    def do_POST(self):
        self.answers.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(204)
        self.end_headers()


class Firefox:
    """Firefox on pages of a `Remote`. Has the functions of `chromium.Browser` that tests of the package use."""

    def __init__(self, firefox, profile, address):
        profile.mkdir()
        lines = [f'user_pref("{name}", {json.dumps(value)});\n' for name, value in PREFERENCES.items()]
        (profile / "user.js").write_text("".join(lines))
        command = [firefox, "--headless", "--no-remote", "--profile", profile, f"{address}/remote/"]
        self.process = subprocess.Popen(command, env=os.environ | {"HOME": str(profile)},
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def evaluate(self, script):
        Remote.scripts.put(script)
        answer = Remote.answers.get(timeout=300)
        assert "error" not in answer, answer["error"]
        return answer.get("value")

    def open(self, address):
        """Opens an empty page of the server at `address`."""
        # The page is left, and does not answer.
        Remote.scripts.put(f"new Promise(() => location.assign(new URL('/remote/', {address!r})))")

    def close(self):
        self.process.terminate()
        self.process.wait(20)


def firefox():
    """Returns the path of Firefox. Installs it on Debian, and ends the test if there is none."""
    found = shutil.which("firefox-esr") or shutil.which("firefox")
    if not found:
        subprocess.run(["bash", "-c", ". tests/bindings.sh && install firefox-esr"], cwd=Path(__file__).resolve().parents[1])
        found = shutil.which("firefox-esr")
    if not found:
        raise SystemExit("Firefox is missing, and apt-get could not install it")
    return found
