"""A tiny data set of random planes, with holograms by an angular spectrum method in plain numpy."""

import json

import numpy as np
import pytest
import torch

WAVELENGTHS = np.array([638e-9, 520e-9, 450e-9])
PITCH = 8e-6
VOLUME = 6e-3


def asm(field, s, pad=64):
    """Propagates by the reference angular spectrum method in float64, zero-padded on all sides, without the carrier."""
    _, h, w = field.shape
    big = np.pad(field.astype(complex), ((0, 0), (pad, pad), (pad, pad)))
    fx, fy = np.fft.fftfreq(w + 2 * pad, PITCH), np.fft.fftfreq(h + 2 * pad, PITCH)
    lam = WAVELENGTHS[:, None, None]
    root = np.sqrt(lam**-2 - fy[:, None] ** 2 - fx**2)
    out = np.fft.ifft2(np.fft.fft2(big) * np.exp(2j * np.pi * s * (root - 1 / lam)))
    return out[:, pad : pad + h, pad : pad + w]


def scene(rng, size, layers):
    """Returns a background with rectangles in front, as a layered depth image and its midpoint hologram."""
    y, x = np.mgrid[:size, :size] / size
    waves = [0.5 + 0.4 * np.sin(rng.uniform(4, 20) * x + rng.uniform(4, 20) * y + k) for k in range(3)]
    surfaces = [(np.stack(waves), np.full((size, size), 0.9), np.ones((size, size), bool))]
    for depth in (0.55, 0.15):
        a, b = rng.integers(0, size // 2, 2)
        mask = np.zeros((size, size), bool)
        mask[a : a + size // 2, b : b + size // 3] = True
        colour = rng.uniform(0.2, 1, 3)[:, None, None] * np.ones((3, size, size))
        surfaces.append((colour, np.full((size, size), depth), mask))
    field, z = np.zeros((3, size, size), complex), None
    for colour, depth, mask in surfaces:
        here = VOLUME * (0.5 - depth[0, 0])
        field = asm(field, here - z) if z is not None else field
        field, z = np.where(mask, colour, field), here
    hologram = asm(field, -z)
    rgba = np.zeros((layers, size, size, 4), np.uint8)
    depths = np.zeros((layers, size, size), np.uint16)
    count = np.zeros((size, size), int)
    for colour, depth, mask in reversed(surfaces):
        for layer in range(layers):
            here = mask & (count == layer)
            rgba[layer][here] = np.concatenate([colour * 255, np.full((1, size, size), 255)])[:, here].T
            depths[layer][here] = depth[here] * 65535
        count += mask
    return rgba, depths, hologram.astype(np.complex64)


@pytest.fixture(scope="session")
def data_folder(tmp_path_factory):
    """Makes eight scenes of 64x64 with three layers: five for training, two for validation and one for tests."""
    folder = tmp_path_factory.mktemp("data")
    rng = np.random.default_rng(3)
    for i in range(8):
        rgb, depth, hologram = scene(rng, 64, 3)
        np.savez_compressed(folder / f"pair_{i:06d}.npz", rgb=rgb, depth=depth, hologram=hologram)
    manifest = {
        "format": "phasefront-dataset-1", "size": 64, "planes": 3, "ldi_layers": 3, "seed": 3, "scenes": 8,
        "display": {"pitch_um": 8.0, "wavelengths_nm": [638, 520, 450], "volume_depth_mm": 6.0},
        "splits": {"train": [0, 5], "validation": [5, 7], "test": [7, 8]},
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


@pytest.fixture(autouse=True)
def one_thread():
    torch.set_num_threads(1)
    torch.manual_seed(0)
