"""Tests the similarity of images."""

import json
import os
import pathlib
import subprocess

import numpy
import pytest
from PIL import Image

from phasefront import SettingError, compare


def pictures(height=21, width=17):
    """Returns two similar pictures, uint8, (H, W, 3)."""
    y, x, c = numpy.mgrid[:height, :width, :3]
    one = (x * 9 + y * 7 + c * 40) % 256
    return one.astype(numpy.uint8), (one * 0.8 + (x * y) % 23).astype(numpy.uint8)


def naive_ssim(a, b):
    """Returns SSIM by its definition, with a sum over each window."""
    weights = numpy.exp(-(numpy.mgrid[-5:6, -5:6] ** 2).sum(0) / (2 * 1.5**2))
    weights /= weights.sum()
    values = []
    for y in range(a.shape[0] - 10):
        for x in range(a.shape[1] - 10):
            p, q = a[y : y + 11, x : x + 11], b[y : y + 11, x : x + 11]
            mp, mq = (weights * p).sum(), (weights * q).sum()
            vp, vq = (weights * (p - mp) ** 2).sum(), (weights * (q - mq) ** 2).sum()
            covariance = (weights * (p - mp) * (q - mq)).sum()
            values.append((2 * mp * mq + 1e-4) * (2 * covariance + 9e-4) / ((mp**2 + mq**2 + 1e-4) * (vp + vq + 9e-4)))
    return numpy.mean(values)


def test_similarity_is_that_of_its_definition():
    one, other = (picture.transpose(2, 0, 1) / 255 for picture in pictures())
    found = compare(one, other)
    assert found.ssim == pytest.approx([naive_ssim(a, b) for a, b in zip(one, other)], abs=1e-12)
    assert found.ssim_overall == pytest.approx(numpy.mean(found.ssim))
    assert found.psnr == pytest.approx([-10 * numpy.log10(((a - b) ** 2).mean()) for a, b in zip(one, other)])
    assert found.psnr_overall == pytest.approx(-10 * numpy.log10(((one - other) ** 2).mean()))
    plane = compare(one[1].astype(numpy.float32), other[1].astype(numpy.float32))
    assert plane.psnr_overall == pytest.approx(found.psnr[1], abs=1e-4)
    same = compare(one, one)
    assert same.psnr_overall == float("inf") and same.ssim_overall == pytest.approx(1)


@pytest.mark.parametrize("size", [(21, 17), (6, 9)])
def test_similarity_is_that_of_the_command(size, tmp_path):
    names = []
    for i, picture in enumerate(pictures(*size)):
        names.append(str(tmp_path / f"{i}.png"))
        Image.fromarray(picture).save(names[-1])
    command = pathlib.Path(os.environ["CARGO_TARGET_DIR"]) / "release" / "phasefront"
    told = subprocess.run([command, "compare", *names, "--json"], check=True, capture_output=True, text=True).stdout
    found = compare(*(picture.transpose(2, 0, 1) for picture in pictures(*size)))
    said = json.loads(told)
    # The command knows what the pictures' values mean.
    assert said.pop("ciede2000") > 0
    for name, value in said.items():
        # The command has the amplitudes in f32.
        assert getattr(found, name) == pytest.approx(value, abs=1e-4), name


def test_unequal_images_are_refused():
    image = numpy.zeros((3, 8, 8))
    for wrong, said in [(image[:2], "only images of one size"), (image > 0, "holds bool"), (image[0, 0], r"\(C, H, W\)")]:
        with pytest.raises(SettingError, match=said):
            compare(image, wrong)
