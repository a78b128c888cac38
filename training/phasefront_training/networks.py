"""The networks: a plain chain of 3x3 convolutions with skips, and what its output means.

Layers are counted from 0. Layer i is a convolution (3x3, stride 1, zero padding) and, but for the last,
a ReLU. For odd i >= 3 the input is input[i] = output[i-1] + input[i-2], so layers (1, 2), (3, 4), ... are
residual pairs. The last layer also reads the network's input, concatenated behind the features.

Two heads turn the last layer's six channels into a field :

* ``amplitude-phase`` (the paper's): t = tanh(o); amplitude = (t[0:3] + 1)·√½, phase = π·t[3:6].
* ``real-imaginary``: real = base[0:3] + o[0:3], imaginary = base[3:6] + o[3:6], where the base is the front
  layer's image (imaginary part 0) or, for the pre-filter, the field that came in.

Inputs: ``rgbd`` (4 channels: R, G, B, depth, each minus 0.5), ``rgbdxy`` (the same, then x and y over the frame from
-0.5 to 0.5, for holograms that correct an aberration which differs over the frame), ``ldiN`` (N from 2 to 9; 4·N channels: rgb0,
depth0, rgb1, ..., each minus 0.5; a pixel without a hit has colour 0 and depth 1), ``seeded`` (10 channels: those of
rgbd, then the plane sweep's field as data.network_input lays it; the field is the base), ``field`` (6 channels: the
real parts of the three colours, then the imaginary ones; a pre-filter of the deep double phase method),
``blurred-field`` (the same of a field that AA-DPM's blur has gone over: what is left for the network is small, so that
its rounding is too) and ``split-blurred-field`` (12 channels: the same in two parts, see `split`, for int8).

A halved network runs at half the resolution: the four pixels of a square of two by two are channels of one, those of the
upper left first, then upper right, lower left, lower right; so are the outputs. It sees twice as far for as many layers.
Frames with odd sides repeat their last row or column.
"""

import math
from dataclasses import asdict, dataclass

import torch
from torch import nn
from torch.nn import functional as F

from .data import seed_of_input

HEADS = ("real-imaginary", "amplitude-phase")
LDI_COUNTS = tuple("23456789")  # as the core takes them; of one layer it is rgbd
SPLIT_STEP = 1 / 64  # of the first part of a split field
REMAINDER_GAIN = 16  # of the second


@dataclass(frozen=True)
class Architecture:
    """Everything that fixes a network's graph."""

    layers: int
    filters: int = 24
    input: str = "rgbd"
    head: str = "real-imaginary"
    halved: bool = False

    def __post_init__(self):
        if self.layers < 3:
            raise ValueError(f"a network has at least 3 layers, not {self.layers}")
        if self.filters < 1:
            raise ValueError(f"a network has at least 1 filter, not {self.filters}")
        if self.input == "seeded" and self.head != "real-imaginary":
            raise ValueError("a seeded network corrects its seed: its head is real-imaginary")
        if self.head not in HEADS:
            raise ValueError(f"the head is one of {', '.join(HEADS)}, not '{self.head}'")
        self.input_channels  # raises where the input is unknown

    @property
    def ldi_layers(self):
        """How many layers of a layered depth image the input takes; rgbd, rgbdxy and seeded take one."""
        if self.input in ("rgbd", "rgbdxy", "seeded"):
            return 1
        count = self.input.removeprefix("ldi")
        if self.input.startswith("ldi") and count in LDI_COUNTS:
            return int(count)
        raise ValueError(f"the input is rgbd, rgbdxy, seeded, ldi2 to ldi9, field, blurred-field or split-blurred-field, not '{self.input}'")

    @property
    def of_fields(self):
        """Whether it is a pre-filter: what it takes is a field."""
        return self.input in ("field", "blurred-field", "split-blurred-field")

    @property
    def input_channels(self):
        known = {"field": 6, "blurred-field": 6, "split-blurred-field": 12, "rgbdxy": 6, "seeded": 10}
        return known.get(self.input) or 4 * self.ldi_layers

    def channels(self, i):
        """(input, output) channels of layer i."""
        last = i == self.layers - 1
        pixels = 4 if self.halved else 1
        given = pixels * self.input_channels
        inputs = given if i == 0 else self.filters
        return inputs + (given if last else 0), 6 * pixels if last else self.filters

    @property
    def reach_px(self):
        """How far it sees, in pixels of the frame."""
        return self.layers * (2 if self.halved else 1)

    def has_skip(self, i):
        """Whether the input of layer i is output[i-1] + input[i-2]."""
        return i >= 3 and i % 2 == 1

    def as_dict(self):
        return asdict(self)


class Chain(nn.Module):
    """The chain; `forward` gives the six channels of the last layer (after tanh for `amplitude-phase`)."""

    def __init__(self, architecture):
        super().__init__()
        self.architecture = architecture
        self.convs = nn.ModuleList(
            nn.Conv2d(*architecture.channels(i), 3, padding=1) for i in range(architecture.layers)
        )
        self.reset()

    def reset(self):
        """He initialisation; residual branches and the last layer begin small, so that depth does not amplify."""
        layers = self.architecture.layers
        with torch.no_grad():
            for i, conv in enumerate(self.convs):
                nn.init.kaiming_normal_(conv.weight, nonlinearity="relu")
                nn.init.zeros_(conv.bias)
                if i % 2 == 0 and 2 <= i < layers - 1:
                    conv.weight *= math.sqrt(2 / layers)
            self.convs[-1].weight *= 0.1

    def forward(self, x):
        return self.leaving(self._chain(self.entering(x)).float(), x.shape[-2:])

    def entering(self, x):
        """What the first layer and the last one read of the network's input."""
        if not self.architecture.halved:
            return x
        height, width = x.shape[-2:]
        return unshuffle(F.pad(x, (0, width % 2, 0, height % 2), mode="replicate"))

    def leaving(self, h, size):
        """The network's output (N, 6, *size) of what the last layer gives."""
        if self.architecture.halved:
            h = shuffle(h)[..., : size[0], : size[1]]
        return torch.tanh(h) if self.architecture.head == "amplitude-phase" else h

    def _chain(self, x):
        last = self.architecture.layers - 1
        inputs, h = [], x
        for i, conv in enumerate(self.convs):
            if self.architecture.has_skip(i):
                h = h + inputs[i - 2]
            inputs.append(h)
            if i == last:
                h = torch.cat([h, x.to(h.dtype)], 1)
            h = conv(h)
            if i < last:
                h = F.relu(h)
        return h

    def field(self, x):
        """The complex field (N, 3, H, W) for network inputs (N, C, H, W)."""
        return head_field(self.architecture, self(x), x)


def unshuffle(x):
    """(N, C, 2·H, 2·W) as (N, 4·C, H, W): squares of two by two pixels, pixel by pixel (ONNX's SpaceToDepth)."""
    n, c, h, w = x.shape
    return x.reshape(n, c, h // 2, 2, w // 2, 2).permute(0, 3, 5, 1, 2, 4).reshape(n, 4 * c, h // 2, w // 2)


def shuffle(x):
    """The inverse of `unshuffle` (ONNX's DepthToSpace, DCR)."""
    n, c, h, w = x.shape
    return x.reshape(n, 2, 2, c // 4, h, w).permute(0, 3, 4, 1, 5, 2).reshape(n, c // 4, 2 * h, 2 * w)


def split(x):
    """A field's channels (N, 6, H, W) in two parts (N, 12, H, W): in steps of 1/64, and what is left, 16 times.

    u8 activations hold the first exactly and the second to 1/2048.
    """
    first = torch.round(x / SPLIT_STEP) * SPLIT_STEP
    return torch.cat([first, REMAINDER_GAIN * (x - first)], 1)


def head_field(architecture, output, x):
    """The complex field (N, 3, H, W) that the output (N, 6, H, W) means for the input x."""
    output = output.float()
    if architecture.head == "amplitude-phase":
        amplitude = (output[:, :3] + 1) * math.sqrt(0.5)
        return torch.polar(amplitude, math.pi * output[:, 3:])
    base = x.float()
    if architecture.input == "seeded":
        real, imaginary = seed_of_input(base)
        return torch.complex(real + output[:, :3], imaginary + output[:, 3:])
    if architecture.of_fields:
        field = base[:, :6]
        if architecture.input == "split-blurred-field":
            field = field + base[:, 6:] / REMAINDER_GAIN
        return torch.complex(field[:, :3] + output[:, :3], field[:, 3:] + output[:, 3:])
    return torch.complex(base[:, :3] + 0.5 + output[:, :3], output[:, 3:].contiguous())


def multiplies_per_pixel(architecture):
    """Multiply-accumulates per pixel of the whole chain."""
    count = sum(9 * a * b for a, b in map(architecture.channels, range(architecture.layers)))
    return count // 4 if architecture.halved else count
