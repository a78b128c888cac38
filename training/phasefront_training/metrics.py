"""How near an amplitude is to the true one: PSNR and SSIM with peak 1, over (3, H, W) or (K, 3, H, W)."""

import torch
from torch.nn import functional as F

WINDOW = 11
SIGMA = 1.5


def psnr(a, b):
    """Peak signal-to-noise ratio in dB for peak 1, over all values."""
    return float(-10 * torch.log10(((a.double() - b.double()) ** 2).mean()))


def ssim(a, b):
    """Structural similarity (Wang 2004): Gaussian window of 11 px with σ 1.5, peak 1, mean over all whole windows."""
    a, b = (x.double().reshape(-1, 1, *x.shape[-2:]) for x in (a, b))
    offsets = torch.arange(WINDOW, dtype=torch.float64, device=a.device) - WINDOW // 2
    window = torch.exp(-(offsets**2) / (2 * SIGMA**2))
    window = window / window.sum()

    def mean(x):
        return F.conv2d(F.conv2d(x, window[None, None, None, :]), window[None, None, :, None])

    mean_a, mean_b = mean(a), mean(b)
    var_a, var_b = mean(a * a) - mean_a**2, mean(b * b) - mean_b**2
    covariance = mean(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    numerator = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    return float((numerator / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))).mean())
