"""Pairs of scenes and holograms from `phasefront-lab dataset`, held in memory, and samples of them.

A data set is a folder with `manifest.json` and one `pair_000123.npz` for each scene:
`rgb` uint8 (L, H, W, 4), front layer first, alpha 0 where the layer has no hit; `depth` uint16 (L, H, W),
normalized depth times 65535; `hologram` complex64 (3, H, W), the midpoint hologram without the carrier. A set made with
sensors also has `sensed` uint16 (S, H, W): the front layer's depth that a session makes of each sensor's reading.

In memory, colour is uint8, and depth and field are float16. The holograms are linear convolutions with black
surroundings, so samples are crops, flips and transposes, never rolls.
"""

import copy
import io
import json
import os
import subprocess
import sys
import threading
import zipfile
import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from .optics import Display, stretched
from .sensor_depth import simulate_sensor_depth

FORMAT = "phasefront-dataset-1"
_HEADER = threading.Lock()
SPLITS = ("train", "validation", "test")
LEAST_SCENES = 40  # of a set with a scene for validation and one for tests, as `phasefront-lab dataset` divides them
LARGEST_GAIN = 4  # of dark samples, whose colours have few levels


class DataError(Exception):
    """A data set cannot be used. The message names the problem and its place."""


def call_laboratory(call):
    """Runs the laboratory's command with its arguments. Raises DataError if it is missing or fails."""
    try:
        status = subprocess.run(call, check=False).returncode
    except FileNotFoundError:
        raise DataError(f"no command '{call[0]}': build it (cargo build --release) and give its path by --phasefront-lab") from None
    if status != 0:
        raise DataError(f"'{' '.join(call)}' ended with status {status}")


def make(output, arguments, command="phasefront-lab"):
    """Calls `phasefront-lab dataset` to make or complete a data set. Raises DataError if it fails."""
    call = [command, "dataset", *arguments, "-o", str(output)]
    call_laboratory(call)


@dataclass(frozen=True)
class Manifest:
    """The manifest of a data set."""

    folder: Path
    table: dict

    @classmethod
    def read(cls, folder):
        path = Path(folder) / "manifest.json"
        try:
            table = json.loads(path.read_text())
        except FileNotFoundError:
            raise DataError(f"{path}: not there; make the data set first (python -m phasefront_training data)") from None
        except json.JSONDecodeError as error:
            raise DataError(f"{path}: not JSON ({error})") from None
        if table.get("format") != FORMAT:
            raise DataError(f"{path}: the format is '{table.get('format')}', expected '{FORMAT}'")
        missing = [key for key in ("size", "planes", "ldi_layers", "seed", "display", "splits") if key not in table]
        if missing:
            raise DataError(f"{path}: no {', '.join(missing)}")
        return cls(Path(folder), table)

    @property
    def display(self):
        return Display.from_manifest(self.table["display"], bool(self.table.get("aberration")))

    @property
    def like(self):
        """The kind of the scenes, such as objects or photographs."""
        return self.table.get("look", {}).get("like", "objects")

    @property
    def sensors(self):
        """The names of the sensors whose depth the pairs hold."""
        return tuple(self.table.get("sensors", ()))

    def indices(self, split):
        """Returns the scene numbers of a split."""
        if split not in self.table["splits"]:
            raise DataError(f"{self.folder}: no split '{split}' in the manifest")
        return range(*self.table["splits"][split])

    def pair(self, index):
        return self.folder / f"pair_{index:06d}.npz"


def read_pair(path, ldi_layers, sensors=0):
    """Reads a pair as colour uint8 (3·L, H, W), depth float16 (L, H, W), field float16 (6, H, W) and the depth of S
    sensors, float16 (S, H, W).

    A pixel without a hit gets colour 0 and depth 1. The field is three real parts, then three imaginary parts.
    Raises DataError if the file is damaged or holds fewer than `ldi_layers` layers.
    """
    try:
        rgba, depth, hologram, *sensed = _read_arrays(path, ("rgb", "depth", "hologram", "sensed")[: 4 if sensors else 3])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise DataError(f"{path}: damaged ({error})") from None
    layers, height, width = depth.shape if depth.ndim == 3 else (0, 0, 0)
    sensed = sensed[0] if sensed else np.zeros((0, height, width), np.uint16)
    if rgba.shape != (layers, height, width, 4) or hologram.shape != (3, height, width) or sensed.shape != (sensors, height, width):
        raise DataError(f"{path}: shapes {rgba.shape}, {depth.shape}, {hologram.shape} do not belong together")
    if layers < ldi_layers:
        raise DataError(f"{path}: {layers} layers, the network's input takes {ldi_layers}")
    if not np.isfinite(hologram).all():
        raise DataError(f"{path}: the hologram holds values that are not finite")
    hit = rgba[:ldi_layers, ..., 3] > 0
    colour = np.where(hit[..., None], rgba[:ldi_layers, ..., :3], 0).astype(np.uint8)
    depth = np.where(hit, depth[:ldi_layers] / np.float32(65535), 1).astype(np.float16)
    field = np.concatenate([hologram.real, hologram.imag]).astype(np.float16)
    sensed = (sensed / np.float32(65535)).astype(np.float16)
    return colour.transpose(0, 3, 1, 2).reshape(3 * ldi_layers, height, width), depth, field, sensed


def seed_planes(facts):
    """Returns the planes of the sweep whose seeds the scenes with these facts have, or None without seeds. All sets of a
    pool have the same."""
    return facts.get("seed_planes") or next((each["seed_planes"] for each in facts.get("sets", ()) if "seed_planes" in each), None)


class Scenes:
    """The scenes of a split in memory. Damaged files are reported on stderr and skipped.

    With `seeds` (a seeds.Seeds), each scene also has variants of its depth, each with the field of the plane sweep. With
    `stacks` (a stacks.Stacks), it also has an incoherent focal stack.
    """

    def __init__(self, manifest, split, ldi_layers=1, limit=None, device="cpu", seeds=None, stacks=None):
        self.display = manifest.display
        self.ldi_layers = ldi_layers
        self.damaged = []
        self.sets = []  # the facts of each of several joined data sets
        self.origin = {key: manifest.table[key] for key in ("seed", "planes")} | {"like": manifest.like}
        self.origin["volume_depth_mm"] = manifest.table["display"]["volume_depth_mm"]
        self.corrected = bool(manifest.table.get("aberration"))
        self.sensors = manifest.sensors
        numbers = list(manifest.indices(split))[:limit]
        if not numbers:
            raise DataError(f"{manifest.folder}: its {manifest.table['scenes']} scenes leave none for the split '{split}'; a set of {LEAST_SCENES} has one (--scenes {LEAST_SCENES})")
        present = [n for n in numbers if manifest.pair(n).exists()]
        if len(present) < len(numbers):
            print(f"{manifest.folder}: {len(numbers) - len(present)} of {len(numbers)} {split} pairs are not there", file=sys.stderr)
        self.numbers, parts = [], []
        with ThreadPoolExecutor(min(8, os.cpu_count() or 1)) as pool:
            for number, read in zip(present, pool.map(lambda n: _try_read(manifest.pair(n), ldi_layers, len(self.sensors)), present)):
                if isinstance(read, DataError):
                    self.damaged.append(manifest.pair(number))
                    print(f"{read}; skipped", file=sys.stderr)
                elif parts and read[1].shape != parts[0][1].shape:
                    self.damaged.append(manifest.pair(number))
                    print(f"{manifest.pair(number)}: {read[1].shape[1:]} pixels, others {parts[0][1].shape[1:]}; skipped", file=sys.stderr)
                else:
                    self.numbers.append(number)
                    parts.append(tuple(map(torch.from_numpy, read)))
        if not parts:
            raise DataError(f"{manifest.folder}: no readable pair in the split '{split}'")
        self.colour, self.depth, self.target, self.sensed = (_gather(parts, k, device) for k in range(4))
        self.stretches = torch.ones(len(self.numbers))  # to the volume of `display`, about the middle
        self.seeded = seeds is not None
        self.refined = seeds.refined if seeds else 0
        if seeds:
            self.origin |= {"seed_planes": seeds.planes, "refined": seeds.refined}
        if self.seeded:
            parts = [tuple(map(torch.from_numpy, seeds.of(number))) for number in self.numbers]
            self.origin["variants"] = len(parts[0][0]) - seeds.refined
            self.variant_depth, self.variant_seed = (_gather(parts, k, device) for k in range(2))
        if stacks:
            parts = [tuple(map(torch.from_numpy, stacks.of(number))) for number in self.numbers]
            self.stack_depths, self.stack = (_gather(parts, k, device) for k in range(2))

    @classmethod
    def joined(cls, parts):
        """Joins the scenes of several data sets, for the display with the deepest volume.

        All must have the same size and, except for the volume, the same display. Depths of a shallower volume are
        stretched.
        """
        if len(parts) == 1:
            return parts[0]
        deepest = max(parts, key=lambda part: part.display.volume_depth_m)
        for part in parts:
            for what in ("shape", "corrected", "refined", "seeded", "sensors"):
                mine, its = getattr(deepest, what), getattr(part, what)
                if mine != its:
                    raise DataError(f"data sets that are trained on together must be alike: {what} {mine} and {its}")
            if replace(part.display, volume_depth_m=deepest.display.volume_depth_m) != deepest.display:
                raise DataError(f"data sets that are trained on together may differ in the volume's depth, in no more of the display: {deepest.display} and {part.display}")
            if part is not deepest:
                part.stretches.fill_(part.display.volume_depth_m / deepest.display.volume_depth_m)
        whole = copy.copy(deepest)
        whole.sets = [part.facts for part in parts]
        whole.numbers = [number for part in parts for number in part.numbers]
        whole.damaged = [path for part in parts for path in part.damaged]
        tensors = [name for name, value in vars(whole).items() if isinstance(value, torch.Tensor)]
        for name in tensors:
            setattr(whole, name, torch.cat([vars(part).pop(name) for part in parts]))
        return whole

    def __len__(self):
        return len(self.numbers)

    @property
    def shape(self):
        return tuple(self.depth.shape[-2:])

    @property
    def facts(self):
        """The facts about the training data that a checkpoint keeps."""
        facts = {"scenes": len(self), "size": self.shape[-1], "ldi_layers": self.ldi_layers} | self.origin
        facts |= {"sensors": list(self.sensors)} if self.sensors else {}
        return facts | ({"sets": self.sets} if self.sets else {})

    def scene(self, i):
        """Returns scene i: colour (3·L, H, W) in [0, 1], depth (L, H, W) normalized to its own set's volume, and the
        true field (3, H, W)."""
        target = self.target[i].float()
        return self.colour[i].float() / 255, self.depth[i].float(), torch.complex(target[:3], target[3:])


    def stretch(self, i):
        """Returns the factor that stretches the depths of scene i to the volume of the display."""
        return float(self.stretches[i])

    def variant(self, i, v):
        """Returns depth (1, H, W), normalized to its own set's volume, and seed (6, H, W) of variant v of scene i. v =
        0 is clean, and the last `refined` variants are refined."""
        return self.variant_depth[i][v][None].float(), self.variant_seed[i][v].float()


def _read_arrays(path, names):
    """Reads arrays of an .npz. Unpacking runs in parallel with other threads. Headers are parsed under a lock, because
    numpy parses them with `ast`, which fails in CPython 3.11 if two threads use it at once."""
    with zipfile.ZipFile(path) as archive:
        packed = [archive.read(f"{name}.npy") for name in names]
    with _HEADER:
        return [np.lib.format.read_array(io.BytesIO(each)) for each in packed]


def _try_read(path, ldi_layers, sensors):
    try:
        return read_pair(path, ldi_layers, sensors)
    except DataError as error:
        return error


def _gather(parts, k, device):
    """Stacks member k of all parts and releases each part at once, so that memory use does not double."""
    whole = torch.empty((len(parts), *parts[0][k].shape), dtype=parts[0][k].dtype, device=device)
    for i, part in enumerate(parts):
        whole[i] = part[k].to(device)
        parts[i] = tuple(None if j == k else member for j, member in enumerate(part))
    return whole


def network_input(colour, depth, kind="rgbd", seed=None):
    """Returns the input of a network of this kind (networks.py): colour and depth of each layer in turn, each minus
    0.5.

    For seeded networks the seed (..., 6, H, W) follows: half of (real part minus 0.5), half of the imaginary part, so
    that all channels have the same range. For rgbdxy, whose input is a whole frame (4, H, W), the two channels of
    `place` follow.
    """
    colour = colour.unflatten(-3, (-1, 3))
    layers = torch.cat([colour, depth.unsqueeze(-3)], -3).flatten(-4, -3) - 0.5
    if kind == "rgbdxy":
        return torch.cat([layers, place(*depth.shape[-2:]).to(layers)], -3)
    if kind != "seeded":
        return layers
    return torch.cat([layers, 0.5 * (seed[..., :3, :, :] - 0.5), 0.5 * seed[..., 3:, :, :]], -3)


def place(height, width):
    """Returns x and y (2, H, W) of a frame's pixels, from -0.5 at the outer edge of the first to 0.5 at that of the
    last."""
    x, y = ((torch.arange(n) + 0.5) / n - 0.5 for n in (width, height))
    return torch.stack([x.expand(height, width), y[:, None].expand(height, width)])


def seed_of_input(x):
    """Returns the real and the imaginary part (N, 3, H, W) of the seed in network inputs (N, 10, H, W)."""
    return 2 * x[:, 4:7] + 0.5, 2 * x[:, 7:]


def brightness_gains(colour, rng):
    """Returns a factor for each colour (3, 1, 1) that keeps the colours (3·L, H, W) in [0, 1] and takes the brightest
    to a random level."""
    level = np.exp(rng.uniform(np.log(0.25), 0)) * np.exp(rng.uniform(np.log(0.75), 0, 3))
    largest = min(1 / max(float(colour.max()), 1e-6), LARGEST_GAIN)
    return torch.tensor(largest * level, dtype=torch.float32, device=colour.device)[:, None, None]


@dataclass(frozen=True)
class Batch:
    """The samples of one step.

    input: the network's input (N, C, H, W). target: complex (N, 3, H, W). depth: clean normalized depth of the front
    layer (N, H, W). valid: (N, 1, H, W), 1 where the crop does not cut the network's view.
    """

    input: torch.Tensor
    target: torch.Tensor
    depth: torch.Tensor
    valid: torch.Tensor


class Sampler:
    """Draws batches for networks of one `kind`. Batch `step` of a seed does not depend on earlier draws.

    Samples with coordinates, and samples of holograms that correct an aberration, are neither flipped nor transposed,
    because the aberration does not flip with the scene. A fraction `sensor_depth` of the samples has sensor depth: that
    of one of the data set's sensors, if it has sensors, and else simulated here. In a fraction `dimmed` of the samples the brightness of each
    colour changes. Optics are linear and colours do not interact, so halving the red of a scene exactly halves the red
    of its hologram. (This does not hold for a change of contrast.)
    """

    batch_of = Batch

    def __init__(self, scenes, batch, crop, margin, sensor_depth=0.0, seed=0, rank=0, kind="rgbd", dimmed=0.0):
        if sensor_depth and scenes.ldi_layers > 1:
            raise ValueError("simulated sensor depth is for rgbd inputs: layered depth images are rendered, not measured")
        height, width = scenes.shape
        self.scenes, self.batch, self.sensor_depth, self.dimmed = scenes, batch, sensor_depth, dimmed
        self.crop = (min(crop, height), min(crop, width))
        if self.crop[0] != self.crop[1]:
            raise ValueError(f"scenes of {width}x{height} hold no square crop of {crop}")
        if 4 * margin > self.crop[0] and self.crop != scenes.shape:
            raise ValueError(f"a margin of {margin} px leaves too little of crops of {crop} px")
        self.margin, self.seed, self.rank = margin, seed, rank
        self.kind = kind
        self.place = place(height, width) if kind == "rgbdxy" else None
        self.flips = not (scenes.corrected or kind == "rgbdxy")

    def draw(self, step):
        rng = np.random.default_rng([self.seed, self.rank, step])
        samples = [self._sample(rng) for _ in range(self.batch)]
        return self.batch_of(*(torch.stack(members) for members in zip(*samples)))

    def target(self, i, window, gains, rng):
        """Returns what the network shall make of scene i in this window, and more members of the batch."""
        return self.scenes.target[i][window].float() * gains.repeat(2, 1, 1), ()

    @staticmethod
    def finished(target):
        """Converts a target to the form that the batch holds."""
        return torch.complex(target[:3].contiguous(), target[3:].contiguous())

    def _sample(self, rng):
        scenes, (h, w), margin = self.scenes, self.crop, self.margin
        height, width = scenes.shape
        i = int(rng.integers(len(scenes)))
        # Draws corners beyond the frame and clamps them, so that samples include the frame's borders often enough.
        y = int(np.clip(rng.integers(-margin, height - h + margin + 1), 0, height - h))
        x = int(np.clip(rng.integers(-margin, width - w + margin + 1), 0, width - w))
        window = (..., slice(y, y + h), slice(x, x + w))
        colour = scenes.colour[i][window].float() / 255
        depth = scenes.depth[i][window].float()
        gains = torch.ones(3, 1, 1, device=depth.device)
        if self.dimmed and rng.random() < self.dimmed:
            gains = brightness_gains(colour, rng)
            colour = colour * gains.repeat(scenes.ldi_layers, 1, 1)
        valid = torch.zeros(1, h, w, device=depth.device)
        # At the frame's border the network also reads zeros in use. The loss leaves out only cut sides.
        valid[
            :,
            margin if y > 0 else 0 : h - margin if y + h < height else h,
            margin if x > 0 else 0 : w - margin if x + w < width else w,
        ] = 1
        from_sensor = rng.random() < self.sensor_depth
        field = None
        if scenes.seeded:
            v = int(rng.integers(1, len(scenes.variant_depth[i]))) if from_sensor else 0
            measured = scenes.variant_depth[i][v][window][None].float()
            field = scenes.variant_seed[i][v][window].float() * gains.repeat(2, 1, 1)
        elif from_sensor and scenes.sensors:
            measured = scenes.sensed[i][int(rng.integers(len(scenes.sensors)))][window][None].float()
        else:
            measured = simulate_sensor_depth(colour, depth[0], rng)[None] if from_sensor else depth
        target, more = self.target(i, window, gains, rng)
        # The sensor's errors are a fraction of the scene's own volume, so the stretch follows the measurement.
        measured, depth = (stretched(each, scenes.stretch(i)) for each in (measured, depth))
        if self.place is None:
            seen = network_input(colour, measured, self.kind, field)
        else:
            seen = torch.cat([network_input(colour, measured), self.place[window].to(measured)])
        members = [seen, target, depth[:1], valid]
        flip_y, flip_x, transpose = rng.random(3) < (0.5 if self.flips else 0)
        axes = [axis for axis, flip in ((-2, flip_y), (-1, flip_x)) if flip]
        if axes:
            members = [member.flip(axes) for member in members]
        if transpose:
            members = [member.transpose(-1, -2) for member in members]
        given, target, depth, valid = members
        return given, self.finished(target), depth[0], valid, *more
