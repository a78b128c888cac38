"""The memory of arrays, passed to the library in place."""

from __future__ import annotations

import ctypes
from typing import Any, TypeVar

import numpy

from ._ffi import PhasefrontError
from .ffi import phasefront_ffi as _generated

Kind = TypeVar("Kind", bound=numpy.generic)

#: The largest size in bytes. The generated code counts bytes in 32 bits.
MOST_BYTES = 2**31 - 1


class Memory:
    """The memory of an array, passed without a copy."""

    def __init__(self, array: numpy.ndarray[Any, Any] | None = None):
        self.array = array
        self.address, self.size = 0, 0
        if array is not None and array.size > 0:
            self.address = array.ctypes.data
            self.size = sum((n - 1) * s for n, s in zip(array.shape, array.strides)) + array.itemsize


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
            raise PhasefrontError.Setting(f"{value.size} bytes are too many; {MOST_BYTES} are the most")
        to.len = value.size
        if value.size > 0:
            to.data = ctypes.cast(value.address, ctypes.POINTER(ctypes.c_char))
            to.memory = value
        return to


_generated._UniffiFfiConverterByRefBytes = _ByRefBytes


def array_at(owner: object, address: int, shape: tuple[int, ...], kind: type[Kind]) -> numpy.typing.NDArray[Kind]:
    """Returns the library's memory as a read-only array that keeps its owner alive."""
    memory: Any = (ctypes.c_uint8 * (numpy.dtype(kind).itemsize * int(numpy.prod(shape)))).from_address(address)
    memory.owner = owner
    array = numpy.frombuffer(memory, kind).reshape(shape)
    array.flags.writeable = False
    return array
