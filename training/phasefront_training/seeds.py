"""Seeds: the plane sweep's field of each scene, on clean depth and on that of sensors, the inputs of seeded networks.

The seeds of a data set are a folder that `python -m phasefront_training seeds` makes. This package writes the depths,
`depth_000123.npy`, uint16 (V, H, W), d·65535. Variant 0 is the clean depth of the visible layer. The others are the
depth of the data set's sensors, in turn, or, if it has none, simulated sensor depth (sensor_depth.py). `evaluate` uses
the first of them. `phasefront-lab seeds` can add R depths that are read by a sensor and refined by the core,
`refined_000123.npy`, uint16 (R, H, W). It adds the fields of all depths, which the SDK computes, `seed_000123.npy`,
int16 (V + R, 6, H, W), real parts, then imaginary parts, times the scale in `seeds.json`.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from .data import DataError, call_laboratory, read_pair
from .evaluate import sensor_generator
from .files import replacing
from .sensor_depth import simulate_sensor_depth

FORMAT = "phasefront-seeds-1"


def make(manifest, output, variants, arguments, command="phasefront-lab"):
    """Makes or completes the seeds of a data set: `variants` depths per scene, then the fields with `phasefront-lab seeds`."""
    output = Path(output)
    output.mkdir(parents=True, exist_ok=True)
    for number in range(manifest.table["scenes"]):
        path = output / f"depth_{number:06d}.npy"
        if manifest.pair(number).exists() and not path.exists():
            with replacing(path) as temporary, open(temporary, "wb") as file:
                np.save(file, _depths(manifest, number, variants))
    call = [command, "seeds", str(manifest.folder), "-o", str(output), *arguments]
    call_laboratory(call)


def _depths(manifest, number, variants):
    sensors = len(manifest.sensors)
    colour, depth, _, sensed = read_pair(manifest.pair(number), 1, sensors)
    colour, depth = torch.from_numpy(colour).float() / 255, torch.from_numpy(depth[0]).float()
    count = variants - 1
    if sensors:
        others = [torch.from_numpy(sensed[(number * count + v) % sensors]).float() for v in range(count)]
    else:
        others = [simulate_sensor_depth(colour, depth, sensor_generator(number, v)) for v in range(count)]
    return (torch.stack([depth, *others]).numpy() * 65535).round().astype(np.uint16)


@dataclass(frozen=True)
class Seeds:
    """A folder of seeds."""

    folder: Path
    scale: float
    planes: int
    refined: int

    @classmethod
    def read(cls, folder):
        path = Path(folder) / "seeds.json"
        try:
            table = json.loads(path.read_text())
        except FileNotFoundError:
            raise DataError(f"{path}: not there; make the seeds first (python -m phasefront_training seeds)") from None
        except json.JSONDecodeError as error:
            raise DataError(f"{path}: not JSON ({error})") from None
        if table.get("format") != FORMAT:
            raise DataError(f"{path}: the format is '{table.get('format')}', expected '{FORMAT}'")
        return cls(Path(folder), float(table["scale"]), int(table["planes"]), int(table.get("refined", 0)))

    def of(self, number):
        """Returns depths float16 (V + R, H, W) and fields float16 (V + R, 6, H, W) of a scene. Refined depths are
        last."""
        depths, fields = (self._array(f"{name}_{number:06d}.npy") for name in ("depth", "seed"))
        if self.refined:
            depths = np.concatenate([depths, self._array(f"refined_{number:06d}.npy")])
        if fields.shape != (len(depths), 6, *depths.shape[1:]):
            raise DataError(f"{self.folder}: depths {depths.shape} and fields {fields.shape} of scene {number} do not belong together")
        return (depths / np.float32(65535)).astype(np.float16), (fields / np.float32(self.scale)).astype(np.float16)

    def _array(self, name):
        try:
            return np.load(self.folder / name)
        except (OSError, ValueError, EOFError) as error:
            raise DataError(f"{self.folder / name}: damaged ({error})") from None
