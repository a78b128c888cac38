"""Writes quantized networks as ONNX files in QDQ form. An integer engine may rely on exactly this graph.

The names are those of export.py. Each quantized tensor T of quantize.py has the constants `T.scale` (float32 scalar)
and `T.zero_point` (uint8 scalar) and the nodes `quantize_T` and `dequantize_T`. The nodes follow the order of the
layers:

    rgbd → [squares →] quantize_input → dequantize_input → conv_0 → relu_0 → quantize_relu_0 → dequantize_relu_0 → conv_1 → …

* Every `conv_i` reads three dequantized values: activations (uint8, per tensor); weights, `conv_i.weight` int8
  (O, I, 3, 3) by `dequantize_conv_i.weight` with `conv_i.weight.scale` (O,) and `conv_i.weight.zero_point` (O,) all 0,
  axis 0; bias, `conv_i.bias` int32 (O,) by `dequantize_conv_i.bias` with `conv_i.bias.scale` (O,) =
  s_activation · s_weight[c], no zero point, axis 0.
* A skip, odd i >= 3: add_i(dequantize_relu_{i-1}, dequantized input of layer i-2) → quantize_add_i → dequantize_add_i →
  conv_i. Zero points of relu_i and add_i are 0.
* The last layer l: its features (add_l if it has a skip, else relu_{l-1}) → quantize_features → dequantize_features;
  the source of quantize_input → quantize_skip → dequantize_skip; concat_l of both, in this order, on axis 1 →
  quantize_concat_l → dequantize_concat_l → conv_l → [pixels →] [tanh →] field, float. All three pairs use
  `concat.scale` and `concat.zero_point`, so the pair after concat_l changes nothing.
* A convolution pads with the value 0, which is the zero point of its input (not 0 for conv_0 and conv_l).
"""

import numpy as np
from onnx import helper, numpy_helper

from .export import build, conv_node, entering, leaving, metadata
from .quantize import tensors


def int8_model(quantized, display, offset_m=0.0, seed_planes=None):
    """Returns the QDQ model of a Quantized network."""
    a = quantized.architecture
    last = a.layers - 1
    given, nodes = entering(a)
    constants = []

    def constant(name, value):
        constants.append(numpy_helper.from_array(np.asarray(value, order="C"), name))

    for name in tensors(a):
        scale, zero = quantized.parameters_of(name)
        constant(f"{name}.scale", np.float32(scale))
        constant(f"{name}.zero_point", np.uint8(zero))

    def rounded(source, name, parameters):
        """Quantizes and dequantizes a value as tensor `name`. Returns the name of the dequantized value."""
        scale = [f"{parameters}.scale", f"{parameters}.zero_point"]
        nodes.append(helper.make_node("QuantizeLinear", [source, *scale], [f"{name}_u8"], f"quantize_{name}"))
        nodes.append(helper.make_node("DequantizeLinear", [f"{name}_u8", *scale], [f"{name}_dq"], f"dequantize_{name}"))
        return f"{name}_dq"

    def layer(i, source, parameters, output):
        conv = quantized.chain.convs[i]
        unit = quantized.parameters_of(parameters)[0]
        scale = quantized.scale(i, parameters)
        weight = (conv.weight.detach() / scale[:, None, None, None]).round().clamp(-127, 127)
        bias = (conv.bias.detach() / (scale * unit)).round()
        name = f"conv_{i}"
        constant(f"{name}.weight", weight.cpu().numpy().astype(np.int8))
        constant(f"{name}.weight.scale", scale.cpu().numpy())
        constant(f"{name}.weight.zero_point", np.zeros(len(scale), np.int8))
        constant(f"{name}.bias", bias.cpu().numpy().astype(np.int32))
        constant(f"{name}.bias.scale", (scale * unit).cpu().numpy())
        parts = []
        for part, suffixes in (("weight", ("", ".scale", ".zero_point")), ("bias", ("", ".scale"))):
            full = f"{name}.{part}"
            nodes.append(helper.make_node("DequantizeLinear", [full + s for s in suffixes], [f"{full}_dq"], f"dequantize_{full}", axis=0))
            parts.append(f"{full}_dq")
        nodes.append(conv_node(i, [source, *parts], output))

    h, parameters, inputs = rounded(given, "input", "input"), "input", []
    for i in range(last):
        if a.has_skip(i):
            nodes.append(helper.make_node("Add", [h, inputs[i - 2]], [f"add_{i}_out"], f"add_{i}"))
            h, parameters = rounded(f"add_{i}_out", f"add_{i}", f"add_{i}"), f"add_{i}"
        inputs.append(h)
        layer(i, h, parameters, f"conv_{i}_out")
        nodes.append(helper.make_node("Relu", [f"conv_{i}_out"], [f"relu_{i}_out"], f"relu_{i}"))
        h = f"relu_{i}_out"
        if i < last - 1 or a.has_skip(last):
            h, parameters = rounded(h, f"relu_{i}", f"relu_{i}"), f"relu_{i}"
    if a.has_skip(last):
        nodes.append(helper.make_node("Add", [h, inputs[last - 2]], [f"add_{last}_out"], f"add_{last}"))
        h = f"add_{last}_out"
    parts = [rounded(h, "features", "concat"), rounded(given, "skip", "concat")]
    nodes.append(helper.make_node("Concat", parts, [f"concat_{last}_out"], f"concat_{last}", axis=1))
    h = rounded(f"concat_{last}_out", f"concat_{last}", "concat")
    out, behind = leaving(a)
    layer(last, h, "concat", out)
    nodes += behind
    return build(a, nodes, constants, metadata(a, display, offset_m, seed_planes))
