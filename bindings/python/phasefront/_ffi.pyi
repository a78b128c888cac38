"""The types of what is generated: written by `bindings/generate`."""

import enum

class ColourFormat(enum.Enum):
    """How a colour image lies in memory.

    Values:
        RGBA: One plane; bytes red, green, blue, alpha (which is not looked at).
        BGRA: One plane; bytes blue, green, red, alpha (which is not looked at). iOS' 32BGRA.
        RGB: One plane; bytes red, green, blue.
        NV12: Two planes: luma; and at half the resolution blue and red chroma side by side. iOS' 420f and 420v.
        YUV420: Three planes: luma, and at half the resolution blue chroma (U) and red chroma (V). Android's YUV_420_888.
    """
    RGBA = 0
    BGRA = 1
    RGB = 2
    NV12 = 3
    YUV420 = 4

class YuvMatrix(enum.Enum):
    """The matrix between luma, chroma and colour.

    Values:
        BT601: ITU-R BT.601: standard definition, JPEG, most Android cameras.
        BT709: ITU-R BT.709: high definition.
    """
    BT601 = 0
    BT709 = 1

class ConfidenceFormat(enum.Enum):
    """How a confidence map lies in memory.

    Values:
        LOW_MEDIUM_HIGH: 0 low, 1 medium, 2 high: ARKit's ARConfidenceLevel.
        U8: 0 none to 255 full: ARCore's acquireRawDepthConfidenceImage.
    """
    LOW_MEDIUM_HIGH = 0
    U8 = 1

class PhasefrontError(Exception):
    """Why Phasefront refused to go on. The message is one line that names what is wrong and what would be right.

    Kinds:
        Display: A display whose physics is impossible or out of range.
        Frame: A frame, plane or image of the wrong shape or with unusable values.
        Timestamp: A frame that is not later than the last one. It is refused; what follows is not harmed.
        Setting: A setting or an argument that cannot be meant or planned for.
        Network: What is not a hologram network, or one for another display.
        File: A file that cannot be read.
        Session: A call that a session cannot answer in its mode or state.
        Internal: A fault of Phasefront. The call had no effect, or the frame is lost; please report it.
    """
    class Display(PhasefrontError):
        """A display whose physics is impossible or out of range."""
    class Frame(PhasefrontError):
        """A frame, plane or image of the wrong shape or with unusable values."""
    class Timestamp(PhasefrontError):
        """A frame that is not later than the last one. It is refused; what follows is not harmed."""
    class Setting(PhasefrontError):
        """A setting or an argument that cannot be meant or planned for."""
    class Network(PhasefrontError):
        """What is not a hologram network, or one for another display."""
    class File(PhasefrontError):
        """A file that cannot be read."""
    class Session(PhasefrontError):
        """A call that a session cannot answer in its mode or state."""
    class Internal(PhasefrontError):
        """A fault of Phasefront. The call had no effect, or the frame is lost; please report it."""

class DepthFormat(enum.Enum):
    """How a depth image lies in memory. But for the normalized ones, 0, negative numbers and what is not finite mean no
    reading.

    Values:
        METRES_F32: Metres, 32-bit floats: ARKit's sceneDepth, AVFoundation's DepthFloat32.
        METRES_F16: Metres, 16-bit floats: AVFoundation's DepthFloat16.
        DISPARITY_F32: Inverse metres, 32-bit floats: AVFoundation's DisparityFloat32.
        DISPARITY_F16: Inverse metres, 16-bit floats: AVFoundation's DisparityFloat16.
        MILLIMETRES_U16: Millimetres, all 16 bits: ARCore's acquireDepthImage16Bits, HardwareBuffer's D_16.
        ANDROID_DEPTH16: Android's DEPTH16: millimetres in the lower 13 bits, a confidence in the upper 3. Not the same as millimetres in all 16.
        NORMALIZED_U8: 0 nearest to 255 farthest; every pixel is a reading.
        NORMALIZED_U16: 0 nearest to 65535 farthest; every pixel is a reading.
    """
    METRES_F32 = 0
    METRES_F16 = 1
    DISPARITY_F32 = 2
    DISPARITY_F16 = 3
    MILLIMETRES_U16 = 4
    ANDROID_DEPTH16 = 5
    NORMALIZED_U8 = 6
    NORMALIZED_U16 = 7

class Rotation(enum.Enum):
    """How far a sensor's picture must be turned clockwise to stand upright.

    Values:
        UPRIGHT: Not at all.
        CLOCKWISE90: A quarter turn.
        HALF: Half a turn.
        CLOCKWISE270: Three quarters.
    """
    UPRIGHT = 0
    CLOCKWISE90 = 1
    HALF = 2
    CLOCKWISE270 = 3

class Layout(enum.Enum):
    """How the levels of the colours lie in images for a modulator's driver.

    Values:
        RGB: One image, bytes red, green, blue.
        RGBA: One image, bytes red, green, blue, alpha 255.
        BGRA: One image, bytes blue, green, red, alpha 255.
        GREY: An image for each colour, one after another: red, green, blue; a byte a pixel.
    """
    RGB = 0
    RGBA = 1
    BGRA = 2
    GREY = 3

class QualityReason(enum.Enum):
    """Why a session changed its quality.

    Values:
        TOO_SLOW: Frames took longer than the target rate allows.
        ROOM: There was room for more.
        THERMAL: The device is hot.
        ASKED: The caller said so.
        REFUSED: The quality level that was to be taken cannot be planned: the session stays where it was, and does not try it again.
        OTHER: For a reason that this version of the bindings does not know.
    """
    TOO_SLOW = 0
    ROOM = 1
    THERMAL = 2
    ASKED = 3
    REFUSED = 4
    OTHER = 5

class Method:
    """What makes holograms.

    One of:
        TRAINED: A trained network.
        SWEEP: The plane sweep, for any display: slower, and nothing needs to be trained.
        AUTO: For each frame what suits its depth: the plane sweep where it is clean, as rendered depth is, the trained network where it is noisy or incomplete, as sensors' depth is.
    """
    class TRAINED(Method):
        """A trained network.

        Fields:
            network: The network, for the session's display.
        """
        network: Network
        def __init__(self, network: Network) -> None: ...
    class SWEEP(Method):
        """The plane sweep, for any display: slower, and nothing needs to be trained."""
        def __init__(self) -> None: ...
    class AUTO(Method):
        """For each frame what suits its depth: the plane sweep where it is clean, as rendered depth is, the trained
        network where it is noisy or incomplete, as sensors' depth is.

        Fields:
            network: The network, for the session's display.
        """
        network: Network
        def __init__(self, network: Network) -> None: ...
    def is_TRAINED(self) -> bool: ...
    def is_trained(self) -> bool: ...
    def is_SWEEP(self) -> bool: ...
    def is_sweep(self) -> bool: ...
    def is_AUTO(self) -> bool: ...
    def is_auto(self) -> bool: ...

class Quality:
    """Whether a session may change its quality.

    One of:
        ADAPTIVE: It changes the quality level: down where frames take longer than the target rate allows or the device is hot, up where there is room.
        FIXED: It stays at this quality level.
    """
    class ADAPTIVE(Quality):
        """It changes the quality level: down where frames take longer than the target rate allows or the device is hot, up
        where there is room.
        """
        def __init__(self) -> None: ...
    class FIXED(Quality):
        """It stays at this quality level.

        Fields:
            quality_level: 0 the best.
        """
        quality_level: int
        def __init__(self, quality_level: int) -> None: ...
    def is_ADAPTIVE(self) -> bool: ...
    def is_adaptive(self) -> bool: ...
    def is_FIXED(self) -> bool: ...
    def is_fixed(self) -> bool: ...

class Encoding:
    """How the field becomes phases.

    One of:
        DOUBLE_PHASE: Double phase on the field as it is.
        ANTI_ALIAS: A small Gaussian blur first (AA-DPM).
        BAND_LIMIT: High diagonal frequencies cut first (BL-DPM).
        DEEP: A pre-filter network first (DDPM), trained for the display's offset together with the hologram network.
    """
    class DOUBLE_PHASE(Encoding):
        """Double phase on the field as it is."""
        def __init__(self) -> None: ...
    class ANTI_ALIAS(Encoding):
        """A small Gaussian blur first (AA-DPM).

        Fields:
            sigma: Standard deviation, pixels; 0.7 as published.
            width: Taps, an odd number; 3 as published.
        """
        sigma: float
        width: int
        def __init__(self, sigma: float, width: int) -> None: ...
    class BAND_LIMIT(Encoding):
        """High diagonal frequencies cut first (BL-DPM).

        Fields:
            k: The bound of |tan(πfx)·tan(πfy)|, f in cycles a pixel; 1 as published.
        """
        k: float
        def __init__(self, k: float) -> None: ...
    class DEEP(Encoding):
        """A pre-filter network first (DDPM), trained for the display's offset together with the hologram network.

        Fields:
            prefilter: The pre-filter.
        """
        prefilter: Network
        def __init__(self, prefilter: Network) -> None: ...
    def is_DOUBLE_PHASE(self) -> bool: ...
    def is_double_phase(self) -> bool: ...
    def is_ANTI_ALIAS(self) -> bool: ...
    def is_anti_alias(self) -> bool: ...
    def is_BAND_LIMIT(self) -> bool: ...
    def is_band_limit(self) -> bool: ...
    def is_DEEP(self) -> bool: ...
    def is_deep(self) -> bool: ...

class Brightness:
    """Which amplitude full light stands for.

    One of:
        SMOOTHED: Near the frame's largest, moving smoothly from frame to frame, so that video does not flicker.
        FIXED: This one; what is brighter is clipped.
        FRAME_MAX: The frame's largest.
    """
    class SMOOTHED(Brightness):
        """Near the frame's largest, moving smoothly from frame to frame, so that video does not flicker."""
        def __init__(self) -> None: ...
    class FIXED(Brightness):
        """This one; what is brighter is clipped.

        Fields:
            scale: The amplitude.
        """
        scale: float
        def __init__(self, scale: float) -> None: ...
    class FRAME_MAX(Brightness):
        """The frame's largest."""
        def __init__(self) -> None: ...
    def is_SMOOTHED(self) -> bool: ...
    def is_smoothed(self) -> bool: ...
    def is_FIXED(self) -> bool: ...
    def is_fixed(self) -> bool: ...
    def is_FRAME_MAX(self) -> bool: ...
    def is_frame_max(self) -> bool: ...

class DepthRange:
    """Which metres are shown at the ends of the volume.

    One of:
        PERCENTILES: The 1st and 99th percentile of the readings, in video smoothed.
        FIXED: These.
    """
    class PERCENTILES(DepthRange):
        """The 1st and 99th percentile of the readings, in video smoothed."""
        def __init__(self) -> None: ...
    class FIXED(DepthRange):
        """These.

        Fields:
            near_m: Metres shown nearest.
            far_m: Metres shown farthest.
        """
        near_m: float
        far_m: float
        def __init__(self, near_m: float, far_m: float) -> None: ...
    def is_PERCENTILES(self) -> bool: ...
    def is_percentiles(self) -> bool: ...
    def is_FIXED(self) -> bool: ...
    def is_fixed(self) -> bool: ...

class Backend(enum.Enum):
    """Where frames are computed.

    Values:
        CPU: On the CPU.
        GPU: On the GPU, where this library was built for it, there is one and it answers as the CPU does; else on the CPU. The statistics' `backend` and `backend_why` say which it is, and why.
    """
    CPU = 0
    GPU = 1

class DropReason(enum.Enum):
    """Why a frame was not made into a hologram, without fault.

    Values:
        SUPERSEDED: A newer frame came while it waited.
        ABOVE_TARGET_RATE: It came sooner than the target rate asks for.
        PAUSED: The session was paused.
        RESET: The session was reset before it was done.
        CLOSED: The session was closed before it was done.
        UNREAD: It became a hologram, but newer ones came before the app took it from its stream of events. Only the packages' streams say so.
        OTHER: For a reason that this version of the bindings does not know.
    """
    SUPERSEDED = 0
    ABOVE_TARGET_RATE = 1
    PAUSED = 2
    RESET = 3
    CLOSED = 4
    UNREAD = 5
    OTHER = 6

class LogLevel(enum.Enum):
    """How much a message matters.

    Values:
        ERROR: What went wrong.
        WARNING: What looks wrong.
        INFO: What is done.
        DEBUG: Details.
    """
    ERROR = 0
    WARNING = 1
    INFO = 2
    DEBUG = 3

class RunningMode(enum.Enum):
    """How a session runs; fixed when it is made.

    Values:
        IMAGE: Each frame is answered by itself.
        VIDEO: Each frame is answered; depth and brightness are smoothed over time. Timestamps must rise.
        LIVE: Frames are submitted without waiting, and the listener hears what becomes of them. Timestamps must rise.
    """
    IMAGE = 0
    VIDEO = 1
    LIVE = 2

class Stage(enum.Enum):
    """A part of the work on a frame.

    Values:
        FRAME: All of a frame's work on the session's threads; the others, but for `Plan` and `Preview`, lie within it.
        COLOUR: Colour: turned, converted, resized.
        DEPTH: Depth: read, aligned, smoothed over time, refined.
        METHOD: From the frame to the midpoint hologram.
        PROPAGATE: From the midpoint to the modulator.
        ENCODE: From the field to levels.
        MIDPOINT: Steps at the midpoint, within `Encode`.
        GPU: A frame that a GPU computes, with the ways there and back.
        PLAN: Plans and memory of a quality level are made.
        PREVIEW: A small view.
    """
    FRAME = 0
    COLOUR = 1
    DEPTH = 2
    METHOD = 3
    PROPAGATE = 4
    ENCODE = 5
    MIDPOINT = 6
    GPU = 7
    PLAN = 8
    PREVIEW = 9

class Thermal(enum.Enum):
    """How hot the device is, as its system says.

    Values:
        NOMINAL: Not warm: nothing is limited.
        FAIR: Warm: frames may take a little less time.
        SERIOUS: Hot: half the time.
        CRITICAL: Too hot: the lowest quality level.
    """
    NOMINAL = 0
    FAIR = 1
    SERIOUS = 2
    CRITICAL = 3

class Intrinsics:
    """The pinhole model of a camera, in pixels of its image before it is turned upright. The middle of the first pixel is
    (0, 0).

    Fields:
        fx: Focal length along x.
        fy: Focal length along y.
        cx: x of the principal point.
        cy: y of the principal point.
    """
    fx: float
    fy: float
    cx: float
    cy: float
    def __init__(self, *, fx: float, fy: float, cx: float, cy: float) -> None: ...

class Pose:
    """Where a point p of the depth camera (x right, y down, z forward) is for the colour camera: R·p + t.

    Fields:
        rotation: R, its 9 numbers row by row.
        translation_m: t, 3 numbers, metres.
    """
    rotation: list[float]
    translation_m: list[float]
    def __init__(self, *, rotation: list[float], translation_m: list[float]) -> None: ...

class Cameras:
    """How the depth camera and the colour camera stand to each other.

    Fields:
        colour: Of the colour image.
        depth: Of the depth image.
        pose: From depth to colour; none for cameras at one place that look one way.
    """
    colour: Intrinsics
    depth: Intrinsics
    pose: Pose | None
    def __init__(self, *, colour: Intrinsics, depth: Intrinsics, pose: Pose | None = ...) -> None: ...

class PlaneInfo:
    """Where the pixels of one plane lie.

    Fields:
        row_stride: Bytes from one row to the next.
        pixel_stride: Bytes from one pixel to the next in a row.
    """
    row_stride: int
    pixel_stride: int
    def __init__(self, *, row_stride: int, pixel_stride: int) -> None: ...

class ColourInfo:
    """What a colour image is.

    Fields:
        format: How it lies in memory.
        width: Pixels along x, as the sensor gives them.
        height: Pixels along y.
        planes: Its planes, in the format's order.
        matrix: The matrix of luma and chroma; other formats do not look at it.
        video_range: Whether luma runs over 16..=235 and chroma over 16..=240, not both over 0..=255; other formats do not look at it.
    """
    format: ColourFormat
    width: int
    height: int
    planes: list[PlaneInfo]
    matrix: YuvMatrix
    video_range: bool
    def __init__(self, *, format: ColourFormat, width: int, height: int, planes: list[PlaneInfo], matrix: YuvMatrix, video_range: bool) -> None: ...

class ConfidenceInfo:
    """What a confidence map is.

    Fields:
        format: How it lies in memory.
        width: Pixels along x: as many as the depth has.
        height: Pixels along y: as many as the depth has.
        plane: Its plane.
    """
    format: ConfidenceFormat
    width: int
    height: int
    plane: PlaneInfo
    def __init__(self, *, format: ConfidenceFormat, width: int, height: int, plane: PlaneInfo) -> None: ...

class NetworkInfo:
    """What a network is, and the display that it was trained for.

    Fields:
        layers: How many convolutions.
        filters: Filters of each hidden layer.
        precision: The numbers that its layers compute in.
        pitch_um: Distance between neighbouring pixels, µm.
        volume_depth_mm: Depth of the volume, mm.
    """
    layers: int
    filters: int
    precision: str
    pitch_um: float
    volume_depth_mm: float
    def __init__(self, *, layers: int, filters: int, precision: str, pitch_um: float, volume_depth_mm: float) -> None: ...

class DeepPair:
    """A hologram network and the pre-filter that was trained with it, for the deep double phase method.

    Fields:
        hologram: Makes the hologram.
        prefilter: Prepares it for its encoding.
    """
    hologram: Network
    prefilter: Network
    def __init__(self, *, hologram: Network, prefilter: Network) -> None: ...

class DepthInfo:
    """What a depth image is.

    Fields:
        format: How it lies in memory.
        width: Pixels along x, as the sensor gives them.
        height: Pixels along y.
        plane: Its plane.
    """
    format: DepthFormat
    width: int
    height: int
    plane: PlaneInfo
    def __init__(self, *, format: DepthFormat, width: int, height: int, plane: PlaneInfo) -> None: ...

class Display:
    """One modulator, its lasers, and the volume it shows. It is checked where it is used.

    Fields:
        width: Pixels along x.
        height: Pixels along y.
        pitch_um: Distance between neighbouring pixels, µm.
        red_nm: Wavelength of the red laser, nm.
        green_nm: Wavelength of the green laser, nm.
        blue_nm: Wavelength of the blue laser, nm.
        laser_nm: Wavelength of the laser of a display that has one, nm, in the place of the three; none where there are three.
        volume_depth_mm: Depth of the volume, mm.
        offset_mm: z of the modulator against the middle of the volume, mm, positive toward the viewer.
        bits: Bits of a modulator level.
        aperture_radius: Radius of the aperture in the Fourier plane; 1 is the whole first order.
    """
    width: int
    height: int
    pitch_um: float
    red_nm: float
    green_nm: float
    blue_nm: float
    laser_nm: float | None
    volume_depth_mm: float
    offset_mm: float
    bits: int
    aperture_radius: float
    def __init__(self, *, width: int = 1920, height: int = 1080, pitch_um: float = 8.0, red_nm: float = 638.0, green_nm: float = 520.0, blue_nm: float = 450.0, laser_nm: float | None = ..., volume_depth_mm: float = 6.0, offset_mm: float = 0.0, bits: int = 8, aperture_radius: float = 1.0) -> None: ...

class Drops:
    """Dropped frames by reason.

    Fields:
        superseded: A newer frame came while they waited.
        above_target_rate: They came sooner than the target rate asks for.
        paused: The session was paused.
        reset: The session was reset before they were done.
        closed: The session was closed before they were done.
        total: All together.
    """
    superseded: int
    above_target_rate: int
    paused: int
    reset: int
    closed: int
    total: int
    def __init__(self, *, superseded: int, above_target_rate: int, paused: int, reset: int, closed: int, total: int) -> None: ...

class Orientation:
    """How a sensor's picture becomes the one that is shown: turned, then mirrored.

    Fields:
        rotation: The turn.
        mirrored: Whether left and right are exchanged after the turn, as front cameras need.
    """
    rotation: Rotation
    mirrored: bool
    def __init__(self, *, rotation: Rotation, mirrored: bool = False) -> None: ...

class FrameInfo:
    """What a frame is; its memory comes beside it.

    Fields:
        timestamp_ns: When it was taken, in nanoseconds of any clock that runs forward.
        colour: The colour image.
        depth: The depth image.
        confidence: The confidence map of the depth, where there is one.
        orientation: How all must be turned to stand upright.
        cameras: How the pixels of depth and colour correspond; none where both show the same field of view.
    """
    timestamp_ns: int
    colour: ColourInfo
    depth: DepthInfo
    confidence: ConfidenceInfo | None
    orientation: Orientation
    cameras: Cameras | None
    def __init__(self, *, timestamp_ns: int, colour: ColourInfo, depth: DepthInfo, confidence: ConfidenceInfo | None, orientation: Orientation, cameras: Cameras | None) -> None: ...

class FrameTimes:
    """How long each stage of a frame took, milliseconds.

    Fields:
        colour_ms: Colour to amplitudes of the display's resolution.
        depth_ms: Depth to normalized depth of the display's resolution.
        method_ms: The midpoint hologram.
        propagate_ms: From the midpoint to the modulator.
        encode_ms: From the field to levels.
        total_ms: All together.
    """
    colour_ms: float
    depth_ms: float
    method_ms: float
    propagate_ms: float
    encode_ms: float
    total_ms: float
    def __init__(self, *, colour_ms: float, depth_ms: float, method_ms: float, propagate_ms: float, encode_ms: float, total_ms: float) -> None: ...

class HologramInfo:
    """What is known of a hologram.

    Fields:
        timestamp_ns: The frame's timestamp.
        width: Pixels along x.
        height: Pixels along y.
        colours: How many colours its levels have: 3, or 1 for a display of one laser.
        scale: The amplitude that full light stands for.
        near_m: Metres at the near end of the volume; none for normalized depth.
        far_m: Metres at the far end of the volume; none for normalized depth.
        valid_depth: The share of the depth sensor's pixels that had a usable reading.
        quality_level: The quality level that it was made at, 0 the best.
        times: How long each stage took.
    """
    timestamp_ns: int
    width: int
    height: int
    colours: int
    scale: float
    near_m: float | None
    far_m: float | None
    valid_depth: float
    quality_level: int
    times: FrameTimes
    def __init__(self, *, timestamp_ns: int, width: int, height: int, colours: int, scale: float, near_m: float | None, far_m: float | None, valid_depth: float, quality_level: int, times: FrameTimes) -> None: ...

class Placement:
    """How a hologram is put on its modulator.

    Fields:
        layout: How colours lie in images.
        flip_x: Whether left and right are exchanged, of the whole image.
        flip_y: Whether top and bottom are exchanged, of the whole image.
        shift_x: How many pixels to the right of the middle the hologram stands, before flips.
        shift_y: How many pixels below the middle it stands, before flips.
    """
    layout: Layout
    flip_x: bool
    flip_y: bool
    shift_x: int
    shift_y: int
    def __init__(self, *, layout: Layout, flip_x: bool = False, flip_y: bool = False, shift_x: int = 0, shift_y: int = 0) -> None: ...

class QualityChange:
    """A change of the quality level.

    Fields:
        from_quality_level: The quality level before.
        to_quality_level: The quality level now; the one before where the step was refused.
        reason: Why.
    """
    from_quality_level: int
    to_quality_level: int
    reason: QualityReason
    def __init__(self, *, from_quality_level: int, to_quality_level: int, reason: QualityReason) -> None: ...

class QualityLevel:
    """One quality: a method, a resolution, and how the displayed image is corrected. A hologram smaller than the modulator
    is shown in its middle.

    Fields:
        method: What makes the hologram.
        width: Width of the hologram, pixels.
        height: Height of the hologram, pixels.
        local_steps: Local steps of this quality level; none for the session's.
        midpoint_steps: Steps at the midpoint of this quality level; none for the session's.
    """
    method: Method
    width: int
    height: int
    local_steps: int | None
    midpoint_steps: int | None
    def __init__(self, *, method: Method, width: int, height: int, local_steps: int | None = ..., midpoint_steps: int | None = ...) -> None: ...

class SessionOptions:
    """What a session makes, and how. `session_options` gives the defaults; change what differs.

    Fields:
        target: What holograms are for.
        quality_levels: Quality levels, the best first: 1 to 16.
        quality: Whether the session may change its quality level by itself.
        target_rate_hz: Frames a second that are aimed at; none takes every frame and never steps.
        encoding: How the field becomes phases.
        brightness: Which amplitude full light stands for.
        dark_threshold: Where the amplitude is below this share of full light, 0 to 1, phases are drawn to 0, against coloured speckle in the dark; none for what suits the encoding: 0.4, and 0 with a pre-filter.
        local_steps: Steps of correction, 0 to 8, each of which draws the displayed image toward the field that is wanted; none for what suits the encoding: 1, and 0 with a pre-filter.
        midpoint_steps: Steps of correction at the midpoint, 0 to 100, each of which costs four transforms a colour: 3 for stills, 1 for video, where it goes on from the frame before.
        depth_range: Which metres are shown at the ends of the volume.
        least_confidence: Readings less sure than this, in 0..=1, are none. ARKit's "low" is 0, "medium" ½, "high" 1.
        threads: Threads to compute with, at most 256; none for as many as the device has.
        most_pixels: Most pixels of a quality level and of the modulator, 8192×4096 unless it is set: what a session allocates is a multiple of them.
        backend: Where frames are computed.
    """
    target: Target
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
    def __init__(self, *, target: Target, quality_levels: list[QualityLevel], quality: Quality, target_rate_hz: float | None, encoding: Encoding, brightness: Brightness, dark_threshold: float | None = ..., local_steps: int | None = ..., midpoint_steps: int = 0, depth_range: DepthRange, least_confidence: float, threads: int | None, most_pixels: int = 33554432, backend: Backend) -> None: ...

class Statistics:
    """What a session has done so far. Submitted frames are processed, failed, refused, dropped or pending.

    Fields:
        submitted: Frames that were given to the session.
        processed: Frames that became holograms.
        failed: Frames that could not be processed.
        refused: Frames that came late.
        dropped: Frames that were dropped.
        pending: Frames that wait or are in flight.
        rate_hz: Holograms a second, of late.
        times: Mean times, of late.
        backend: What runs the network.
        backend_why: Why that.
        quality_level: The quality level, 0 the best.
        listener_failures: How often the listener threw.
    """
    submitted: int
    processed: int
    failed: int
    refused: int
    dropped: Drops
    pending: int
    rate_hz: float
    times: FrameTimes
    backend: str
    backend_why: str
    quality_level: int
    listener_failures: int
    def __init__(self, *, submitted: int, processed: int, failed: int, refused: int, dropped: Drops, pending: int, rate_hz: float, times: FrameTimes, backend: str, backend_why: str, quality_level: int, listener_failures: int) -> None: ...

def built_in_pair(offset_mm: float) -> DeepPair:
    """The pair in int8 that is bundled for a modulator at `offset_mm` and the default display's pitch, colours and
    volume.

    Errors: Another offset, or a library that was built without them.
    """

def display_from_toml(text: str) -> Display:
    """Reads a display from its TOML form; what is left out has the default value.

    Errors: Text that is not TOML, an unknown key, or a value out of its range.
    """

def session_options(target: Target, method: Method | None = ...) -> SessionOptions:
    """The default options for `target`: holograms of its modulator's resolution by `method` and AA-DPM with one step of
    correction, or, without a method, by the network that is built in, by the plane sweep where it was not trained for
    the display; smoothed brightness, near and far by percentiles.
    """

def set_log_listener(level: LogLevel, listener: LogListener | None) -> None:
    """Sends messages of `level` and above to `listener`; none for silence. Of the libraries underneath, warnings and
    errors are sent.

    Errors: A process that already logs elsewhere.
    """

def set_stage_listener(listener: StageListener | None) -> None:
    """Tells `listener` of every stage of every session; None for silence, which costs nothing. Set it between frames: of a
    stage that is under way it may hear the end alone.

    Errors: A process that already collects Rust's `tracing` elsewhere: the spans of stages go there.
    """

def version() -> str:
    """The version of the library."""

class Network:
    """A hologram network. Immutable; one serves many sessions."""
    @classmethod
    def built_in(cls, name: str = 'rgbd-8') -> Network:
        """A network in int8 that is bundled, by `name`: that of 8 layers unless another is named. For the default
        display's pitch, colours and volume.

        Errors: A name that none has, or a library that was built without them.
        """
    @classmethod
    def from_bytes(cls, onnx: bytes) -> Network:
        """Reads an ONNX file's bytes.

        Errors: What is not a hologram network, with what is not so and what would be right.
        """
    @classmethod
    def from_file(cls, path: str) -> Network:
        """Reads an ONNX file.

        Errors: A file that cannot be read; as `from_bytes`.
        """
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def info(self) -> NetworkInfo:
        """What it is."""

class Target:
    """What holograms are made for: a display and, where it is calibrated, what its modulator answers to a phase, its
    lasers' light, what corrects its optics. Immutable; one serves many sessions.
    """
    @classmethod
    def from_bytes(cls, file: bytes) -> Target:
        """Reads the bytes of a calibration's file, as `phasefront calibrate pack` writes it.

        Errors: What is not such a file, with what is not so.
        """
    @classmethod
    def from_file(cls, path: str) -> Target:
        """Reads a calibration's file.

        Errors: A file that cannot be read; as `from_bytes`.
        """
    @classmethod
    def of_display(cls, display: Display) -> Target:
        """A display with levels in equal steps of phase, as many as its bits have.

        Errors: A display that cannot be.
        """
    @classmethod
    def with_look_up_table(cls, display: Display, levels: bytes) -> Target:
        """A display whose modulator was calibrated as a whole: of 256 levels the one at i shows the phase 2πi/256.

        Errors: A display that cannot be, or another number of levels.
        """
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def display(self) -> Display:
        """The display itself."""

class LogListener:
    """Hears log messages, on any thread. It may call the library, but where a session computes on its thread it cannot
    wait for a frame: `process`, `warm_up` and previews are refused there, and closing does not wait. What it throws is
    ignored.
    """
    def on_log(self, level: LogLevel, message: str) -> None:
        """One message."""

class RawPlanes:
    """Numbers of 32 bits at each pixel of each colour: planes row by row without gaps, one after another. For the layers
    by hand.
    """
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def colours(self) -> int:
        """Planes: 3, or 1 of a display of one laser."""
    def height(self) -> int:
        """Pixels along y."""
    def pixel_bytes(self) -> int:
        """Bytes of a pixel: 4 of an amplitude, 8 of a real and an imaginary part."""
    def plane_address(self, colour: int) -> int:
        """Where the plane of one colour lies: 0 red, 1 green, 2 blue, or 0 of one laser. Valid as long as this object.

        Errors: Another colour.
        """
    def share(self) -> RawPlanes:
        """Another handle to the same planes: whoever reads their memory holds one."""
    def width(self) -> int:
        """Pixels along x."""

class RawImage:
    """An image, row by row without gaps. For the layers by hand."""
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def address(self) -> int:
        """Where its bytes lie. Valid as long as this object."""
    def byte_len(self) -> int:
        """How many bytes lie there."""
    def height(self) -> int:
        """Pixels along y."""
    def pixel_bytes(self) -> int:
        """Bytes of a pixel."""
    def share(self) -> RawImage:
        """Another handle to the same image: whoever reads its memory holds one."""
    def width(self) -> int:
        """Pixels along x."""

class RawHologram:
    """The hologram of one frame: modulator levels of three colours. For the layers by hand, which keep it alive while its
    planes are read.
    """
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def field(self, z_mm: float) -> RawPlanes:
        """The complex field that the levels make behind the aperture at `z_mm`, 0 the midpoint, without the carrier: real
        and imaginary part of each pixel.

        Errors: A z too far away.
        """
    def info(self) -> HologramInfo:
        """What is known of it."""
    def output(self, placement: Placement, image: int) -> RawImage:
        """Image `image` of those that the modulator's driver takes, of the modulator's resolution: levels as they are, in
        the upper bits of a byte, the hologram where `placement` says.

        Errors: An image that the layout has not.
        """
    def plane_address(self, colour: int) -> int:
        """Where the levels of one colour lie, a byte each, row by row without gaps: 0 red, 1 green, 2 blue, or 0 of one
        laser. The colours follow one another without gaps, too. Valid as long as this object.

        Errors: Another colour.
        """
    def plane_len(self) -> int:
        """How many bytes lie there."""
    def preview(self, z_mm: float, width: int, height: int) -> RawImage:
        """What an eye focused at `z_mm` sees, `width` × `height` pixels.

        Errors: An empty image, or a z too far away.
        """
    def refocus(self, z_mm: float) -> RawPlanes:
        """What an eye focused at `z_mm` sees of the whole hologram: amplitudes, of which 1 is white.

        Errors: A z too far away.
        """
    def share(self) -> RawHologram:
        """Another handle to the same hologram: whoever reads its memory holds one."""
    def z_at(self, x: float, y: float) -> float:
        """z of what is seen at (`x`, `y`) of the picture, each 0 to 1 from its upper left corner, mm: where to focus when
        it is tapped on.
        """

class RawSession:
    """A session. Every call may come from any thread, at any moment."""
    def __init__(self, options: SessionOptions, mode: RunningMode, listener: SessionListener | None) -> None:
        """A session that runs in `mode`; live, it needs a `listener`.

        Errors: Options that cannot be meant or planned for, a live session without a listener, another with one, or threads
        that cannot be started.
        """
    def pause(self) -> None:
        """Takes no frames until `resume`."""
    def process(self, luma_or_colour: bytes, chroma: bytes, chroma_v: bytes, depth: bytes, confidence: bytes, info: FrameInfo) -> RawHologram:
        """The hologram of a frame, in an image or a video session. `luma_or_colour` is the first plane of its colour,
        `chroma` and `chroma_v` the others; what the frame has not, is empty.

        Errors: A frame that is not usable or late, or a session that is live, paused or closed. None of them harms the frames
        that follow.
        """
    def reset(self) -> None:
        """Forgets all frames so far, one in the making too; the next, of any timestamp, is the first again."""
    def resume(self) -> None:
        """Takes frames again."""
    def set_quality(self, quality: Quality) -> None:
        """Allows or forbids changes of the quality level.

        Errors: A quality level that the session does not have.
        """
    def set_thermal(self, thermal: Thermal) -> None:
        """Says how hot the device is."""
    def shut_down(self) -> None:
        """Takes no more frames and gives the memory back. When it returns, the listener has heard everything, `on_closed`
        last, and will not be called again; called by a listener, of this session or another, or by a log handler while
        a session computes, it does not wait for that. Closing twice does nothing.
        """
    def statistics(self) -> Statistics:
        """What the session has done so far; of a closed one, what it did. Never waits for a frame."""
    def submit(self, luma_or_colour: bytes, chroma: bytes, chroma_v: bytes, depth: bytes, confidence: bytes, info: FrameInfo) -> DropReason | None:
        """Hands a frame to a live session, which copies it and goes on by itself. Gives why the frame was dropped, if it
        was at once; the listener hears of it too. Planes as `process` takes them.

        Errors: A frame that is not usable or late, or a session that is not live or is closed. None of them harms the frames
        that follow.
        """
    def warm_up(self) -> None:
        """Runs an empty frame through the stages, so that the first real one is as fast as the others. Waits for it."""

class SessionListener:
    """Hears what becomes of the frames of a live session: one call after another, on the session's own thread, in the
    order in which things happened. While it is busy no frame is processed. What it throws is counted and logged.
    """
    def on_processed(self, hologram: RawHologram) -> None:
        """A frame became a hologram."""
    def on_dropped(self, timestamp_ns: int, reason: DropReason) -> None:
        """A frame was dropped."""
    def on_failed(self, timestamp_ns: int, message: str) -> None:
        """A frame could not be processed. The session goes on."""
    def on_quality_changed(self, timestamp_ns: int, change: QualityChange) -> None:
        """The frames after this one are made at another quality level."""
    def on_closed(self) -> None:
        """The session is closed and its memory is given back. This is the last call, made exactly once, also where
        shutting down does not wait for it.
        """

class StageListener:
    """Hears when stages begin and end, on the threads that compute them: on one thread they lie within one another. It
    must not call the library. What it throws is ignored.
    """
    def on_begin(self, stage: Stage) -> None:
        """A stage begins on this thread."""
    def on_end(self, stage: Stage) -> None:
        """The stage that began last on this thread ends."""
