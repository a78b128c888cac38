"""Sessions: frames in, holograms out."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, TypeAlias, TypedDict, Unpack

from . import _ffi
from ._ffi import (
    Backend,
    Brightness,
    DepthRange,
    Display,
    DropReason,
    Encoding,
    LogLevel,
    Method,
    Network,
    Quality,
    QualityChange,
    QualityLevel,
    RunningMode,
    SessionOptions,
    Stage,
    Statistics,
    Thermal,
)
from ._frame import Frame
from ._hologram import Hologram, Purpose
from ._target import Target


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
        timestamp_ns: The frame's.
        reason: Why.
    """

    timestamp_ns: int
    reason: DropReason


@dataclass(frozen=True)
class Failed:
    """A frame could not be processed. The session goes on.

    Fields:
        timestamp_ns: The frame's.
        message: What is wrong and what would be right, in one line.
    """

    timestamp_ns: int
    message: str


@dataclass(frozen=True)
class QualityChanged:
    """The frames after this one are made at another quality level.

    Fields:
        timestamp_ns: The frame's.
        change: From which quality level to which, and why.
    """

    timestamp_ns: int
    change: QualityChange


#: What a live stream tells its listener.
Event: TypeAlias = Processed | Dropped | Failed | QualityChanged


class _Listener(_ffi.SessionListener):
    def __init__(self, tell: Callable[[Event], object], purpose: Purpose):
        self._tell, self._purpose = tell, purpose

    def on_processed(self, hologram: _ffi.RawHologram) -> None:
        self._tell(Processed(Hologram(hologram, self._purpose)))

    def on_dropped(self, timestamp_ns: int, reason: DropReason) -> None:
        self._tell(Dropped(timestamp_ns, reason))

    def on_failed(self, timestamp_ns: int, message: str) -> None:
        self._tell(Failed(timestamp_ns, message))

    def on_quality_changed(self, timestamp_ns: int, change: QualityChange) -> None:
        self._tell(QualityChanged(timestamp_ns, change))

    def on_closed(self) -> None:
        """Nothing waits for it: Python keeps the listener as long as it is needed."""


class Changes(TypedDict, total=False):
    """Fields of `SessionOptions`, any of them."""

    quality_levels: list[QualityLevel]
    quality: Quality
    target_rate_hz: float | None
    encoding: Encoding
    brightness: Brightness
    dark_threshold: float | None
    local_steps: int | None
    midpoint_steps: int
    depth_range: DepthRange
    least_confidence: float
    threads: int | None
    most_pixels: int
    backend: Backend


def session_options(
    method: Network | Method | None = None, target: Display | _ffi.Target | None = None, **changes: Unpack[Changes]
) -> SessionOptions:
    """The default options for `target`, with changes.

    Args:
        method: A network or another method; without one the network that is built in, and the plane sweep where that was
            not trained for the display.
        target: A display, or a calibrated one; without it the default display of 1920×1080. Holograms have its resolution.
        changes: Fields of `SessionOptions`, which says what each does.

    Raises `PhasefrontError.Display` for a display that cannot be.
    """
    if not isinstance(target, _ffi.Target):
        target = Target.of_display(Display() if target is None else target)
    if isinstance(method, Network):
        method = Method.TRAINED(network=method)
    fields: dict[str, Any] = vars(_ffi.session_options(target, method)) | {"target": target} | changes
    return SessionOptions(**fields)


class Session:
    """Frames in, holograms out. Every call may come from any thread, at any moment.

    Args:
        options: What to make, and how: `session_options` gives the defaults.
        mode: Image and video sessions answer `process`. A live stream takes `submit` and never waits.
        listener: For a live stream alone: hears `Processed`, `Dropped`, `Failed` and `QualityChanged` on the session's
            own thread; no frame is processed while it is busy. What it raises is counted in the statistics.

    As a context it is closed at its end. Raises `PhasefrontError` for options that cannot be meant or planned for.
    """

    def __init__(
        self,
        options: SessionOptions,
        mode: RunningMode = RunningMode.IMAGE,
        listener: Callable[[Event], object] | None = None,
    ):
        self._purpose = Purpose(options.target, options.encoding)
        self._raw = _ffi.RawSession(options, mode, None if listener is None else _Listener(listener, self._purpose))
        # Also when Python exits: later the session's thread could not call it any more, which aborts the process.
        weakref.finalize(self, self._raw.shut_down)

    def process(self, frame: Frame) -> Hologram:
        """The hologram of `frame`, in an image or a video session. Waits for it; other Python threads run meanwhile.

        Raises `PhasefrontError.Frame` for a frame that is not usable, `.Timestamp` for one that is not later than the last
        of a video, `.Session` where the session is live, paused or closed. None of them harms the frames that follow.
        """
        return Hologram(self._raw.process(*frame._arguments()), self._purpose)

    def submit(self, frame: Frame) -> DropReason | None:
        """Hands `frame` to a live stream, which copies it and goes on by itself. Gives why it was dropped, if it was at
        once; the listener hears of it too.

        Raises as `process` does.
        """
        return self._raw.submit(*frame._arguments())

    def warm_up(self) -> None:
        """Runs an empty frame through the stages, so that the first real one is as fast as the others. Waits for it."""
        self._raw.warm_up()

    def reset(self) -> None:
        """Forgets all frames so far, one in the making too; the next, of any timestamp, is the first again."""
        self._raw.reset()

    def pause(self) -> None:
        """Takes no frames until `resume`."""
        self._raw.pause()

    def resume(self) -> None:
        """Takes frames again."""
        self._raw.resume()

    def set_thermal(self, thermal: Thermal) -> None:
        """Says how hot the device is. A session with several quality levels steps down where it is hot."""
        self._raw.set_thermal(thermal)

    def set_quality(self, quality: Quality) -> None:
        """Allows or forbids changes of the quality level.

        Raises `PhasefrontError.Setting` for one that the session does not have.
        """
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _LogHandler(_ffi.LogListener):
    def __init__(self, handle: Callable[[LogLevel, str], object]):
        self._handle = handle

    def on_log(self, level: LogLevel, message: str) -> None:
        self._handle(level, message)


def send_log(level: LogLevel, handler: Callable[[LogLevel, str], object] | None) -> None:
    """Sends the library's messages of `level` and above to `handler`, which is called on any thread; None for silence."""
    _ffi.set_log_listener(level, None if handler is None else _LogHandler(handler))


class _StageHandler(_ffi.StageListener):
    def __init__(self, handle: Callable[[Stage, bool], object]):
        self._handle = handle

    def on_begin(self, stage: Stage) -> None:
        self._handle(stage, True)

    def on_end(self, stage: Stage) -> None:
        self._handle(stage, False)


def send_stages(handler: Callable[[Stage, bool], object] | None) -> None:
    """Calls `handler` with each stage of a frame that begins (True) or ends (False), on the thread that computes it, where
    stages lie within one another; None for silence. It must not call the library."""
    _ffi.set_stage_listener(None if handler is None else _StageHandler(handler))
