"""Frames: arrays of colour and depth with their description for the library."""

from __future__ import annotations

from typing import Any, TypedDict

import numpy
from numpy.typing import ArrayLike

from . import _ffi
from ._ffi import (
    Cameras,
    ColourFormat,
    ConfidenceFormat,
    DepthFormat,
    FrameError,
    Orientation,
    RgbEncoding,
    Rotation,
    YuvMatrix,
)
from ._memory import MOST_BYTES, NO_ARRAY, Memory, as_array
from ._take import forbid_copies, shown, take

_Array = numpy.ndarray[Any, Any]

_DEPTH_FORMATS = {
    "float32": DepthFormat.METRES_F32,
    "float16": DepthFormat.METRES_F16,
    "uint16": DepthFormat.MILLIMETRES_U16,
    "uint8": DepthFormat.NORMALIZED_U8,
}
_DEPTH_TYPES = {
    DepthFormat.METRES_F32: "float32",
    DepthFormat.METRES_F16: "float16",
    DepthFormat.DISPARITY_F32: "float32",
    DepthFormat.DISPARITY_F16: "float16",
    DepthFormat.MILLIMETRES_U16: "uint16",
    DepthFormat.ANDROID_DEPTH16: "uint16",
    DepthFormat.NORMALIZED_U8: "uint8",
    DepthFormat.NORMALIZED_U16: "uint16",
    DepthFormat.RELATIVE_F32: "float32",
    DepthFormat.RELATIVE_F16: "float16",
}
_CHANNELS = {
    ColourFormat.RGB: [("colour", 3)],
    ColourFormat.RGBA: [("colour", 4)],
    ColourFormat.BGRA: [("colour", 4)],
    ColourFormat.NV12: [("luma", 1), ("chroma", 2)],
    ColourFormat.YUV420: [("luma", 1), ("U chroma", 1), ("V chroma", 1)],
}


def _array(what: str, values: ArrayLike) -> _Array:
    try:
        return as_array(values)
    except NO_ARRAY as error:
        raise FrameError(f"frame: {what} is no array: {error}") from None


def _plane(what: str, array: _Array, dtype: str, pixel: int) -> tuple[Memory, _ffi.PlaneInfo, int, int]:
    """Returns the memory, strides, width and height of an image of (H, W) or (H, W, pixel) values."""
    dimensions = 2 if pixel == 1 else 3
    if array.ndim != dimensions or (pixel > 1 and array.shape[2] != pixel):
        right = "(H, W)" if pixel == 1 else f"(H, W, {pixel})"
        raise FrameError(f"frame: {what} is {array.shape}; {right} is right{_order(what, array, pixel)}")
    if array.dtype != dtype or array.dtype.byteorder == ">":
        raise FrameError(f"frame: {what} holds {array.dtype}; {dtype} is needed{_remedy(what, array, dtype)}")
    # The library reads images row by row, as from cameras. Rotated or mirrored arrays are copied.
    rows, pixels = array.strides[:2]
    value = pixel * array.itemsize
    is_plain = pixels >= value and rows >= (array.shape[1] - 1) * pixels + value
    if not (is_plain and (pixel == 1 or array.strides[2] == array.itemsize)):
        array = numpy.ascontiguousarray(array)
        rows, pixels = array.strides[:2]
    memory = Memory(array)
    if memory.size > MOST_BYTES or rows >= 2**31:
        raise FrameError(
            f"frame: {what} is {array.shape} over {memory.size} bytes; {MOST_BYTES} bytes are the most"
        )
    return memory, _ffi.PlaneInfo(row_stride=rows, pixel_stride=pixels), array.shape[1], array.shape[0]


def _order(what: str, array: _Array, pixel: int) -> str:
    """Returns a hint that brings the axes of a tensor into order, or nothing."""
    if pixel > 1 and array.ndim == 3 and array.shape[0] == pixel:
        return f": {what}.permute(1, 2, 0) of a tensor, {what}.transpose(1, 2, 0) of an array"
    if pixel > 1 and array.ndim == 4 and array.shape[:2] == (1, pixel):
        return f": {what}[0].permute(1, 2, 0) of a tensor, {what}[0].transpose(1, 2, 0) of an array"
    if array.ndim > 2 and pixel == 1 and set(array.shape[:-2]) == {1}:
        return f": {what}.reshape({what}.shape[-2:])"
    return ""


def _remedy(what: str, array: _Array, dtype: str) -> str:
    """Returns a hint that converts an image's numbers to bytes, or nothing."""
    if dtype == "uint8" and array.dtype.kind == "f":
        return f"; where 1 is the most, (255 * {what}).round().astype(numpy.uint8) makes it so"
    if dtype == "uint8" and array.dtype == "uint16":
        return f"; ({what} >> 8).astype(numpy.uint8) makes it so"
    return ""


def _colour(colour: ArrayLike, colour_format: ColourFormat | None) -> tuple[list[_Array], ColourFormat]:
    """Returns the planes of a colour image and their format."""
    planar = isinstance(colour, (tuple, list))
    if planar and colour_format is None:
        raise FrameError("frame: colour comes in planes; say whether it is ColourFormat.NV12 or YUV420")
    images = [_array("colour", plane) for plane in colour] if isinstance(colour, (tuple, list)) else [_array("colour", colour)]
    if colour_format is None:
        grey = images[0].ndim == 2
        if grey:
            images = [numpy.stack(3 * [images[0]], axis=2)]
        rgba = images[0].ndim > 2 and (images[0].shape[-1] == 4 or images[0].shape[-3] == 4)
        colour_format = ColourFormat.RGBA if rgba else ColourFormat.RGB
    if len(images) != len(_CHANNELS[colour_format]):
        needed = len(_CHANNELS[colour_format])
        raise FrameError(f"frame: {len(images)} colour planes are given; {colour_format.name} has {needed}")
    return images, colour_format


def _depth(depth: ArrayLike, depth_format: DepthFormat | None) -> tuple[_Array, DepthFormat]:
    """Returns a depth image and its format. Rounds 64-bit numbers to 32 bits; infinite results are no readings."""
    array = _array("depth", depth)
    if array.dtype == "float64":
        with numpy.errstate(over="ignore"):
            array = array.astype(numpy.float32)
    if depth_format is None:
        depth_format = _DEPTH_FORMATS.get(str(array.dtype))
    if depth_format is None:
        raise FrameError(
            f"frame: depth holds {array.dtype}; metres are float32, float16 or float64: depth.astype(numpy.float32); "
            "millimetres are uint16: depth.astype(numpy.uint16)"
        )
    return array, depth_format


def arguments(frame: Frame) -> tuple[Any, ...]:
    """Returns the arguments of the generated calls that take `frame`.

    Raises `FrameError` for anything else.
    """
    if not isinstance(frame, Frame):
        raise FrameError(f"frame is {shown(frame)}; Frame(colour, depth) makes one of arrays")
    return frame._arguments()


class FrameOptions(TypedDict, total=False):
    """Arguments of `Frame` that are the same for all frames of a batch."""

    colour_format: ColourFormat | None
    depth_format: DepthFormat | None
    orientation: Orientation | None
    cameras: Cameras | None
    encoding: RgbEncoding


def batch(what: str, values: ArrayLike) -> _Array:
    """Returns images along the first axis of an array."""
    array = _array(what, values)
    if array.ndim < 3:
        raise FrameError(f"frames: {what} is {array.shape}; the first axis counts frames, (N, H, W) or (N, H, W, 3)")
    return array


class Frame:
    """A colour image and a depth image of the same moment.

    Args:
        colour: uint8: (H, W) for grey, (H, W, 3) for RGB, (H, W, 4) for RGBA or BGRA; for NV12 the pair of luma (H, W)
            and chroma (H/2, W/2, 2), for YUV 420 the three planes. Halves are rounded up.
        depth: (h, w): metres in float32, float16 or float64, millimetres in uint16, or normalized in uint8 (0 nearest,
            255 farthest), unless `depth_format` is given. Except in normalized and relative depth, 0, negative
            numbers, NaN, 10⁹ and more, 65535 in uint16 and 65504 in float16 are no reading. Without depth, the
            session's depth network estimates it.
        timestamp_ns: The capture time in nanoseconds of any monotonic clock. Image sessions ignore it.
        colour_format: The memory layout of the colour image. Required for BGRA and for planes.
        depth_format: The meaning of the depth's numbers, if the default is wrong.
        confidence: The confidence of the depth, uint8, (h, w).
        confidence_format: The meaning of the confidence's numbers.
        matrix: The matrix that converts luma and chroma to colour. RGB formats ignore it.
        video_range: Whether luma spans 16 to 235 instead of 0 to 255. RGB formats ignore it.
        orientation: The rotation and mirroring that bring the sensor's image upright. By default it is upright.
        cameras: The colour camera and the depth camera, if they are apart.
        encoding: The meaning of red, green and blue: `RgbEncoding.DISPLAY_P3` for photographs of phones, `AMPLITUDE` for
            the amplitudes of the paper's data sets.

    Anything that NumPy reads in place will do for an array, such as a tensor of PyTorch or an object with DLPack.

    A session reads the arrays in place, during the call that takes the frame. Grey images, float64 depth and rotated or
    mirrored arrays are copied. Raises `FrameError` for arrays of other types or shapes.
    """

    def __init__(
        self,
        colour: ArrayLike,
        depth: ArrayLike | None = None,
        *,
        timestamp_ns: int = 0,
        colour_format: ColourFormat | None = None,
        depth_format: DepthFormat | None = None,
        confidence: ArrayLike | None = None,
        confidence_format: ConfidenceFormat = ConfidenceFormat.U8,
        matrix: YuvMatrix = YuvMatrix.BT601,
        video_range: bool = False,
        orientation: Orientation | None = None,
        cameras: Cameras | None = None,
        encoding: RgbEncoding = RgbEncoding.SRGB,
    ):
        colour_format = take("colour_format", colour_format, ColourFormat | None)
        depth_format = take("depth_format", depth_format, DepthFormat | None)
        images, colour_format = _colour(colour, colour_format)
        channels = _CHANNELS[colour_format]
        planes = [_plane(what, image, "uint8", pixel) for (what, pixel), image in zip(channels, images)]
        self._colour = [plane[0] for plane in planes] + [Memory()] * (3 - len(planes))

        self._depth, depth_info = Memory(), None
        if depth is not None:
            array, depth_format = _depth(depth, depth_format)
            self._depth, plane, width, height = _plane("depth", array, _DEPTH_TYPES[depth_format], 1)
            depth_info = _ffi.DepthInfo(format=depth_format, width=width, height=height, plane=plane)

        self._confidence, confidence_info = Memory(), None
        if confidence is not None:
            array = _array("confidence", confidence)
            self._confidence, plane, width, height = _plane("confidence", array, "uint8", 1)
            confidence_info = _ffi.ConfidenceInfo(format=take("confidence_format", confidence_format, ConfidenceFormat), width=width, height=height, plane=plane)

        self._info = _ffi.FrameInfo(
            timestamp_ns=take("timestamp_ns", timestamp_ns, int),
            colour=_ffi.ColourInfo(
                format=colour_format,
                width=planes[0][2],
                height=planes[0][3],
                planes=[plane[1] for plane in planes],
                matrix=take("matrix", matrix, YuvMatrix),
                video_range=take("video_range", video_range, bool),
                encoding=take("encoding", encoding, RgbEncoding),
            ),
            depth=depth_info,
            confidence=confidence_info,
            orientation=take("orientation", orientation or Orientation(rotation=Rotation.UPRIGHT, mirrored=False), Orientation),
            cameras=take("cameras", cameras, Cameras | None),
        )

    def __repr__(self) -> str:
        colour, depth = self._info.colour, self._info.depth
        told = f"{colour.width}×{colour.height} {colour.format.name}"
        told += f", depth {depth.width}×{depth.height} {depth.format.name}" if depth else ", no depth"
        return f"Frame({told}, timestamp_ns={self._info.timestamp_ns})"

    def _arguments(self) -> tuple[Any, ...]:
        return (*self._colour, self._depth, self._confidence, self._info)


forbid_copies(Frame)
