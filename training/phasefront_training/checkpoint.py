"""Checkpoints: everything needed to continue a training exactly, or to use its weights.

Samples and focal planes are functions of (seed, rank, step), so no generator's state has to be kept.
"""

from dataclasses import dataclass, field
from pathlib import Path

import torch

from .files import replacing
from .networks import Architecture, Chain
from .optics import Display

FORMAT = "phasefront-checkpoint-1"
RENAMED = {"degraded": "sensor_depth"}  # options that early checkpoints name otherwise


class CheckpointError(Exception):
    """A file that is no checkpoint, or one of another kind; the message says which and what was expected."""


@dataclass
class Checkpoint:
    """kind: what was trained (stage1, stage2, qat). networks: {name: (architecture, weights)}.

    Where weights are averaged, those are the means, and `average` is what the training itself goes on from.
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
        except Exception as error:  # torch raises many kinds for a damaged file
            raise CheckpointError(f"{path}: no readable checkpoint ({str(error).splitlines()[0]})") from None
        if not isinstance(table, dict) or table.get("format") != FORMAT:
            raise CheckpointError(f"{path}: no checkpoint of this package (format {FORMAT})")
        del table["format"]
        table["networks"] = {name: (Architecture(**a), weights) for name, (a, weights) in table["networks"].items()}
        table["display"] = Display(**table["display"])
        table["options"] = {RENAMED.get(name, name): value for name, value in table["options"].items()}
        return cls(**table)

    def network(self, name="hologram"):
        """One of the networks with its weights."""
        architecture, weights = self.networks[name]
        network = Chain(architecture)
        network.load_state_dict(weights)
        return network


def load_network(path):
    """(network, display) of a float32 .onnx of this package or a checkpoint."""
    if Path(path).suffix == ".onnx":
        from .export import read_onnx

        return read_onnx(path)
    checkpoint = Checkpoint.load(path)
    return checkpoint.network(), checkpoint.display
