import numpy as np
import pytest
import torch
from conftest import asm
from matplotlib import pyplot

from phasefront_training.__main__ import main
from phasefront_training.checkpoint import Checkpoint
from phasefront_training.encode import (
    DeepDoublePhase, anti_alias, aperture, band_limit, double_phase, phase_regulariser, reconstruct, scale_of, wraps,
)
from phasefront_training.export import float_model, read_description, write
from phasefront_training.networks import Architecture, Chain
from phasefront_training.optics import Display
from phasefront_training.stage2 import prefilter_network

DISPLAY = Display()


def smooth_field(seed, h, w):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:h, :w]
    amplitude = [0.5 + 0.4 * np.sin(x / rng.uniform(5, 12) + y / rng.uniform(5, 12)) for _ in range(3)]
    return np.stack(amplitude) * np.exp(1j * np.stack([0.6 * np.cos(x / 9 + k) for k in range(3)]))


def test_double_phase_is_the_float64_reference():
    u = smooth_field(0, 13, 18)
    scale = np.abs(u).max() + 1e-6
    y, x = np.mgrid[:13, :18]
    theta = np.arccos(np.minimum(np.abs(u) / scale, 1 - 1e-6))
    expected = np.angle(u) + np.where((x + y) % 2 == 0, theta, -theta)
    field = torch.from_numpy(u).to(torch.complex64)[None]
    # Near full amplitude, acos amplifies a float32 ulp to a few 1e-4.
    assert np.abs(double_phase(field, scale_of(field))[0].numpy() - expected).max() < 2e-3


def test_reconstruction_is_the_float64_reference():
    rng = np.random.default_rng(1)
    phase = rng.uniform(-3, 3, (3, 40, 40))
    offset = 3e-3
    ours = reconstruct(torch.from_numpy(phase).float()[None], torch.ones(1, 1, 1, 1), offset, DISPLAY)[0].numpy()
    big = np.pad(np.exp(1j * phase), ((0, 0), (0, 72 - 40), (0, 72 - 40)))
    assert ours.shape == (3, 40, 40)
    spectrum = np.fft.fft2(big)
    fy, fx = np.fft.fftfreq(72)[:, None], np.fft.fftfreq(72)
    spectrum = spectrum * (fy**2 + fx**2 <= 0.25)
    expected = asm(np.fft.ifft2(spectrum), -offset, 0)[:, :40, :40]
    assert np.abs(ours - expected).max() < 1e-4


def test_what_is_encoded_is_shown_with_its_brightness():
    u = smooth_field(2, 64, 64)
    field = torch.from_numpy(u).to(torch.complex64)[None]
    scale = scale_of(field)
    shown = reconstruct(double_phase(field, scale), scale, 0.0, DISPLAY)[0].numpy()
    inner = (slice(None), slice(8, -8), slice(8, -8))
    assert np.abs(shown[inner] - u[inner]).mean() < 0.03
    assert abs(np.abs(shown[inner]).mean() / np.abs(u[inner]).mean() - 1) < 0.02


def test_gradients_stay_finite_in_the_dark():
    field = torch.zeros(1, 3, 8, 8, dtype=torch.complex64)
    field[..., 4:] = 1 + 0j
    field.requires_grad_()
    scale = scale_of(field)
    loss = reconstruct(double_phase(field, scale), scale, 1e-3, DISPLAY).abs().mean() + phase_regulariser(field)
    loss.backward()
    assert torch.isfinite(torch.view_as_real(field.grad)).all()


def test_regulariser_and_wraps():
    flat = torch.polar(torch.ones(1, 3, 9, 9), torch.full((1, 3, 9, 9), -0.3))
    assert phase_regulariser(flat) == pytest.approx(0.3, abs=1e-4)
    phase = torch.tensor([[0.2, 0.6], [0.2, 0.6]]).repeat(1, 3, 3, 3)
    assert phase_regulariser(torch.polar(torch.ones_like(phase), phase)) == pytest.approx(0.4 + 0.2, abs=0.05)
    assert wraps(torch.tensor([0.0, 3.0, 3.2, -3.2])) == 0.5


def test_aperture_is_the_circle_inside_the_square():
    mask = aperture(40, 40)
    assert mask[0, 20] == 1 and mask[20, 20] == 0 and abs(float(mask.mean()) - np.pi / 4) < 0.03


def test_blur_keeps_a_constant():
    field = torch.ones(1, 3, 9, 9, dtype=torch.complex64) * (0.5 + 0.5j)
    assert torch.allclose(anti_alias(field)[..., 1:-1, 1:-1], field[..., 1:-1, 1:-1])


def test_band_limit_cuts_the_diagonals_alone():
    y, x = torch.meshgrid(torch.arange(24), torch.arange(36), indexing="ij")
    wave = lambda fy, fx: torch.polar(torch.ones(1, 3, 24, 36), (2 * np.pi * (fy * y + fx * x)).float().expand(1, 3, 24, 36))
    for kept in (wave(1 / 3, 0), wave(0, -1 / 3), wave(1 / 6, 1 / 6)):
        assert torch.allclose(band_limit(kept), kept, atol=1e-5)
    assert band_limit(wave(1 / 3, 1 / 3)).abs().max() < 1e-5  # tan² = 3
    assert band_limit(wave(1 / 6, -1 / 6), 0.3).abs().max() < 1e-5  # tan² = 1/3


def test_a_new_prefilter_leaves_the_blur_and_learns():
    prefilter = prefilter_network()
    x = torch.randn(1, 6, 20, 20)
    model = DeepDoublePhase(Chain(Architecture(4, 8)), prefilter, 0.0, DISPLAY)
    field = torch.complex(x[:, :3], x[:, 3:])
    assert torch.allclose(model.filtered(field), anti_alias(field), atol=1e-5)
    prefilter(x).sum().backward()
    assert prefilter.convs[-1].weight.grad[:, :8].abs().max() > 0


def test_both_networks_learn_through_the_encoding():
    model = DeepDoublePhase(Chain(Architecture(4, 8)), Chain(Architecture(4, 8, "field")), 1e-3, DISPLAY)
    before, after = model(torch.rand(1, 4, 32, 32) - 0.5)
    (after.abs().mean() + phase_regulariser(before)).backward()
    assert all(torch.isfinite(p.grad).all() and p.grad.abs().max() > 0 for p in model.parameters())


def deep(table):
    """Returns the first figure of the deep double phase method."""
    return float(table.split("| deep double phase |")[1].split("|")[0])


def test_stage2_trains_resumes_and_exports_both_networks(data_folder, tmp_path, capsys):
    first, second = tmp_path / "first", tmp_path / "second"
    common = ["--data", str(data_folder), "--crop", "64"]
    assert main(["stage1", *common, "-o", str(first), "--layers", "4", "--filters", "8", "--steps", "20"]) == 0
    call = ["stage2", *common, "-o", str(second), "--init", str(first / "checkpoint.pt"), "--offset-mm", "1"]
    assert main([*call, "--steps", "4", "--identity-steps", "40"]) == 0
    assert main(["stage2", "--data", str(data_folder), "-o", str(second), "--resume", "--steps", "6"]) == 0
    last = Checkpoint.load(second / "checkpoint.pt")
    assert last.step == 6 and set(last.networks) == {"hologram", "prefilter"} and last.extra["offset_m"] == pytest.approx(1e-3)
    path = tmp_path / "pre.onnx"
    assert main(["export", str(second / "checkpoint.pt"), "--network", "prefilter", "-o", str(path)]) == 0
    assert read_description(path)["input"] == "blurred-field" and read_description(path)["offset_mm"] == "1"
    again = ["stage2", *common, "-o", str(tmp_path / "again"), "--init", str(second / "checkpoint.pt"), "--offset-mm", "1", "--steps", "1", "--rate", "0"]
    assert main([*again, "--init-prefilter", str(path)]) == 0
    begun = Checkpoint.load(tmp_path / "again" / "checkpoint.pt")
    for name in ("hologram", "prefilter"):
        assert all(torch.equal(w, last.networks[name][1][k]) for k, w in begun.networks[name][1].items())
    assert main([*again, "--init-prefilter", str(first / "checkpoint.pt")]) == 1
    assert "a pre-filter takes a field" in capsys.readouterr().err
    other = tmp_path / "other.onnx"
    write(float_model(last.network("prefilter"), Display(pitch_m=6.4e-6), 1e-3), other)
    assert main([*again, "--init-prefilter", str(other)]) == 1
    assert "other.onnx is for Display(pitch_m=6.4" in capsys.readouterr().err
    picture = tmp_path / "worst.png"
    assert main(["evaluate-encoding", str(second / "checkpoint.pt"), "--data", str(data_folder), "--picture", str(picture)]) == 0
    assert pyplot.imread(picture).std() > 0
    exact = capsys.readouterr().out
    assert "deep double phase" in exact and "anti-aliased" in exact and "worst_scene" in exact
    assert main(["evaluate-encoding", str(second / "checkpoint.pt"), "--data", str(data_folder), "--sensor-depth"]) == 0
    assert deep(capsys.readouterr().out) != deep(exact)
    int8 = tmp_path / "pre-int8.onnx"
    before = last.networks["hologram"][1]
    call = ["quantize", str(second / "checkpoint.pt"), "--network", "prefilter", *common, "-o", str(int8)]
    assert main([*call, "--always-train", "--steps", "3", "--rate", "0.01"]) == 0
    told = capsys.readouterr().err
    assert "trained through the rounding" in told and read_description(int8)["offset_mm"] == "1"
    trained = Checkpoint.load(tmp_path / "pre-int8.onnx.qat" / "checkpoint.pt")
    assert all(torch.equal(w, before[name]) for name, w in trained.networks["hologram"][1].items())
    assert not torch.equal(trained.networks["prefilter"][1]["convs.0.weight"], last.networks["prefilter"][1]["convs.0.weight"])
    call = ["evaluate-encoding", str(second / "checkpoint.pt"), "--data", str(data_folder)]
    assert main([*call, "--prefilter", str(int8)]) == 0
    assert deep(capsys.readouterr().out) != deep(exact)
    assert main([*call, "--prefilter", str(path)]) == 0
    assert deep(capsys.readouterr().out) == pytest.approx(deep(exact), abs=0.02)
