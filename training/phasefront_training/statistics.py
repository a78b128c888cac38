"""Statistics of scenes: brightness, spectrum and depths of data sets, to compare with captured frames.

The numbers of an image are its mean amplitude, the slope of its grey spectrum, power against frequency (about -2 for
photographs, less for blurred ones), the correlation of its colours, the distribution of its depths, and the fraction of
neighbouring pixels across a step in depth. A captured frame is a file `colorNAME` with a `depthNAME.png` in the same
folder. Its depths are normalized from the 1st to the 99th percentile of the readings. Pixels without a reading are
ignored.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from .data import DataError, Manifest, read_pair

DEPTH_BINS = 10
STEP = 0.05  # fraction of the volume
FREQUENCIES = np.geomspace(0.02, 0.4, 12)  # cycles per pixel


@dataclass(frozen=True)
class Look:
    """The statistics of an image."""

    amplitude: float
    slope: float
    correlation: float
    depths: np.ndarray  # fractions of the bins from near to far
    steps: float


def look(colour, depth):
    """Returns the Look of colour (3, H, W) in [0, 1] and normalized depth (H, W), NaN without a reading."""
    known = depth[np.isfinite(depth)]
    shares = np.histogram(known.clip(0, 1), DEPTH_BINS, (0, 1))[0] / max(known.size, 1)
    steps = np.abs(np.diff(depth, axis=1))
    steps = steps[np.isfinite(steps)]
    return Look(float(colour.mean()), slope(colour.mean(0)), correlation(colour), shares, float((steps > STEP).mean()) if steps.size else 0.0)


def slope(grey):
    """Returns the exponent of power against frequency, fitted to rings of the spectrum of the largest central
    square."""
    size = min(grey.shape)
    top, left = ((n - size) // 2 for n in grey.shape)
    window = np.hanning(size)[:, None] * np.hanning(size)
    square = grey[top : top + size, left : left + size]
    power = np.abs(np.fft.fft2((square - square.mean()) * window)) ** 2
    f = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.fftfreq(size))
    rings = [(f >= low) & (f < high) for low, high in zip(FREQUENCIES, FREQUENCIES[1:])]
    points = [(f[ring].mean(), power[ring].mean()) for ring in rings if ring.any()]
    frequency, mean = np.array([point for point in points if point[1] > 0]).reshape(-1, 2).T
    return float(np.polyfit(np.log(frequency), np.log(mean), 1)[0]) if len(mean) > 1 else float("nan")


def correlation(colour):
    """Returns the mean correlation of two colours, or NaN if a colour does not vary."""
    flat = colour.reshape(3, -1)
    if flat.std(1).min() == 0:
        return float("nan")
    r = np.corrcoef(flat)
    return float((r[0, 1] + r[0, 2] + r[1, 2]) / 3)


def of_data(folder, split, limit=None):
    """Returns the Looks of the existing scenes of a split."""
    manifest = Manifest.read(folder)
    paths = [manifest.pair(n) for n in manifest.indices(split) if manifest.pair(n).exists()][:limit]
    if not paths:
        raise DataError(f"{folder}: no pair of the split '{split}' is there")
    looks = []
    for path in paths:
        colour, depth = read_pair(path, 1)[:2]
        looks.append(look(colour / np.float32(255), depth[0].astype(np.float32)))
    return looks


def of_frames(folder):
    """Returns the Looks of the captured frames in a folder and its subfolders."""
    looks = []
    for path in sorted(Path(folder).rglob("color*")):
        beside = path.with_name(path.name.replace("color", "depth", 1)).with_suffix(".png")
        if beside.exists():
            colour = np.asarray(Image.open(path).convert("RGB"), np.float32).transpose(2, 0, 1) / 255
            looks.append(look(colour, normalized(np.asarray(Image.open(beside), np.float32))))
    return looks


def normalized(readings):
    """Converts readings to normalized depth. A reading of 0 becomes NaN."""
    known = readings[readings > 0]
    if known.size == 0:
        return np.full_like(readings, np.nan)
    near, far = np.percentile(known, [1, 99])
    return np.where(readings > 0, ((readings - near) / max(far - near, 1e-6)).clip(0, 1), np.nan)


def table(named):
    """Returns {name: Looks} as a Markdown table."""
    lines = [
        "| | images | mean amplitude (10 % below, above) | spectrum's slope | colours' correlation | depth, shares of tenths from near to far, % | steps in depth, % |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, looks in named.items():
        amplitudes = [each.amplitude for each in looks]
        low, high = np.percentile(amplitudes, [10, 90])
        depths = " ".join(f"{100 * share:.0f}" for share in np.mean([each.depths for each in looks], 0))
        slopes, correlations = (np.nanmean([getattr(each, what) for each in looks]) for what in ("slope", "correlation"))
        steps = 100 * np.mean([each.steps for each in looks])
        lines.append(
            f"| {name} | {len(looks)} | {np.mean(amplitudes):.2f} ({low:.2f}, {high:.2f}) | {slopes:.2f} | {correlations:.2f} | {depths} | {steps:.1f} |"
        )
    return "\n".join(lines)
