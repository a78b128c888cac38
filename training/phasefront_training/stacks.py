"""Incoherent focal stacks of a data set's scenes: what natural focus looks like, the goal of networks for it.

`phasefront-lab stacks` makes them from whole layered scenes with exact occlusion, through the whole aperture:
`stack_000123.npz` with `depths`, float32 (K), normalized, and `amplitudes`, uint8 (K, 3, H, W), times 255.
"""

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .data import DataError, call_laboratory


def make(manifest, output, arguments, command="phasefront-lab"):
    """Makes or completes the stacks of a data set."""
    call = [command, "stacks", str(manifest.folder), "-o", str(output), *arguments]
    call_laboratory(call)


@dataclass(frozen=True)
class Stacks:
    """A folder of stacks."""

    folder: Path

    @classmethod
    def read(cls, folder):
        if not Path(folder).is_dir():
            raise DataError(f"{folder}: not there; make the stacks first (python -m phasefront_training stacks)")
        return cls(Path(folder))

    def of(self, number):
        """Returns depths of focus float32 (K) and amplitudes uint8 (K, 3, H, W) of a scene."""
        path = self.folder / f"stack_{number:06d}.npz"
        try:
            with np.load(path) as arrays:
                depths, amplitudes = arrays["depths"], arrays["amplitudes"]
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise DataError(f"{path}: damaged ({error})") from None
        if amplitudes.shape[:2] != (len(depths), 3):
            raise DataError(f"{path}: {len(depths)} depths do not belong to amplitudes {amplitudes.shape}")
        return depths, amplitudes
