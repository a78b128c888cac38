"""The quality of a network's holograms on scenes that it was not trained on.

The figures are means over scenes of amplitude PSNR and SSIM (peak 1), of the midpoint hologram and of a focal stack of
five planes inside the volume. Two baselines are 'RGB as the field', the front layer's image with phase 0, and 'SM-LBM
of what is visible', exact waves from the front layer alone. Depth is clean, or simulated sensor depth that depends only
on the scene's number, so that figures are comparable. If there are seeds on refined depth, depth refined by the core is
evaluated too.
"""

import json
import sys
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from .checkpoint import load_network
from .data import network_input
from .files import replacing
from .metrics import psnr, ssim
from .networks import Architecture, head_field
from .optics import padded_shape, propagate, stretched, transfer
from .sensor_depth import simulate_sensor_depth

STACK = (0.4, 0.2, 0.0, -0.2, -0.4)  # planes, in volume depths from the midpoint
RANGE_TOLERANCE = 0.02  # beyond the trained range, as in the core
COLOUR_TOLERANCE = 0.05  # of a colour's own range from the mean of the colours, as in the core
SENSOR = "simulated sensor"  # a kind of depth
FIGURES = ("amplitude_psnr", "amplitude_ssim", "focal_psnr", "focal_ssim")


def rgb_as_field(colour, depth, seed=None):
    """Returns the front layer's image as amplitude, with phase 0."""
    return torch.complex(colour[:3], torch.zeros_like(colour[:3]))


def visible_layers(display, planes):
    """Returns a predictor by SM-LBM (Eq. 1 to 4) of the front layer, like the lab's `sm_lbm`, with whole transforms."""
    z = display.z_m((torch.arange(planes, dtype=torch.float64) + 0.5) / planes)

    def predict(colour, depth, seed=None):
        height, width = depth.shape[-2:]
        shape = padded_shape(display, display.volume_depth_m, height, width)
        plane = (depth[0].double() * planes).long().clamp(max=planes - 1)
        wave, at = torch.zeros(3, *shape, dtype=torch.complex64), z[-1]
        for k in plane.unique().flip(0).tolist():
            wave, at = _on(wave, float(z[k] - at), display), z[k]
            here = plane == k
            wave[:, :height, :width][:, here] = colour[:3, here].to(wave)
        return _on(wave, float(-at), display)[:, :height, :width]

    return predict


def _on(wave, distance_m, display):
    """Propagates `wave` by distance_m, circularly."""
    return torch.fft.ifft2(torch.fft.fft2(wave) * transfer(display, distance_m, *wave.shape[-2:]))


def seed_as_field(colour, depth, seed):
    """Returns the field of the plane sweep alone."""
    return torch.complex(seed[:3], seed[3:])


def torch_predictor(network, autocast=False):
    """Returns a predictor, colour, depth, seed -> field (3, H, W), by a network in memory."""
    device = next(network.parameters()).device

    def predict(colour, depth, seed=None):
        x = network_input(colour, depth, network.architecture.input, seed)[None]
        x = x.to(device).contiguous(memory_format=torch.channels_last)
        with torch.no_grad(), torch.autocast(device.type, torch.bfloat16, enabled=autocast):
            output = network(x)
        return head_field(network.architecture, output, x)[0]

    return predict


def onnx_session(path, threads=None):
    """Returns an ONNX Runtime session on the CPU with exact int8 sums."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads or torch.get_num_threads()
    # Without this, sums of two products saturate at 16 bits on CPUs that have AVX2 but not VNNI.
    options.add_session_config_entry("session.x64quantprecision", "1")
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


class OnnxNetwork:
    """A float32 or int8 network file on ONNX Runtime. It is called like a Chain and computes on the CPU.

    In `architecture`, only the input and the head are read from the file.
    """

    def __init__(self, path, threads=None):
        from .export import read_description

        description = read_description(path)
        self.session = onnx_session(path, threads)
        self.name = self.session.get_inputs()[0].name
        self.architecture = Architecture(layers=3, input=description["input"], head=description["head"])

    def __call__(self, x):
        output = self.session.run(None, {self.name: x.cpu().contiguous().numpy()})[0]
        return torch.from_numpy(output).to(x.device)


def onnx_predictor(path, threads=None):
    """Returns (predict, architecture's input and head) of a float32 or int8 file, by ONNX Runtime."""
    network = OnnxNetwork(path, threads)
    meaning = network.architecture

    def predict(colour, depth, seed=None):
        x = network_input(colour.cpu(), depth.cpu(), meaning.input, None if seed is None else seed.cpu())[None]
        return head_field(meaning, network(x), x)[0]

    return predict, meaning


def predictor(path, device="cpu"):
    """Returns (predict, architecture, display that it was trained for) of a checkpoint or an .onnx file."""
    if Path(path).suffix == ".onnx":
        from .export import read_display

        return *onnx_predictor(path), read_display(path)
    network, display = load_network(path)
    return torch_predictor(network.to(device).eval()), network.architecture, display


def served(predict, trained, display):
    """Returns a predictor for frames of `display` by a network for the display `trained`, with stretched depths as in
    sessions.

    Raises ValueError if the network does not suit the display.
    """
    if trained.corrected and display != trained:
        raise ValueError("the network corrects the optics of one display and serves no other")
    each = display.stretches(trained)
    stretch = float(np.mean(each))
    if any(abs(own - stretch) > COLOUR_TOLERANCE * stretch for own in each):
        raise ValueError(f"the network was trained for wavelengths of {trained.wavelengths_m} m, the display has {display.wavelengths_m}")
    if stretch > 1 + RANGE_TOLERANCE:
        raise ValueError(f"the network was trained for depths of {trained}; those of {display} need {stretch:.2f} times the range")
    return lambda colour, depth, seed=None: predict(colour, stretched(depth, stretch), seed)


def compare(field, truth, display, full=True):
    """Returns {figure: value} of a field against the true field, both (3, H, W). `full` adds the slow figures."""
    truth = truth.to(field.device)
    figures = {"amplitude_psnr": psnr(field.abs(), truth.abs())}
    if full:
        figures["amplitude_ssim"] = ssim(field.abs(), truth.abs())
        pairs = []
        for part in STACK:
            z = part * display.volume_depth_m
            pairs.append([propagate(f, z, display).abs() for f in (field, truth)])
        figures["focal_psnr"] = float(np.mean([psnr(a, b) for a, b in pairs]))
        figures["focal_ssim"] = float(np.mean([ssim(a, b) for a, b in pairs]))
    return figures


def sensor_generator(number, variant=0):
    """Returns the generator of a scene's simulated sensor depth. Evaluation uses variant 0."""
    return np.random.default_rng([7, number] if variant == 0 else [8, number, variant])


def depths(scenes):
    """Returns the kinds of depth that the scenes have."""
    if scenes.ldi_layers > 1:
        return ("clean",)
    return ("clean", SENSOR, "refined") if scenes.refined else ("clean", SENSOR)


def scene_as_seen(scenes, i, kind):
    """Returns the colour, depth, seed (or None) and truth of a scene. The depth is of one of the kinds of `depths`, in
    the display's volume."""
    colour, depth, truth = scenes.scene(i)
    seed = None
    if scenes.seeded:
        depth, seed = scenes.variant(i, {"clean": 0, SENSOR: 1, "refined": -scenes.refined}[kind])
    elif kind == SENSOR:
        depth = torch.cat([simulate_sensor_depth(colour[:3], depth[0], sensor_generator(scenes.numbers[i]))[None], depth[1:]])
    return colour, stretched(depth, scenes.stretch(i)), seed, truth


def evaluate(predict, scenes, depth="clean", full=True, progress=False):
    """Returns {figure: mean, 'worst': …} of a predictor over scenes."""
    rows = []
    for i in tqdm(range(len(scenes)), disable=not (progress and sys.stderr.isatty())):
        colour, seen, seed, truth = scene_as_seen(scenes, i, depth)
        rows.append(compare(predict(colour, seen, seed), truth, scenes.display, full))
    return means_and_worst(rows, scenes) | {"scenes": len(rows)}


def means_and_worst(rows, scenes):
    """Returns {figure: mean} of the scenes' rows of `compare`, with the least amplitude PSNR and its scene."""
    means = {figure: round(float(np.mean([row[figure] for row in rows])), 4) for figure in rows[0]}
    worst = int(np.argmin([row["amplitude_psnr"] for row in rows]))
    return means | {
        "worst_amplitude_psnr": round(rows[worst]["amplitude_psnr"], 4),
        "worst_scene": scenes.numbers[worst],
    }


def table(results):
    """Returns a Markdown table of {method: {condition: figures}}."""
    lines = ["| method | depth | amplitude PSNR / SSIM | focal stack PSNR / SSIM | worst scene |", "|---|---|---|---|---|"]
    for method, conditions in results.items():
        for condition, f in conditions.items():
            amplitude = f"{f['amplitude_psnr']:.2f} / {f['amplitude_ssim']:.3f}"
            focal = f"{f['focal_psnr']:.2f} / {f['focal_ssim']:.3f}"
            lines.append(f"| {method} | {condition} | {amplitude} | {focal} | {f['worst_amplitude_psnr']:.2f} (scene {f['worst_scene']}) |")
    return "\n".join(lines)


def save(results, path):
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(results, indent=1) + "\n")
