"""Sessions, which turn frames into holograms."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, TypeAlias, TypedDict, Unpack

import numpy
from numpy.typing import ArrayLike, NDArray

from . import _ffi
from ._ffi import (
    Backend,
    Brightness,
    DepthNetwork,
    DepthRange,
    Display,
    DropReason,
    Encoding,
    Focus,
    FrameError,
    LogLevel,
    Method,
    Network,
    Quality,
    QualityChange,
    QualityLevel,
    RunningMode,
    SessionOptions,
    SettingError,
    Stage,
    Statistics,
    Thermal,
)
from ._frame import Frame, FrameOptions, arguments, batch
from ._hologram import Hologram, Purpose
from ._take import forbid_copies, shown, take
from ._target import Modulated, Targeted, target_of


@dataclass(frozen=True)
class Processed:
    """A frame became a hologram.

    Fields:
        hologram: The hologram.
    """

    hologram: Hologram


@dataclass(frozen=True)
class Dropped:
    """A frame was dropped.

    Fields:
        timestamp_ns: The timestamp of the frame.
        reason: The reason.
    """

    timestamp_ns: int
    reason: DropReason


@dataclass(frozen=True)
class Failed:
    """A frame could not be processed. The session continues.

    Fields:
        timestamp_ns: The timestamp of the frame.
        message: One line that names the problem and the remedy.
    """

    timestamp_ns: int
    message: str


@dataclass(frozen=True)
class QualityChanged:
    """The session processes the frames after this one at another quality level.

    Fields:
        timestamp_ns: The timestamp of the frame.
        change: The old and the new quality level, and the reason.
    """

    timestamp_ns: int
    change: QualityChange


#: An event of a live stream.
Event: TypeAlias = Processed | Dropped | Failed | QualityChanged


def _call(handler: Callable[..., object], *arguments: object) -> None:
    """Calls a handler of the user. What it raises becomes an `Exception`: the generated code catches no other, and
    ctypes would report success."""
    try:
        handler(*arguments)
    except Exception:
        raise
    except BaseException as error:
        raise RuntimeError(f"{type(error).__name__}: {error}") from error


class _Listener(_ffi.SessionListener):
    def __init__(self, tell: Callable[[Event], object], purpose: Purpose):
        self._tell, self._purpose = tell, purpose

    def on_processed(self, hologram: _ffi.RawHologram) -> None:
        _call(self._tell, Processed(Hologram(hologram, self._purpose)))

    def on_dropped(self, timestamp_ns: int, reason: DropReason) -> None:
        _call(self._tell, Dropped(timestamp_ns, reason))

    def on_failed(self, timestamp_ns: int, message: str) -> None:
        _call(self._tell, Failed(timestamp_ns, message))

    def on_quality_changed(self, timestamp_ns: int, change: QualityChange) -> None:
        _call(self._tell, QualityChanged(timestamp_ns, change))

    def on_closed(self) -> None:
        """Does nothing: Python keeps the listener as long as it is needed."""


class Changes(TypedDict, total=False):
    """Any fields of `SessionOptions`."""

    quality_levels: list[QualityLevel]
    quality: Quality | int | str
    target_rate_hz: float | None
    encoding: Encoding | str
    brightness: Brightness | float | str
    dark_threshold: float | None
    local_steps: int | None
    midpoint_steps: int
    focus: Focus | str
    depth_range: DepthRange | tuple[float, float] | str
    least_confidence: float
    keep_standing: bool
    threads: int | None
    most_pixels: int
    backend: Backend | str
    depth_network: DepthNetwork | None


def session_options(
    method: Network | Method | str | None = None, target: Targeted | None = None, **changes: Unpack[Changes]
) -> SessionOptions:
    """Returns the default options for `target`, with changes.

    Args:
        method: A network or another method, also by name: "auto", "sweep", "network". By default the choice between the
            built-in network and the plane sweep by each frame's depth, "auto".
        target: A display, a calibrated target, or a modulator or its name, as `modulator_names` lists them. By default
            the display of 1920×1080. Holograms have its resolution.
        changes: Fields of `SessionOptions`, which documents each of them. A number stands for a fixed brightness or
            quality level, a pair for a range of depth in metres, and a name for a value without fields.

    Raises `DisplayError` for an impossible display, and `SettingError` for a value of another type.
    """
    if isinstance(method, (Display, _ffi.Target, Modulated)):
        raise SettingError(f"method is {shown(method)}; a target is right as target=…")
    target = target_of(target)
    defaults: Any = method
    fields: dict[str, Any] = vars(_ffi.session_options(target, defaults)) | {"target": target} | changes
    return SessionOptions(**fields)


class Session:
    """A session that turns frames into holograms. Every method may be called from any thread at any time.

    Args:
        options: The options. `session_options` returns the defaults.
        mode: The running mode, also by name: "image", "video", "live". Image and video sessions accept `process`. A live stream accepts `submit` and never
            waits.
        listener: A listener for a live stream. The session calls it with `Processed`, `Dropped`, `Failed` and
            `QualityChanged` on its own thread and processes no frame during a call. The statistics count its
            exceptions.

    As a context manager, it closes the session at the end. Raises `PhasefrontError` if the options are invalid or
    cannot be planned for.
    """

    def __init__(
        self,
        options: SessionOptions,
        mode: RunningMode | str = RunningMode.IMAGE,
        listener: Callable[[Event], object] | None = None,
    ):
        options = take("options", options, SessionOptions)
        self._mode = take("mode", mode, RunningMode)
        if listener is not None and not callable(listener):
            raise SettingError(f"listener is {shown(listener)}; a function of one event is right")
        self._purpose = Purpose.of(options.target, options.encoding)
        self._raw = _ffi.RawSession(options, self._mode, None if listener is None else _Listener(listener, self._purpose))
        # Also closes it when Python exits. A later call from the session's thread would abort the process.
        weakref.finalize(self, self._raw.shut_down)

    def __repr__(self) -> str:
        return f"Session(mode={self._mode}, backend={self.statistics().backend!r})"

    def process(self, frame: Frame) -> Hologram:
        """Returns the hologram of `frame`, in an image or a video session. Blocks until it is done; other Python
        threads run meanwhile.

        Raises `FrameError` if the frame is unusable, `TimestampError` if it is not later than the previous frame
        of a video, and `SessionError` if the session is live, paused or closed. Later frames are not affected.
        """
        return Hologram(self._raw.process(*arguments(frame)), self._purpose)

    def process_batch(
        self,
        colour: ArrayLike,
        depth: ArrayLike | None = None,
        *,
        timestamps_ns: Sequence[int] | None = None,
        out: NDArray[numpy.uint8] | None = None,
        **options: Unpack[FrameOptions],
    ) -> NDArray[numpy.uint8]:
        """Returns the levels of several frames of one size, uint8, (N, C, H, W). Processes them one after another, and
        keeps one hologram at a time.

        Args:
            colour: uint8, (N, H, W) for grey, (N, H, W, 3) for RGB, (N, H, W, 4) for RGBA or BGRA.
            depth: (N, h, w), of the types of `Frame`.
            timestamps_ns: The timestamps, which a video session needs.
            out: The array to write into and to return, for example one for all batches.
            options: Other arguments of `Frame`, which are those of all frames.

        Raises the same errors as `process`, `FrameError` if colour and depth have another number of frames, and
        `SettingError` if `out` does not fit or the session changed its quality level.
        """
        colours = batch("colour", colour)
        depths = [None] * len(colours) if depth is None else batch("depth", depth)
        times = [0] * len(colours) if timestamps_ns is None else timestamps_ns
        if not len(colours) == len(depths) == len(times) > 0:
            counts = f"{len(colours)} colour images, {len(depths)} depth images and {len(times)} timestamps"
            raise FrameError(f"frames: there are {counts}; the same number of each is right, 1 or more")
        for i, (image, metres, time) in enumerate(zip(colours, depths, times)):
            levels = self.process(Frame(image, metres, timestamp_ns=time, **options)).levels
            out = numpy.empty((len(colours), *levels.shape), numpy.uint8) if out is None else out
            if out.dtype != numpy.uint8 or out.shape != (len(colours), *levels.shape):
                raise SettingError(f"out is {out.dtype}, {out.shape}; frame {i} of {len(colours)} has levels of {levels.shape}, uint8")
            out[i] = levels
        assert out is not None, "there is a frame"
        return out

    def submit(self, frame: Frame) -> DropReason | None:
        """Submits `frame` to a live stream, which copies it. Never waits for a frame. Returns the reason if the frame
        was dropped at once; the listener receives that event too.

        Raises the same errors as `process`.
        """
        return self._raw.submit(*arguments(frame))

    def warm_up(self) -> None:
        """Processes an empty frame, so that the first real frame is as fast as the later ones. Blocks until it is
        done."""
        self._raw.warm_up()

    def reset(self) -> None:
        """Discards all earlier frames, including one in progress. The next frame may have any timestamp."""
        self._raw.reset()

    def pause(self) -> None:
        """Stops accepting frames until `resume`."""
        self._raw.pause()

    def resume(self) -> None:
        """Accepts frames again."""
        self._raw.resume()

    def set_thermal(self, thermal: Thermal) -> None:
        """Reports how hot the device is. A session with several quality levels lowers its level on a hot device."""
        self._raw.set_thermal(thermal)

    def set_quality(self, quality: Quality) -> None:
        """Sets whether the session may change its quality level.

        Raises `SettingError` for a level that the session does not have.
        """
        self._raw.set_quality(quality)

    def statistics(self) -> Statistics:
        """Returns the session's statistics, also after it is closed. Never blocks on a frame."""
        return self._raw.statistics()

    def close(self) -> None:
        """Stops accepting frames and frees the memory. Returned holograms stay valid. Waits until the listener has
        received all events, unless a listener of this or another session calls it. Closing twice does nothing."""
        self._raw.shut_down()

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


forbid_copies(Session)


class _LogHandler(_ffi.LogListener):
    def __init__(self, handle: Callable[[LogLevel, str], object]):
        self._handle = handle

    def on_log(self, level: LogLevel, message: str) -> None:
        _call(self._handle, level, message)


def send_log(level: LogLevel, handler: Callable[[LogLevel, str], object] | None) -> None:
    """Sends the library's messages of `level` and above to `handler`, which may be called on any thread. None turns
    them off."""
    _ffi.set_log_listener(level, None if handler is None else _LogHandler(handler))


class _StageHandler(_ffi.StageListener):
    def __init__(self, handle: Callable[[Stage, bool], object]):
        self._handle = handle

    def on_begin(self, stage: Stage) -> None:
        _call(self._handle, stage, True)

    def on_end(self, stage: Stage) -> None:
        _call(self._handle, stage, False)


def send_stages(handler: Callable[[Stage, bool], object] | None) -> None:
    """Calls `handler` with each stage of a frame that begins (True) or ends (False), on the thread that computes it.
    Stages on a thread are nested. None turns the calls off. The handler must not call the library."""
    _ffi.set_stage_listener(None if handler is None else _StageHandler(handler))
