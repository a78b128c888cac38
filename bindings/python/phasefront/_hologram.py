"""Results: holograms, their displayed images and their files."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy
from numpy.typing import NDArray

from . import _ffi, _png
from ._ffi import Display, Encoding, HologramInfo, Layout, PhasefrontError, Placement
from ._memory import array_at
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
    names = [("double", Encoding.DOUBLE_PHASE), ("anti-alias", Encoding.ANTI_ALIAS), ("band-limit", Encoding.BAND_LIMIT)]
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

    def preview(self, z_mm: float, width: int, height: int) -> NDArray[numpy.uint8]:
        """Returns the displayed image for an eye focused at `z_mm`: red, green, blue, alpha, uint8, (height, width, 4).
        Read only.

        Raises `PhasefrontError.Setting` if the image is empty or too large, or if z is too far away.
        """
        if width < 1 or height < 1:
            raise PhasefrontError.Setting(f"a preview of {width}×{height} is empty; each side must be at least 1")
        image = self._raw.preview(z_mm, width, height)
        return array_at(image, image.address(), (height, width, 4), numpy.uint8)

    def refocus(self, z_mm: float) -> NDArray[numpy.float32]:
        """Returns the displayed image of the whole hologram for an eye focused at `z_mm`, as amplitudes; 1 is white,
        float32, (C, H, W). Read only.

        Raises `PhasefrontError.Setting` if z is too far away.
        """
        return self._numbers(self._raw.refocus(z_mm), numpy.float32)

    def field(self, z_mm: float = 0.0) -> NDArray[numpy.complex64]:
        """Returns the complex field of the levels behind the aperture at `z_mm` (0 is the midpoint), complex64,
        (C, H, W), without the carrier exp(i2πz/λ). Read only.

        Raises `PhasefrontError.Setting` if z is too far away.
        """
        return self._numbers(self._raw.field(z_mm), numpy.complex64)

    def _numbers(self, planes: _ffi.RawPlanes, kind: type[Number]) -> NDArray[Number]:
        """Returns planes as an array of this type."""
        return array_at(planes, planes.plane_address(0), self._shape, kind)

    def output(self, placement: Placement | None = None, image: int = 0) -> NDArray[numpy.uint8]:
        """Returns image `image` of the images for the modulator's driver, at the modulator's resolution, with unchanged
        levels, uint8, (H, W, bytes per pixel). All layouts except grey have one image. RGB is the default. Read only.

        Raises `PhasefrontError.Setting` if the layout has no such image.
        """
        output = self._raw.output(placement or Placement(layout=Layout.RGB), image)
        return array_at(output, output.address(), (output.height(), output.width(), output.pixel_bytes()), numpy.uint8)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the levels and their metadata as a PNG, like the command `phasefront hologram`. `phasefront refocus`
        and `phasefront view` read it. If the target is a calibration file, these commands need its `--display`.

        Raises `PhasefrontError.File` if the file cannot be written or its name does not end in .png, and
        `PhasefrontError.Setting` if the display has more than 8 bits, because a byte cannot hold its levels.
        """
        file = Path(path)
        if file.suffix.lower() != ".png":
            raise PhasefrontError.File(f"{file}: the name must end in .png")
        bits = self._purpose.target.display().bits
        if bits > 8:
            raise PhasefrontError.Setting(f"save writes levels of up to 8 bits; the display has {bits}; take output()")
        try:
            _png.write(file, self.levels.transpose(1, 2, 0), "phasefront", self._purpose.told(self.info.scale))
        except OSError as error:
            raise PhasefrontError.File(f"{file}: cannot be written: {error.strerror}") from None
