import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

from phasefront_training.metrics import psnr, ssim


def test_psnr_of_a_known_error():
    a = torch.rand(3, 20, 20)
    assert psnr(a + 0.1, a) == pytest.approx(20, abs=1e-4)


def test_ssim_is_that_of_gaussian_filters():
    rng = np.random.default_rng(0)
    a = rng.random((3, 40, 50))
    b = np.clip(a + rng.normal(0, 0.1, a.shape), 0, 1)

    def mean(x):
        return gaussian_filter(x, 1.5, axes=(1, 2), truncate=5 / 1.5)[:, 5:-5, 5:-5]

    va, vb = mean(a * a) - mean(a) ** 2, mean(b * b) - mean(b) ** 2
    top = (2 * mean(a) * mean(b) + 1e-4) * (2 * (mean(a * b) - mean(a) * mean(b)) + 9e-4)
    expected = (top / ((mean(a) ** 2 + mean(b) ** 2 + 1e-4) * (va + vb + 9e-4))).mean()
    assert ssim(torch.from_numpy(a), torch.from_numpy(b)) == pytest.approx(expected, abs=1e-9)
    assert ssim(torch.from_numpy(a), torch.from_numpy(a)) == pytest.approx(1)
