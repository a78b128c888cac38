"""Fields that come from elsewhere, and modulators with the frames that their inputs take."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from . import _ffi
from ._ffi import Brightness, EncoderOptions, Encoding, FrameError, RawMemory, SettingError
from ._hologram import Hologram, Purpose
from ._memory import MOST_BYTES, NO_ARRAY, Memory, as_array, image
from ._take import forbid_copies, shown, take
from ._target import Modulated, Targeted, target_of


class Modulator(Modulated):
    """A modulator: its display, the phases of its levels, and the frames that its input takes.

    Args:
        raw: What `named` and `from_toml` make it of.
    """

    #: The target of holograms for the modulator.
    target: _ffi.Target

    def __init__(self, raw: _ffi.RawModulator):
        if not isinstance(raw, _ffi.RawModulator):
            raise SettingError(f"raw is {shown(raw)}; Modulator.named and Modulator.from_toml make a modulator")
        self._raw = raw
        self.target = raw.target()
        self._size = raw.output_size()

    def __repr__(self) -> str:
        return f"Modulator({self.target.display()})"

    @classmethod
    def named(cls, name: str) -> Modulator:
        """Returns one of the modulators that `modulator_names` lists, for example ti-plm-p47.

        Raises `DisplayError` for any other name.
        """
        return cls(_ffi.RawModulator.named(name))

    @classmethod
    def from_toml(cls, text: str) -> Modulator:
        """Reads the text of a modulator's file, with keys such as packing and levels_turns.

        Raises `DisplayError` for text that is not TOML, an unknown key, or a value out of its range.
        """
        return cls(_ffi.RawModulator.from_toml(text))

    def pack(self, hologram: Hologram, *, out: Sequence[NDArray[numpy.uint8]] | None = None) -> list[NDArray[numpy.uint8]]:
        """Returns the images that the modulator's input takes, uint8, (H, W, bytes per pixel): one, or one for each
        colour.

        Args:
            hologram: The hologram.
            out: The arrays to write into and to return, for example those of the previous frame.

        Raises `SettingError` for a hologram that does not fit the modulator, or if `out` does not fit.
        """
        size = self._size
        if out is not None and len(out) != size.images:
            raise SettingError(f"out has {len(out)} arrays; the modulator takes {size.images}")
        images = []
        for n in range(size.images):
            array, memory = image(out[n] if out else None, (size.height, size.width, size.pixel_bytes), numpy.uint8)
            self._raw.write_output(hologram._raw, n, memory)
            images.append(array)
        return images

    def unpack(self, images: Sequence[ArrayLike], shape: tuple[int, int] | None = None) -> NDArray[numpy.uint16]:
        """Returns the levels in `images`, uint16, (C, H, W): the inverse of `pack`.

        Args:
            images: What `pack` returned, uint8.
            shape: (H, W) of the hologram in the middle of the modulator. By default it has the modulator's size.

        Raises `SettingError` for images of another type or size.
        """
        arrays = [numpy.asarray(given) for given in images]
        if any(array.dtype != numpy.uint8 for array in arrays):
            raise SettingError("images hold bytes, uint8, as pack returns them")
        display = self.target.display()
        height, width = shape or (display.height, display.width)
        values = numpy.concatenate([array.ravel() for array in arrays]) if arrays else numpy.zeros(0, numpy.uint8)
        given: Any = Memory(values)
        colours = 3 if display.laser_nm is None else 1
        levels = numpy.empty((colours, height, width), numpy.uint16)
        self._raw.read(given, width, height, RawMemory(address=levels.ctypes.data, length=levels.nbytes, row_stride=2 * width))
        return levels


forbid_copies(Modulator)


def encode(
    field: ArrayLike,
    target: Targeted | None = None,
    *,
    z_mm: float = 0.0,
    encoding: Encoding | str | None = None,
    scale: float | None = None,
    dark_threshold: float | None = None,
    local_steps: int | None = None,
    midpoint_steps: int = 0,
) -> Hologram:
    """Makes the hologram of a complex field. It propagates to the modulator, and is corrected and encoded for it.

    Args:
        field: Complex, (H, W) for one laser or (C, H, W) for C lasers, red first: an array, a tensor or an object with
            DLPack. It may be smaller than the modulator, and then lies in its middle.
        target: A display, a calibrated target, or a modulator or its name. By default the display of 1920×1080.
        z_mm: z of the field from the middle of the volume, in mm toward the viewer.
        encoding: How the field becomes phases. By default a small Gaussian blur comes first (AA-DPM).
        scale: The amplitude that full light stands for. By default the largest of the field.
        dark_threshold: See `SessionOptions`.
        local_steps: See `SessionOptions`.
        midpoint_steps: See `SessionOptions`.

    The result's depth is not known: its `z_at` returns 0. Raises `FrameError` for a field of another type or
    shape, or with values that are NaN or infinite, and `SettingError` for an option out of its range.
    """
    target = target_of(target)
    array = _field(field, 3 if target.display().laser_nm is None else 1)
    options = EncoderOptions(
        encoding=take("encoding", encoding or "anti-alias", Encoding),
        brightness=Brightness.frame_max() if scale is None else Brightness.fixed(scale=scale),
        dark_threshold=dark_threshold,
        local_steps=local_steps,
        midpoint_steps=midpoint_steps,
    )
    _, height, width = array.shape
    memory: Any = Memory(array)
    raw = _ffi.RawHologram.of_field(memory, width, height, z_mm, target, options)
    return Hologram(raw, Purpose.of(target, options.encoding))


def _field(field: ArrayLike, colours: int) -> NDArray[numpy.complex64]:
    """Returns a field as complex64, (C, H, W), without gaps."""
    try:
        given = as_array(field)
    except NO_ARRAY as error:
        raise FrameError(f"the field is no array: {error}") from None
    if given.dtype.kind != "c":
        raise FrameError(f"the field holds {given.dtype}; it must be complex: field.astype(numpy.complex64)")
    array = given[numpy.newaxis] if given.ndim == 2 else given
    if array.ndim != 3 or array.shape[0] != colours:
        right = "(H, W) of one laser" if colours == 1 else f"({colours}, H, W), red first,"
        raise FrameError(f"the field is {given.shape}; {right} is right")
    if array.size * 8 > MOST_BYTES:
        raise FrameError(f"the field is {given.shape}; {MOST_BYTES} bytes of complex64 are the most")
    with numpy.errstate(over="ignore"):
        return numpy.ascontiguousarray(array, numpy.complex64)
