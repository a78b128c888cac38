"""Tests that the command estimates depth with what `tools/depth-network/export` writes, and sees what PyTorch gives."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from PIL import Image
from test_sdk import COMMAND

EXPORT = Path(__file__).resolve().parents[2] / "tools" / "depth-network" / "export"
WIDTH, HEIGHT = 96, 64
# A network in the form of common ones: a table of places that is enlarged to the picture's size, patches, an output
# without the axis of colours.
MODULE = """
import torch
from types import SimpleNamespace


class Network(torch.nn.Module):
    def __init__(self):
        super().__init__()
        torch.manual_seed(3)
        self.patches = torch.nn.Conv2d(3, 8, 4, stride=4)
        self.places = torch.nn.Parameter(torch.randn(1, 8, 7, 7))
        self.depth = torch.nn.Conv2d(8, 1, 3, padding=1)

    def forward(self, picture):
        seen = self.patches(picture)
        places = torch.nn.functional.interpolate(self.places, size=seen.shape[-2:], mode="bicubic", align_corners=False)
        seen = torch.nn.functional.gelu(seen + 0.2 * places)
        seen = torch.nn.functional.interpolate(seen, scale_factor=4, mode="bilinear", align_corners=True)
        return self.depth(seen)[:, 0]


class Distance(Network):
    def forward(self, picture):
        return SimpleNamespace(predicted_depth=5 - super().forward(picture), fields=None)


class Two(torch.nn.Module):
    def forward(self, picture):
        return picture[:, :2]


def number():
    return 5
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Writes the networks' module and a picture of their size into a new folder."""
    monkeypatch.chdir(tmp_path)
    Path("nets.py").write_text(MODULE)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    near = (x - 40) ** 2 + (y - 30) ** 2 < 400
    picture = np.stack([np.where(near, 200, 60) + 40 * np.sin(x / (5 + c) + y / 9) for c in range(3)], -1).astype(np.uint8)
    Image.fromarray(picture).save("photo.png")
    Image.fromarray(picture).save("photo.jpg")
    return tmp_path


def export(network, *more):
    return subprocess.run([sys.executable, EXPORT, network, "-o", "depth.onnx", *more], capture_output=True, text=True)


def hologram(*call):
    """Returns the levels of a hologram."""
    Path("display.toml").write_text(f"width = {WIDTH}\nheight = {HEIGHT}\n")
    run = subprocess.run([COMMAND, "hologram", *call, "--display", "display.toml", "--method", "sweep", "-o", "hologram.png"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return np.asarray(Image.open("hologram.png")).astype(int)


@pytest.mark.parametrize(
    ("network", "more", "mean", "spread"),
    [
        ("nets:Network", [], [0.485, 0.456, 0.406], [0.229, 0.224, 0.225]),
        ("nets:Network", ["--colours", "unit"], [0, 0, 0], [1, 1, 1]),
        ("nets:Distance", ["--colours", "signed", "--distance"], [0.5] * 3, [0.5] * 3),
    ],
)
def test_the_command_sees_what_pytorch_gives(folder, network, more, mean, spread):
    run = export(network, "--size", f"{WIDTH}x{HEIGHT}", *more)
    assert run.returncode == 0, run.stderr
    graph = onnx.load("depth.onnx").graph
    shapes = [[axis.dim_value for axis in end.type.tensor_type.shape.dim] for end in (*graph.input, *graph.output)]
    assert shapes == [[1, 3, HEIGHT, WIDTH], [1, 1, HEIGHT, WIDTH]]
    names = {}
    exec(MODULE, names)
    picture = torch.from_numpy(np.asarray(Image.open("photo.png")).transpose(2, 0, 1) / np.float32(255))[None]
    column = lambda values: torch.tensor(values, dtype=torch.float32).reshape(1, 3, 1, 1)  # noqa: E731
    with torch.no_grad():
        nearer = names["Network"]().eval()((picture - column(mean)) / column(spread))[0].numpy()
    # As a distance file, with the same percentiles at its ends.
    np.save("depth.npy", 1 + nearer.max() - nearer)
    own = hologram("--rgb", "photo.png", "--depth", "depth.npy", "--depth-unit", "m")
    seen = hologram("--photo", "photo.png", "--depth-network", "depth.onnx")
    off = np.abs((seen - own + 128) % 256 - 128)
    assert np.mean(off > 2) < 0.01, np.mean(off > 2)
    assert np.ptp(own) > 100
    hologram("--photo", "photo.jpg", "--depth-network", "depth.onnx")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (["nets"], ["MODULE:FUNCTION"]),
        (["nowhere:network"], ["nowhere"]),
        (["nets:nothing"], ["nothing"]),
        (["nets:number"], ["int", "torch.nn.Module"]),
        (["nets:Two", "--size", "16x16"], ["(1, 2, 16, 16)", "one plane"]),
        (["nets:Network", "--size", "16"], ["'16'", "518x518"]),
    ],
)
def test_what_is_no_depth_network_is_refused(folder, call, words):
    run = export(*call)
    assert run.returncode != 0 and not Path("depth.onnx").exists()
    last = run.stderr.strip().splitlines()[-1]
    assert all(word in last for word in words), run.stderr
