"""Results: holograms, their displayed images and their files."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy
from numpy.typing import NDArray

from . import _ffi, _png
from ._ffi import Display, Encoding, FileError, HologramInfo, Layout, Placement, SettingError
from ._memory import array_at, image
from ._target import Target

Number = TypeVar("Number", numpy.float32, numpy.complex64)


@dataclass(frozen=True)
class Purpose:
    """The target and the encoding of a session's holograms."""

    target: _ffi.Target
    encoding: Encoding

    def told(self, scale: float) -> str:
        """Returns the metadata of a hologram's file in the format of the command `phasefront`."""
        target = self.target
        display = target.display()
        told: dict[str, object] = {"display": _display(display), "encoder": _encoder(self.encoding), "scale": scale}
        if isinstance(target, Target) and target._table is not None:
            told["lut"] = list(target._table)
        if not isinstance(target, Target) or target._calibrated:
            told["calibrated"] = ["the display's calibration"]
        return json.dumps(told)


def _display(display: Display) -> dict[str, object]:
    """Returns a display with the keys of its TOML form."""
    fields = dict(vars(display))
    three = [fields.pop(f"{colour}_nm") for colour in ("red", "green", "blue")]
    laser = fields.pop("laser_nm")
    return fields | {"wavelengths_nm": three if laser is None else [laser]}


def _encoder(encoding: Encoding) -> str:
    """Returns the name of an encoding on the command line."""
    names = [("double", Encoding.double_phase), ("anti-alias", Encoding.anti_alias), ("band-limit", Encoding.band_limit)]
    return next((name for name, kind in names if isinstance(encoding, kind)), "deep")


class Hologram:
    """The hologram of one frame. The session reuses its memory when the hologram and all its arrays are gone."""

    #: The metadata of the hologram.
    info: HologramInfo

    def __init__(self, raw: _ffi.RawHologram, purpose: Purpose):
        self._raw, self._purpose = raw, purpose
        self.info = raw.info()
        self._shape = (self.info.colours, self.info.height, self.info.width)

    @property
    def levels(self) -> NDArray[numpy.uint8]:
        """The modulator levels in place, uint8, (3, H, W): red, green, blue; (1, H, W) for a single laser. Read
        only."""
        return array_at(self._raw, self._raw.plane_address(0), self._shape, numpy.uint8)

    def z_at(self, x: float, y: float) -> float:
        """Returns the z in mm of the scene point at (x, y) of the image, each 0 to 1 from the upper left corner."""
        return self._raw.z_at(x, y)

    def preview(
        self,
        z_mm: float,
        width: int,
        height: int,
        *,
        layout: Layout = Layout.RGB,
        out: NDArray[numpy.uint8] | None = None,
    ) -> NDArray[numpy.uint8]:
        """Returns the displayed image for an eye focused at `z_mm`: red, green, blue, uint8, (height, width, 3).

        Args:
            z_mm: The z of the focus.
            width: The width in pixels.
            height: The height in pixels.
            layout: RGB, or RGBA or BGRA with (height, width, 4).
            out: The array to write into and to return, for example one for all frames. Its rows may have gaps.

        Raises `SettingError` if the image is empty or too large, if z is too far away, or if `out` does not
        fit.
        """
        if width < 1 or height < 1:
            raise SettingError(f"a preview of {width}×{height} is empty; each side must be at least 1")
        array, memory = image(out, (height, width, 3 if layout == Layout.RGB else 4), numpy.uint8)
        self._raw.write_preview(z_mm, width, height, layout, memory)
        return array

    def refocus(self, z_mm: float | Sequence[float] | NDArray[Any]) -> NDArray[numpy.float32]:
        """Returns the displayed image of the whole hologram for an eye focused at `z_mm`, as amplitudes; 1 is white,
        float32, (C, H, W). Read only. For several z it returns their focal stack, (Z, C, H, W).

        Raises `SettingError` if a z is too far away.
        """
        foci = numpy.asarray(z_mm, numpy.float64)
        if foci.ndim == 0:
            return self._numbers(self._raw.refocus(float(foci)), numpy.float32)
        stack = numpy.empty((len(foci), *self._shape), numpy.float32)
        for image, z in zip(stack, foci):
            image[...] = self.refocus(z)
        return stack

    def field(self, z_mm: float = 0.0) -> NDArray[numpy.complex64]:
        """Returns the complex field of the levels behind the aperture at `z_mm` (0 is the midpoint), complex64,
        (C, H, W), without the carrier exp(i2πz/λ). Read only.

        Raises `SettingError` if z is too far away.
        """
        return self._numbers(self._raw.field(z_mm), numpy.complex64)

    def _numbers(self, planes: _ffi.RawPlanes, kind: type[Number]) -> NDArray[Number]:
        """Returns planes as an array of this type."""
        return array_at(planes, planes.plane_address(0), self._shape, kind)

    def output(
        self, placement: Placement | None = None, index: int = 0, *, out: NDArray[Any] | None = None
    ) -> NDArray[Any]:
        """Returns one of the images for the modulator's driver, at the modulator's resolution, with unchanged levels:
        uint8, (H, W, bytes per pixel), but uint16, (H, W, 1), for GREY16 and uint32, (H, W, 1), for RGB10.

        Args:
            placement: The layout, flips and shifts. By default RGB in the middle.
            index: The index of the image: all layouts except GREY and GREY16 have one.
            out: The array to write into and to return, for example one for all frames. Its rows may have gaps.

        Raises `SettingError` if the layout has no such image or `out` does not fit.
        """
        placement = placement or Placement(layout=Layout.RGB)
        size = self._raw.output_size(placement.layout)
        kind: type[Any] = {Layout.GREY16: numpy.uint16, Layout.RGB10: numpy.uint32}.get(placement.layout, numpy.uint8)
        array, memory = image(out, (size.height, size.width, size.pixel_bytes // numpy.dtype(kind).itemsize), kind)
        self._raw.write_output(placement, index, memory)
        return array

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the levels and their metadata as a PNG, like the command `phasefront hologram`. `phasefront refocus`
        and `phasefront view` read it. If the target is a calibration file, these commands need its `--display`.

        Raises `FileError` if the file cannot be written or its name does not end in .png, and
        `SettingError` if the display has more than 8 bits, because a byte cannot hold its levels.
        """
        file = Path(path)
        if file.suffix.lower() != ".png":
            raise FileError(f"{file}: the name must end in .png")
        bits = self._purpose.target.display().bits
        if bits > 8:
            raise SettingError(f"save writes levels of up to 8 bits; the display has {bits}; take output()")
        try:
            _png.write(file, self.levels.transpose(1, 2, 0), "phasefront", self._purpose.told(self.info.scale))
        except OSError as error:
            raise FileError(f"{file}: cannot be written: {error.strerror}") from None
