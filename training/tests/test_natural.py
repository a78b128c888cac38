import json
import math

import numpy as np
import pytest
import torch

from phasefront_training.__main__ import main
from phasefront_training.checkpoint import Checkpoint
from phasefront_training.data import DataError, Manifest, Scenes
from phasefront_training.encode import centred, darkened, default_phasors, full_light, local_filter, views
from phasefront_training.evaluate import onnx_predictor
from phasefront_training.natural import StackSampler, blur_px, figures
from phasefront_training.optics import Display
from phasefront_training.stacks import Stacks

DISPLAY = Display()


@pytest.fixture
def folders(data_folder, tmp_path):
    """Makes stacks of four depths of focus: the visible image, blurred by nothing."""
    stacks = tmp_path / "stacks"
    stacks.mkdir()
    for i in range(8):
        with np.load(data_folder / f"pair_{i:06d}.npz") as pair:
            colour = pair["rgb"][0, ..., :3].transpose(2, 0, 1)
        depths = np.array([0.1, 0.4, 0.6, 0.9], np.float32)
        np.savez(stacks / f"stack_{i:06d}.npz", depths=depths, amplitudes=np.stack([colour] * 4))
    return data_folder, stacks


def scenes(folders, split="train"):
    data, stacks = folders
    return Scenes(Manifest.read(data), split, stacks=Stacks.read(stacks))


def test_samples_hold_the_stack_of_their_crop(folders):
    found = scenes(folders)
    batch = StackSampler(found, 6, 48, 4, planes=2, dimmed=0.5).draw(3)
    assert batch.stack.shape == (6, 2, 3, 48, 48) and batch.depths.shape == (6, 2)
    # The stack is the image, so it must have been cropped, flipped and dimmed with it.
    assert torch.allclose(batch.stack[:, 0], batch.input[:, :3] + 0.5, atol=1e-6)
    assert set(batch.depths.flatten().tolist()) <= set(found.stack_depths[0].tolist())


def test_a_damaged_stack_is_named(folders):
    (folders[1] / "stack_000001.npz").write_bytes(b"PK")
    with pytest.raises(DataError, match="stack_000001.npz: damaged"):
        scenes(folders)


def test_a_network_learns_through_the_default_encoder(folders, tmp_path):
    data, stacks = folders
    given = ["--data", str(data), "--stacks", str(stacks), "-o", str(tmp_path / "out")]
    main(["natural", *given, "--layers", "4", "--filters", "8", "--crop", "64", "--steps", "80", "--rate", "0.002"])
    lines = [json.loads(line) for line in (tmp_path / "out" / "curve.jsonl").read_text().splitlines()]
    # Pixels in focus weigh the most.
    found = [line["validation_in_focus_psnr"] for line in lines if "validation_psnr" in line]
    assert found[-1] > found[0] + 0.5
    last = Checkpoint.load(tmp_path / "out" / "checkpoint.pt")
    assert last.kind == "natural" and last.network().architecture.halved


def test_blur_is_that_of_the_aperture():
    depth = torch.full((1, 4, 4), 0.5)
    blur = blur_px(depth, torch.tensor([[0.5, 0.0]]), DISPLAY)
    assert blur[0, 0].abs().max() < 1e-6
    # Over 3 mm the outermost green ray, of sine 520 nm / 16 µm, moves 12.2 pixels of 8 µm.
    assert float(blur[0, 1, 1, 0, 0]) == pytest.approx(12.19, abs=0.01)


def test_figures_find_what_is_perfect(folders):
    found = scenes(folders, "validation")
    for i in range(len(found)):
        colour, _, _ = found.scene(i)
        field = torch.complex(colour, torch.zeros_like(colour))[None]
        scale = full_light(field)
        seen = views(default_phasors(field, scale), scale, found.stack_depths[i][None], found.display)[0]
        found.stack[i] = (255 * seen / seen.max()).round().to(torch.uint8)
    perfect = figures(lambda colour, depth, seed: torch.complex(colour, torch.zeros_like(colour)), found)
    assert perfect["psnr"] > 45 and perfect["ssim"] > 0.99


def local_step_in_numpy(field, scale):
    """The core's encoder (encode.rs, encode/local.rs), pixel by pixel in float64."""
    height, width = field.shape[-2:]
    out = np.zeros(field.shape, complex)
    gauss = np.exp(-np.arange(-1, 2) ** 2 / (2 * 0.7**2))
    gauss = np.outer(gauss, gauss) / gauss.sum() ** 2
    taps = local_filter().double().numpy()
    for c, plane in enumerate(field.numpy().astype(complex)):
        plane = plane * np.exp(-1j * np.angle(plane.sum())) / scale
        weight = np.minimum(1, np.abs(plane) / 0.4)
        dark = weight * plane + (1 - weight) * np.abs(plane)
        edge = np.pad(dark, 1, mode="edge")
        start = sum(gauss[dy, dx] * edge[dy : dy + height, dx : dx + width] for dy in range(3) for dx in range(3))
        half = np.arccos(np.minimum(1, np.abs(start)))
        y, x = np.mgrid[:height, :width]
        shown = np.exp(1j * (np.angle(start) + np.where((y + x) % 2 == 0, half, -half)))
        change = np.pad(plane - shown, 3, mode="reflect")
        shown = shown + sum(taps[dy, dx] * change[dy : dy + height, dx : dx + width] for dy in range(7) for dx in range(7))
        out[c] = shown / np.abs(shown)
    return out


def test_phasors_are_those_of_the_core():
    field = torch.complex(*torch.rand(2, 1, 3, 20, 22) * 0.6 + 0.1)
    found = default_phasors(field, torch.full((1, 1, 1, 1), 1.1))[0].numpy()
    assert np.abs(found - local_step_in_numpy(field[0], 1.1)).max() < 0.02


def test_the_filter_passes_the_picture_and_stops_the_checkerboard():
    taps = local_filter().double()
    y = torch.arange(7) - 3
    sign = 1 - 2 * ((y[:, None] + y) % 2)
    assert float(taps.sum()) == pytest.approx(1, abs=1e-6)
    assert float((sign * taps).sum()) == pytest.approx(0, abs=1e-6)
    assert float(taps[3, 3]) == pytest.approx(math.pi / 4, abs=0.02)


def test_dark_values_move_to_the_real_axis():
    field = torch.tensor([[[[0.8j, 0.1j, 0.0]]]]).expand(1, 3, 1, 3)
    moved = darkened(field, 1.0)[0, 0, 0]
    assert moved[0] == field[0, 0, 0, 0]
    assert torch.allclose(moved[1], torch.tensor(0.075 + 0.025j))
    assert moved[2] == 0
    assert torch.allclose(centred(field * (1 + 1j)).sum((-2, -1)).imag, torch.zeros(1, 3), atol=1e-6)


def test_full_light_is_the_brightest_thousandth():
    field = torch.full((2, 3, 100, 100), 0.5, dtype=torch.complex64)
    field[0, :, :2, :15] = 2.0
    assert full_light(field).flatten().tolist() == pytest.approx([2.0, 0.5])
    assert float(full_light(torch.zeros(1, 3, 8, 8, dtype=torch.complex64))) == pytest.approx(0.05)


def test_an_int8_file_keeps_natural_focus(folders, tmp_path):
    data, stacks = folders
    given = ["--data", str(data), "--stacks", str(stacks)]
    out = tmp_path / "out"
    main(["natural", *given, "-o", str(out), "--layers", "4", "--filters", "16", "--crop", "64", "--steps", "60", "--rate", "0.002"])
    main(["export", str(out / "checkpoint.pt"), "-o", str(tmp_path / "n.onnx")])
    main(["quantize", str(tmp_path / "n.onnx"), *given, "-o", str(tmp_path / "n-int8.onnx"), "--never-train"])
    found = scenes(folders, "validation")
    exact, rounded = (figures(onnx_predictor(tmp_path / name)[0], found)["psnr"] for name in ("n.onnx", "n-int8.onnx"))
    assert abs(exact - rounded) < 0.5
