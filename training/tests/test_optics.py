import numpy as np
import torch
from conftest import asm

from phasefront_training.losses import focal_stack
from phasefront_training.optics import Display, fast_length, propagate, transfer

DISPLAY = Display()


def field(rng, h, w):
    return rng.uniform(0, 1, (3, h, w)) * np.exp(1j * rng.uniform(-1, 1, (3, h, w)))


def test_propagation_is_the_numpy_reference():
    rng = np.random.default_rng(0)
    for h, w, s in ((48, 37, 2e-3), (33, 64, -5e-3)):
        u = field(rng, h, w)
        # The reference pads more, and a kernel on another grid differs by its faint tail beyond the reach.
        ours = propagate(torch.from_numpy(u).to(torch.complex64), s, DISPLAY).numpy()
        error = np.abs(ours - asm(u, s, 160))
        assert np.sqrt((error**2).mean()) < 0.02
    # On the same grid they agree to float32 precision.
    pad = 32
    u = field(rng, 40, 40)
    big = np.pad(u, ((0, 0), (pad, pad), (pad, pad)))
    kernel = transfer(DISPLAY, 3e-3, 104, 104)
    ours = torch.fft.ifft2(torch.fft.fft2(torch.from_numpy(big).to(torch.complex64)) * kernel).numpy()[:, pad:-pad, pad:-pad]
    assert np.abs(ours - asm(u, 3e-3, pad)).max() < 1e-5


def test_circular_stack_keeps_energy_and_returns():
    u = torch.from_numpy(field(np.random.default_rng(1), 30, 45)).to(torch.complex64)[None]
    there = focal_stack(u, torch.tensor([[2e-3, -1e-3]], dtype=torch.float64), DISPLAY)
    assert torch.allclose(there.abs().square().sum((-1, -2, -3)), u.abs().square().sum(), rtol=1e-5)
    back = focal_stack(there[:, 0], torch.tensor([[-2e-3]], dtype=torch.float64), DISPLAY)
    assert torch.allclose(back[:, 0], u, atol=1e-5)


def test_reach_and_fast_lengths():
    assert DISPLAY.reach_px(3e-3) == 15
    assert [fast_length(n) for n in (1, 7, 11, 13, 121, 384)] == [1, 8, 12, 15, 125, 384]
