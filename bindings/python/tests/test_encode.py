"""Tests holograms of fields that come from elsewhere, and the frames of modulators."""

import numpy
import pytest

import phasefront
from phasefront import Display, DisplayError, Encoding, FrameError, Modulator, SettingError, Target, encode


def smooth(colours, height=48, width=64):
    """Returns a smooth field, complex64, (C, H, W)."""
    y, x = numpy.mgrid[:height, :width]
    amplitude = 0.7 + 0.2 * numpy.sin(x / 8) * numpy.cos(y / 6)
    planes = [amplitude * numpy.exp(1j * (0.05 * x + c)) for c in range(colours)]
    return numpy.stack(planes).astype(numpy.complex64)


def test_a_field_is_displayed(display):
    field = smooth(3)
    hologram = encode(field, display, z_mm=1.0)
    assert hologram.levels.shape == (3, 48, 64) and hologram.z_at(0.5, 0.5) == 0
    inside = numpy.s_[:, 12:-12, 12:-12]
    seen = hologram.field(z_mm=1.0)[inside]
    assert abs(seen - field[inside]).mean() < 0.1 * abs(field[inside]).mean()


def test_types_and_layouts_are_one_field():
    display = Display(width=64, height=48, laser_nm=532)
    field = smooth(1)
    expected = encode(field, display).levels
    double = field.astype(numpy.complex128)
    columns = numpy.asfortranarray(field[0])
    for same in (double, field[0], columns, numpy.flip(numpy.flip(field, 2).copy(), 2)):
        numpy.testing.assert_array_equal(encode(same, Target.of_display(display)).levels, expected)
    assert (encode(field, display, local_steps=0, dark_threshold=0).levels != expected).any()
    scaled = encode(field, display, scale=2.0, encoding=Encoding.band_limit(k=1.0))
    assert scaled.info.scale == 2


def test_a_hologram_of_a_field_is_saved(tmp_path, display):
    encode(smooth(3), display).save(tmp_path / "hologram.png")
    assert (tmp_path / "hologram.png").stat().st_size > 1000


@pytest.mark.parametrize("name", ["ti-plm-p47", "santec-slm-200", "holoeye-gaea-2", "meadowlark-hdmi"])
def test_frames_go_to_a_modulator_and_back(name):
    modulator = Modulator.named(name)
    display = modulator.target.display()
    field = smooth(3, display.height, display.width)
    hologram = encode(field, modulator)
    images = modulator.pack(hologram)
    levels = modulator.unpack(images)
    assert levels.dtype == numpy.uint16 and levels.max() < 2**display.bits
    again = modulator.pack(hologram, out=[numpy.empty_like(image) for image in images])
    assert all((a == b).all() for a, b in zip(again, images, strict=True))
    numpy.testing.assert_array_equal(levels >> max(0, display.bits - 8), hologram.levels)
    with pytest.raises(SettingError, match="bytes"):
        modulator.unpack(images[:-1])


def test_a_modulators_file_is_read():
    text = 'width = 64\nheight = 48\nwavelengths_nm = [532]\npacking = "grey"\nflip_x = true'
    modulator = Modulator.from_toml(text)
    hologram = encode(smooth(1, 20, 30)[0], modulator)
    (image,) = modulator.pack(hologram)
    assert image.shape == (48, 64, 1)
    numpy.testing.assert_array_equal(modulator.unpack([image], (20, 30)), hologram.levels)
    with pytest.raises(SettingError, match="3 lasers"):
        modulator.pack(encode(smooth(3), Display(width=64, height=48)))
    with pytest.raises(DisplayError, match="no device"):
        Modulator.named("none")


@pytest.mark.parametrize(
    ("field", "words"),
    [
        (numpy.ones((48, 64)), r"float64; it must be complex: field.astype\(numpy.complex64\)"),
        (smooth(1), r"\(1, 48, 64\); \(3, H, W\)"),
        (smooth(3)[0, 0], r"\(64,\)"),
        (numpy.zeros((3, 48, 64), complex), "dark"),
        (smooth(3) * numpy.nan, "finite"),
        (smooth(3, 49), "does not fit"),
        (smooth(3).astype(complex) * 1e300, "finite"),
        (numpy.ones((3, 0, 64), complex), "dark"),
    ],
)
def test_what_is_no_field_is_named(display, field, words):
    with pytest.raises(FrameError, match=words) as told:
        encode(field, display)
    assert "\n" not in str(told.value)


def test_options_out_of_range_are_named(display):
    with pytest.raises(SettingError, match="scale"):
        encode(smooth(3), display, scale=-1)
    with pytest.raises(SettingError, match="steps"):
        phasefront.encode(smooth(3), display, local_steps=99)
