"""Calibrates simulated benches of slmsuite unattended, by the command."""

import json
import os
import pathlib
import subprocess
import sys
import tomllib

import numpy
import PIL.Image
import pytest
import relay
from slmsuite.hardware.cameras.simulated import SimulatedCamera
from slmsuite.hardware.slms.simulated import SimulatedSLM

from phasefront_capture import Request
from phasefront_capture.slmsuite import Bench

COMMAND = pathlib.Path(os.environ["CARGO_TARGET_DIR"]) / "release" / "phasefront"
W, H = relay.SIZE
DISPLAY = f"width = {W}\nheight = {H}\nwavelengths_nm = [{relay.WAVELENGTH_NM}]\n"


LASERS_NM = {"laser": relay.WAVELENGTH_NM}
THREE_NM = {"red": 638, "green": 520, "blue": 450}


def phasefront(folder, *arguments, check=True):
    run = subprocess.run([COMMAND, *arguments], cwd=folder, capture_output=True, text=True)
    assert not check or run.returncode == 0, run.stderr
    return run


def dark(unit):
    """Returns the flag of a level that turns the phase by about π, so that marks are dark."""
    calibrate_flag = "--dark"
    return [calibrate_flag, str(numpy.argmin(abs(relay.curve(unit) - numpy.pi)))]


def calibrate(folder, unit, *more, check=True):
    """Runs all calibrations, and returns what the command printed: an object for each step."""
    command = ["calibrate", "all", "bench", "--z-mm", "5", "--gaussians", "1", "--display", "display.toml", "--json", *dark(unit), *more]
    run = phasefront(folder, *command, "--capture", sys.executable, relay.__file__, unit, check=check)
    return run, [json.loads(line) for line in run.stdout.splitlines()]


def phase_error(unit, levels, wavelength_nm):
    """Returns the RMS phase error in radians of levels, (…, 256), one for each phase step, where the curve reaches."""
    steps = numpy.arange(256) / 256 * 2 * numpy.pi
    curve = relay.curve(unit, wavelength_nm)
    reached = steps <= curve[255]
    turns = (curve[levels[..., reached]] - steps[reached]) / (2 * numpy.pi)
    return 2 * numpy.pi * numpy.sqrt(numpy.mean((turns - numpy.rint(turns)) ** 2))


def check_curves(folder, unit, lasers_nm):
    """Compares the phases of the calibrated display with the unit's true ones."""
    full = ["--captures", "bench/captures", "-o", "again.pfp", "--full", "full", "--display", "display.toml"]
    phasefront(folder, "calibrate", "lut", *full)
    assert (folder / "again.pfp").read_bytes() == (folder / "bench" / "table.pfp").read_bytes()
    for colour, wavelength_nm in lasers_nm.items():
        before = phase_error(unit, numpy.arange(256)[None], wavelength_nm)
        after = phase_error(unit, numpy.load(folder / "full" / f"full_{colour}.npy"), wavelength_nm)
        print(f"unit {unit}, {colour}: phase error {before:.3f} to {after:.4f} rad")
        assert before > 0.3 and after < 0.05


def check_aberration(folder, unit, lasers_nm):
    """Compares the Strehl ratio before and after."""
    entry = tomllib.loads((folder / "bench" / "aberration.toml").read_text())["at"][0]
    for colour, wavelength_nm in lasers_nm.items():
        true = numpy.array(relay.UNITS[unit][3]) * relay.WAVELENGTH_NM / wavelength_nm
        # The file holds the correction.
        before, after = strehl(true), strehl(numpy.array(entry[colour]) + true)
        print(f"unit {unit}, {colour}: Strehl ratio {before:.3f} to {after:.3f}")
        assert before < 0.92 and after > 0.95


def check_diagnosis(steps):
    """Checks what the last photographs say of the calibrated display: nothing is wrong that calibration changes."""
    diagnosis = steps[-2]["diagnosis"]
    causes = [finding["cause"] for finding in diagnosis["findings"]]
    print("diagnosis:", causes, diagnosis["explained"])
    assert not {"wrong phase range", "inverted curve", "bent curve", "wrong distance"} & set(causes)
    assert diagnosis["explained"] > 0.8


def picture(folder, lasers_nm):
    """Writes a picture in the middle of the volume and returns its amplitudes, (C, H, W)."""
    y, x = numpy.mgrid[:H, :W]
    rgb = numpy.stack([0.5 + 0.4 * numpy.sin(0.2 * x + c) * numpy.cos(0.25 * y - c) for c in range(3)])
    rgb[:, 24:48, 50:90] *= 0.3
    rgb = numpy.rint(255 * rgb).astype(numpy.uint8)
    PIL.Image.fromarray(numpy.moveaxis(rgb, 0, -1)).save(folder / "rgb.png")
    PIL.Image.fromarray(numpy.full((H, W), 128, numpy.uint8)).save(folder / "depth.png")
    light = (rgb / 255) ** 2
    return numpy.sqrt(light if len(lasers_nm) == 3 else numpy.tensordot([[0.2126, 0.7152, 0.0722]], light, 1))


def seen(folder, unit, display, wanted, lasers_nm):
    """Returns the PSNR of photographs of the picture's hologram, shown in the light of each laser."""
    hologram = ["--rgb", "rgb.png", "--depth", "depth.png", "--method", "layers", "--planes", "9", "--scale", "1"]
    phasefront(folder, "hologram", *hologram, "--display", display, "-o", "h.png")
    levels = numpy.asarray(PIL.Image.open(folder / "h.png"))
    bench, square = relay.bench(unit), 0.0
    for i, (colour, wavelength_nm) in enumerate(lasers_nm.items()):
        plane = levels if len(lasers_nm) == 1 else levels[..., i]
        photograph = bench(plane, Request(colour, float(wavelength_nm), expose=True)).values
        top, left = ((n - relay.ZOOM * m) // 2 for n, m in zip(photograph.shape, (H, W)))
        panel = photograph[top : top + relay.ZOOM * H, left : left + relay.ZOOM * W].astype(float)
        shown = numpy.sqrt(panel.reshape(H, relay.ZOOM, W, relay.ZOOM).mean((1, 3)))[8:-8, 8:-8]
        asked = wanted[i, 8:-8, 8:-8]
        square += numpy.mean((shown * (shown * asked).sum() / (shown**2).sum() - asked) ** 2)
    return -10 * numpy.log10(square / len(lasers_nm))


@pytest.mark.parametrize("unit", ["one", "two"])
def test_a_bench_is_calibrated_unattended_by_one_command(unit, tmp_path):
    (tmp_path / "display.toml").write_text(DISPLAY)
    _, steps = calibrate(tmp_path, unit, "--photographs", "8")
    assert [step.get("step") for step in steps] == ["curves", "laser", "aberration, laser", "model", "diagnosis", None]
    check_diagnosis(steps)
    settings = json.loads((tmp_path / "bench" / "captures" / "laser" / "settings.json").read_text())
    assert settings["exposure_s"] > 0
    check_curves(tmp_path, unit, LASERS_NM)
    check_aberration(tmp_path, unit, LASERS_NM)
    wanted = picture(tmp_path, LASERS_NM)
    before, after = (seen(tmp_path, unit, display, wanted, LASERS_NM) for display in ("display.toml", "bench/display.toml"))
    print(f"unit {unit}: the picture {before:.1f} to {after:.1f} dB")
    assert after > before + 3 and after > 20


def test_three_lasers_take_turns_on_one_panel(tmp_path):
    unit = "of three lasers"
    (tmp_path / "display.toml").write_text(f"width = {W}\nheight = {H}\n")
    _, steps = calibrate(tmp_path, unit)
    assert len(steps) == 7
    check_diagnosis(steps)
    check_curves(tmp_path, unit, THREE_NM)
    check_aberration(tmp_path, unit, THREE_NM)
    wanted = picture(tmp_path, THREE_NM)
    before, after = (seen(tmp_path, unit, display, wanted, THREE_NM) for display in ("display.toml", "bench/display.toml"))
    print(f"three lasers: the picture {before:.1f} to {after:.1f} dB")
    assert after > before + 3 and after > 20


def test_a_calibration_that_is_cut_off_resumes(tmp_path):
    (tmp_path / "display.toml").write_text(DISPLAY)
    # The program ends after so many photographs.
    (tmp_path / "short.py").write_text(
        "import sys, phasefront_capture, relay\n"
        "bench, left = relay.bench('two'), [int(sys.argv[1])]\n"
        "def take(levels, request):\n"
        "    left[0] -= 1\n"
        "    if left[0] < 0:\n"
        "        sys.exit(3)\n"
        "    return bench(levels, request)\n"
        "phasefront_capture.serve(take)\n"
    )
    command = ["calibrate", "all", "bench", "--z-mm", "5", "--gaussians", "1", "--display", "display.toml", "--json", *dark("two")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([os.environ.get("PYTHONPATH", ""), str(pathlib.Path(__file__).parent)])}
    steps = []
    for count in (40, 230, 9, 5):
        capture = ["--capture", sys.executable, "short.py", str(count)]
        run = subprocess.run([COMMAND, *command, *capture], cwd=tmp_path, capture_output=True, text=True, env=environment)
        assert run.returncode == 1 and run.stderr.count("error: ") == 1, run.stderr
        assert run.stderr.splitlines()[-1].endswith("what was taken is kept")
        steps.append(run.stdout.count("\n"))
    assert steps == [0, 2, 2, 2]
    table = (tmp_path / "bench" / "table.pfp").read_bytes()
    # Of 33 spots, 27 are there.
    run, steps = calibrate(tmp_path, "two")
    assert [step.get("step") for step in steps] == ["curves", "laser", "aberration, laser", "diagnosis", None]
    assert (tmp_path / "bench" / "table.pfp").read_bytes() == table
    assert tomllib.loads((tmp_path / "bench" / "display.toml").read_text()).keys() >= {"per_pixel", "laser", "aberration"}
    (tmp_path / "display.toml").write_text(DISPLAY + "pitch_um = 6.4\n")
    run, _ = calibrate(tmp_path, "two", check=False)
    assert run.returncode == 1 and "is of another display" in run.stderr


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
