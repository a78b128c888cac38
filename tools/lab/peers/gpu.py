"""PyTorch (half, channels_last) against `phasefront bench --backend gpu`, on the same networks and the same GPU, in turn.

    python tools/lab/peers/gpu.py 8 15 30 --size 1920x1080

Needs torch and numpy from PyPI, a CUDA or Apple GPU, and the command `phasefront`, which is one file: a machine with
nothing installed but a driver runs `phasefront bench --backend gpu` by itself. A number is a network of that many layers of 24
filters with random weights, written as ONNX for both (needs onnx); an .onnx file is taken as it is. The network alone
is timed in PyTorch, the network's stage and the whole frame in Phasefront; a ratio is one of medians of one round, and
the table has the median of all rounds. The exit code is 1 where the GPU's frame costs over 1.5 times PyTorch's network.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn

from run import CACHE


class Chain(nn.Module):
    """The residual chain of the paper: see sdk/core/src/method/network/chain.rs."""

    def __init__(self, layers, filters=24, inputs=4):
        super().__init__()
        widths = [inputs] + [filters] * (layers - 1)
        widths[-1] += inputs
        outs = [filters] * (layers - 1) + [6]
        self.layers = nn.ModuleList(nn.Conv2d(i, o, 3, padding=1) for i, o in zip(widths, outs))

    def forward(self, rgbd):
        inputs, x = [], rgbd
        last = len(self.layers) - 1
        for i, layer in enumerate(self.layers):
            if i >= 3 and i % 2 == 1:
                x = x + inputs[i - 2]
            inputs.append(x)
            if i == last:
                x = torch.cat([x, rgbd], dim=1)
            x = layer(x)
            if i < last:
                x = torch.relu(x)
        return x


def from_onnx(path):
    """The f32 chain of a file."""
    import onnx
    from onnx import numpy_helper

    tensors = {t.name: numpy_helper.to_array(t) for t in onnx.load(path).graph.initializer}
    nodes = [node for node in onnx.load(path).graph.node if node.op_type == "Conv"]
    kernels = [tensors[node.input[1]] for node in nodes]
    chain = Chain(len(nodes), kernels[0].shape[0], kernels[0].shape[1])
    with torch.no_grad():
        for layer, node in zip(chain.layers, nodes):
            layer.weight.copy_(torch.from_numpy(tensors[node.input[1]].copy()))
            layer.bias.copy_(torch.from_numpy(tensors[node.input[2]].copy()))
    return chain


def to_onnx(chain, path):
    """Writes a chain as training exports it, for the paper's display."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    nodes, tensors, reads, writes, x = [], [], [], [], "rgbd"
    last = len(chain.layers) - 1
    for i, layer in enumerate(chain.layers):
        if i >= 3 and i % 2 == 1:
            nodes.append(helper.make_node("Add", [x, reads[i - 2]], [f"sum{i}"]))
            x = f"sum{i}"
        reads.append(x)
        if i == last:
            nodes.append(helper.make_node("Concat", [x, "rgbd"], ["joined"], axis=1))
            x = "joined"
        for name, value in [("w", layer.weight), ("b", layer.bias)]:
            tensors.append(numpy_helper.from_array(value.detach().numpy(), f"{name}{i}"))
        out = "field" if i == last else f"conv{i}"
        nodes.append(helper.make_node("Conv", [x, f"w{i}", f"b{i}"], [out], kernel_shape=[3, 3], pads=[1, 1, 1, 1]))
        x = out
        if i < last:
            nodes.append(helper.make_node("Relu", [x], [f"relu{i}"]))
            x = f"relu{i}"
        writes.append(x)
    planes = lambda name, channels: helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, "height", "width"])
    graph = helper.make_graph(nodes, "chain", [planes("rgbd", 4)], [planes("field", 6)], tensors)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    metadata = {"input": "rgbd", "head": "real-imaginary", "pitch_um": "8.0", "wavelengths_nm": "638,520,450",
                "volume_depth_mm": "6.0", "offset_mm": "0"}
    helper.set_model_props(model, {f"phasefront.{key}": value for key, value in metadata.items()})
    onnx.save(model, path)


def torch_device():
    if torch.cuda.is_available():
        return torch.device("cuda"), torch.cuda.synchronize, torch.cuda.get_device_name()
    if torch.backends.mps.is_available():
        return torch.device("mps"), torch.mps.synchronize, "Apple GPU"
    sys.exit("no CUDA and no Apple GPU for PyTorch; `phasefront bench --backend gpu` runs by itself")


def torch_ms(chain, width, height, seconds):
    """The median time of the network alone, its input and output on the device."""
    device, wait, _ = torch_device()
    chain = chain.to(device).half().to(memory_format=torch.channels_last).eval()
    frame = (torch.rand(1, 4, height, width, device=device) - 0.5).half().to(memory_format=torch.channels_last)
    torch.backends.cudnn.benchmark = True
    times = []
    with torch.inference_mode():
        for _ in range(5):
            chain(frame)
        wait()
        start = time.perf_counter()
        while len(times) < 5 or time.perf_counter() - start < seconds:
            begin = time.perf_counter()
            chain(frame)
            wait()
            times.append((time.perf_counter() - begin) * 1e3)
    return statistics.median(times)


def ours(command, path, size, gpu, seconds):
    """The rows of our benchmark: f16 and f32, layers and pairs."""
    arguments = [command, "bench", "--backend", "gpu", "--network", str(path), "--size", size, "--seconds", str(seconds), "--json"]
    if gpu:
        arguments += ["--gpu", gpu]
    done = subprocess.run(arguments, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(arguments)}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("networks", nargs="+", metavar="LAYERS|FILE.onnx")
    parser.add_argument("--size", action="append", metavar="WxH", help="default: 1920x1080")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=1.0, help="for each in a round (default 1)")
    parser.add_argument("--phasefront", default=str(CACHE / "target/release/phasefront"), metavar="FILE")
    parser.add_argument("--gpu", metavar="NAME", help="a part of the GPU's name, where there are several")
    parser.add_argument("--json", metavar="FILE", help="write the figures there too")
    arguments = parser.parse_args()
    _, _, name = torch_device()
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for network in arguments.networks:
            if network.isdigit():
                torch.manual_seed(int(network))
                chain, path = Chain(int(network)), Path(folder) / f"chain-{network}.onnx"
                to_onnx(chain, path)
            else:
                path = Path(network)
                chain = from_onnx(path)
            for size in arguments.size or ["1920x1080"]:
                width, height = map(int, size.split("x"))
                theirs, rows = [], []
                for _ in range(arguments.rounds):
                    theirs.append(torch_ms(chain, width, height, arguments.seconds))
                    measured = ours(arguments.phasefront, path, size, arguments.gpu, arguments.seconds)
                    rows.append(measured["rows"])
                for k, row in enumerate(rows[0]):
                    frames = [r[k]["flying_ms"] for r in rows]
                    results.append({
                        "network": network, "size": size, "kernels": row["kernels"], "precision": row["precision"],
                        "torch_ms": statistics.median(theirs),
                        "network_ms": statistics.median(r[k]["stage_ms"].get("network", np.nan) for r in rows),
                        "frame_ms": statistics.median(frames),
                        "frame_over_torch": statistics.median(f / t for f, t in zip(frames, theirs)),
                        "peak_percent": row["peak_percent"], "bandwidth_percent": row["bandwidth_percent"],
                        "device": measured["machine"], "torch": f"{torch.__version__} on {name}",
                    })
                    print(json.dumps(results[-1]), flush=True)
    print("\n| network | size | numbers | PyTorch network ms | ours network ms | ours frame ms | frame / PyTorch | % of peak | % of bandwidth |")
    print("|---|---|---|---|---|---|---|---|---|")
    for r in results:
        share = [f"{v:.0f}" if v is not None else "–" for v in (r["peak_percent"], r["bandwidth_percent"])]
        print(f"| {r['network']} | {r['size']} | {r['kernels']} | {r['torch_ms']:.2f} | {r['network_ms']:.2f} | {r['frame_ms']:.2f} "
              f"| {r['frame_over_torch']:.2f} | {share[0]} | {share[1]} |")
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(results, indent=1) + "\n")
    best = {}
    for r in results:
        key = (r["network"], r["size"])
        best[key] = min(best.get(key, np.inf), r["frame_over_torch"])
    sys.exit(any(ratio > 1.5 for ratio in best.values()))


if __name__ == "__main__":
    main()
