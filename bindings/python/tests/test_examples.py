"""Tests that the examples run on the sample scene and that the command reads their files."""

import os
import pathlib
import subprocess
import sys

import pytest
from PIL import Image

ROOT = pathlib.Path(__file__).parents[3]
COMMAND = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target")) / "release" / "phasefront"


@pytest.mark.parametrize(("example", "size"), [("still.py", (1920, 1080)), ("live.py", (640, 360))])
def test_an_example_makes_a_hologram_that_the_command_reads(example, size, tmp_path):
    sample = [ROOT / "samples" / name for name in ("scene_rgb.jpg", "scene_depth.png")]
    # Runs in another folder, because the package in this folder lacks the generated module.
    for run in (
        [sys.executable, "-P", ROOT / "examples" / example, *sample, "hologram.png"],
        [COMMAND.absolute(), "refocus", "hologram.png", "--z-mm", "2", "-o", "view.png"],
    ):
        ended = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True)
        assert ended.returncode == 0, ended.stdout + ended.stderr
    assert Image.open(tmp_path / "view.png").size == size
