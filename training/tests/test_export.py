import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from phasefront_training import from_pretrained
from phasefront_training.export import ExportError, float_model, read_description, read_onnx, write
from phasefront_training.networks import Architecture, Chain
from phasefront_training.optics import Display
from phasefront_training.pretrained import MODELS

CASES = [Architecture(4), Architecture(5, 8), Architecture(8, head="amplitude-phase"), Architecture(6, 16, "ldi3"), Architecture(8, 8, "field"), Architecture(8, 8, halved=True), Architecture(5, 8, head="amplitude-phase", halved=True)]


def run(path, x):
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(None, {session.get_inputs()[0].name: x.numpy()})[0]


@pytest.mark.parametrize("architecture", CASES, ids=str)
def test_the_file_is_the_network(architecture, tmp_path):
    network = Chain(architecture)
    for conv in network.convs:
        torch.nn.init.normal_(conv.bias, std=0.1)
    path = tmp_path / "n.onnx"
    write(float_model(network, Display()), path)
    for h, w in ((16, 16), (22, 40)) if architecture.halved else ((16, 16), (23, 41)):
        x = torch.rand(1, architecture.input_channels, h, w) - 0.5
        with torch.no_grad():
            assert np.abs(run(path, x) - network(x).numpy()).max() < 1e-4
    again, display = read_onnx(path)
    assert again.architecture == architecture and display.wavelengths_m == pytest.approx(Display().wavelengths_m)
    assert all(torch.equal(a, b) for a, b in zip(network.state_dict().values(), again.state_dict().values()))
    write(float_model(again, display), tmp_path / "again.onnx")
    assert path.read_bytes() == (tmp_path / "again.onnx").read_bytes()


def test_names_and_metadata_are_the_contract(tmp_path):
    path = tmp_path / "n.onnx"
    write(float_model(Chain(Architecture(8, head="amplitude-phase")), Display(), 6e-3), path)
    names = [node.name for node in onnx.load(path).graph.node]
    assert names[:3] == ["conv_0", "relu_0", "conv_1"]
    assert names[-4:] == ["add_7", "concat_7", "conv_7", "tanh"] and {"add_3", "add_5"} < set(names)
    assert read_description(path) == {
        "input": "rgbd", "head": "amplitude-phase", "pitch_um": "8", "wavelengths_nm": "638,520,450",
        "volume_depth_mm": "6", "offset_mm": "6",
    }


def test_a_network_for_corrected_optics_says_so(tmp_path):
    display = Display(corrected=True)
    write(float_model(Chain(Architecture(4)), display), tmp_path / "n.onnx")
    assert read_description(tmp_path / "n.onnx")["corrected"] == "true"
    assert read_onnx(tmp_path / "n.onnx")[1].corrected


def test_a_file_of_another_kind_is_refused(tmp_path):
    (tmp_path / "x.onnx").write_bytes(b"nothing")
    with pytest.raises(ExportError, match="x.onnx"):
        read_onnx(tmp_path / "x.onnx")
    with pytest.raises(ExportError, match="not there"):
        read_onnx(tmp_path / "y.onnx")


def test_a_bundled_network_is_a_torch_module(tmp_path):
    network, display = from_pretrained("rgbd-8")
    assert network.architecture == Architecture(8, 24) and display.volume_depth_m == pytest.approx(6e-3)
    x = torch.rand(1, 4, 17, 23) - 0.5
    session = onnxruntime.InferenceSession(MODELS / "rgbd-8.onnx")
    [expected] = session.run(None, {session.get_inputs()[0].name: x.numpy()})
    with torch.no_grad():
        np.testing.assert_allclose(network(x).numpy(), expected, atol=1e-5)
    with pytest.raises(ExportError, match="no network of Phasefront is called rgbd-9; there are .*rgbd-8.*ldi3-15"):
        from_pretrained("rgbd-9")
    with pytest.raises(ExportError, match="say where"):
        from_pretrained("rgbd-8", tmp_path)
