"""Tests that the code in the pages runs and type-checks."""

import os
import pathlib
import re
import subprocess
import sys

import nbclient
import nbformat
import pytest

ROOT = pathlib.Path(__file__).parents[3]
GUIDE = ROOT / "docs" / "python.md"
CONVENTIONS = ROOT / "docs" / "conventions.md"
NOTEBOOK = ROOT / "docs" / "python.ipynb"


def snippets(page):
    return re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)


def test_the_readme_runs():
    (code,) = snippets(ROOT / "README.md")
    scope = {}
    exec(code, scope)
    assert scope["levels"].shape == (3, 480, 640)


@pytest.mark.parametrize("code", snippets(GUIDE))
def test_the_guide_runs(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(code, {"__name__": "guide"})


def test_the_guides_video_is_made(tmp_path):
    import numpy

    (code,) = [code for code in snippets(GUIDE) if "def video" in code]
    scope = {"__name__": "guide"}
    exec(code, scope)
    frame = numpy.full((48, 64, 3), 99, numpy.uint8), numpy.ones((24, 32), numpy.float32)
    shapes = [hologram.levels.shape for hologram in scope["video"]([frame] * 2, 30.0)]
    assert shapes == [(3, 1080, 1920)] * 2


def test_the_conventions_reconstruct_a_hologram(tmp_path, monkeypatch):
    import numpy
    from PIL import Image

    monkeypatch.chdir(tmp_path)
    sample = ROOT / "samples"
    Image.open(sample / "scene_rgb.jpg").resize((320, 180)).save("rgb.png")
    Image.open(sample / "scene_depth.png").resize((320, 180), Image.Resampling.NEAREST).save("depth.png")
    command = pathlib.Path(os.environ["CARGO_TARGET_DIR"]) / "release" / "phasefront"
    for offset_mm in (0, 3):
        hologram = ["hologram", "--rgb", "rgb.png", "--depth", "depth.png", "--offset-mm", str(offset_mm), "-o", "hologram.png"]
        for arguments in (hologram, ["refocus", "hologram.png", "--z-mm", "2.4", "-o", "by_command.png"]):
            subprocess.run([command, *arguments], check=True)
        (code,) = snippets(CONVENTIONS)
        exec(code, {"__name__": "conventions"})
        views = [numpy.asarray(Image.open(name)).astype(int) for name in ("near.png", "by_command.png")]
        inside = [view[48:-48, 48:-48] for view in views]
        assert inside[0].std() > 20
        # At the edge of what sRGB shows, a little light more or less is a large difference of the smallest value.
        apart = abs(inside[0] - inside[1])
        assert numpy.percentile(apart, 99) <= 3 and apart.mean() < 1


def test_a_type_checker_follows_the_pages(tmp_path):
    for i, code in enumerate(snippets(GUIDE) + snippets(ROOT / "README.md")):
        (tmp_path / f"snippet_{i}.py").write_text(code)
    wrong = "import phasefront\nphasefront.session_options(dark_threshold='much', no_option=1)\nphasefront.Display(width='1')\n"
    (tmp_path / "wrong.py").write_text(wrong)
    # Runs in another folder, because the package in this folder lacks the generated module.
    mypy = [sys.executable, "-P", "-m", "mypy", "--strict", "."]
    told = subprocess.run(mypy, cwd=tmp_path, capture_output=True, text=True)
    found = [line for line in told.stdout.splitlines() if ": error:" in line]
    assert len(found) == 3 and all(line.startswith("wrong.py") for line in found), told.stdout + told.stderr


def pictures(notebook):
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return [output for output in outputs if "image/png" in output.get("data", {})]


def test_the_notebook_runs(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONSAFEPATH", "1")
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    stored = pictures(notebook)
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = pictures(notebook)
    # The file has its pictures, for readers who do not run it.
    assert len(stored) == len(shown)
    assert len(shown) >= 3
    assert (tmp_path / "hologram.png").exists()
