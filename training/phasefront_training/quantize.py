"""int8 networks: the quantization scheme, calibration, and a Chain that quantizes in its forward pass (for evaluation
and QAT).

Weights are int8 and symmetric with one scale for each output channel: scale = max|w| / 127. Biases are int32 with the
scale s_input · s_weight[c]. Activations are u8 with one scale and zero point for each tensor, from ranges chosen on
training scenes (`calibrate`):

* outputs of a ReLU and sums of two of them: zero point 0, scale = max / 255;
* the network's input, and the input of the last convolution (features and the network's input, concatenated):
  scale = (max − min) / 254, zero point = round(−min / scale), so that 0 is exact.

Each tensor that a convolution or a skip reads is quantized once: `input`; `relu_i`, the output of layer i; `add_i`, the
sum of the dequantized terms before layer i, rounded again; and `concat`, the common scale and zero point of the last
layer's input. The features are quantized to it directly, without a scale of their own, and the network's input a second
time. The last convolution's output is float. Rounding is half to even.

Features and the network's input share that scale, and their weights in a filter of the last layer share another, so
both must have a similar size, as must the channels of each tensor: prepare.py scales them. The last step rounds the
weights in order (rounding.py).
"""

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from .data import network_input
from .evaluate import evaluate, scene_as_seen, torch_predictor
from .evaluate_encoding import DEEP, encoding_figures
from .natural import Natural, figures
from .networks import SPLIT_STEP
from .stage1 import Stage1
from .stage2 import Stage2

ALLOWED_LOSS_DB = 0.1  # the largest loss without quantization-aware training
CALIBRATION_SCENES = 16
BINS = 4096  # of a tensor's histogram, for choosing its range
CLIPPED = [1 - 0.05 * k for k in range(17)]  # candidate ends of ranges, as fractions of the maximum
SILENT = 1.0  # range of a tensor that is 0 everywhere; a finer one gives the layer before it unbounded scales


def tensors(architecture):
    """Returns the names of the quantized tensors, in the order of the graph."""
    last = architecture.layers - 1
    names = ["input"]
    for i in range(last):
        if architecture.has_skip(i):
            names.append(f"add_{i}")
        if i < last - 1 or architecture.has_skip(last):
            names.append(f"relu_{i}")
    return [*names, "concat"]


def quantizer(name, low, high):
    """Returns (scale, zero point) of the tensor `name` with values from low to high. The scale is a float32 value."""
    if name in ("input", "concat"):
        low, high = min(low, 0.0), max(high, 0.0)
        scale = float(np.float32((high - low if high > low else SILENT) / 254))
        return scale, round(-low / scale)
    return float(np.float32((high if high > 0 else SILENT) / 255)), 0


def weight_scale(weight, bias, input_scale):
    """Returns scales (O,) of a layer's weights (O, I, 3, 3). An empty channel gets a scale that fits its bias."""
    largest = weight.detach().abs().amax((1, 2, 3)) / 127
    return torch.maximum(largest, bias.detach().abs() / (input_scale * 2**30)).clamp(min=1e-12)


def _through(exact, rounded):
    """Returns the rounded value with the gradient of the exact value."""
    return exact + (rounded - exact).detach()


class Quantized(nn.Module):
    """A Chain whose forward pass rounds weights and activations like its int8 file.

    ranges: {tensor: (min, max)} for the names of `tensors`. scales: {layer: (O,)} of layers with fixed weight scales
    (rounding.py). The scales of other layers follow from their weights.
    """

    def __init__(self, chain, ranges):
        super().__init__()
        self.chain = chain
        self.architecture = chain.architecture
        self.ranges = {name: tuple(map(float, ranges[name])) for name in tensors(self.architecture)}
        self.scales = {}

    def parameters_of(self, name):
        return quantizer(name, *self.ranges[name])

    def activation(self, name, x):
        return torch.fake_quantize_per_tensor_affine(x, *self.parameters_of(name), 0, 255)

    def scale(self, i, input_name):
        """Returns scales (O,) of the weights of layer i, which reads the tensor `input_name`."""
        if i in self.scales:
            return self.scales[i]
        conv = self.chain.convs[i]
        return weight_scale(conv.weight, conv.bias, self.parameters_of(input_name)[0])

    def layer(self, i, input_name):
        """Returns the rounded (weight, bias) of layer i."""
        conv = self.chain.convs[i]
        scale = self.scale(i, input_name)
        wide = scale[:, None, None, None]
        weight = _through(conv.weight, torch.round(conv.weight / wide).clamp(-127, 127) * wide)
        unit = scale * self.parameters_of(input_name)[0]
        return weight, _through(conv.bias, torch.round(conv.bias / unit) * unit)

    def forward(self, x):
        with torch.autocast(x.device.type, enabled=False):  # bf16 is coarser than the steps
            return self._rounded(x.float())

    def _rounded(self, x):
        walk = self.walk(x)
        i, h, name = next(walk)
        while True:
            try:
                i, h, name = walk.send(F.conv2d(h, *self.layer(i, name), padding=1))
            except StopIteration as end:
                return end.value

    def walk(self, x):
        """Yields the number, input and input tensor's name of each layer, receives the layer's output by `send`, and
        returns the network's output."""
        a = self.architecture
        last = a.layers - 1
        inputs, name, size = [], "input", x.shape[-2:]
        x = self.chain.entering(x)
        h = self.activation(name, x)
        for i in range(a.layers):
            if a.has_skip(i):
                name = f"add_{i}" if i < last else "concat"
                h = self.activation(name, h + inputs[i - 2])
            inputs.append(h)
            if i == last:
                h, name = torch.cat([h, self.activation("concat", x)], 1), "concat"
            h = yield i, h, name
            if i < last:
                name = f"relu_{i}" if i < last - 1 or a.has_skip(last) else "concat"
                h = self.activation(name, F.relu(h))
        return self.chain.leaving(h, size)


def activations(chain, x):
    """Yields each name of `tensors` with its exact values, for a network input (1, C, H, W)."""
    x = chain.entering(x)
    a = chain.architecture
    last = a.layers - 1
    yield "input", x
    inputs, h = [], x
    for i, conv in enumerate(chain.convs[:-1]):
        if a.has_skip(i):
            h = h + inputs[i - 2]
            yield f"add_{i}", h
        inputs.append(h)
        h = F.relu(conv(h))
        if i < last - 1 or a.has_skip(last):
            yield f"relu_{i}", h
    yield "concat", h + inputs[last - 2] if a.has_skip(last) else h
    yield "concat", x


@torch.no_grad()
def calibrate(chain, examples):
    """Returns {tensor: (min, max)} of a Chain over a list of inputs (C, H, W): the range with the least error of
    rounding and clipping, because finer steps for all pixels matter more than a few bright pixels."""
    ranges = extremes(chain, examples)
    # Never clips the image: its range is symmetric about 0, and no end is below it.
    counts = {name: 0 for name, (low, high) in ranges.items() if name != "input" and high > -low}
    for x in examples:
        for name, values in activations(chain, x[None]):
            if name in counts:
                low, high = ranges[name]
                # A few values may lie outside a range that was fixed beforehand.
                at = (values.clamp(low, high) - low) * ((BINS - 1) / (high - low))
                counts[name] += torch.bincount(at.round().long().flatten(), minlength=BINS)
    for name, seen in counts.items():
        low, high = ranges[name]
        ends = [max(end * high, -low) for end in CLIPPED]
        ranges[name] = low, min(ends, key=lambda end: rounding_error(name, low, high, end, seen))
    return ranges


@torch.no_grad()
def extremes(chain, examples):
    """Returns {tensor: (min, max)} over inputs. Colours, depths and seeds have their whole possible range, and a split
    field the range whose steps match its own."""
    ranges = {}
    for x in examples:
        for name, values in activations(chain, x[None]):
            low, high = ranges.get(name, (0.0, 0.0))
            ranges[name] = min(low, float(values.min())), max(high, float(values.max()))
    if chain.architecture.input == "split-blurred-field":
        ranges["input"] = ranges["concat"] = -127 * SPLIT_STEP, 127 * SPLIT_STEP
    elif not chain.architecture.of_fields:
        ranges["input"] = (-0.5, 0.5)
        ranges["concat"] = min(ranges["concat"][0], -0.5), max(ranges["concat"][1], 0.5)
    return ranges


def rounding_error(name, low, high, end, counts):
    """Returns the summed square error of a tensor's values, counted in `BINS` bins from low to high, for a range from
    low to end."""
    values = torch.linspace(low, high, BINS)
    rounded = torch.fake_quantize_per_tensor_affine(values, *quantizer(name, low, end), 0, 255)
    return float((counts * (rounded - values).double().square()).sum())


def examples(scenes, kind):
    """Yields inputs of networks of this kind on scenes spread over the whole set, for calibration."""
    count = min(len(scenes), CALIBRATION_SCENES)
    for i in range(count):
        colour, depth, seed, _ = scene_as_seen(scenes, i * len(scenes) // count, "clean")
        yield network_input(colour, depth, kind, seed)


class QuantizationAware(Stage1):
    """Stage 1 with rounding in the forward pass. Ranges stay as calibrated, and dead units are not revived."""

    kind = "qat"

    def __init__(self, network, *args, **options):
        super().__init__(network, *args, bf16=False, **options)
        self.networks = {"hologram": network.chain}

    def revive(self, step, progress):
        return 0

    def extra(self):
        return super().extra() | {"ranges": self.network.ranges}


class NaturalQuantizationAware(QuantizationAware, Natural):
    """Training for natural focus with rounding in the forward pass."""


class PrefilterQuantizationAware(Stage2):
    """Stage 2 with rounding in the forward pass of the pre-filter alone. Its ranges stay as calibrated."""

    kind = "qat"

    def __init__(self, model, *args, **options):
        model.hologram.requires_grad_(False)
        super().__init__(model, *args, **options)
        self.networks = {"hologram": model.hologram, "prefilter": model.prefilter.chain}

    def extra(self):
        return super().extra() | {"ranges": self.model.prefilter.ranges}


def prefilter_examples(model, scenes):
    """Yields inputs of a DeepDoublePhase's pre-filter, for calibration."""
    for x in examples(scenes, model.hologram.architecture.input):
        yield model.seen_by_prefilter(model.hologram.field(x[None]))[0]


def figure(network, scenes):
    """Returns the amplitude PSNR of a Chain or a Quantized network on scenes."""
    return evaluate(torch_predictor(network), scenes, full=False)["amplitude_psnr"]


def natural_figure(network, scenes):
    """Returns the amplitude PSNR of what the default encoder displays of a network's fields, against the stacks of
    scenes."""
    return figures(torch_predictor(network), scenes)["psnr"]


def encoded_figure(model, scenes):
    """Returns the amplitude PSNR of the displayed images of a DeepDoublePhase on scenes."""
    return encoding_figures(model, scenes, full=False, others=False)[DEEP]["amplitude_psnr"]
