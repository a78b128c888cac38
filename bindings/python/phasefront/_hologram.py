"""Results: holograms, their displayed images and their files."""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy
from numpy.typing import NDArray

from . import _ffi, _png
from ._ffi import Display, Encoding, FileError, HologramInfo, Layout, Placement, SettingError
from ._memory import NO_ARRAY, Memory, array_at, image
from ._take import shown, take
from ._target import Target

Number = TypeVar("Number", numpy.float32, numpy.complex64)


#: The longest side of the picture of a notebook, in pixels.
_NOTEBOOK = 640
#: The longest side of a preview, in pixels.
_LONGEST_SIDE = 2**14


@dataclass(frozen=True)
class Purpose:
    """The target and the encoding of a session's holograms."""

    target: _ffi.Target
    #: The name on the command line.
    encoder: str

    @classmethod
    def of(cls, target: _ffi.Target, encoding: Encoding) -> Purpose:
        """Returns the purpose of holograms for `target` by `encoding`."""
        return cls(target, _encoder(encoding))

    def told(self, scale: float, levels: NDArray[numpy.uint8], srgb_of_light: list[float] | None) -> str:
        """Returns the metadata of a hologram's file in the format of the command `phasefront`."""
        target = self.target
        display = target.display()
        told: dict[str, object] = {"display": _display(display), "encoder": self.encoder, "scale": scale}
        # The command sees by it whether another program changed the levels.
        told["levels"] = f"{zlib.crc32(levels.tobytes(), zlib.crc32(struct.pack('<3Q', *levels.shape))):08x}"
        if isinstance(target, Target) and target._table is not None:
            told["lut"] = list(target._table)
        if not isinstance(target, Target) or target._calibrated:
            told["calibrated"] = ["the display's calibration"]
        if srgb_of_light is not None:
            told["srgb_of_light"] = numpy.reshape(srgb_of_light, (3, -1)).tolist()
        return json.dumps(told)


def _display(display: Display) -> dict[str, object]:
    """Returns a display with the keys of its TOML form."""
    fields = {name: value for name, value in vars(display).items() if value is not None}
    for name in ("red_nm", "green_nm", "blue_nm", "laser_nm"):
        fields.pop(name, None)
    if "primaries" in fields:
        fields["primaries"] = numpy.reshape(fields["primaries"], (3, 3)).tolist()
    return fields | {"wavelengths_nm": display.wavelengths_nm}


def _encoder(encoding: Encoding) -> str:
    """Returns the name of an encoding on the command line."""
    names = [("double", Encoding.double_phase), ("anti-alias", Encoding.anti_alias), ("band-limit", Encoding.band_limit)]
    return next((name for name, kind in names if isinstance(encoding, kind)), "deep")


class Hologram:
    """The hologram of one frame. The session reuses its memory when the hologram and all its arrays are gone.

    `numpy.asarray` takes its levels. Notebooks show its preview. Pickling keeps the levels with their metadata, but not
    the scene's depth: the `z_at` of a copy returns 0.
    """

    #: The metadata of the hologram.
    info: HologramInfo

    def __init__(self, raw: _ffi.RawHologram, purpose: Purpose, info: HologramInfo | None = None):
        self._raw, self._purpose = raw, purpose
        self.info = info or raw.info()
        self._shape = (self.info.colours, self.info.height, self.info.width)

    @property
    def levels(self) -> NDArray[numpy.uint8]:
        """The modulator levels in place, uint8, (3, H, W): red, green, blue; (1, H, W) for a single laser. Read
        only."""
        return array_at(self._raw, self._raw.plane_address(0), self._shape, numpy.uint8)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Returns the levels. NumPy calls it."""
        if dtype is not None and numpy.dtype(dtype) != numpy.uint8:
            return self.levels.astype(dtype)
        return self.levels.copy() if copy else self.levels

    def __repr__(self) -> str:
        colours, height, width = self._shape
        return f"Hologram({width}×{height}, {colours} colours, scale={self.info.scale:.4g}, timestamp_ns={self.info.timestamp_ns})"

    def _repr_png_(self) -> bytes:
        """Returns the preview in the middle of the volume as a PNG. Notebooks call it."""
        _, height, width = self._shape
        part = min(1, _NOTEBOOK / max(height, width))
        width, height = (max(1, round(part * side)) for side in (width, height))
        return _png.encoded(self.preview(width=width, height=height), {})

    def __reduce__(self) -> tuple[Any, ...]:
        """Returns the levels and their metadata. `pickle` and `copy` call it.

        Raises `SettingError` if the display has more than 8 bits, because a byte cannot hold its levels.
        """
        target, encoder = self._purpose.target, self._purpose.encoder
        self._check_bits("pickle holds")
        state = (target._table, target._calibrated) if isinstance(target, Target) else None
        return _restored, (numpy.array(self.levels), self.info, target.to_bytes(), state, encoder)

    def _check_bits(self, what: str) -> None:
        bits = self._purpose.target.display().bits
        if bits > 8:
            raise SettingError(f"{what} levels of up to 8 bits; the display has {bits}; take output()")

    def z_at(self, x: float, y: float) -> float:
        """Returns the z in mm of the scene point at (x, y) of the image, each 0 to 1 from the upper left corner."""
        return self._raw.z_at(x, y)

    def preview(
        self,
        z_mm: float = 0.0,
        *,
        width: int | None = None,
        height: int | None = None,
        layout: Layout = Layout.RGB,
        out: NDArray[numpy.uint8] | None = None,
    ) -> NDArray[numpy.uint8]:
        """Returns the displayed image in sRGB for an eye focused at `z_mm`: uint8, (height, width, 3).

        Args:
            z_mm: The z of the focus. By default the middle of the volume.
            width: The width in pixels. By default that of the hologram.
            height: The height in pixels. By default that of the hologram.
            layout: RGB, or RGBA or BGRA with (height, width, 4).
            out: The array to write into and to return, for example one for all frames. Its rows may have gaps.

        Raises `SettingError` if the image is empty or too large, if z is too far away, or if `out` does not
        fit.
        """
        width = take("width", self.info.width if width is None else width, int)
        height = take("height", self.info.height if height is None else height, int)
        if not (1 <= width <= _LONGEST_SIDE and 1 <= height <= _LONGEST_SIDE):
            wrong = "empty" if width < 1 or height < 1 else "too large"
            raise SettingError(f"a preview of {width}×{height} is {wrong}; each side must be 1 to {_LONGEST_SIDE}")
        layout = take("layout", layout, Layout)
        array, memory = image(out, (height, width, 3 if layout == Layout.RGB else 4), numpy.uint8)
        self._raw.write_preview(z_mm, width, height, layout, memory)
        return array

    def refocus(self, z_mm: float | Sequence[float] | NDArray[Any]) -> NDArray[numpy.float32]:
        """Returns the displayed image of the whole hologram for an eye focused at `z_mm`, as amplitudes; 1 is white,
        float32, (C, H, W). Read only. For several z it returns their focal stack, (Z, C, H, W).

        Raises `SettingError` if a z is too far away.
        """
        try:
            foci = numpy.asarray(z_mm, numpy.float64)
        except NO_ARRAY:
            raise SettingError(f"z_mm is {shown(z_mm)}; a number or several are right") from None
        if foci.ndim > 1:
            raise SettingError(f"z_mm is {shown(z_mm)}; a number or several in a row are right")
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
        placement = take("placement", placement or Placement(layout=Layout.RGB), Placement)
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
        file = Path(take("path", path, str))
        if file.suffix.lower() != ".png":
            raise FileError(f"{file}: the name must end in .png")
        self._check_bits("save writes")
        texts = {"phasefront": self._purpose.told(self.info.scale, self.levels, self._raw.srgb_of_light())}
        try:
            _png.write(file, _png.encoded(self.levels.transpose(1, 2, 0), texts))
        except OSError as error:
            raise FileError(f"{file}: cannot be written: {error.strerror}") from None


def _restored(
    levels: NDArray[numpy.uint8], info: HologramInfo, target: bytes, state: tuple[bytes | None, bool] | None, encoder: str
) -> Hologram:
    """Returns the hologram that was pickled."""
    made = (_ffi.Target if state is None else Target).from_bytes(target)
    if isinstance(made, Target) and state is not None:
        made._table, made._calibrated = state
    memory: Any = Memory(levels)
    raw = _ffi.RawHologram.from_levels(memory, info, made)
    return Hologram(raw, Purpose(made, encoder), info)
