import numpy as np
import pytest
from PIL import Image

from phasefront_training import statistics
from phasefront_training.__main__ import main


def noise(exponent, size=128):
    """Returns grey noise whose power falls with frequency by this exponent."""
    rng = np.random.default_rng(1)
    f = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.fftfreq(size))
    f[0, 0] = 1
    spectrum = np.fft.fft2(rng.standard_normal((size, size))) * f ** (exponent / 2)
    return np.fft.ifft2(spectrum).real


@pytest.mark.parametrize("exponent", [0.0, -1.0, -2.0])
def test_the_slope_is_the_spectrums(exponent):
    assert statistics.slope(noise(exponent, 256)) == pytest.approx(exponent, abs=0.2)


def test_a_look_counts_what_is_there():
    colour = np.stack([noise(-2)[:40, :60]] * 2 + [-noise(-2)[:40, :60]])
    depth = np.full((40, 60), 0.15)
    depth[:, 30:] = 0.95
    depth[:10] = np.nan
    seen = statistics.look(colour, depth)
    assert seen.correlation == pytest.approx((1 - 1 - 1) / 3)
    assert seen.depths[1] == seen.depths[9] == 0.5 and seen.depths.sum() == 1
    assert seen.steps == pytest.approx(1 / 59)


def test_data_sets_stand_beside_captured_frames(data_folder, tmp_path, capsys):
    frames = tmp_path / "frames" / "one"
    frames.mkdir(parents=True)
    rng = np.random.default_rng(2)
    Image.fromarray(rng.integers(0, 256, (48, 64, 3), np.uint8)).save(frames / "color_0.png")
    readings = rng.integers(500, 3000, (48, 64)).astype(np.uint16)
    readings[:5] = 0
    Image.fromarray(readings).save(frames / "depth_0.png")
    call = ["statistics", "--data", str(data_folder), "--split", "train"]
    assert main([*call, "--frames", str(frames.parent)]) == 0
    told = capsys.readouterr()
    assert told.out.count("\n| ") == 2 and "| 5 |" in told.out and "| 1 | 0.50" in told.out
    assert main([*call, "--frames", str(tmp_path / "absent")]) == 0
    told = capsys.readouterr()
    assert "absent: no captured frames" in told.err and told.out.count("\n| ") == 1


def test_readings_become_depth_by_their_percentiles():
    depth = statistics.normalized(np.concatenate([np.zeros(7), np.arange(1, 1001)])[None])
    assert np.isnan(depth[0, :7]).all() and depth[0, 7] == 0 and depth[0, -1] == 1
    assert np.isnan(statistics.normalized(np.zeros((2, 2)))).all()
