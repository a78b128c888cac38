import numpy as np
import onnx
import pytest
import torch

from phasefront_training.__main__ import main
from phasefront_training.checkpoint import load_network
from phasefront_training.data import Manifest, Scenes
from phasefront_training.evaluate import evaluate, onnx_predictor, onnx_session, torch_predictor
from phasefront_training.export import write
from phasefront_training.export_int8 import int8_model
from phasefront_training.networks import Architecture, Chain
from phasefront_training.optics import Display
from phasefront_training.quantize import Quantized, calibrate, extremes, tensors

CASES = [Architecture(8), Architecture(5, 8), Architecture(4, 8, head="amplitude-phase"), Architecture(6, 8, "ldi2"), Architecture(8, 8, "field"), Architecture(8, 8, halved=True)]


def network(architecture):
    chain = Chain(architecture)
    for conv in chain.convs:
        torch.nn.init.normal_(conv.bias, std=0.1)
    with torch.no_grad():
        chain.convs[-1].weight *= 5
    return chain


@pytest.mark.parametrize("architecture", CASES, ids=str)
def test_the_int8_file_is_the_rounded_network(architecture, tmp_path):
    chain = network(architecture)
    seen = torch.rand(3, architecture.input_channels, 24, 24) - 0.5
    quantized = Quantized(chain, calibrate(chain, seen))
    path = tmp_path / "n.onnx"
    write(int8_model(quantized, Display()), path)
    session = onnx_session(path)
    x = torch.rand(1, architecture.input_channels, 22, 34) - 0.5
    with torch.no_grad():
        ours, exact = quantized(x).numpy(), chain(x).numpy()
    theirs = session.run(None, {session.get_inputs()[0].name: x.numpy()})[0]
    rms = lambda e: np.sqrt((e**2).mean())
    # Float sums may round a tie to the other side, so the values are equal except for a few last digits.
    assert rms(theirs - ours) < 0.1 * rms(ours - exact) + 1e-6
    assert 0 < rms(ours - exact) < 0.05 * rms(exact)
    write(int8_model(quantized, Display()), tmp_path / "again.onnx")
    assert path.read_bytes() == (tmp_path / "again.onnx").read_bytes()


@pytest.mark.parametrize("layers", [8, 5])
def test_the_graph_is_as_documented(layers):
    chain = network(Architecture(layers, 8))
    model = int8_model(Quantized(chain, calibrate(chain, torch.rand(1, 4, 16, 16) - 0.5)), Display())
    producers = {out: node for node in model.graph.node for out in node.output}
    constants = {c.name: onnx.numpy_helper.to_array(c) for c in model.graph.initializer}
    convs = [node for node in model.graph.node if node.op_type == "Conv"]
    assert [c.name for c in convs] == [f"conv_{i}" for i in range(layers)]
    for i, conv in enumerate(convs):
        activation, weight, bias = (producers[name] for name in conv.input)
        assert {n.op_type for n in (activation, weight, bias)} == {"DequantizeLinear"}
        assert constants[weight.input[0]].dtype == np.int8 and constants[bias.input[0]].dtype == np.int32
        unit = constants[activation.input[1]] * constants[weight.input[1]]
        assert np.allclose(constants[bias.input[1]], unit, rtol=1e-6)
        zero = constants[activation.input[2]]
        assert zero.dtype == np.uint8 and (zero > 0) == (i in (0, layers - 1))
    for node in model.graph.node:
        if node.op_type in ("Add", "Concat"):
            assert all(producers[name].op_type == "DequantizeLinear" for name in node.input)
    assert set(tensors(chain.architecture)) == {n.removesuffix(".scale") for n in constants if n.endswith(".scale") and "conv" not in n}


def test_an_empty_channel_keeps_its_bias(tmp_path):
    chain = network(Architecture(4, 8))
    with torch.no_grad():
        chain.convs[1].weight[3] = 0
    quantized = Quantized(chain, calibrate(chain, torch.rand(1, 4, 16, 16) - 0.5))
    _, bias = quantized.layer(1, "relu_0")
    assert torch.allclose(bias, chain.convs[1].bias, atol=1e-2)
    write(int8_model(quantized, Display()), tmp_path / "n.onnx")


def test_ranges_end_where_the_error_is_least():
    chain = network(Architecture(5, 8))
    seen = 0.05 * torch.randn(3, 4, 64, 64) ** 3  # few values are large, and some are out of the range of colours
    ranges, widest = calibrate(chain, seen), extremes(chain, seen)
    assert ranges["input"] == (-0.5, 0.5) and ranges["concat"][1] >= 0.5

    def error(ranges):
        with torch.no_grad():
            return float((Quantized(chain, ranges)(seen) - chain(seen.clamp(-0.5, 0.5))).square().mean())

    assert any(ranges[name][1] < widest[name][1] for name in ranges) and error(ranges) < error(widest)


def test_quantization_aware_training_reaches_the_weights():
    chain = network(Architecture(5, 8))
    x = torch.rand(1, 4, 16, 16) - 0.5
    quantized = Quantized(chain, calibrate(chain, x))
    quantized(x).square().mean().backward()
    assert all(p.grad.abs().max() > 0 for p in chain.parameters())


def test_the_command_writes_an_int8_file_near_the_float_one(data_folder, tmp_path):
    out = tmp_path / "run"
    assert main(["stage1", "--data", str(data_folder), "-o", str(out), "--layers", "4", "--filters", "8", "--crop", "48", "--steps", "30"]) == 0
    onnx_path = tmp_path / "n-int8.onnx"
    call = ["quantize", str(out / "checkpoint.pt"), "--data", str(data_folder), "-o", str(onnx_path)]
    assert main([*call, "--steps", "5", "--always-train", "--crop", "48"]) == 0
    scenes = Scenes(Manifest.read(data_folder), "validation")
    exact = evaluate(torch_predictor(load_network(out / "checkpoint.pt")[0]), scenes)["amplitude_psnr"]
    int8 = evaluate(onnx_predictor(onnx_path)[0], scenes)["amplitude_psnr"]
    assert abs(exact - int8) < 0.3
