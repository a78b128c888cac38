"""The networks: a plain chain of 3x3 convolutions with skips, and the field that its output represents.

Layers are counted from 0. Layer i is a convolution (3x3, stride 1, zero padding) and, except in the last layer, a ReLU.
For odd i >= 3 the input is input[i] = output[i-1] + input[i-2], so layers (1, 2), (3, 4), ... are residual pairs. The
last layer also reads the network's input, concatenated after the features.

Two heads convert the last layer's six channels to a field:

* ``amplitude-phase`` (the paper's): t = tanh(o); amplitude = (t[0:3] + 1)·√½, phase = π·t[3:6].
* ``real-imaginary``: real = base[0:3] + o[0:3], imaginary = base[3:6] + o[3:6], where the base is the front
  layer's image (imaginary part 0) or, for the pre-filter, its input field.

Inputs:

* ``rgbd``: 4 channels, R, G, B, depth, each minus 0.5.
* ``rgbdxy``: those of rgbd, then x and y over the frame from -0.5 to 0.5, for holograms that correct an aberration that
  varies over the frame.
* ``ldiN``, N from 2 to 9: 4·N channels, rgb0, depth0, rgb1, ..., each minus 0.5. A pixel without a hit has colour 0 and
  depth 1.
* ``seeded``: 10 channels, those of rgbd, then the field of the plane sweep in the layout of data.network_input. That
  field is the base.
* ``field``: 6 channels, the real parts of the three colours, then the imaginary parts, for a pre-filter of the deep
  double phase method.
* ``blurred-field``: the channels of field after the blur of AA-DPM. The network's correction is then small, and so is
  its rounding error.
* ``split-blurred-field``: 12 channels, the blurred field in two parts (see `split`), for int8.

A halved network runs at half the resolution: the four pixels of each 2x2 square become channels of one pixel, in the
order upper left, upper right, lower left, lower right; likewise the outputs. With the same number of layers it reaches
twice as far. Frames with odd sides repeat their last row or column.
"""

import math
from dataclasses import asdict, dataclass

import torch
from torch import nn
from torch.nn import functional as F

from .data import seed_of_input

HEADS = ("real-imaginary", "amplitude-phase")
LDI_COUNTS = tuple("23456789")  # the counts that the core supports; one layer is rgbd
SPLIT_STEP = 1 / 64  # of the first part of a split field
REMAINDER_GAIN = 16  # of the second part


@dataclass(frozen=True)
class Architecture:
    """The parameters that determine a network's graph."""

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
        if self.seeded and self.head != "real-imaginary":
            raise ValueError("a seeded network corrects its seed: its head is real-imaginary")
        if self.head not in HEADS:
            raise ValueError(f"the head is one of {', '.join(HEADS)}, not '{self.head}'")
        self.input_channels  # raises if the input is unknown

    @property
    def ldi_layers(self):
        """The number of layers of a layered depth image in the input: 1 for rgbd, rgbdxy and those with seeds."""
        if self.input in ("rgbd", "rgbdxy", "seeded"):
            return 1
        count = self.input.removeprefix("ldi")
        if self.input.startswith("ldi") and count in LDI_COUNTS:
            return int(count)
        raise ValueError(f"the input is rgbd, rgbdxy, seeded, ldi2 to ldi9, field, blurred-field or split-blurred-field, not '{self.input}'")

    @property
    def seeded(self):
        """Whether the network corrects the plane sweep's field."""
        return self.input == "seeded"

    @property
    def of_fields(self):
        """Whether the network is a pre-filter, whose input is a field."""
        return self.input in ("field", "blurred-field", "split-blurred-field")

    @property
    def input_channels(self):
        known = {"field": 6, "blurred-field": 6, "split-blurred-field": 12, "rgbdxy": 6, "seeded": 10}
        return known.get(self.input) or 4 * self.ldi_layers

    def channels(self, i):
        """Returns the (input, output) channels of layer i."""
        last = i == self.layers - 1
        pixels = 4 if self.halved else 1
        given = pixels * self.input_channels
        inputs = given if i == 0 else self.filters
        return inputs + (given if last else 0), 6 * pixels if last else self.filters

    @property
    def reach_px(self):
        """The reach of the receptive field, in pixels of the frame."""
        return self.layers * (2 if self.halved else 1)

    def has_skip(self, i):
        """Checks whether the input of layer i is output[i-1] + input[i-2]."""
        return i >= 3 and i % 2 == 1

    def as_dict(self):
        return asdict(self)


class Chain(nn.Module):
    """The chain. `forward` returns the six channels of the last layer (after tanh for `amplitude-phase`)."""

    def __init__(self, architecture):
        super().__init__()
        self.architecture = architecture
        self.convs = nn.ModuleList(
            nn.Conv2d(*architecture.channels(i), 3, padding=1) for i in range(architecture.layers)
        )
        self.reset()

    def reset(self):
        """Initialises the weights after He. Residual branches and the last layer start small, so that depth does not
        amplify."""
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
        """Converts the network's input to the form that the first and the last layer read."""
        if not self.architecture.halved:
            return x
        height, width = x.shape[-2:]
        return unshuffle(F.pad(x, (0, width % 2, 0, height % 2), mode="replicate"))

    def leaving(self, h, size):
        """Converts the output of the last layer to the network's output (N, 6, *size)."""
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
        """Returns the complex field (N, 3, H, W) of network inputs (N, C, H, W)."""
        return head_field(self.architecture, self(x), x)


@torch.no_grad()
def scale_output(chain, factor):
    """Multiplies the six channels of a Chain's last layer by a factor."""
    chain.convs[-1].weight *= factor
    chain.convs[-1].bias *= factor


def unshuffle(x):
    """Converts (N, C, 2·H, 2·W) to (N, 4·C, H, W): 2x2 squares, pixel by pixel (SpaceToDepth of ONNX)."""
    n, c, h, w = x.shape
    return x.reshape(n, c, h // 2, 2, w // 2, 2).permute(0, 3, 5, 1, 2, 4).reshape(n, 4 * c, h // 2, w // 2)


def shuffle(x):
    """Inverts `unshuffle` (DepthToSpace of ONNX, DCR)."""
    n, c, h, w = x.shape
    return x.reshape(n, 2, 2, c // 4, h, w).permute(0, 3, 4, 1, 5, 2).reshape(n, c // 4, 2 * h, 2 * w)


def split(x):
    """Splits a field's channels (N, 6, H, W) in two parts (N, 12, H, W): steps of 1/64, and 16 times the remainder.

    u8 activations hold the first part exactly and the second to 1/2048.
    """
    first = torch.round(x / SPLIT_STEP) * SPLIT_STEP
    return torch.cat([first, REMAINDER_GAIN * (x - first)], 1)


def head_field(architecture, output, x):
    """Converts the output (N, 6, H, W) for the input x to a complex field (N, 3, H, W)."""
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
    """Returns the multiply-accumulates of the whole chain per pixel, for all colours."""
    count = sum(9 * a * b for a, b in map(architecture.channels, range(architecture.layers)))
    return count // 4 if architecture.halved else count
