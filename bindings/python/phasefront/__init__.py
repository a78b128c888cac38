"""RGB-D frames to phase-only 3D holograms.

>>> import numpy, phasefront
>>> display = phasefront.Display(width=64, height=48)
>>> session = phasefront.Session(phasefront.session_options(target=display))
>>> colour = numpy.full((48, 64, 3), 128, numpy.uint8)
>>> metres = numpy.full((24, 32), 0.5, numpy.float32)
>>> session.process(phasefront.Frame(colour, metres)).levels.shape
(3, 48, 64)

The buffer protocol passes arrays in and out without a copy. Every error is a `PhasefrontError`, whose message is one
line that names the problem and the remedy.
"""

from ._ffi import (
    Backend,
    Brightness,
    Cameras,
    ColourFormat,
    ConfidenceFormat,
    DeepPair,
    DepthFormat,
    DepthRange,
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
    QualityLevel,
    QualityReason,
    Rotation,
    RunningMode,
    SessionOptions,
    Stage,
    Statistics,
    Thermal,
    YuvMatrix,
    built_in_pair,
    display_from_toml,
    version,
)
from ._encode import Modulator, encode
from ._frame import Frame
from ._hologram import Hologram
from ._session import Dropped, Event, Failed, Processed, QualityChanged, Session, send_log, send_stages, session_options
from ._target import Target

__all__ = [
    "Backend", "Brightness", "Cameras", "ColourFormat", "ConfidenceFormat", "DeepPair", "DepthFormat", "DepthRange", "Display",
    "DropReason", "Dropped", "Drops", "Encoding", "Event", "Failed", "Frame", "FrameTimes", "Hologram", "HologramInfo",
    "Intrinsics", "Layout", "LogLevel", "Method", "Modulator", "Network", "NetworkInfo", "Orientation", "PhasefrontError", "Placement",
    "Pose", "Processed", "Quality", "QualityChange", "QualityChanged", "QualityLevel", "QualityReason", "Rotation", "RunningMode",
    "Session", "SessionOptions", "Stage", "Statistics", "Target", "Thermal", "YuvMatrix", "__version__", "built_in_pair",
    "display_from_toml", "encode", "send_log", "send_stages", "session_options", "version",
]  # fmt: skip

#: The version of the library.
__version__ = version()
