"""Tests that the SDK and this package make the same holograms with exported networks, pre-filtered and encoded."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from phasefront_training.data import Manifest
from phasefront_training.encode import DeepDoublePhase, double_phase, scale_of
from phasefront_training.evaluate import visible_layers
from phasefront_training.export import float_model, write
from phasefront_training.export_int8 import int8_model
from phasefront_training.networks import Architecture, Chain
from phasefront_training.optics import Display
from phasefront_training.quantize import Quantized, calibrate
from phasefront_training.stage2 import prefilter_network

CACHE = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "phasefront"
BUILT = Path(os.environ.get("CARGO_TARGET_DIR", CACHE / "target")) / "release"
COMMAND, LAB = BUILT / "phasefront", BUILT / "phasefront-lab"
OFFSET_MM = 2.0


def networks():
    """Returns a hologram network and a pre-filter that both differ from their initial state."""
    hologram, prefilter = Chain(Architecture(3, 8)), prefilter_network()
    for network, size in ((hologram, 0.02), (prefilter, 0.01)):
        with torch.no_grad():
            network.convs[-1].weight += size * torch.randn_like(network.convs[-1].weight)
            network.convs[-1].bias += size * torch.randn_like(network.convs[-1].bias)
    return hologram.eval(), prefilter.eval()


@pytest.mark.parametrize("precision", ["f32", "int8"])
def test_deep_encoding_of_an_image_is_the_same(tmp_path, precision):
    assert COMMAND.exists(), "cargo build --release --workspace builds the command"
    display, (hologram, prefilter) = Display(), networks()
    height, width = 60, 83
    y, x = np.mgrid[:height, :width]
    rgb = np.stack([127 + 90 * np.sin(x / (5 + c) + y / 9) for c in range(3)], -1).astype(np.uint8)
    depth = (65535 * (x + y) / (height + width)).astype(np.uint16)
    Image.fromarray(rgb).save(tmp_path / "rgb.png")
    Image.fromarray(depth).save(tmp_path / "depth.png")
    channels = np.concatenate([rgb.transpose(2, 0, 1) / 255, depth[None] / 65535]).astype(np.float32)
    model = DeepDoublePhase(hologram, prefilter, OFFSET_MM * 1e-3, display)
    with torch.no_grad():
        given = torch.from_numpy(channels)[None] - 0.5
        midpoint = hologram.field(given)
        if precision == "int8":
            model.prefilter = Quantized(prefilter, calibrate(prefilter, model.seen_by_prefilter(midpoint))).eval()
        before = model.filtered(midpoint)
        scale = scale_of(before)
        phase = double_phase(before, scale)[0].numpy()
    write(float_model(hologram, display), tmp_path / "hologram.onnx")
    exported = float_model(prefilter, display, model.offset_m)
    if precision == "int8":
        exported = int8_model(model.prefilter, display, model.offset_m)
    write(exported, tmp_path / "prefilter.onnx")
    run = subprocess.run(
        [COMMAND, "hologram", "--rgb", "rgb.png", "--depth", "depth.png", "--rgb-encoding", "amplitude", "--network", "hologram.onnx", "--encoder", "deep",
         "--prefilter", "prefilter.onnx", "--offset-mm", str(OFFSET_MM), "--json", "-o", "out.png"],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["scale"] == pytest.approx(float(scale), rel=2e-3)
    levels = np.asarray(Image.open(tmp_path / "out.png")).transpose(2, 0, 1)
    apart = (levels * (2 * np.pi / 256) - phase + np.pi) % (2 * np.pi) - np.pi
    # Rounding is half a level. The two pad for the offset by different amounts, acos is steep at full light, and int8
    # engines round some values to a neighbouring step.
    step = np.pi / 256
    assert np.median(np.abs(apart)) < step
    assert (np.abs(apart) > 2 * step).mean() < (0.04 if precision == "int8" else 0.01)


def test_what_is_visible_by_waves_is_the_labs(tmp_path):
    assert LAB.exists(), "cargo build --release --workspace builds the command"
    size = ["--scenes", "1", "--size", "61", "--planes", "23", "--ldi-layers", "1"]
    subprocess.run([LAB, "dataset", *size, "-o", tmp_path / "data"], check=True)
    manifest = Manifest.read(tmp_path / "data")
    pair = np.load(manifest.pair(0))
    assert pair["rgb"][..., 3].all()
    colour = torch.from_numpy(pair["rgb"][0, ..., :3].transpose(2, 0, 1) / np.float32(255))
    depth = torch.from_numpy(pair["depth"] / np.float32(65535))
    truth = torch.from_numpy(pair["hologram"])
    field = visible_layers(manifest.display, 23)(colour, depth)
    error = (field - truth).abs().square().mean() / truth.abs().square().mean()
    # Light that leaves the frame returns in part, and the two pad it by different amounts.
    assert error < 1e-4
