"""The propagation of complex fields of a display by the angular spectrum method, without the carrier.

Fields are complex64 tensors (..., 3, H, W), colours in the order R, G, B. x runs right, y down, z toward the
viewer; a positive distance propagates toward the viewer. The carrier exp(i2πs/λ) is left out, so a plane wave
along z does not change: F⁻¹(F(u)·exp(−i2πs·λf²/(1 + √(1 − λ²f²)))), f² = µ² + ν². The exponent is computed in
float64. encode.py encodes fields as phase.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import torch


@dataclass(frozen=True)
class Display:
    """The physics of a display, with lengths in metres. The wavelengths are R, G, B."""

    pitch_m: float = 8e-6
    wavelengths_m: tuple = (638e-9, 520e-9, 450e-9)
    volume_depth_m: float = 6e-3
    corrected: bool = False  # whether holograms correct an aberration of this display's optics

    def __post_init__(self):
        if len(self.wavelengths_m) != 3:
            raise ValueError(f"a display has three wavelengths, not {len(self.wavelengths_m)}")
        if self.pitch_m <= 0 or self.volume_depth_m < 0 or min(self.wavelengths_m) <= 0:
            raise ValueError("pitch and wavelengths must be positive and the volume's depth not negative")

    @classmethod
    def from_manifest(cls, table, corrected=False):
        """Reads the `display` table of a data set's manifest, in µm, nm and mm."""
        return cls(
            pitch_m=table["pitch_um"] * 1e-6,
            wavelengths_m=tuple(nm * 1e-9 for nm in table["wavelengths_nm"]),
            volume_depth_m=table["volume_depth_mm"] * 1e-3,
            corrected=corrected,
        )

    def z_m(self, depth):
        """Returns the z in metres of a normalized depth (0 nearest, 1 farthest)."""
        return self.volume_depth_m * (0.5 - depth)

    def stretches(self, trained):
        """Returns the factor for each colour that stretches depths of this display for a network of the display
        `trained`.

        s = (λ·V/p²) / (λ·V/p²)trained, and d' = ½ + s·(d − ½), because to the paraxial order a midpoint hologram
        without its carrier depends only on λ·z/p².
        """
        depth = self.volume_depth_m / trained.volume_depth_m * (trained.pitch_m / self.pitch_m) ** 2
        return [depth * mine / its for mine, its in zip(self.wavelengths_m, trained.wavelengths_m)]

    def reach_px(self, distance_m):
        """Returns the number of pixels that light of the longest wavelength spreads sideways over a distance."""
        sine = min(max(self.wavelengths_m) / (2 * self.pitch_m), 0.999)
        return math.ceil(abs(distance_m) * math.tan(math.asin(sine)) / self.pitch_m)


def stretched(depth, stretch):
    """Stretches normalized depths about the middle."""
    return depth if stretch == 1 else 0.5 + stretch * (depth - 0.5)


def fast_length(n):
    """Returns the least length >= n whose only prime factors are 2, 3 and 5."""
    while True:
        rest = n
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return n
        n += 1


@lru_cache(maxsize=64)
def _transfer(display, distance_m, height, width, device):
    x = torch.fft.fftfreq(width, display.pitch_m, dtype=torch.float64)
    y = torch.fft.fftfreq(height, display.pitch_m, dtype=torch.float64)
    f2 = (y[:, None] ** 2 + x[None, :] ** 2)[None]
    wavelength = torch.tensor(display.wavelengths_m, dtype=torch.float64)[:, None, None]
    under_root = 1 - wavelength**2 * f2
    phase = -2 * math.pi * distance_m * wavelength * f2 / (1 + under_root.clamp(min=0).sqrt())
    transfer = torch.polar((under_root > 0).double(), phase)
    return transfer.to(torch.complex64).to(device)


def transfer(display, distance_m, height, width, device="cpu"):
    """Returns the transfer function (3, height, width) in the order of `torch.fft.fft2`, without evanescent waves."""
    return _transfer(display, float(distance_m), height, width, torch.device(device))


def padded_shape(display, distance_m, height, width):
    """Returns the shape on which propagation by `distance_m` is a linear convolution for the cropped result."""
    reach = 2 * display.reach_px(distance_m)
    return fast_length(height + reach), fast_length(width + reach)


def propagate(field, distance_m, display):
    """Propagates the field by `distance_m` toward the viewer, with black surroundings. The shape stays the same."""
    height, width = field.shape[-2:]
    shape = padded_shape(display, distance_m, height, width)
    spectrum = torch.fft.fft2(field, s=shape)
    kernel = transfer(display, distance_m, *shape, field.device)
    return torch.fft.ifft2(spectrum * kernel)[..., :height, :width]

