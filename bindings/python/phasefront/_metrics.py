"""The similarity of amplitudes, as the commands `compare` and `evaluate` measure it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from ._ffi import SettingError
from ._memory import NO_ARRAY, as_array

#: The standard deviation of SSIM's window in pixels, and its half width (Wang et al., IEEE TIP 13, 600, 2004).
_SIGMA, _HALF = 1.5, 5


@dataclass(frozen=True)
class Comparison:
    """The similarity of two images. Its peak is an amplitude of 1.

    Fields:
        psnr: The PSNR of each colour in dB.
        psnr_overall: The PSNR over all values of all colours in dB.
        ssim: The SSIM of each colour.
        ssim_overall: The mean SSIM of the colours.
    """

    psnr: list[float]
    psnr_overall: float
    ssim: list[float]
    ssim_overall: float


def compare(a: ArrayLike, b: ArrayLike) -> Comparison:
    """Returns the similarity of two images: numbers where 1 is white, such as `Hologram.refocus` returns, or uint8, where
    255 is white. SSIM is the mean over all positions where its window of 11×11 pixels fits; in a smaller image the window
    shrinks to fit.

    Args:
        a: An image, (C, H, W), or (H, W) of one colour.
        b: The image to compare it with, of the same shape.

    Raises `SettingError` for arrays of other types or shapes.
    """
    one, other = _amplitudes(a), _amplitudes(b)
    if one.shape != other.shape:
        raise SettingError(f"one image is {one.shape}, the other {other.shape}; only images of one size can be compared")
    squares = [float(numpy.mean((x - y) ** 2)) for x, y in zip(one, other)]
    ssims = [_ssim(x, y) for x, y in zip(one, other)]
    overall = sum(squares) / len(squares)
    return Comparison([_decibels(s) for s in squares], _decibels(overall), ssims, sum(ssims) / len(ssims))


def _amplitudes(image: ArrayLike) -> NDArray[numpy.float64]:
    """Returns an image as amplitudes, (C, H, W)."""
    try:
        array = as_array(image)
    except NO_ARRAY as error:
        raise SettingError(f"the image is no array: {error}") from None
    if array.dtype.kind != "f" and array.dtype != numpy.uint8:
        raise SettingError(f"the image holds {array.dtype}; amplitudes are floats, or uint8 from 0 to 255")
    if array.ndim not in (2, 3) or array.size == 0:
        raise SettingError(f"the image is {array.shape}; (C, H, W) or (H, W) is right")
    amplitudes: NDArray[Any] = array / 255 if array.dtype == numpy.uint8 else array
    return amplitudes.astype(numpy.float64).reshape(-1, *array.shape[-2:])


def _decibels(mean_square: float) -> float:
    return float("inf") if mean_square == 0 else float(-10 * numpy.log10(mean_square))


def _ssim(a: NDArray[numpy.float64], b: NDArray[numpy.float64]) -> float:
    """Returns the mean structural similarity of two planes."""
    half = min(_HALF, (min(a.shape) - 1) // 2)
    taps = numpy.exp(-0.5 * ((numpy.arange(2 * half + 1) - half) / _SIGMA) ** 2)
    taps /= taps.sum()

    def window(plane: NDArray[numpy.float64]) -> NDArray[numpy.float64]:
        """Returns the means under the window at all positions where it fits."""
        height, width = plane.shape[0] - 2 * half, plane.shape[1] - 2 * half
        down: NDArray[numpy.float64] = sum(tap * plane[i : i + height] for i, tap in enumerate(taps))
        across: NDArray[numpy.float64] = sum(tap * down[:, i : i + width] for i, tap in enumerate(taps))
        return across

    mean_a, mean_b = window(a), window(b)
    variances = window(a * a) - mean_a**2 + window(b * b) - mean_b**2
    covariance = window(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    similarity = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    return float(numpy.mean(similarity / ((mean_a**2 + mean_b**2 + c1) * (variances + c2))))
