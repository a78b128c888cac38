"""RGB-D frames to phase-only 3D holograms.

>>> import numpy, phasefront
>>> display = phasefront.Display(width=64, height=48)
>>> session = phasefront.Session(phasefront.session_options(target=display))
>>> colour = numpy.full((48, 64, 3), 128, numpy.uint8)
>>> metres = numpy.full((24, 32), 0.5, numpy.float32)
>>> session.process(phasefront.Frame(colour, metres)).levels.shape
(3, 48, 64)

Arrays go in and come out through the buffer protocol, without a copy.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy

from .ffi import phasefront_ffi as _ffi
from .ffi.phasefront_ffi import (
    Backend,
    Brightness,
    Cameras,
    ColourFormat,
    ConfidenceFormat,
    DepthFormat,
    DepthRange,
    DeepPair,
    Display,
    DropReason,
    Drops,
    Encoding,
    FrameTimes,
    HologramInfo,
    Intrinsics,
    Layout,
    LogLevel,
    Method,
    Network,
    NetworkInfo,
    Orientation,
    PhasefrontError,
    Placement,
    Pose,
    Quality,
    QualityChange,
    QualityReason,
    Rotation,
    Rung,
    RunningMode,
    SessionOptions,
    Statistics,
    Target,
    Thermal,
    YuvMatrix,
    built_in_pair,
    display_from_toml,
    version,
)

__all__ = [
    "Backend", "Brightness", "Cameras", "ColourFormat", "ConfidenceFormat", "DeepPair", "DepthFormat", "DepthRange", "Display",
    "DropReason", "Dropped", "Drops", "Encoding", "Failed", "Frame", "FrameTimes", "Hologram", "HologramInfo", "Intrinsics", "Layout", "LogLevel",
    "Made", "Method", "Network", "NetworkInfo", "Orientation", "PhasefrontError", "Placement", "Pose", "Quality", "QualityChange", "QualityChanged",
    "QualityReason", "Rotation", "Rung", "RunningMode", "Session", "SessionOptions", "Statistics", "Target", "Thermal",
    "YuvMatrix", "built_in_pair", "display_from_toml", "send_log", "session_options", "version",
]  # fmt: skip

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
}


#: What is generated counts bytes in 32 bits.
_MOST_BYTES = 2**31 - 1


class _Memory:
    """The memory of an array, passed without a copy."""

    def __init__(self, array: numpy.ndarray | None = None):
        self.array = array
        self.address, self.size = None, 0
        if array is not None and array.size > 0:
            self.address = array.ctypes.data
            self.size = sum((n - 1) * s for n, s in zip(array.shape, array.strides)) + array.itemsize


class _ByRefBytes:
    """What is generated takes `bytes` alone for a `&[u8]`; this takes any memory."""

    @staticmethod
    def check_lower(value):
        if not isinstance(value, (bytes, _Memory)):
            raise TypeError(f"bytes are needed, not {type(value).__name__}")

    @staticmethod
    def lower(value):
        to = _ffi._UniffiForeignBytes()
        if isinstance(value, bytes):
            value = _Memory(numpy.frombuffer(value, numpy.uint8))
        if value.size > _MOST_BYTES:
            raise PhasefrontError.Setting(f"{value.size} bytes are too many; {_MOST_BYTES} are the most")
        to.len = value.size
        if value.size > 0:
            to.data = ctypes.cast(value.address, ctypes.POINTER(ctypes.c_char))
            to.memory = value
        return to


_ffi._UniffiFfiConverterByRefBytes = _ByRefBytes


def _plane(what: str, array, dtype: str, pixel: int) -> tuple[_Memory, _ffi.PlaneInfo, int, int]:
    """The memory of an image of (H, W) or (H, W, pixel) values, its strides, its width and height."""
    try:
        array = numpy.asarray(array)
    except (TypeError, ValueError) as error:
        raise PhasefrontError.Frame(f"frame: {what} is no array: {error}") from None
    if array.dtype != dtype or array.dtype.byteorder == ">":
        raise PhasefrontError.Frame(f"frame: {what} holds {array.dtype}; {dtype} is needed")
    dimensions = 2 if pixel == 1 else 3
    if array.ndim != dimensions or (pixel > 1 and array.shape[2] != pixel):
        right = "(H, W)" if pixel == 1 else f"(H, W, {pixel})"
        raise PhasefrontError.Frame(f"frame: {what} is {array.shape}; {right} is right")
    # Row by row, as cameras give it; what is turned or mirrored is copied.
    rows, pixels = array.strides[:2]
    value = pixel * array.itemsize
    is_plain = pixels >= value and rows >= (array.shape[1] - 1) * pixels + value
    if not (is_plain and (pixel == 1 or array.strides[2] == array.itemsize)):
        array = numpy.ascontiguousarray(array)
        rows, pixels = array.strides[:2]
    memory = _Memory(array)
    if memory.size > _MOST_BYTES or rows >= 2**32:
        raise PhasefrontError.Frame(
            f"frame: {what} is {array.shape} over {memory.size} bytes; {_MOST_BYTES} bytes are the most"
        )
    return memory, _ffi.PlaneInfo(row_stride=rows, pixel_stride=pixels), array.shape[1], array.shape[0]


class Frame:
    """Colour and depth of one moment.

    `colour` is uint8: (H, W, 3) for RGB, (H, W, 4) for RGBA or BGRA; for NV12 the pair of luma (H, W) and chroma
    (H/2, W/2, 2), for YUV 420 the three planes; halves are rounded up. `depth` is (h, w): float32 or float16 metres, uint16
    millimetres, or uint8 normalized (0 nearest, 255 farthest), unless `depth_format` says otherwise. `confidence` is uint8,
    (h, w).

    Raises `PhasefrontError.Frame` for arrays of other types or shapes.
    """

    def __init__(
        self,
        colour,
        depth,
        *,
        timestamp_ns: int = 0,
        colour_format: ColourFormat | None = None,
        depth_format: DepthFormat | None = None,
        confidence=None,
        confidence_format: ConfidenceFormat = ConfidenceFormat.U8,
        matrix: YuvMatrix = YuvMatrix.BT601,
        video_range: bool = False,
        orientation: Orientation | None = None,
        cameras: Cameras | None = None,
    ):
        planar = isinstance(colour, (tuple, list))
        if colour_format is None:
            if planar:
                raise PhasefrontError.Frame("frame: colour comes in planes; say whether it is ColourFormat.NV12 or YUV420")
            rgb = numpy.ndim(colour) == 3 and numpy.shape(colour)[2] == 3
            colour_format = ColourFormat.RGB if rgb else ColourFormat.RGBA
        channels = {
            ColourFormat.RGB: [("colour", 3)],
            ColourFormat.RGBA: [("colour", 4)],
            ColourFormat.BGRA: [("colour", 4)],
            ColourFormat.NV12: [("luma", 1), ("chroma", 2)],
            ColourFormat.YUV420: [("luma", 1), ("U chroma", 1), ("V chroma", 1)],
        }[colour_format]
        images = list(colour) if planar else [colour]
        if len(images) != len(channels):
            raise PhasefrontError.Frame(f"frame: {len(images)} colour planes are given; {colour_format.name} has {len(channels)}")
        planes = [_plane(what, image, "uint8", pixel) for (what, pixel), image in zip(channels, images)]
        self._colour = [plane[0] for plane in planes] + [_Memory()] * (3 - len(planes))

        if depth_format is None:
            kind = str(getattr(depth, "dtype", type(depth).__name__))
            depth_format = _DEPTH_FORMATS.get(kind)
            if depth_format is None:
                raise PhasefrontError.Frame(f"frame: depth holds {kind}; float32, float16, uint16 or uint8 are possible")
        self._depth, plane, width, height = _plane("depth", depth, _DEPTH_TYPES[depth_format], 1)
        depth_info = _ffi.DepthInfo(format=depth_format, width=width, height=height, plane=plane)

        self._confidence, confidence_info = _Memory(), None
        if confidence is not None:
            self._confidence, plane, width, height = _plane("confidence", confidence, "uint8", 1)
            confidence_info = _ffi.ConfidenceInfo(format=confidence_format, width=width, height=height, plane=plane)

        self._info = _ffi.FrameInfo(
            timestamp_ns=timestamp_ns,
            colour=_ffi.ColourInfo(
                format=colour_format,
                width=planes[0][2],
                height=planes[0][3],
                planes=[plane[1] for plane in planes],
                matrix=matrix,
                video_range=video_range,
            ),
            depth=depth_info,
            confidence=confidence_info,
            orientation=orientation or Orientation(rotation=Rotation.UPRIGHT, mirrored=False),
            cameras=cameras,
        )

    def _arguments(self):
        return (*self._colour, self._depth, self._confidence, self._info)


def _array(owner, address: int, shape: Sequence[int]) -> numpy.ndarray:
    """The library's memory as an array that keeps its owner alive, read only."""
    memory = (ctypes.c_uint8 * int(numpy.prod(shape))).from_address(address)
    memory.owner = owner
    array = numpy.frombuffer(memory, numpy.uint8).reshape(shape)
    array.flags.writeable = False
    return array


class Hologram:
    """The hologram of one frame. Its memory goes back to the session when it and all its arrays are gone."""

    def __init__(self, raw: _ffi.RawHologram):
        self._raw = raw
        #: What is known of it.
        self.info: HologramInfo = raw.info()

    @property
    def levels(self) -> numpy.ndarray:
        """The modulator levels in place, uint8, (3, H, W): red, green, blue; or (1, H, W) for a display of one laser."""
        return _array(self._raw, self._raw.plane_address(0), (self.info.colours, self.info.height, self.info.width))

    def z_at(self, x: float, y: float) -> float:
        """z of what is seen at (x, y) of the picture, each 0 to 1 from its upper left corner, in mm."""
        return self._raw.z_at(x, y)

    def preview(self, z_mm: float, width: int, height: int) -> numpy.ndarray:
        """What an eye focused at `z_mm` sees: red, green, blue, alpha, uint8, (height, width, 4)."""
        if width < 1 or height < 1:
            raise PhasefrontError.Setting(f"a preview of {width}×{height} is empty; each side must be at least 1")
        image = self._raw.preview(z_mm, width, height)
        return _array(image, image.address(), (height, width, 4))

    def output(self, placement: Placement | None = None, image: int = 0) -> numpy.ndarray:
        """Image `image` of those that the modulator's driver takes, of the modulator's resolution, levels as they are;
        uint8, (H, W, bytes of a pixel). All layouts but grey have one; RGB is usual."""
        output = self._raw.output(placement or Placement(layout=Layout.RGB), image)
        return _array(output, output.address(), (output.height(), output.width(), output.pixel_bytes()))


@dataclass(frozen=True)
class Made:
    """A frame became a hologram."""

    hologram: Hologram


@dataclass(frozen=True)
class Dropped:
    """A frame was dropped."""

    timestamp_ns: int
    reason: DropReason


@dataclass(frozen=True)
class Failed:
    """A frame could not be processed. The session goes on."""

    timestamp_ns: int
    message: str


@dataclass(frozen=True)
class QualityChanged:
    """The frames after this one are made on another rung of the ladder."""

    timestamp_ns: int
    change: QualityChange


class _Listener(_ffi.SessionListener):
    def __init__(self, tell: Callable[[Made | Dropped | Failed | QualityChanged], None]):
        self._tell = tell

    def on_hologram(self, hologram):
        self._tell(Made(Hologram(hologram)))

    def on_dropped(self, timestamp_ns, reason):
        self._tell(Dropped(timestamp_ns, reason))

    def on_failed(self, timestamp_ns, message):
        self._tell(Failed(timestamp_ns, message))

    def on_quality_changed(self, timestamp_ns, change):
        self._tell(QualityChanged(timestamp_ns, change))


def session_options(
    method: Network | Method | None = None, target: Display | Target | None = None, **changes
) -> SessionOptions:
    """What is usual for `target`, a display or a calibrated one: holograms of its resolution by a network or another method
    and AA-DPM, or, without one, by the pair of networks that is built in for the display, by the plane sweep where there is
    none. `changes` are fields of `SessionOptions`.

    Raises `PhasefrontError.Display` for a display that cannot be."""
    if not isinstance(target, Target):
        target = Target.of_display(Display() if target is None else target)
    if isinstance(method, Network):
        method = Method.TRAINED(network=method)
    return SessionOptions(**(vars(_ffi.session_options(target, method)) | changes))


class Session:
    """Frames in, holograms out. Every call may come from any thread, at any moment.

    A live stream (`RunningMode.LIVE_STREAM`) calls `listener` with `Made`, `Dropped`, `Failed` and `QualityChanged` on the
    session's own thread; no frame is processed while it is busy. Raises `PhasefrontError` for options that cannot be meant
    or planned for.
    """

    def __init__(
        self,
        options: SessionOptions,
        mode: RunningMode = RunningMode.IMAGE,
        listener: Callable[[Made | Dropped | Failed | QualityChanged], None] | None = None,
    ):
        self._raw = _ffi.RawSession(options, mode, None if listener is None else _Listener(listener))

    def process(self, frame: Frame) -> Hologram:
        """The hologram of `frame`, in an image or a video session. Waits for it."""
        return Hologram(self._raw.process(*frame._arguments()))

    def submit(self, frame: Frame) -> DropReason | None:
        """Hands `frame` to a live stream, which copies it and goes on by itself. Gives why it was dropped, if it was at
        once; the listener hears of it too."""
        return self._raw.submit(*frame._arguments())

    def warm_up(self) -> None:
        """Runs an empty frame through the stages. Waits for it."""
        self._raw.warm_up()

    def reset(self) -> None:
        """Forgets all frames so far; the next, of any timestamp, is the first again."""
        self._raw.reset()

    def pause(self) -> None:
        """Takes no frames until `resume`."""
        self._raw.pause()

    def resume(self) -> None:
        """Takes frames again."""
        self._raw.resume()

    def set_thermal(self, thermal: Thermal) -> None:
        """Says how hot the device is."""
        self._raw.set_thermal(thermal)

    def set_quality(self, quality: Quality) -> None:
        """Allows or forbids steps on the ladder."""
        self._raw.set_quality(quality)

    def statistics(self) -> Statistics:
        """What the session has done so far; of a closed one, what it did. Never waits for a frame."""
        return self._raw.statistics()

    def close(self) -> None:
        """Takes no more frames and gives the memory back; holograms that were handed out stay valid. When it returns, the
        listener has heard everything; called by a listener, of this session or another, it does not wait for that. Closing
        twice does nothing."""
        self._raw.shut_down()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_) -> None:
        self.close()


class _LogHandler(_ffi.LogListener):
    def __init__(self, handle: Callable[[LogLevel, str], None]):
        self._handle = handle

    def on_log(self, level, message):
        self._handle(level, message)


def send_log(level: LogLevel, handler: Callable[[LogLevel, str], None] | None) -> None:
    """Sends the library's messages of `level` and above to `handler`, which is called on any thread; None for silence."""
    _ffi.set_log_listener(level, None if handler is None else _LogHandler(handler))
