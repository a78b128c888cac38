"""Tests the protocol with a program in a process of its own."""

import json
import subprocess
import sys

import numpy
from PIL import Image

PROGRAM = """
import numpy, phasefront_capture
def take(levels, request):
    print("a driver says hello")
    if request.colour == "blue":
        raise RuntimeError("the laser is off")
    if request.colour == "green":
        return levels / 2
    return phasefront_capture.Photograph(levels.astype(numpy.uint16) * 257, {"z": request.z_mm, "again": request.again})
phasefront_capture.serve(take)
"""


def test_each_line_is_answered(tmp_path):
    levels = numpy.arange(35, dtype=numpy.uint8).reshape(5, 7)
    Image.fromarray(levels).save(tmp_path / "show.png")
    asked = {"show": str(tmp_path / "show.png"), "photo": str(tmp_path / "photo.png"), "wavelength_nm": 638.0, "z_mm": 2.5, "settings": None, "new": 1}
    lines = [json.dumps(asked | {"colour": colour, "again": "dark"}) for colour in ("red", "green", "blue")]
    run = subprocess.run([sys.executable, "-c", PROGRAM], input="\n".join(lines), capture_output=True, text=True)
    answers = [json.loads(line) for line in run.stdout.splitlines()]
    assert answers[0] == {"done": {"z": 2.5, "again": "dark"}}
    assert "float64" in answers[1]["error"] and answers[2] == {"error": "RuntimeError: the laser is off"}
    assert run.returncode == 0 and "a driver says hello" in run.stderr
    photo = numpy.asarray(Image.open(tmp_path / "photo.png"))
    numpy.testing.assert_array_equal(photo, levels.astype(int) * 257)
