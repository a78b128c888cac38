"""Measures of the error of an amplitude: PSNR and SSIM with peak 1, over (3, H, W) or (K, 3, H, W)."""

import math

import torch

WINDOW = 11
SIGMA = 1.5


def psnr(a, b):
    """Returns the peak signal-to-noise ratio in dB for peak 1, over all values."""
    return float(-10 * torch.log10(((a.double() - b.double()) ** 2).mean()))


def ssim(a, b):
    """Returns the structural similarity (Wang 2004) for peak 1: the mean over all whole Gaussian windows of 11 px with
    σ 1.5."""
    a, b = a.double(), b.double()
    mean_a, mean_b = _blur(a), _blur(b)
    var_a, var_b = _blur(a * a) - mean_a**2, _blur(b * b) - mean_b**2
    covariance = _blur(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    numerator = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    return float((numerator / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))).mean())


def _blur(x):
    """Returns the Gaussian mean over each whole window. Sums of shifted planes are much faster than a convolution
    here."""
    weights = [math.exp(-((k - WINDOW // 2) ** 2) / (2 * SIGMA**2)) for k in range(WINDOW)]
    for axis in (-1, -2):
        length = x.shape[axis] - WINDOW + 1
        shifted = (x.narrow(axis, k, length) for k in range(WINDOW))
        total = weights[0] * next(shifted)
        for weight, plane in zip(weights[1:], shifted):
            total.add_(plane, alpha=weight)
        x = total / sum(weights)
    return x
