"""Tests that the command runs networks of other forms, exported as docs/own-networks.md says, and gives PyTorch's output."""

import re
import subprocess
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from PIL import Image
from test_sdk import COMMAND

PAGE = Path(__file__).resolve().parents[2] / "docs" / "own-networks.md"
DISPLAY = {"pitch_um": "8", "wavelengths_nm": "638,520,450", "volume_depth_mm": "6", "offset_mm": "0"}
PLANES = "red,green,blue,depth"


@pytest.fixture
def page(tmp_path, monkeypatch):
    """Runs the page's code in a new folder and returns its names."""
    monkeypatch.chdir(tmp_path)
    names = {}
    torch.manual_seed(7)
    for block in re.findall(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL):
        exec(block, names)
    return names


class UNet(torch.nn.Module):
    """Two halvings, with connections across."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.down = torch.nn.Conv2d(inputs, 12, 3, stride=2, padding=1)
        self.deep = torch.nn.Conv2d(12, 24, 3, stride=2, padding=1)
        self.up = torch.nn.ConvTranspose2d(24, 12, 2, stride=2)
        self.last = torch.nn.ConvTranspose2d(24, 8, 2, stride=2)
        self.out = torch.nn.Conv2d(8 + inputs, outputs, 5, padding=2)

    def forward(self, frame):
        half = torch.relu(self.down(frame))
        quarter = torch.relu(self.deep(half))
        half = torch.cat([torch.relu(self.up(quarter)), half], 1)
        return self.out(torch.cat([self.last(half), frame], 1))


class Half(torch.nn.Module):
    """Computes in float16."""

    def __init__(self, network):
        super().__init__()
        self.network = network.half()

    def forward(self, frame):
        return self.network(frame.half()).float()


def frame(height, width):
    """Writes an image with depth and returns its planes, (4, H, W)."""
    y, x = np.mgrid[:height, :width]
    # Conditioning leaves depth as it is where its edges are those of the colours.
    near = x < width // 3
    rgb = np.stack([np.where(near, 200, 60) + 40 * np.sin(x / (5 + c) + y / 9) for c in range(3)], -1).astype(np.uint8)
    depth = np.where(near, 9000, 47000).astype(np.uint16)
    Image.fromarray(rgb).save("rgb.png")
    Image.fromarray(depth).save("depth.png")
    planes = np.concatenate([rgb.transpose(2, 0, 1) / 255, depth[None] / 65535])
    return torch.from_numpy(planes.astype(np.float32))


def command(network, *more):
    call = [COMMAND, "hologram", "--rgb", "rgb.png", "--depth", "depth.png", "--rgb-encoding", "amplitude", "--network", network, "-o", "out.png"]
    return subprocess.run([*call, *more], capture_output=True, text=True)


def field(network, *more):
    """Returns the field that the command makes of the image."""
    run = command(network, "--complex", "field.npy", *more)
    assert run.returncode == 0, run.stderr
    assert "tract runs this network" in run.stderr
    return np.load("field.npy")


def apart(made, expected):
    """Returns the relative error of each colour, apart from a constant phase."""
    errors = []
    for a, b in zip(made, expected, strict=True):
        turn = np.vdot(a, b) / abs(np.vdot(a, b))
        errors.append(np.linalg.norm(a * turn - b) / np.linalg.norm(b))
    return max(errors)


def run(network, planes):
    with torch.no_grad():
        return network(planes[None])[0].numpy()


@pytest.mark.parametrize("size", [(32, 40), (37, 45)])
def test_the_pages_stack_of_convolutions_is_pytorchs(page, size):
    planes = frame(*size)
    output = run(page["network"], planes)
    assert apart(field("stack.onnx"), output[:3] + 1j * output[3:]) < 1e-4


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("size", [(32, 40), (37, 45)])
def test_a_u_net_is_pytorchs_at_odd_sizes_too(page, size, half):
    unet = UNet(4, 6).eval()
    network = Half(unet).eval() if half else unet
    page["export"](
        network, "unet.onnx", output="amplitude-phase", planes="depth,blue,green,red", colour_range="-1,1", depth_range="1,-0.5", multiple="4", **DISPLAY
    )
    red, green, blue, depth = frame(*size)
    taken = torch.stack([1 - 1.5 * depth, 2 * blue - 1, 2 * green - 1, 2 * red - 1])
    height, width = size
    beyond = (0, -width % 4, 0, -height % 4)
    taken = torch.nn.functional.pad(taken[None], beyond, mode="replicate")[0]
    output = run(network, taken)[:, :height, :width]
    assert apart(field("unet.onnx"), output[:3] * np.exp(1j * output[3:])) < (5e-3 if half else 1e-4)


def test_phases_of_one_laser_are_shown_as_they_are(page):
    Path("one.toml").write_text("wavelengths_nm = [520]\noffset_mm = 2\n")
    network = UNet(2, 1).eval()
    # The phases of a new network are small; five times as many radians fill the turn.
    network.out.weight.data *= 5
    network.out.bias.data *= 5
    page["export"](
        network, "phase.onnx", output="phase", planes="amplitude,depth", multiple="4", **DISPLAY | {"wavelengths_nm": "520", "offset_mm": "2"}
    )
    planes = frame(37, 45)
    grey = np.asarray(Image.open("rgb.png"))[..., 1]
    Image.fromarray(np.repeat(grey[..., None], 3, 2)).save("rgb.png")
    taken = torch.stack([torch.from_numpy(grey / np.float32(255)), planes[3]])
    taken = torch.nn.functional.pad(taken[None], (0, 3, 0, 3), mode="replicate")[0]
    phase = run(network, taken)[0, :37, :45]
    made = command("phase.onnx", "--display", "one.toml")
    assert made.returncode == 0, made.stderr
    levels = np.asarray(Image.open("out.png"))
    steps = levels * (2 * np.pi / 256) - phase
    off = np.abs((steps + np.pi) % (2 * np.pi) - np.pi)
    assert off.max() < 1.01 * np.pi / 256
    refused = command("phase.onnx", "--display", "one.toml", "--encoder", "double")
    assert refused.returncode != 0 and "--encoder goes with a network that gives a wave" in refused.stderr, refused.stderr
    # At another offset these phases show another picture.
    Path("one.toml").write_text("wavelengths_nm = [520]\noffset_mm = 3\n")
    refused = command("phase.onnx", "--display", "one.toml")
    assert refused.returncode != 0 and "offset in mm of 2.000" in refused.stderr, refused.stderr


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"output": "waves"}, ["phasefront.output", "waves", "real-imaginary"]),
        ({"pitch_um": None, "planes": None}, ["phasefront.planes", "phasefront.pitch_um", "missing"]),
        ({"planes": "red,green,blue"}, ["4 planes", "names 3"]),
        ({"planes": "red,green,blue,alpha"}, ["phasefront.planes", "alpha", "depth"]),
        ({"output": "phase"}, ["6 planes", "needs 3"]),
        ({"pitch_um": "3.74"}, ["3.740", "8.000"]),
        ({"multiple": "0"}, ["phasefront.multiple", "1024"]),
        ({"output": None}, ["phasefront.output", "docs/own-networks.md"]),
    ],
)
def test_a_file_that_says_too_little_is_refused_in_one_line(page, change, words):
    frame(8, 12)
    model = onnx.load("stack.onnx")
    keys = {entry.key: entry.value for entry in model.metadata_props} | {f"phasefront.{key}": value for key, value in change.items()}
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, {key: value for key, value in keys.items() if value is not None})
    onnx.save(model, "wrong.onnx")
    run = command("wrong.onnx")
    assert run.returncode != 0 and run.stderr.count("\n") - run.stderr.count("tract runs this network") == 1, run.stderr
    assert all(word in run.stderr for word in words), run.stderr


def test_a_u_net_without_its_multiple_is_refused_in_one_line(page):
    page["export"](UNet(4, 6), "unet.onnx", output="real-imaginary", planes=PLANES, **DISPLAY)
    frame(37, 45)
    run = command("unet.onnx")
    assert run.returncode != 0 and run.stderr.count("\n") - run.stderr.count("tract runs this network") == 1, run.stderr
