"""Writes networks as ONNX files and reads them.

The graph is written node by node, so that its names are stable and the same network always gives the same bytes. The
input is `rgbd` (1, 4, H, W) (`ldi` or `field` for the other kinds). The nodes are `conv_0`, `relu_0`, …, `add_3` before
each layer that has a skip, `concat_L` before the last convolution, and `tanh` after it for the amplitude-phase head.
The output `field` (1, 6, H, W) (`filtered` if the input is `field`) has the six channels of the last layer in the order
of networks.py. H and W are dynamic.

The graph of a halved network begins with the node `squares` (SpaceToDepth), whose output `squares_out` the first and
the last layer read, and `pixels` (DepthToSpace) follows the last convolution. It takes even H and W.

`metadata_props` describes the network, with keys `phasefront.*`; for a seeded network also the number of planes of its
seed. export_int8.py writes the int8 form.
"""

import os
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

from .files import replacing
from .networks import Architecture, Chain
from .optics import Display

OPSET = 17
IR_VERSION = 8


class ExportError(Exception):
    """An .onnx file is not a network of this package. The message names the missing part."""


def input_name(architecture):
    """Returns the name of the graph's input."""
    return "ldi" if architecture.input.startswith("ldi") else architecture.input


def output_name(architecture):
    """Returns the name of the graph's output, which must differ from that of the input."""
    return "filtered" if architecture.of_fields else "field"


def metadata(architecture, display, offset_m=0.0, seed_planes=None):
    """Returns the key-value pairs that describe a network, its display and the seed that it was trained for."""
    found = {
        "phasefront.input": architecture.input,
        "phasefront.head": architecture.head,
        "phasefront.pitch_um": _number(display.pitch_m * 1e6),
        "phasefront.wavelengths_nm": ",".join(_number(w * 1e9) for w in display.wavelengths_m),
        "phasefront.volume_depth_mm": _number(display.volume_depth_m * 1e3),
        "phasefront.offset_mm": _number(offset_m * 1e3),
    }
    found |= {"phasefront.corrected": "true"} if display.corrected else {}
    return found | ({"phasefront.seed_planes": str(seed_planes)} if architecture.seeded and seed_planes else {})


def _number(value):
    return f"{value:.9g}"


def build(architecture, nodes, initializers, properties):
    """Builds and checks a model of the nodes from the network's input to its output."""
    shape = [1, architecture.input_channels, "H", "W"]
    graph = helper.make_graph(
        nodes,
        "phasefront",
        [helper.make_tensor_value_info(input_name(architecture), TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info(output_name(architecture), TensorProto.FLOAT, [1, 6, "H", "W"])],
        initializers,
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION, producer_name="phasefront-training"
    )
    helper.set_model_props(model, properties)
    onnx.checker.check_model(model, full_check=True)
    return model


def entering(architecture):
    """Returns the name of the tensor that the first and the last layer read, and the nodes before it."""
    given = input_name(architecture)
    if not architecture.halved:
        return given, []
    return "squares_out", [helper.make_node("SpaceToDepth", [given], ["squares_out"], "squares", blocksize=2)]


def leaving(architecture):
    """Returns the name of the last convolution's output, and the nodes after it."""
    conv = f"conv_{architecture.layers - 1}_out"
    tanh = architecture.head == "amplitude-phase"
    pixels = "pixels_out" if tanh else output_name(architecture)
    nodes = []
    if architecture.halved:
        nodes.append(helper.make_node("DepthToSpace", [conv], [pixels], "pixels", blocksize=2, mode="DCR"))
    if tanh:
        nodes.append(helper.make_node("Tanh", [pixels if nodes else conv], [output_name(architecture)], "tanh"))
    return (conv, nodes) if nodes else (output_name(architecture), [])


def conv_node(i, inputs, output):
    """Returns the convolution node of layer i."""
    return helper.make_node("Conv", inputs, [output], f"conv_{i}", kernel_shape=[3, 3], pads=[1, 1, 1, 1], strides=[1, 1])


def float_model(network, display, offset_m=0.0, seed_planes=None):
    """Returns the float32 model of a Chain."""
    a = network.architecture
    given, nodes = entering(a)
    initializers, inputs = [], []
    h = given
    for i, conv in enumerate(network.convs):
        if a.has_skip(i):
            nodes.append(helper.make_node("Add", [h, inputs[i - 2]], [f"add_{i}_out"], f"add_{i}"))
            h = f"add_{i}_out"
        inputs.append(h)
        last = i == a.layers - 1
        if last:
            nodes.append(helper.make_node("Concat", [h, given], [f"concat_{i}_out"], f"concat_{i}", axis=1))
            h = f"concat_{i}_out"
        for part in ("weight", "bias"):
            values = getattr(conv, part).detach().cpu().float().contiguous().numpy()
            initializers.append(numpy_helper.from_array(values, f"conv_{i}.{part}"))
        out, behind = leaving(a) if last else (f"conv_{i}_out", [])
        nodes += [conv_node(i, [h, f"conv_{i}.weight", f"conv_{i}.bias"], out), *behind]
        if not last:
            nodes.append(helper.make_node("Relu", [out], [f"relu_{i}_out"], f"relu_{i}"))
            h = f"relu_{i}_out"
    return build(a, nodes, initializers, metadata(a, display, offset_m, seed_planes))


def write(model, path):
    """Writes a model. The same model always gives the same bytes."""
    with replacing(path) as temporary:
        Path(temporary).write_bytes(model.SerializeToString(deterministic=True))


def load_model(path):
    try:
        return onnx.load(os.fspath(path))
    except FileNotFoundError:
        raise ExportError(f"{path}: not there") from None
    except Exception as error:  # protobuf raises its own exceptions for a damaged file
        raise ExportError(f"{path}: no readable ONNX file ({str(error).splitlines()[0]})") from None


def read_description(path):
    """Returns {'input', 'head', 'pitch_um', …} from a model's metadata_props."""
    return _description(load_model(path), path)


def _description(model, path):
    properties = {p.key: p.value for p in model.metadata_props}
    found = {k.removeprefix("phasefront."): v for k, v in properties.items() if k.startswith("phasefront.")}
    missing = [k for k in ("input", "head", "pitch_um", "wavelengths_nm", "volume_depth_mm", "offset_mm") if k not in found]
    if missing:
        raise ExportError(f"{path}: metadata has no {', '.join('phasefront.' + k for k in missing)}")
    return found


def read_display(path):
    """Returns the Display that a model was trained for."""
    return _display(read_description(path))


def _display(found):
    return Display(
        pitch_m=float(found["pitch_um"]) * 1e-6,
        wavelengths_m=tuple(float(w) * 1e-9 for w in found["wavelengths_nm"].split(",")),
        volume_depth_m=float(found["volume_depth_mm"]) * 1e-3,
        corrected=found.get("corrected") == "true",
    )


def read_onnx(path):
    """Returns (Chain, Display) of a float32 file of this package, to resume training from."""
    model = load_model(path)
    found = _description(model, path)
    weights = {t.name: numpy_helper.to_array(t) for t in model.graph.initializer}
    layers = sum(node.op_type == "Conv" for node in model.graph.node)
    if f"conv_{layers - 1}.weight" not in weights or weights["conv_0.weight"].dtype != np.float32:
        raise ExportError(f"{path}: weights are not float32 constants conv_i.weight; take the float32 file, not the int8 one")
    halved = any(node.op_type == "SpaceToDepth" for node in model.graph.node)
    architecture = Architecture(layers, weights["conv_0.weight"].shape[0], found["input"], found["head"], halved)
    network = Chain(architecture)
    try:
        network.load_state_dict({f"convs.{n[5:]}": torch.from_numpy(w.copy()) for n, w in weights.items()})
    except RuntimeError as error:
        raise ExportError(f"{path}: the weights are not those of a chain ({str(error).splitlines()[-1].strip()})") from None
    return network, _display(found)
