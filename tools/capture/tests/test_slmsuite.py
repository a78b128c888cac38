"""Calibrates simulated benches of slmsuite unattended, by the command."""

import json
import os
import pathlib
import subprocess
import sys
import tomllib

import numpy
import pytest
import relay
from slmsuite.hardware.cameras.simulated import SimulatedCamera
from slmsuite.hardware.slms.simulated import SimulatedSLM

from phasefront_capture import Request
from phasefront_capture.slmsuite import Bench

COMMAND = pathlib.Path(os.environ["CARGO_TARGET_DIR"]) / "release" / "phasefront"
W, H = relay.SIZE
DISPLAY = f"width = {W}\nheight = {H}\nwavelengths_nm = [{relay.WAVELENGTH_NM}]\n"


def phasefront(folder, *arguments, unit):
    capture = ["--capture", sys.executable, relay.__file__, unit]
    run = subprocess.run([COMMAND, *arguments, "--json", *capture], cwd=folder, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def phase_error(unit, levels):
    """Returns the RMS phase error in radians of levels, (…, 256), one for each phase step, where the curve reaches."""
    steps = numpy.arange(256) / 256 * 2 * numpy.pi
    curve = relay.curve(unit)
    reached = steps <= curve[255]
    turns = (curve[levels[..., reached]] - steps[reached]) / (2 * numpy.pi)
    return 2 * numpy.pi * numpy.sqrt(numpy.mean((turns - numpy.rint(turns)) ** 2))


@pytest.mark.parametrize("unit", sorted(relay.UNITS))
def test_a_bench_is_calibrated_unattended(unit, tmp_path):
    (tmp_path / "display.toml").write_text(DISPLAY)
    display = ["--display", "display.toml"]
    phasefront(tmp_path, "calibrate", "lut", "--captures", "captures", "-o", "table.pfp", "--full", "full", *display, unit=unit)
    before = phase_error(unit, numpy.arange(256)[None])
    after = phase_error(unit, numpy.load(tmp_path / "full" / "full_laser.npy"))
    print(f"phase error of unit {unit}: {before:.3f} to {after:.4f} rad")
    assert before > 0.3 and after < 0.03
    settings = json.loads((tmp_path / "captures" / "laser" / "settings.json").read_text())
    assert settings["exposure_s"] > 0
    assert len(list((tmp_path / "captures" / "laser").glob("capture_*.png"))) == 256

    phasefront(tmp_path, "calibrate", "laser", "captures", "--gaussians", "1", "-o", "laser.png", *display, unit=unit)
    assert (tmp_path / "captures" / "laser" / "flat.png").is_file()

    (tmp_path / "calibrated.toml").write_text(DISPLAY + 'per_pixel = "table.pfp"\nlaser = "laser.png"\n')
    search = ["calibrate", "aberration", "search", "--z-mm", "5", "-o", "aberration.toml", "--display", "calibrated.toml"]
    found = phasefront(tmp_path, *search, unit=unit)["coefficients_rad"]
    # The file holds the correction.
    left = numpy.array(found) + relay.UNITS[unit][3]
    before, after = (strehl(a) for a in (relay.UNITS[unit][3], left))
    print(f"Strehl ratio of unit {unit}: {before:.3f} to {after:.3f}")
    assert before < 0.75 and after > 0.95
    entries = tomllib.loads((tmp_path / "aberration.toml").read_text())["at"]
    assert entries == [{"z_mm": 5.0, "laser": found}]


def strehl(a):
    y, x = numpy.mgrid[-1:1:101j, -1:1:101j]
    r2 = x**2 + y**2
    terms = (2 * r2 - 1, x**2 - y**2, 2 * x * y, (3 * r2 - 2) * x, (3 * r2 - 2) * y)
    phase = sum(c * term for c, term in zip(a, terms))
    return abs(numpy.exp(1j * phase)[r2 <= 1].mean()) ** 2


def bench():
    """Returns slmsuite's own SLM and camera, which is in the Fourier plane."""
    slm = SimulatedSLM((64, 48))
    return slm, SimulatedCamera(slm, bitdepth=10, gain=1 / 64)


def test_levels_are_shown_as_they_are_and_photographs_fill_16_bits():
    slm, camera = bench()
    levels = numpy.random.default_rng(0).integers(0, 256, (48, 64), dtype=numpy.uint8)
    photograph = Bench(slm, camera)(levels, Request("green", 520.0))
    numpy.testing.assert_array_equal(slm.display, levels)
    numpy.testing.assert_array_equal(photograph.values, camera.get_image().astype(numpy.uint16) << 6)
    assert photograph.settings == {"exposure_s": camera.get_exposure()}
    with pytest.raises(ValueError, match="another size"):
        Bench(slm, camera)(levels[:40], Request("green", 520.0))


def test_the_exposure_is_found_once_and_comes_back():
    slm, camera = bench()
    levels = numpy.random.default_rng(0).integers(0, 256, (48, 64), dtype=numpy.uint8)
    for start in (1e-3, 1.0, 1e3):
        camera.set_exposure(start)
        photograph = Bench(slm, camera)(levels, Request("laser", 532.0, expose=True))
        bright = photograph.values.max() / 65535
        assert 0.44 < bright < 0.86, (start, bright)
    camera.set_exposure(1e-3)
    again = Bench(slm, camera)(levels, Request("laser", 532.0, settings=photograph.settings))
    numpy.testing.assert_array_equal(again.values, photograph.values)
    assert again.settings == photograph.settings
