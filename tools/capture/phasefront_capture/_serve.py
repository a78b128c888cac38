"""The protocol: a line of JSON for each photograph."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy
from numpy.typing import NDArray
from PIL import Image


@dataclass(frozen=True)
class Request:
    """A photograph that is asked for.

    Fields:
        colour: The laser to switch on: red, green, blue, or laser where there is one.
        wavelength_nm: Its wavelength.
        z_mm: The z that the camera focuses on, from the middle of the volume toward the viewer.
        expose: Whether the exposure may change. Otherwise it is that of the photograph before.
        settings: The settings of an earlier photograph, which may be of an earlier run.
        again: The reason why the photograph before was not good enough, if there is one.
    """

    colour: str
    wavelength_nm: float
    z_mm: float = 0.0
    expose: bool = False
    settings: dict[str, Any] = field(default_factory=dict)
    again: str | None = None


@dataclass(frozen=True)
class Photograph:
    """A photograph with the settings that it was taken with.

    Fields:
        values: uint8 or uint16, (H, W), proportional to light.
        settings: Anything that JSON can hold, for example the exposure. It comes back in later requests.
    """

    values: NDArray[Any]
    settings: dict[str, Any] = field(default_factory=dict)


#: Shows levels, uint8, (H, W), and photographs them.
Take = Callable[[NDArray[numpy.uint8], Request], "Photograph | NDArray[Any]"]


def serve(take: Take) -> None:
    """Answers the requests of the command `phasefront`, until it ends.

    Args:
        take: Shows levels, uint8, (H, W), and returns the photograph. What it raises goes to the command as the reason
            why there is none, and the command asks again.
    """
    # Drivers print to the standard output, which is the command's.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    for line in sys.stdin:
        asked = json.loads(line)
        answer: dict[str, Any]
        try:
            answer = {"done": _answer(take, asked)}
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), file=answers, flush=True)


def _answer(take: Take, asked: dict[str, Any]) -> dict[str, Any]:
    """Takes one photograph and returns its settings."""
    known = Request.__dataclass_fields__
    request = Request(**{key: value for key, value in asked.items() if key in known and value is not None})
    with Image.open(asked["show"]) as image:
        levels = numpy.asarray(image)
    taken = take(levels, request)
    photograph = taken if isinstance(taken, Photograph) else Photograph(taken)
    values = numpy.asarray(photograph.values)
    if values.dtype not in (numpy.uint8, numpy.uint16) or values.ndim != 2:
        raise TypeError(f"the photograph is {values.dtype} of shape {values.shape}; it must be uint8 or uint16, (H, W)")
    Image.fromarray(numpy.ascontiguousarray(values)).save(asked["photo"])
    return photograph.settings
