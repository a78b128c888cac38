"""Tests holograms as files, which the command reads."""

import json
import os
import pathlib
import struct
import subprocess
import zlib

import matplotlib.image
import numpy
import pytest
from conftest import still

import phasefront
from phasefront import Encoding, FileError, Session, SettingError, Target, session_options

COMMAND = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target")) / "release" / "phasefront"


def chunks(path):
    """Returns the chunks of a PNG by kind."""
    data, found, at = path.read_bytes(), {}, 8
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        content = data[at + 8 : at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length :][:4]) == (zlib.crc32(kind + content),)
        found[kind.decode()] = content
        at += 12 + length
    return found


def told(path):
    keyword, text = chunks(path)["tEXt"].split(b"\0")
    assert keyword == b"phasefront"
    return json.loads(text)


def saved(path, **options):
    with Session(session_options(**options)) as session:
        hologram = session.process(still())
        hologram.save(path)
    return hologram


def test_a_file_has_the_levels_and_what_they_are_for(display, tmp_path):
    hologram = saved(tmp_path / "hologram.png", target=display)
    png = chunks(tmp_path / "hologram.png")
    assert struct.unpack(">IIBB", png["IHDR"][:10]) == (64, 48, 8, 2)
    rows = numpy.frombuffer(zlib.decompress(png["IDAT"]), numpy.uint8).reshape(48, 1 + 3 * 64)
    numpy.testing.assert_array_equal(rows[:, 1:].reshape(48, 64, 3), hologram.levels.transpose(1, 2, 0))
    info = told(tmp_path / "hologram.png")
    assert info["display"]["wavelengths_nm"] == [638, 520, 450] and info["display"]["width"] == 64
    assert info["encoder"] == "anti-alias" and info["scale"] == pytest.approx(hologram.info.scale)
    assert info.keys() == {"display", "encoder", "levels", "scale", "srgb_of_light"}
    # White is the light of all lasers together.
    assert numpy.sum(info["srgb_of_light"], 1) == pytest.approx([1, 1, 1], abs=1e-3)
    assert os.listdir(tmp_path) == ["hologram.png"]


def test_a_new_file_has_the_permissions_of_others_and_a_replaced_one_its_own(display, tmp_path):
    path = tmp_path / "hologram.png"
    # Windows has other permissions, of which it tells only whether a file may be written.
    new, own = (0o644, 0o600) if os.name == "posix" else (0o666, 0o666)
    before = os.umask(0o022)
    try:
        saved(path, target=display)
        assert path.stat().st_mode & 0o777 == new
        path.chmod(own)
        saved(path, target=display)
        assert path.stat().st_mode & 0o777 == own
    finally:
        os.umask(before)
    assert os.listdir(tmp_path) == ["hologram.png"]


def test_a_table_travels_and_a_calibration_is_named(display, tmp_path):
    table = bytes(range(255, -1, -1))
    saved(str(tmp_path / "table.png"), target=Target.with_look_up_table(display, table), encoding=Encoding.double_phase())
    info = told(tmp_path / "table.png")
    assert bytes(info["lut"]) == table and info["encoder"] == "double" and "calibrated" not in info
    # Like the target of a calibration file.
    calibrated = Target.of_display(display)
    del calibrated._calibrated
    saved(tmp_path / "calibrated.png", target=calibrated)
    assert told(tmp_path / "calibrated.png")["calibrated"]


def test_what_cannot_be_written_is_named(display, tmp_path):
    with pytest.raises(FileError, match="must end in .png"):
        saved(tmp_path / "hologram.jpg", target=display)
    with pytest.raises(FileError, match="nowhere"):
        saved(tmp_path / "nowhere" / "hologram.png", target=display)
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(FileError, match="folder.png"):
        saved(tmp_path / "folder.png", target=display)
    with pytest.raises(SettingError, match="the display has 10"):
        saved(tmp_path / "deep.png", target=phasefront.Display(width=64, height=48, bits=10))
    assert os.listdir(tmp_path) == ["folder.png"]


def test_the_command_sees_what_a_view_shows(tmp_path):
    target = Target.with_look_up_table(phasefront.Display(width=64, height=48, offset_mm=2), bytes(range(256)))
    hologram = saved(tmp_path / "hologram.png", target=target)
    view = [COMMAND, "refocus", "hologram.png", "--z-mm", "1", "--json", "-o", "view.png"]
    run = subprocess.run(view, cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    seen = matplotlib.image.imread(tmp_path / "view.png")[..., :3]
    shown = hologram.preview(1, width=64, height=48) / 255
    assert numpy.corrcoef(seen.ravel(), shown.ravel())[0, 1] > 0.9
    # The light of the lasers in sRGB (IEC 61966-2-1).
    light = numpy.tensordot(told(tmp_path / "hologram.png")["srgb_of_light"], hologram.refocus(1) ** 2, 1).clip(0, 1)
    whole = numpy.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055).transpose(1, 2, 0)
    numpy.testing.assert_allclose(seen, whole, atol=1.1 / 255)


def test_the_command_refuses_levels_that_another_program_changed(tmp_path):
    hologram = saved(tmp_path / "hologram.png", target=phasefront.Display(width=64, height=48))
    levels = hologram.levels.transpose(1, 2, 0).copy()
    levels[5, 7, 1] ^= 1
    changed = phasefront._png.encoded(levels, {"phasefront": json.dumps(told(tmp_path / "hologram.png"))})
    (tmp_path / "changed.png").write_bytes(changed)
    view = [COMMAND, "refocus", "--z-mm", "1", "-o", "view.png"]
    assert subprocess.run([*view, "hologram.png"], cwd=tmp_path).returncode == 0
    run = subprocess.run([*view, "changed.png"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 1 and "holds other levels" in run.stderr
