"""Differentiable encoding of a complex field as a phase-only hologram, and its reconstruction: Eq. 6 to 11.

Fields are complex64 (N, 3, H, W). Offsets are signed distances in metres from the midpoint hologram to the modulator's
plane (positive: toward the viewer).
"""

import math
from functools import lru_cache

import torch
from torch.nn import functional as F

from .losses import phase_per_metre
from .networks import head_field, split
from .optics import padded_shape, propagate, transfer

LARGEST = 1 - 1e-6  # bound of the normalized amplitude, so that the slope of acos stays finite
BLUR_SIGMA = 0.7  # pixels, of AA-DPM
LARGEST_COSINE = 0.999  # the same bound where the slope of a sine is needed
DARK_THRESHOLD = 0.4  # the core's default, a share of full light
CLIPPED = 1e-3  # share of amplitudes above full light, as in the core
LEAST_SCALE = 0.05  # as in the core
DARK = 1e-3  # fraction of the scale below which the gradient of the phase fades instead of growing without bound


def channels(field):
    """Returns a field as six real channels of a network: three real parts, then three imaginary parts."""
    return torch.cat([field.real, field.imag], 1)


def scale_of(field):
    """Returns the largest amplitude over all colours of each image, (N, 1, 1, 1), plus 1e-6."""
    return field.abs().amax((1, 2, 3), keepdim=True) + 1e-6


def phase_of(field, scale):
    """Returns the phase in (−π, π], with a gradient that fades where the field is dark."""
    phase = field.angle()
    power = field.detach().abs().square()
    weight = power / (power + (DARK * scale.detach()) ** 2)
    return phase.detach() + weight * (phase - phase.detach())


def double_phase(field, scale):
    """Returns the phase map φ ± acos(|u|/scale), + where x + y is even (Eq. 7); (N, 3, H, W), not wrapped."""
    height, width = field.shape[-2:]
    y = torch.arange(height, device=field.device)[:, None]
    x = torch.arange(width, device=field.device)
    sign = 1 - 2 * ((x + y) % 2)
    return phase_of(field, scale) + sign * torch.acos((field.abs() / scale).clamp(max=LARGEST))


def aperture(height, width, radius=1.0, device="cpu"):
    """Returns 1 inside the circle of `radius` times the Nyquist frequency, else 0 (Eq. 9); (height, width), in the
    order of fft2."""
    y = torch.fft.fftfreq(height, 0.5, dtype=torch.float64, device=device)
    x = torch.fft.fftfreq(width, 0.5, dtype=torch.float64, device=device)
    return (y[:, None] ** 2 + x**2 <= radius**2).float()


def reconstruct(phase, scale, offset_m, display, radius=1.0):
    """Returns the midpoint hologram that a phase map at the offset produces behind the aperture (Eq. 8 and 10).

    The modulator has unit amplitude, and its light has the amplitude `scale`. The factor 0.5 of Eq. 7 is left out,
    because the aperture's mean of neighbours is scale·cos(acos A), the encoded amplitude, without it. The surroundings
    are black, and the result is cropped.
    """
    height, width = phase.shape[-2:]
    shape = padded_shape(display, offset_m, height, width)
    field = scale * torch.polar(torch.ones_like(phase), phase)
    spectrum = torch.fft.fft2(field, s=shape) * aperture(*shape, radius, phase.device)
    return torch.fft.ifft2(spectrum * transfer(display, -offset_m, *shape, phase.device))[..., :height, :width]


class DeepDoublePhase(torch.nn.Module):
    """The chain of stage 2: hologram network, offset, pre-filter network, double phase, aperture, back."""

    def __init__(self, hologram, prefilter, offset_m, display, bf16=False):
        super().__init__()
        self.hologram, self.prefilter = hologram, prefilter
        self.offset_m, self.display, self.bf16 = offset_m, display, bf16

    def seen_by_prefilter(self, midpoint):
        """Returns the pre-filter's input (N, 6, H, W): the field at the modulator's plane, blurred if its kind
        requires."""
        there = propagate(midpoint, self.offset_m, self.display) if self.offset_m else midpoint
        kind = self.prefilter.architecture.input
        x = channels(there if kind == "field" else anti_alias(there))
        return split(x) if kind == "split-blurred-field" else x

    def filtered(self, midpoint):
        """Returns the pre-encoding field at the modulator's plane (Eq. 6). The carrier-free ASM includes the phase
        correction."""
        x = self.seen_by_prefilter(midpoint).contiguous(memory_format=torch.channels_last)
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.bf16):
            output = self.prefilter(x)
        return head_field(self.prefilter.architecture, output, x)

    def forward(self, x):
        """Returns (pre-encoding field at the modulator, post-encoding midpoint hologram) of network inputs."""
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.bf16):
            output = self.hologram(x)
        before = self.filtered(head_field(self.hologram.architecture, output, x))
        scale = scale_of(before)
        return before, reconstruct(double_phase(before, scale), scale, self.offset_m, self.display)


def phase_regulariser(field):
    """Returns the standard deviation plus |mean| of the pre-encoding phase, averaged over colours and images (Eq. 11).

    The sign of the mean is irrelevant, so its modulus is used.
    """
    phase = phase_of(field, scale_of(field)).flatten(2)
    mean = phase.mean(-1, keepdim=True)
    deviation = ((phase - mean).square().mean(-1) + 1e-12).sqrt()
    return (deviation + mean[..., 0].abs()).mean()


def wraps(phase):
    """Returns the fraction of values of a phase map outside (−π, π]. Each is a jump of 2π on the modulator."""
    return float(((phase > math.pi) | (phase <= -math.pi)).float().mean())


def blur_kernel(sigma=BLUR_SIGMA, width=3):
    """Returns a Gaussian of σ pixels over `width` taps a side, with sum 1. AA-DPM uses 3x3."""
    places = torch.arange(width) - width // 2
    weights = torch.exp(-places.square() / (2 * sigma**2))
    weights = weights / weights.sum()
    return weights[:, None] * weights


def anti_alias(field, sigma=BLUR_SIGMA, width=3):
    """Blurs the real and imaginary parts of a field (the filter of AA-DPM). Edges are repeated."""
    kernel = blur_kernel(sigma, width).to(field.device).expand(6, 1, width, width)
    blurred = F.conv2d(F.pad(channels(field), [width // 2] * 4, mode="replicate"), kernel, groups=6)
    return torch.complex(blurred[:, :3].contiguous(), blurred[:, 3:].contiguous())


def band_limit(field, k=1.0):
    """Keeps the frequencies with |tan(πfx)·tan(πfy)| ≤ k, f in cycles per pixel (the filter of BL-DPM, Sui et al.
    2021). The field is periodic."""
    height, width = field.shape[-2:]
    y, x = (torch.fft.fftfreq(n, dtype=torch.float64, device=field.device) for n in (height, width))
    stays = (math.pi * y).tan()[:, None] * (math.pi * x).tan()
    return torch.fft.ifft2(torch.fft.fft2(field) * (stays.abs() <= k))


def full_light(field):
    """Returns the amplitude that maps to full light (N, 1, 1, 1): the mean of the brightest values, about the 99.9th
    percentile that sessions take, at least LEAST_SCALE. Its gradient tells a network what bright points cost."""
    amplitudes = field.abs().flatten(1)
    brightest = amplitudes.topk(math.ceil(2 * CLIPPED * amplitudes.shape[1]), 1, sorted=False).values
    return brightest.mean(1).clamp(min=LEAST_SCALE)[:, None, None, None]


def centred(field):
    """Turns each colour of a field so that its mean phase is 0."""
    turn = field.detach().sum((-2, -1), keepdim=True).conj()
    return field * (turn / turn.abs().clamp(min=1e-9))


def darkened(field, scale, threshold=DARK_THRESHOLD):
    """Moves values below the share `threshold` of the scale toward the real axis (the core's dark threshold)."""
    amplitude = field.abs()
    weight = (amplitude / (threshold * scale)).clamp(max=1)
    return torch.complex(weight * field.real + (1 - weight) * amplitude, weight * field.imag)


@lru_cache(maxsize=8)
def local_filter(radius=1.0):
    """Returns the taps (7, 7) of the core's local correction: the aperture's circle, with the values 1 at frequency 0
    and 0 at that of the checkerboard."""
    y = (torch.arange(7) - 3).double()[:, None]
    x, square = y.T, (y**2 + y.T**2)
    rho = square.sqrt().clamp(min=1e-9)
    taps = torch.where(square > 0, radius * torch.special.bessel_j1(math.pi * radius * rho) / (2 * rho), math.pi * radius**2 / 4)
    sign = 1 - 2 * ((y + x) % 2)
    # [N 1; 1 N]·[even; odd] = [1 − sum; −turned] for N taps.
    count, missing, turned = taps.numel(), 1 - taps.sum(), (sign * taps).sum()
    even = (count * missing + turned) / (count**2 - 1)
    odd = (-count * turned - missing) / (count**2 - 1)
    return (taps + even + odd * sign).float()


def default_phasors(field, scale):
    """Returns the phasors (N, 3, H, W) that the default encoder displays for a field at the modulator: dark threshold,
    the blur of AA-DPM, double phase and one local step (core: encode/local.rs). Their gradient fades in darkness."""
    wanted = centred(field) / scale
    start = anti_alias(darkened(wanted, 1.0))
    amplitude = start.abs()
    cosine = amplitude.clamp(max=LARGEST_COSINE)
    height, width = field.shape[-2:]
    y, x = torch.arange(height, device=field.device)[:, None], torch.arange(width, device=field.device)
    sine = (1 - 2 * ((x + y) % 2)) * (1 - cosine.square()).sqrt()
    shown = start / (amplitude.square() + DARK**2).sqrt() * torch.complex(cosine, sine)
    taps = local_filter().to(field.device).expand(6, 1, 7, 7)
    change = F.conv2d(F.pad(channels(wanted - shown), [3] * 4, mode="reflect"), taps, groups=6)
    corrected = shown + torch.complex(change[:, :3].contiguous(), change[:, 3:].contiguous())
    return corrected / (corrected.abs().square() + DARK**2).sqrt()


def views(phasors, scale, depths, display):
    """Returns the amplitudes (N, P, 3, H, W) that phasors at the midpoint display behind the aperture at normalized
    depths of focus (N, P). The surroundings are black."""
    height, width = phasors.shape[-2:]
    shape = padded_shape(display, display.volume_depth_m / 2, height, width)
    spectrum = torch.fft.fft2(phasors, s=shape) * aperture(*shape, 1.0, phasors.device)
    phase = display.z_m(depths)[..., None, None, None] * phase_per_metre(display, *shape, phasors.device)
    there = spectrum[:, None] * torch.polar(torch.ones_like(phase, dtype=torch.float32), phase.float())
    seen = torch.fft.ifft2(there)[..., :height, :width]
    return scale[:, None] * (seen.real.square() + seen.imag.square() + 1e-8).sqrt()
