"""The memory of arrays, passed to the library in place."""

from __future__ import annotations

import ctypes
from typing import Any, TypeVar

import numpy
from numpy.typing import ArrayLike

from ._ffi import RawMemory, SettingError
from ._take import forbid_copies
from .ffi import phasefront_ffi as _generated

Kind = TypeVar("Kind", bound=numpy.generic)

#: The largest size in bytes. The generated code counts bytes in 32 bits.
MOST_BYTES = 2**31 - 1


def as_array(values: Any) -> numpy.ndarray[Any, Any]:
    """Returns arrays and tensors in place, by DLPack if that is all they have, and anything else as a new array.

    Raises one of `NO_ARRAY` for what is no array or lies in a GPU's memory, and for a tensor that requires a gradient.
    """
    if hasattr(values, "__dlpack__") and not hasattr(values, "__array__"):
        return numpy.from_dlpack(values)
    return numpy.asarray(values)


#: What NumPy and tensors raise instead of becoming an array.
NO_ARRAY = (TypeError, ValueError, RuntimeError, BufferError)


class Memory:
    """The memory of an array, passed without a copy."""

    def __init__(self, array: numpy.ndarray[Any, Any] | None = None):
        self.array = array
        self.address, self.size = 0, 0
        if array is not None and array.size > 0:
            self.address = array.ctypes.data
            self.size = sum((n - 1) * s for n, s in zip(array.shape, array.strides)) + array.itemsize


forbid_copies(Memory)


class _ByRefBytes:
    """A converter that accepts any memory for a `&[u8]`. The generated converter accepts only `bytes`."""

    @staticmethod
    def check_lower(value: object) -> None:
        if not isinstance(value, (bytes, Memory)):
            raise TypeError(f"bytes are needed, not {type(value).__name__}")

    @staticmethod
    def lower(value: bytes | Memory) -> Any:
        to = _generated._UniffiForeignBytes()
        if isinstance(value, bytes):
            value = Memory(numpy.frombuffer(value, numpy.uint8))
        if value.size > MOST_BYTES:
            raise SettingError(f"{value.size} bytes are too many; {MOST_BYTES} are the most")
        to.len = value.size
        if value.size > 0:
            to.data = ctypes.cast(value.address, ctypes.POINTER(ctypes.c_char))
            to.memory = value
        return to


_generated._UniffiFfiConverterByRefBytes = _ByRefBytes


def image(out: ArrayLike | None, shape: tuple[int, int, int], kind: type[Kind]) -> tuple[numpy.typing.NDArray[Kind], RawMemory]:
    """Returns the array that an image is written into, `out` or a new one, and its memory.

    Raises `SettingError` if `out` has another type or shape, gaps inside rows, or is read only.
    """
    try:
        array = numpy.empty(shape, kind) if out is None else as_array(out)
    except NO_ARRAY as error:
        raise SettingError(f"out is no array: {error}") from None
    _, width, values = shape
    packed = array.itemsize * values, array.itemsize
    if array.dtype != kind or array.shape != shape or not array.flags.writeable or array.strides[1:] != packed or array.strides[0] < width * packed[0]:
        raise SettingError(f"out must be a writable array of {numpy.dtype(kind)}, {shape}, without gaps inside rows")
    length = (shape[0] - 1) * array.strides[0] + width * packed[0]
    return array, RawMemory(address=array.ctypes.data, length=length, row_stride=array.strides[0])


def array_at(owner: object, address: int, shape: tuple[int, ...], kind: type[Kind]) -> numpy.typing.NDArray[Kind]:
    """Returns the library's memory as a read-only array that keeps its owner alive."""
    memory: Any = (ctypes.c_uint8 * (numpy.dtype(kind).itemsize * int(numpy.prod(shape)))).from_address(address)
    memory.owner = owner
    array = numpy.frombuffer(memory, kind).reshape(shape)
    array.flags.writeable = False
    return array
