"""Simulates sensor depth from clean depth. Colour and target do not change.

Phone depth is coarse (a LiDAR frame has 256x192 pixels for an image of 1920x1440), its noise grows with distance, it
has holes where no light returned, its edges bleed, and it is shifted by a few pixels against the colour. Each defect
occurs at random with a random strength. Holes are then filled with the nearest valid depth, as the core does before a
network reads a frame.
"""

import numpy as np
import torch
from torch.nn import functional as F

MAX_FACTOR = 6.0  # of the pixel size relative to colour
MAX_NOISE = 0.012  # standard deviation at the far end, as a fraction of the volume
MAX_SHIFT_PX = 3.0
MAX_HOLES = 0.04  # fraction of the coarse pixels that seed a hole


def simulate_sensor_depth(colour, depth, rng):
    """Simulates a phone's normalized depth (H, W) for the colour (3, H, W). Values stay in [0, 1].

    `rng` is a numpy Generator. The same state gives the same depth.
    """
    height, width = depth.shape
    coarse = depth[None, None]
    shift = rng.uniform(-MAX_SHIFT_PX, MAX_SHIFT_PX, 2) if rng.random() < 0.7 else np.zeros(2)
    coarse = _shift(coarse, *shift)
    if rng.random() < 0.3:
        coarse = _bleed(coarse, int(rng.integers(1, 3)), toward_viewer=rng.random() < 0.7)
    factor = rng.uniform(1.5, MAX_FACTOR) if rng.random() < 0.8 else 1.0
    size = max(2, round(height / factor)), max(2, round(width / factor))
    # Averaging mixes the two sides of an edge (flying pixels). A sensor that picks one side keeps the edge abrupt but
    # jagged.
    averaged = rng.random() < 0.5
    if factor > 1:
        coarse = F.interpolate(coarse, size, mode="area" if averaged else "nearest-exact")
    if rng.random() < 0.7:
        sigma = rng.uniform(0, MAX_NOISE)
        noise = torch.from_numpy(rng.standard_normal(coarse.shape, dtype=np.float32)).to(depth.device)
        coarse = coarse + sigma * (0.25 + 0.75 * coarse.clamp(0, 1) ** 2) * noise
    if rng.random() < 0.5:
        coarse = fill_nearest(coarse, _holes(coarse, colour, rng))
    if coarse.shape[-2:] != (height, width):
        smooth = rng.random() < 0.8
        coarse = F.interpolate(coarse, (height, width), **({"mode": "bilinear", "align_corners": False} if smooth else {"mode": "nearest-exact"}))
    return coarse[0, 0].clamp(0, 1)


def _shift(depth, dx, dy):
    """Shifts a depth map (1, 1, H, W) by whole pixels, so that edges do not blur. Borders are repeated."""
    dx, dy = round(float(dx)), round(float(dy))
    if dx == 0 and dy == 0:
        return depth
    reach = max(abs(dx), abs(dy))
    padded = F.pad(depth, (reach,) * 4, mode="replicate")
    height, width = depth.shape[-2:]
    return padded[..., reach - dy : reach - dy + height, reach - dx : reach - dx + width]


def _bleed(depth, radius, toward_viewer):
    """Grows near surfaces over far surfaces by `radius` pixels, or far over near."""
    size = 2 * radius + 1
    sign = -1 if toward_viewer else 1
    return sign * F.max_pool2d(sign * depth, size, 1, radius)


def _holes(depth, colour, rng):
    """Returns True where the sensor has no reading: random spots and dark surfaces."""
    height, width = depth.shape[-2:]
    seeds = torch.from_numpy(rng.random((1, 1, height, width), dtype=np.float32)).to(depth.device)
    holes = (seeds < rng.uniform(0, MAX_HOLES)).float()
    holes = F.max_pool2d(holes, 3, 1, 1) > 0
    if rng.random() < 0.5:
        dark = F.interpolate(colour[None].amax(1, keepdim=True), (height, width), mode="area") < 0.1
        holes |= dark & (seeds > rng.uniform(0.3, 1))
    return holes


def fill_nearest(depth, holes):
    """Fills each hole of a depth map (1, 1, H, W) with the depth of a nearest valid pixel, in steps of one pixel."""
    if holes.all():
        return torch.full_like(depth, 0.5)
    depth, valid = depth.clone(), ~holes
    while not valid.all():
        near_depth, near_valid = F.pad(depth, (1,) * 4), F.pad(valid, (1,) * 4)
        filled, found = depth, valid
        for dy, dx in ((0, 1), (2, 1), (1, 0), (1, 2), (0, 0), (0, 2), (2, 0), (2, 2)):
            window = (..., slice(dy, dy + depth.shape[-2]), slice(dx, dx + depth.shape[-1]))
            take = near_valid[window] & ~found
            filled, found = torch.where(take, near_depth[window], filled), found | take
        depth, valid = filled, found
    return depth
