"""ONNX Runtime and OpenVINO against `phasefront bench`, on the same .onnx files, in turn, on this machine.

    python tools/lab/peers/run.py models/rgbd-8-int8.onnx models/rgbd-8.onnx --size 1920x1080 --threads 2

Needs onnxruntime, openvino and numpy from PyPI, and the command `phasefront` (samples/run builds it). In each round
every engine runs the network on the same frame for about a second; a ratio is one of medians of one round, and the
table has the median ratio of all rounds, so that a machine whose speed drifts slows all alike.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

CACHE = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "phasefront"


def frame(path, width, height):
    """Input of the network's channels, in [-0.5, 0.5]; what is in it does not change what it costs."""
    import onnx

    graph = onnx.load(path).graph
    channels = graph.input[0].type.tensor_type.shape.dim[1].dim_value
    values = np.random.default_rng(0).random((1, channels, height, width), dtype=np.float32) - 0.5
    return graph.input[0].name, values


class OnnxRuntime:
    name = "ONNX Runtime"

    def __init__(self, path, width, height, threads):
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        self.session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        self.feed = dict([frame(path, width, height)])
        self.version = onnxruntime.__version__

    def run(self):
        self.session.run(None, self.feed)


class OpenVino:
    name = "OpenVINO"

    def __init__(self, path, width, height, threads):
        import openvino

        core = openvino.Core()
        model = core.read_model(path)
        name, values = frame(path, width, height)
        model.reshape({name: list(values.shape)})
        hints = {"INFERENCE_NUM_THREADS": threads, "PERFORMANCE_HINT": "LATENCY", "INFERENCE_PRECISION_HINT": "f32"}
        self.request = core.compile_model(model, "CPU", hints).create_infer_request()
        self.feed = {name: values}
        self.version = openvino.__version__.split("-")[0]

    def run(self):
        self.request.infer(self.feed)


def median_ms(run, seconds):
    """Median time of calls for so many seconds, three at least, after one that is not counted."""
    run()
    times, start = [], time.perf_counter()
    while len(times) < 3 or time.perf_counter() - start < seconds:
        begin = time.perf_counter()
        run()
        times.append((time.perf_counter() - begin) * 1e3)
    return statistics.median(times)


def ours_ms(command, path, size, threads, seconds):
    """The median time of our network stage, and the kernels that ran."""
    arguments = [command, "bench", "--network", path, "--size", size, "--threads", str(threads), "--seconds", str(seconds), "--json"]
    done = subprocess.run(arguments, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(arguments)}: {done.stderr.strip()}")
    row = json.loads(done.stdout)["rows"][0]
    return row["stage_ms"]["network"], row["kernels"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("networks", nargs="+", metavar="FILE.onnx")
    parser.add_argument("--size", action="append", metavar="WxH", help="default: 384x384 and 1920x1080")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=1.0, help="for each engine in a round (default 1)")
    parser.add_argument("--phasefront", default=str(CACHE / "target/release/phasefront"), metavar="FILE")
    parser.add_argument("--json", metavar="FILE", help="write the figures there too")
    arguments = parser.parse_args()
    rows = []
    for path in arguments.networks:
        for size in arguments.size or ["384x384", "1920x1080"]:
            width, height = map(int, size.split("x"))
            peers = [engine(path, width, height, arguments.threads) for engine in (OnnxRuntime, OpenVino)]
            times = {"phasefront": [], **{peer.name: [] for peer in peers}}
            for _ in range(arguments.rounds):
                ms, kernels = ours_ms(arguments.phasefront, path, size, arguments.threads, arguments.seconds)
                times["phasefront"].append(ms)
                for peer in peers:
                    times[peer.name].append(median_ms(peer.run, arguments.seconds))
            row = {"network": Path(path).name, "size": size, "threads": arguments.threads, "kernels": kernels}
            row["ms"] = {name: statistics.median(values) for name, values in times.items()}
            row["times_slower"] = {
                peer.name: statistics.median(theirs / ours for theirs, ours in zip(times[peer.name], times["phasefront"]))
                for peer in peers
            }
            row["versions"] = {peer.name: peer.version for peer in peers}
            rows.append(row)
            print(json.dumps(row), flush=True)
    print("\n| network | size | threads | ours ms | ONNX Runtime ms | OpenVINO ms | ONNX Runtime / ours | OpenVINO / ours |")
    print("|---|---|---|---|---|---|---|---|")
    for row in rows:
        ms, ratio = row["ms"], row["times_slower"]
        print(
            f"| {row['network']} | {row['size']} | {row['threads']} | {ms['phasefront']:.1f} | {ms['ONNX Runtime']:.1f} "
            f"| {ms['OpenVINO']:.1f} | {ratio['ONNX Runtime']:.2f} | {ratio['OpenVINO']:.2f} |"
        )
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
