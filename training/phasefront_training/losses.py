"""The training losses: the distance between a predicted and a true field, at the midpoint and over a focal stack.

* field: mean |P − T| of the complex fields (the modulus of the difference).
* amplitude: mean ||P| − |T||.
* focal stack: both fields propagated to planes chosen from the scene's depth; the difference of amplitudes, each
  pixel weighted by attention exp(0.35·(6 − |Δd|)), Δd the distance in mm of the pixel's depth from the plane,
  divided by its greatest value exp(0.35·6).
* total variation: the error of the horizontal and vertical differences of the weighted amplitudes.

Fields are complex (N, 3, H, W). Where a crop cuts the network's view (valid = 0), the truth replaces the prediction
before the comparison, so errors there neither count nor spread by propagation. The focal stack uses circular
propagation: both fields wrap around alike, and their difference keeps its energy.
"""

import math

import numpy as np
import torch


BINS = 200  # of the depth histogram
FULLEST = 15  # planes at the fullest bins
OTHERS = 5  # planes at random other bins
ATTENTION_PER_MM = 0.35


def fill_invalid(prediction, target, valid):
    """Returns the prediction where valid (N, 1, H, W) is 1, and the target elsewhere."""
    return torch.where(valid > 0, prediction, target)


def stack_distances(depth, display, planes, rng):
    """Returns signed distances in metres (N, planes) to the planes of a dynamic focal stack of each depth map (N, H,
    W).

    The candidates are the 15 fullest bins of a 200-bin histogram and 5 random others, all shifted by one sub-bin jitter
    per image. The stack has all 20, or `planes` of them at random.
    """
    distances = np.empty((len(depth), planes))
    for row, image in zip(distances, depth):
        counts = torch.histc(image.float(), BINS, 0, 1).cpu().numpy()
        order = np.argsort(-counts, kind="stable")
        bins = np.concatenate([order[:FULLEST], rng.choice(order[FULLEST:], OTHERS, replace=False)])
        jitter = rng.random()
        chosen = bins if planes == FULLEST + OTHERS else rng.choice(bins, planes, replace=False)
        row[:] = display.z_m((chosen + jitter) / BINS)
    return torch.from_numpy(distances)


def phase_per_metre(display, height, width, device):
    """Returns the carrier-free exponent per metre (3, H, W), float64."""
    key = (display, height, width, device)
    if key not in phase_per_metre.cache:
        x = torch.fft.fftfreq(width, display.pitch_m, dtype=torch.float64)
        y = torch.fft.fftfreq(height, display.pitch_m, dtype=torch.float64)
        f2 = y[:, None] ** 2 + x**2
        wavelength = torch.tensor(display.wavelengths_m, dtype=torch.float64)[:, None, None]
        root = (1 - wavelength**2 * f2).clamp(min=0).sqrt()
        phase_per_metre.cache[key] = (-2 * math.pi * wavelength * f2 / (1 + root)).to(device)
    return phase_per_metre.cache[key]


phase_per_metre.cache = {}


def focal_stack(field, distances_m, display):
    """Propagates fields (N, 3, H, W) circularly to distances (N, K). Returns fields (N, K, 3, H, W)."""
    per_metre = phase_per_metre(display, *field.shape[-2:], field.device)
    phase = (distances_m.to(field.device)[..., None, None, None] * per_metre).float()
    kernel = torch.polar(torch.ones_like(phase), phase)
    return torch.fft.ifft2(torch.fft.fft2(field)[:, None] * kernel)


def focal_stack_terms(prediction, target, depth, display, planes, rng):
    """Returns the (focal stack, total variation) terms. depth is the clean normalized depth (N, H, W)."""
    distances = stack_distances(depth, display, planes, rng)
    away_mm = (display.z_m(depth)[:, None] - distances.to(depth)[..., None, None]).abs() * 1e3
    attention = torch.exp(-ATTENTION_PER_MM * away_mm)[:, :, None]
    predicted = attention * focal_stack(prediction, distances, display).abs()
    with torch.no_grad():
        true = attention * focal_stack(target, distances, display).abs()
    error = predicted - true
    variation = error.diff(dim=-1).abs().mean() + error.diff(dim=-2).abs().mean()
    return error.abs().mean(), variation


def field_terms(prediction, target):
    """Returns the (field, amplitude) terms."""
    field = (prediction - target).abs().mean()
    return field, (prediction.abs() - target.abs()).abs().mean()
