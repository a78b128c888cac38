"""RGB-D frames to phase-only 3D holograms.

>>> import numpy, phasefront
>>> display = phasefront.Display(width=64, height=48)
>>> session = phasefront.Session(phasefront.session_options(target=display))
>>> colour = numpy.full((48, 64, 3), 128, numpy.uint8)
>>> metres = numpy.full((24, 32), 0.5, numpy.float32)
>>> session.process(phasefront.Frame(colour, metres)).levels.shape
(3, 48, 64)

The buffer protocol passes arrays in and out without a copy. Every error is a `PhasefrontError` of some kind, such as
`FrameError`, whose message is one line that names the problem and the remedy.
"""

from ._ffi import (
    Backend,
    Brightness,
    Cameras,
    ColourFormat,
    ColourScale,
    ConfidenceFormat,
    DeepPair,
    DepthFormat,
    DepthNetwork,
    DepthRange,
    Display,
    DisplayError,
    DropReason,
    Drops,
    Encoding,
    FileError,
    Focus,
    FrameError,
    FrameTimes,
    HologramInfo,
    InternalError,
    Intrinsics,
    Layout,
    LogLevel,
    Method,
    Network,
    NetworkError,
    NetworkInfo,
    Orientation,
    PhasefrontError,
    Placement,
    Pose,
    Quality,
    QualityChange,
    QualityLevel,
    QualityReason,
    RgbEncoding,
    Rotation,
    RunningMode,
    SessionError,
    SessionOptions,
    SettingError,
    Stage,
    Statistics,
    Thermal,
    TimestampError,
    YuvMatrix,
    built_in_pair,
    display_from_toml,
    modulator_names,
    version,
)
from ._encode import Modulator, encode
from ._frame import Frame
from ._hologram import Hologram
from ._metrics import Comparison, compare
from ._notices import third_party_notices
from ._session import Dropped, Event, Failed, Processed, QualityChanged, Session, send_log, send_stages, session_options
from ._target import Target

__all__ = [
    "Backend", "Brightness", "Cameras", "ColourFormat", "ColourScale", "Comparison", "ConfidenceFormat", "DeepPair", "DepthFormat",
    "DepthNetwork", "DepthRange",
    "Display", "DisplayError", "DropReason", "Dropped", "Drops", "Encoding", "Event", "Failed", "FileError", "Focus", "Frame",
    "FrameError", "FrameTimes", "Hologram", "HologramInfo", "InternalError", "Intrinsics", "Layout", "LogLevel",
    "Method", "Modulator", "Network", "NetworkError", "NetworkInfo", "Orientation", "PhasefrontError", "Placement",
    "Pose", "Processed", "Quality", "QualityChange", "QualityChanged", "QualityLevel", "QualityReason", "RgbEncoding", "Rotation",
    "RunningMode", "Session", "SessionError", "SessionOptions", "SettingError", "Stage", "Statistics", "Target",
    "Thermal", "TimestampError", "YuvMatrix", "__version__", "built_in_pair", "compare", "display_from_toml", "encode",
    "modulator_names", "send_log", "send_stages", "session_options", "third_party_notices",
    "version",
]  # fmt: skip

#: The version of the library.
__version__ = version()
