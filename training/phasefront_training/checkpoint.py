"""Checkpoints, which hold everything needed to resume a training exactly or to use its weights.

Samples and focal planes are functions of (seed, rank, step), so a checkpoint holds no generator state.
"""

from dataclasses import dataclass, field
from pathlib import Path

import torch

from .files import replacing
from .networks import Architecture, Chain
from .optics import Display

FORMAT = "phasefront-checkpoint-1"
RENAMED = {"degraded": "sensor_depth"}  # the names of options in early checkpoints


class CheckpointError(Exception):
    """A file is not a checkpoint, or is a checkpoint of another kind. The message names the file and the expected
    kind."""


@dataclass
class Checkpoint:
    """The state of a training. kind: stage1, stage2 or qat. networks: {name: (architecture, weights)}.

    If the training averages its weights, `networks` holds the means, and `average` the state to resume from.
    """

    kind: str
    networks: dict
    display: Display
    step: int = 0
    elapsed_s: float = 0.0
    optimiser: dict | None = None
    average: dict | None = None
    options: dict = field(default_factory=dict)
    extra: dict = field(default_factory=dict)

    def save(self, path):
        table = {
            "format": FORMAT,
            "kind": self.kind,
            "networks": {name: (a.as_dict(), weights) for name, (a, weights) in self.networks.items()},
            "display": self.display.__dict__,
            "step": self.step,
            "elapsed_s": self.elapsed_s,
            "optimiser": self.optimiser,
            "average": self.average,
            "options": self.options,
            "extra": self.extra,
        }
        with replacing(path) as temporary:
            torch.save(table, temporary)

    @classmethod
    def load(cls, path):
        try:
            table = torch.load(path, map_location="cpu", weights_only=True)
        except FileNotFoundError:
            raise CheckpointError(f"{path}: not there") from None
        except Exception as error:  # torch raises many exceptions for a damaged file
            raise CheckpointError(f"{path}: no readable checkpoint ({str(error).splitlines()[0]})") from None
        if not isinstance(table, dict) or table.get("format") != FORMAT:
            raise CheckpointError(f"{path}: no checkpoint of this package (format {FORMAT})")
        del table["format"]
        table["networks"] = {name: (Architecture(**a), weights) for name, (a, weights) in table["networks"].items()}
        table["display"] = Display(**table["display"])
        table["options"] = {RENAMED.get(name, name): value for name, value in table["options"].items()}
        return cls(**table)

    def network(self, name="hologram"):
        """Returns a network with its weights."""
        architecture, weights = self.networks[name]
        network = Chain(architecture)
        network.load_state_dict(weights)
        return network


def load_network(path):
    """Returns (network, display) of a checkpoint or of a float32 .onnx file of this package."""
    if Path(path).suffix == ".onnx":
        from .export import read_onnx

        return read_onnx(path)
    checkpoint = Checkpoint.load(path)
    return checkpoint.network(), checkpoint.display
