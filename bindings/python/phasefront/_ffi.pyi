"""The types of what is generated: written by `bindings/generate`."""

import enum

class ColourFormat(enum.Enum):
    """The memory layout of a colour image.

    Values:
        RGBA: One plane with the bytes red, green, blue, alpha. Alpha is ignored.
        BGRA: One plane with the bytes blue, green, red, alpha, as in iOS' 32BGRA. Alpha is ignored.
        RGB: One plane with the bytes red, green, blue.
        NV12: Two planes: luma, and interleaved blue and red chroma at half the resolution. iOS' 420f and 420v.
        YUV420: Three planes: luma, and at half the resolution blue chroma (U) and red chroma (V). Android's YUV_420_888.
    """
    RGBA = 0
    BGRA = 1
    RGB = 2
    NV12 = 3
    YUV420 = 4

class YuvMatrix(enum.Enum):
    """The matrix that converts luma and chroma to colour.

    Values:
        BT601: ITU-R BT.601, for standard definition, JPEG and most Android cameras.
        BT709: ITU-R BT.709, for high definition.
        BT2020: ITU-R BT.2020 with non-constant luminance, for films of high dynamic range.
    """
    BT601 = 0
    BT709 = 1
    BT2020 = 2

class RgbEncoding(enum.Enum):
    """The meaning of a picture's red, green and blue.

    Values:
        SRGB: sRGB (IEC 61966-2-1), and BT.709 video, which screens show alike.
        DISPLAY_P3: Display P3: the primaries of DCI-P3, white D65 and the curve of sRGB. Photographs and videos of phones.
        BT2020: BT.2020 of standard dynamic range, with the curve of sRGB.
        BT2020_HLG: BT.2020 with hybrid log-gamma (BT.2100). Light above the reference white of 203 cd/m² is brought below full light.
        BT2020_PQ: BT.2020 with perceptual quantization (BT.2100, SMPTE ST 2084). As for hybrid log-gamma, light above the reference white is brought below full light.
        AMPLITUDE: Amplitudes of the lasers themselves: the value is the amplitude, its square is the light. This is the convention of the paper, its data sets and its networks' training.
    """
    SRGB = 0
    DISPLAY_P3 = 1
    BT2020 = 2
    BT2020_HLG = 3
    BT2020_PQ = 4
    AMPLITUDE = 5

class ConfidenceFormat(enum.Enum):
    """The memory layout of a confidence map.

    Values:
        LOW_MEDIUM_HIGH: 0 low, 1 medium, 2 high, as in ARKit's ARConfidenceLevel.
        U8: 0 none to 255 full, as in ARCore's acquireRawDepthConfidenceImage.
    """
    LOW_MEDIUM_HIGH = 0
    U8 = 1

class DepthFormat(enum.Enum):
    """The memory layout of a depth image. In all formats except the normalized and the relative ones, 0, negative numbers,
    NaN, numbers of 10⁹ or more, the largest code of an integer format and the largest finite 16-bit float mean no
    reading.

    Values:
        METRES_F32: Metres as 32-bit floats: ARKit's sceneDepth, AVFoundation's DepthFloat32.
        METRES_F16: Metres as 16-bit floats: AVFoundation's DepthFloat16.
        DISPARITY_F32: Inverse metres as 32-bit floats: AVFoundation's DisparityFloat32.
        DISPARITY_F16: Inverse metres as 16-bit floats: AVFoundation's DisparityFloat16.
        MILLIMETRES_U16: Millimetres in all 16 bits: ARCore's acquireDepthImage16Bits, HardwareBuffer's D_16.
        ANDROID_DEPTH16: Android's DEPTH16: millimetres in the lower 13 bits, and a confidence in the upper 3 bits. It differs from millimetres in all 16 bits.
        NORMALIZED_U8: Bytes from 0 nearest to 255 farthest. Every pixel is a reading.
        NORMALIZED_U16: 16-bit numbers from 0 nearest to 65535 farthest. Every pixel is a reading.
        RELATIVE_F32: Relative inverse depth as 32-bit floats, as networks estimate it: larger where nearer, on any scale. NaN and numbers from ±10⁹ on mean no reading.
        RELATIVE_F16: Relative inverse depth as 16-bit floats.
    """
    METRES_F32 = 0
    METRES_F16 = 1
    DISPARITY_F32 = 2
    DISPARITY_F16 = 3
    MILLIMETRES_U16 = 4
    ANDROID_DEPTH16 = 5
    NORMALIZED_U8 = 6
    NORMALIZED_U16 = 7
    RELATIVE_F32 = 8
    RELATIVE_F16 = 9

class Encoding:
    """The conversion of a field to phases.

    One of:
        double_phase: Double phase of the unchanged field.
        anti_alias: Double phase after a small Gaussian blur (AA-DPM).
        band_limit: Double phase after a filter that removes high diagonal frequencies (BL-DPM).
        deep: Double phase after a pre-filter network (DDPM), which was trained together with the hologram network for the offset of the display.
    """
    class double_phase(Encoding):
        """Double phase of the unchanged field."""
        def __init__(self) -> None: ...
    class anti_alias(Encoding):
        """Double phase after a small Gaussian blur (AA-DPM).

        Fields:
            sigma: The standard deviation in pixels; 0.7 in the paper.
            width: The number of taps, an odd number; 3 in the paper.
        """
        sigma: float
        width: int
        def __init__(self, sigma: float, width: int) -> None: ...
    class band_limit(Encoding):
        """Double phase after a filter that removes high diagonal frequencies (BL-DPM).

        Fields:
            k: The bound of |tan(πfx)·tan(πfy)|, where f is in cycles per pixel; 1 in the paper.
        """
        k: float
        def __init__(self, k: float) -> None: ...
    class deep(Encoding):
        """Double phase after a pre-filter network (DDPM), which was trained together with the hologram network for the
        offset of the display.

        Fields:
            prefilter: The pre-filter.
        """
        prefilter: Network
        def __init__(self, prefilter: Network) -> None: ...
    def is_double_phase(self) -> bool: ...
    def is_anti_alias(self) -> bool: ...
    def is_band_limit(self) -> bool: ...
    def is_deep(self) -> bool: ...

class Brightness:
    """The amplitude that maps to full light.

    One of:
        smoothed: An amplitude near the frame's largest that changes smoothly from frame to frame, so that video does not flicker.
        fixed: A fixed amplitude. Larger amplitudes are clipped.
        frame_max: The largest amplitude of the frame.
    """
    class smoothed(Brightness):
        """An amplitude near the frame's largest that changes smoothly from frame to frame, so that video does not flicker."""
        def __init__(self) -> None: ...
    class fixed(Brightness):
        """A fixed amplitude. Larger amplitudes are clipped.

        Fields:
            scale: The amplitude.
        """
        scale: float
        def __init__(self, scale: float) -> None: ...
    class frame_max(Brightness):
        """The largest amplitude of the frame."""
        def __init__(self) -> None: ...
    def is_smoothed(self) -> bool: ...
    def is_fixed(self) -> bool: ...
    def is_frame_max(self) -> bool: ...

class Rotation(enum.Enum):
    """The clockwise rotation that turns a sensor's image upright.

    Values:
        UPRIGHT: No rotation.
        CLOCKWISE90: A quarter turn.
        HALF: Half a turn.
        CLOCKWISE270: Three quarters of a turn.
    """
    UPRIGHT = 0
    CLOCKWISE90 = 1
    HALF = 2
    CLOCKWISE270 = 3

class Layout(enum.Enum):
    """The arrangement of the colours' levels in images for a modulator's driver.

    Values:
        RGB: One image with bytes red, green, blue.
        RGBA: One image with bytes red, green, blue, alpha 255.
        BGRA: One image with bytes blue, green, red, alpha 255.
        RGB10: One image with 32-bit little-endian words: red in the lowest 10 bits, then green, then blue, alpha 3. Android's RGBA_1010102, Metal's rgb10a2.
        GREY: One image for each colour in the order red, green, blue, with one byte for each pixel.
        GREY16: One image for each colour in the order red, green, blue, with one 16-bit little-endian word for each pixel.
    """
    RGB = 0
    RGBA = 1
    BGRA = 2
    RGB10 = 3
    GREY = 4
    GREY16 = 5

class QualityReason(enum.Enum):
    """The reason why a session changed its quality level.

    Values:
        TOO_SLOW: Frames took longer than the target rate allows.
        ROOM: There was time left.
        THERMAL: The device is hot.
        ASKED: The app asked for it.
        REFUSED: The next quality level cannot be planned. The session keeps the previous one and does not try the next one again.
        OTHER: A reason that this version of the bindings does not know.
    """
    TOO_SLOW = 0
    ROOM = 1
    THERMAL = 2
    ASKED = 3
    REFUSED = 4
    OTHER = 5

class Method:
    """The method that computes holograms.

    One of:
        auto: The trained network for frames whose depth has soft edges, such as depth from motion or depth that a network estimated, and the plane sweep for all others. This is the default.
        sweep: The plane sweep, which suits any display and needs no training.
        trained: A trained network.
    """
    class auto(Method):
        """The trained network for frames whose depth has soft edges, such as depth from motion or depth that a network
        estimated, and the plane sweep for all others. This is the default.

        Fields:
            network: The network, which must suit the session's display; none for the built-in one, or for the plane sweep alone
        if that network was not trained for the display.
        """
        network: Network | None
        def __init__(self, network: Network | None = ...) -> None: ...
    class sweep(Method):
        """The plane sweep, which suits any display and needs no training."""
        def __init__(self) -> None: ...
    class trained(Method):
        """A trained network.

        Fields:
            network: The network, which must suit the session's display.
        """
        network: Network
        def __init__(self, network: Network) -> None: ...
    def is_auto(self) -> bool: ...
    def is_sweep(self) -> bool: ...
    def is_trained(self) -> bool: ...

class PhasefrontError(Exception):
    """The error of a call. The message is one line that names what is wrong and what would be right.

    Kinds:
        DisplayError: The physics of a display is impossible or out of range.
        FrameError: A frame, plane or image has the wrong shape or unusable values.
        TimestampError: A frame is not later than the previous one. It is refused; later frames are not affected.
        SettingError: A setting or an argument is invalid or cannot be planned.
        NetworkError: A file is not a hologram network, or the network is for another display.
        FileError: A file cannot be read.
        SessionError: A session cannot answer the call in its mode or state.
        InternalError: Phasefront has a bug. The call had no effect, or the frame is lost. Please report it.
    """

class DisplayError(PhasefrontError):
    """The physics of a display is impossible or out of range."""

class FrameError(PhasefrontError):
    """A frame, plane or image has the wrong shape or unusable values."""

class TimestampError(PhasefrontError):
    """A frame is not later than the previous one. It is refused; later frames are not affected."""

class SettingError(PhasefrontError):
    """A setting or an argument is invalid or cannot be planned."""

class NetworkError(PhasefrontError):
    """A file is not a hologram network, or the network is for another display."""

class FileError(PhasefrontError):
    """A file cannot be read."""

class SessionError(PhasefrontError):
    """A session cannot answer the call in its mode or state."""

class InternalError(PhasefrontError):
    """Phasefront has a bug. The call had no effect, or the frame is lost. Please report it."""

class Quality:
    """Determines whether a session may change its quality level.

    One of:
        adaptive: The session lowers the quality level if frames take longer than the target rate allows or the device is hot, and raises it if there is time left.
        fixed: The session stays at this quality level.
    """
    class adaptive(Quality):
        """The session lowers the quality level if frames take longer than the target rate allows or the device is hot, and
        raises it if there is time left.
        """
        def __init__(self) -> None: ...
    class fixed(Quality):
        """The session stays at this quality level.

        Fields:
            quality_level: The quality level; 0 is the best.
        """
        quality_level: int
        def __init__(self, quality_level: int) -> None: ...
    def is_adaptive(self) -> bool: ...
    def is_fixed(self) -> bool: ...

class Focus:
    """How what is out of focus looks.

    One of:
        coherent: As a laser shows it, with halos and rings. This is the default.
        natural: Soft, as in the world.
    """
    class coherent(Focus):
        """As a laser shows it, with halos and rings. This is the default."""
        def __init__(self) -> None: ...
    class natural(Focus):
        """Soft, as in the world.

        Fields:
            steps: The number of steps that follow the method, 0 to 1000, each of two transforms for each plane and colour. 30
        bring most of the gain in stills. Without steps, as live frames need it, the method `Auto` without a network
        takes the built-in network for natural focus.
        """
        steps: int
        def __init__(self, steps: int) -> None: ...
    def is_coherent(self) -> bool: ...
    def is_natural(self) -> bool: ...

class DepthRange:
    """The distances that map to the ends of the volume.

    One of:
        percentiles: The 1st and 99th percentile of the readings, smoothed over time in video.
        fixed: Fixed distances.
    """
    class percentiles(DepthRange):
        """The 1st and 99th percentile of the readings, smoothed over time in video."""
        def __init__(self) -> None: ...
    class fixed(DepthRange):
        """Fixed distances.

        Fields:
            near_m: The distance of the near end, in metres.
            far_m: The distance of the far end, in metres.
        """
        near_m: float
        far_m: float
        def __init__(self, near_m: float, far_m: float) -> None: ...
    def is_percentiles(self) -> bool: ...
    def is_fixed(self) -> bool: ...

class Backend(enum.Enum):
    """The backend that computes frames.

    Values:
        CPU: Computes on the CPU.
        GPU: Computes on the GPU if this library was built with GPU support, a GPU exists and its results agree with the CPU's; otherwise on the CPU. `backend` and `backend_why` in the statistics name the backend in use and the reason.
    """
    CPU = 0
    GPU = 1

class ColourScale(enum.Enum):
    """The scaling that a depth network expects for colour values from 0 to 1.

    Values:
        IMAGENET: Normalized by the mean and the spread of ImageNet, as in the training of MiDaS, DPT and Depth Anything.
        UNIT: From 0 to 1.
        SIGNED: From -1 to 1.
    """
    IMAGENET = 0
    UNIT = 1
    SIGNED = 2

class DropReason(enum.Enum):
    """The reason why a session dropped a frame without an error.

    Values:
        SUPERSEDED: A newer frame arrived while this one waited.
        ABOVE_TARGET_RATE: The frame arrived sooner than the target rate allows.
        PAUSED: The session was paused.
        RESET: The session was reset before the frame was finished.
        CLOSED: The session was closed before the frame was finished.
        UNREAD: The frame became a hologram, but newer ones arrived before the app took it from the stream of events. Only the streams of the packages report this reason.
        OTHER: A reason that this version of the bindings does not know.
    """
    SUPERSEDED = 0
    ABOVE_TARGET_RATE = 1
    PAUSED = 2
    RESET = 3
    CLOSED = 4
    UNREAD = 5
    OTHER = 6

class LogLevel(enum.Enum):
    """The severity of a log message.

    Values:
        ERROR: An error.
        WARNING: Something that may be wrong.
        INFO: An action of the library.
        DEBUG: Details.
    """
    ERROR = 0
    WARNING = 1
    INFO = 2
    DEBUG = 3

class RunningMode(enum.Enum):
    """The running mode of a session. It is fixed when the session is created.

    Values:
        IMAGE: The session answers each frame independently of all others.
        VIDEO: The session answers each frame, and smooths depth and brightness over time. Timestamps must increase.
        LIVE: The app submits frames without waiting, and the listener receives the outcome of each. Timestamps must increase.
    """
    IMAGE = 0
    VIDEO = 1
    LIVE = 2

class Stage(enum.Enum):
    """A part of the work on a frame.

    Values:
        FRAME: The whole work on a frame on the session's threads. It contains all other stages except `Plan` and `Preview`.
        COLOUR: Rotating, converting and resizing the colour image.
        DEPTH: Reading, aligning, temporally smoothing and refining the depth.
        METHOD: Computing the midpoint hologram from the frame.
        PROPAGATE: Propagating from the midpoint to the modulator.
        ENCODE: Encoding the field into levels.
        MIDPOINT: Correction steps at the midpoint, inside `Encode`.
        GPU: Computing a frame on a GPU, including both transfers.
        PLAN: Creating the plans and memory of a quality level.
        PREVIEW: Computing a preview.
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
    """The thermal state of the device as reported by its system.

    Values:
        NOMINAL: The device is not warm; nothing is limited.
        FAIR: The device is warm; frames may take a little less time.
        SERIOUS: The device is hot; frames may take half the time.
        CRITICAL: The device is too hot; the session uses the lowest quality level.
    """
    NOMINAL = 0
    FAIR = 1
    SERIOUS = 2
    CRITICAL = 3

class Intrinsics:
    """The pinhole model of a camera, in pixels of its image before the image is turned upright. The middle of the first
    pixel is (0, 0).

    Fields:
        fx: The focal length along x.
        fy: The focal length along y.
        cx: The x of the principal point.
        cy: The y of the principal point.
    """
    fx: float
    fy: float
    cx: float
    cy: float
    def __init__(self, *, fx: float, fy: float, cx: float, cy: float) -> None: ...

class Pose:
    """The pose of the depth camera. A point p of the depth camera (x right, y down, z forward) is at R·p + t of the colour
    camera.

    Fields:
        rotation: R: 9 numbers, row by row.
        translation_m: t: 3 numbers, in metres.
    """
    rotation: list[float]
    translation_m: list[float]
    def __init__(self, *, rotation: list[float], translation_m: list[float]) -> None: ...

class Cameras:
    """The intrinsics and the relative pose of the depth camera and the colour camera.

    Fields:
        colour: The intrinsics of the colour camera.
        depth: The intrinsics of the depth camera.
        pose: The pose from the depth camera to the colour camera; none for cameras with the same position and orientation.
    """
    colour: Intrinsics
    depth: Intrinsics
    pose: Pose | None
    def __init__(self, *, colour: Intrinsics, depth: Intrinsics, pose: Pose | None = ...) -> None: ...

class PlaneInfo:
    """The strides of a plane.

    Fields:
        row_stride: The number of bytes from one row to the next.
        pixel_stride: The number of bytes from one pixel to the next in a row.
    """
    row_stride: int
    pixel_stride: int
    def __init__(self, *, row_stride: int, pixel_stride: int) -> None: ...

class ColourInfo:
    """The format and size of a colour image.

    Fields:
        format: The memory layout.
        width: The width of the sensor's image, in pixels.
        height: The height of the sensor's image, in pixels.
        planes: The planes, in the format's order.
        matrix: The matrix of luma and chroma. Other formats ignore it.
        video_range: Whether luma spans 16..=235 and chroma 16..=240 instead of 0..=255 for both. Other formats ignore it.
        encoding: The meaning of red, green and blue.
    """
    format: ColourFormat
    width: int
    height: int
    planes: list[PlaneInfo]
    matrix: YuvMatrix
    video_range: bool
    encoding: RgbEncoding
    def __init__(self, *, format: ColourFormat, width: int, height: int, planes: list[PlaneInfo], matrix: YuvMatrix, video_range: bool, encoding: RgbEncoding) -> None: ...

class ConfidenceInfo:
    """The format and size of a confidence map.

    Fields:
        format: The memory layout.
        width: The width in pixels, equal to the depth image's.
        height: The height in pixels, equal to the depth image's.
        plane: The plane.
    """
    format: ConfidenceFormat
    width: int
    height: int
    plane: PlaneInfo
    def __init__(self, *, format: ConfidenceFormat, width: int, height: int, plane: PlaneInfo) -> None: ...

class NetworkInfo:
    """The properties of a network and of the display that it was trained for.

    Fields:
        layers: The number of convolutions.
        filters: The number of filters of each hidden layer.
        precision: The number format of the layers: `f32` or `int8`, or `own` for a network of another form, which runs in the formats that its file names.
        pitch_um: The distance between neighbouring pixels, in µm.
        volume_depth_mm: The depth of the volume, in mm.
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
        hologram: The hologram network.
        prefilter: The pre-filter.
    """
    hologram: Network
    prefilter: Network
    def __init__(self, *, hologram: Network, prefilter: Network) -> None: ...

class DepthInfo:
    """The format and size of a depth image.

    Fields:
        format: The memory layout.
        width: The width of the sensor's image, in pixels.
        height: The height of the sensor's image, in pixels.
        plane: The plane.
    """
    format: DepthFormat
    width: int
    height: int
    plane: PlaneInfo
    def __init__(self, *, format: DepthFormat, width: int, height: int, plane: PlaneInfo) -> None: ...

class Display:
    """A modulator, its lasers, and the display volume. It is checked when it is used.

    Fields:
        width: The number of pixels along x.
        height: The number of pixels along y.
        pitch_um: The distance between neighbouring pixels, in µm.
        red_nm: The wavelength of the red laser, in nm.
        green_nm: The wavelength of the green laser, in nm.
        blue_nm: The wavelength of the blue laser, in nm.
        laser_nm: The wavelength, in nm, of the only laser of a display with one laser, which replaces the other three wavelengths; none for a display with three lasers.
        volume_depth_mm: The depth of the volume, in mm.
        offset_mm: The z of the modulator relative to the middle of the volume, in mm, positive toward the viewer.
        bits: The number of bits of a modulator level.
        aperture_radius: The radius of the aperture in the Fourier plane; 1 is the whole first order.
        white: The chromaticity x, y of the light of all lasers; none if it is not known. At most one of `white`, `powers` and `primaries` may be given; without one, all lasers together are taken for D65.
        powers: The radiant powers of red, green and blue, on any scale.
        primaries: X, Y and Z of red, of green and of blue, 9 numbers on any scale.
        wavelengths_nm: The wavelengths of the lasers, in nm: red, green and blue, or that of the only one. They replace the four fields of single wavelengths.
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
    white: list[float] | None
    powers: list[float] | None
    primaries: list[float] | None
    def __init__(self, *, width: int = 1920, height: int = 1080, pitch_um: float = 8.0, red_nm: float = 638.0, green_nm: float = 520.0, blue_nm: float = 450.0, laser_nm: float | None = ..., volume_depth_mm: float = 6.0, offset_mm: float = 0.0, bits: int = 8, aperture_radius: float = 1.0, white: list[float] | None = ..., powers: list[float] | None = ..., primaries: list[float] | None = ..., wavelengths_nm: list[float] | tuple[float, ...] | None = ...) -> None: ...
    @property
    def wavelengths_nm(self) -> list[float]: ...
    @classmethod
    def named(cls, name: str) -> Display: ...

class Drops:
    """The number of dropped frames for each reason.

    Fields:
        superseded: Frames that waited when a newer frame arrived.
        above_target_rate: Frames that arrived sooner than the target rate allows.
        paused: Frames that arrived while the session was paused.
        reset: Frames that were not finished when the session was reset.
        closed: Frames that were not finished when the session was closed.
        total: The sum of all reasons.
    """
    superseded: int
    above_target_rate: int
    paused: int
    reset: int
    closed: int
    total: int
    def __init__(self, *, superseded: int, above_target_rate: int, paused: int, reset: int, closed: int, total: int) -> None: ...

class EncoderOptions:
    """How a field becomes levels.

    Fields:
        encoding: How the field becomes phases.
        brightness: Which amplitude full light stands for.
        dark_threshold: Where the amplitude is below this share of full light, 0 to 1, phases are drawn to 0, against coloured speckle in the dark; none for what suits the encoding: 0.4, and 0 with a pre-filter.
        local_steps: Steps of correction, 0 to 8, each of which draws the displayed image toward the field that is wanted; none for what suits the encoding: 1, and 0 with a pre-filter.
        midpoint_steps: Steps of correction at the midpoint, 0 to 100, each of which costs four transforms a colour.
    """
    encoding: Encoding
    brightness: Brightness
    dark_threshold: float | None
    local_steps: int | None
    midpoint_steps: int
    def __init__(self, *, encoding: Encoding, brightness: Brightness, dark_threshold: float | None = ..., local_steps: int | None = ..., midpoint_steps: int = 0) -> None: ...

class Orientation:
    """The transformation from a sensor's image to the upright image: a rotation, then mirroring.

    Fields:
        rotation: The rotation.
        mirrored: Whether left and right are exchanged after the rotation, as front cameras need.
    """
    rotation: Rotation
    mirrored: bool
    def __init__(self, *, rotation: Rotation, mirrored: bool = False) -> None: ...

class FrameInfo:
    """The description of a frame. Its memory is passed with it.

    Fields:
        timestamp_ns: The time at which the frame was taken, in nanoseconds of any clock that runs forward.
        colour: The colour image.
        depth: The depth image; none if the session's depth network estimates it.
        confidence: The confidence map of the depth image; none if there is no map or no depth image.
        orientation: The transformation of all images to upright ones.
        cameras: The correspondence of the pixels of depth and colour; none if both images have the same field of view.
    """
    timestamp_ns: int
    colour: ColourInfo
    depth: DepthInfo | None
    confidence: ConfidenceInfo | None
    orientation: Orientation
    cameras: Cameras | None
    def __init__(self, *, timestamp_ns: int, colour: ColourInfo, depth: DepthInfo | None, confidence: ConfidenceInfo | None, orientation: Orientation, cameras: Cameras | None) -> None: ...

class FrameTimes:
    """The time that each stage of a frame took, in milliseconds.

    Fields:
        colour_ms: Rotating, converting and resizing the colour image.
        depth_ms: Reading, aligning, temporally smoothing and refining the depth.
        method_ms: Computing the midpoint hologram from the frame.
        propagate_ms: Propagating from the midpoint to the modulator.
        encode_ms: Encoding the field into levels.
        total_ms: The sum of all stages.
    """
    colour_ms: float
    depth_ms: float
    method_ms: float
    propagate_ms: float
    encode_ms: float
    total_ms: float
    def __init__(self, *, colour_ms: float, depth_ms: float, method_ms: float, propagate_ms: float, encode_ms: float, total_ms: float) -> None: ...

class HologramInfo:
    """The properties of a hologram.

    Fields:
        timestamp_ns: The timestamp of the frame.
        width: The width in pixels.
        height: The height in pixels.
        colours: The number of colours of the levels: 3, or 1 for a display with one laser.
        scale: The amplitude that maps to full light.
        near_m: The distance of the near end of the volume in metres; none for normalized depth.
        far_m: The distance of the far end of the volume in metres; none for normalized depth.
        valid_depth: The share of the depth sensor's pixels that had a usable reading.
        quality_level: The quality level of the hologram; 0 is the best.
        times: The time that each stage took.
        encoding: The meaning of the frame's colours. Views are in sRGB unless these are amplitudes, as which views show them.
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
    encoding: RgbEncoding
    def __init__(self, *, timestamp_ns: int, width: int, height: int, colours: int, scale: float, near_m: float | None, far_m: float | None, valid_depth: float, quality_level: int, times: FrameTimes, encoding: RgbEncoding) -> None: ...

class OutputSize:
    """The images that a modulator's input takes of a hologram.

    Fields:
        width: The width of an image in pixels.
        height: The height of an image in pixels.
        pixel_bytes: The number of bytes of a pixel.
        images: The number of images: one, or one for each colour.
    """
    width: int
    height: int
    pixel_bytes: int
    images: int
    def __init__(self, *, width: int, height: int, pixel_bytes: int, images: int) -> None: ...

class Placement:
    """The placement of a hologram on its modulator.

    Fields:
        layout: The arrangement of colours in images.
        flip_x: Whether the whole image is flipped left to right.
        flip_y: Whether the whole image is flipped top to bottom.
        shift_x: The hologram's shift to the right of the middle in pixels, before flips.
        shift_y: The hologram's shift below the middle in pixels, before flips.
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
        from_quality_level: The previous quality level.
        to_quality_level: The new quality level; the previous one if the reason is `Refused`.
        reason: The reason.
    """
    from_quality_level: int
    to_quality_level: int
    reason: QualityReason
    def __init__(self, *, from_quality_level: int, to_quality_level: int, reason: QualityReason) -> None: ...

class QualityLevel:
    """A quality level: a method, a resolution and the number of correction steps. A hologram smaller than the modulator is
    displayed in its centre.

    Fields:
        method: The method that computes the hologram.
        width: The width of the hologram in pixels.
        height: The height of the hologram in pixels.
        local_steps: The number of local steps; none for the session's number.
        midpoint_steps: The number of steps at the midpoint; none for the session's number.
        focus_steps: The number of steps of natural focus, in a session with natural focus; none for the session's number.
    """
    method: Method
    width: int
    height: int
    local_steps: int | None
    midpoint_steps: int | None
    focus_steps: int | None
    def __init__(self, *, method: Method, width: int, height: int, local_steps: int | None = ..., midpoint_steps: int | None = ..., focus_steps: int | None = ...) -> None: ...

class RawMemory:
    """The caller's memory for an image. The layers written by hand promise that it stays valid during the call and that
    nobody else uses it.

    Fields:
        address: The address of the first byte.
        length: The number of bytes.
        row_stride: The number of bytes from one row to the next.
    """
    address: int
    length: int
    row_stride: int
    def __init__(self, *, address: int, length: int, row_stride: int) -> None: ...

class SessionOptions:
    """The options of a session. `session_options` returns the defaults.

    Fields:
        target: The target of the holograms.
        quality_levels: The quality levels, best first: 1 to 16.
        quality: Whether the session may change its quality level by itself.
        target_rate_hz: The target rate in frames per second; none if the session takes every frame and does not adapt its quality level to frame times.
        encoding: The conversion of fields to phases.
        brightness: The amplitude that maps to full light.
        dark_threshold: The share of full light, 0 to 1, below which phases are drawn to 0, which reduces coloured speckle in dark areas; none for the encoding's default: 0.4, and 0 with a pre-filter.
        local_steps: The number of correction steps, 0 to 8. Each step draws the displayed image toward the wanted field. None for the encoding's default: 1, and 0 with a pre-filter.
        midpoint_steps: The number of correction steps at the midpoint, 0 to 100. Each step costs four transforms per colour: 3 suit stills; 1 suits video, where each frame continues from the previous one.
        focus: How what is out of focus looks.
        depth_range: The distances that map to the ends of the volume.
        least_confidence: The confidence, in 0..=1, below which readings are ignored. ARKit's "low" is 0, "medium" ½, "high" 1.
        keep_standing: Whether what stands still in a video keeps its wave on the CPU: a frame computes only the parts where colour or depth have changed by more than a camera's noise.
        threads: The number of threads to compute with, at most 256; none for as many as the device has.
        most_pixels: The maximum number of pixels of a quality level and of the modulator; 8192×4096 by default. The memory of a session is a multiple of it.
        backend: The backend that computes frames.
        depth_network: The network that estimates the depth of frames without depth; none if all frames have depth. A live session runs it on its own thread, at the network's own rate; other sessions run it for each frame.
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
    focus: Focus
    depth_range: DepthRange
    least_confidence: float
    keep_standing: bool
    threads: int | None
    most_pixels: int
    backend: Backend
    depth_network: DepthNetwork | None
    def __init__(self, *, target: Target, quality_levels: list[QualityLevel], quality: Quality, target_rate_hz: float | None, encoding: Encoding, brightness: Brightness, dark_threshold: float | None = ..., local_steps: int | None = ..., midpoint_steps: int = 0, focus: Focus, depth_range: DepthRange, least_confidence: float, keep_standing: bool = True, threads: int | None, most_pixels: int = 33554432, backend: Backend, depth_network: DepthNetwork | None = ...) -> None: ...

class Statistics:
    """The statistics of a session at one moment. Each submitted frame is either processed, failed, refused, dropped or
    pending.

    Fields:
        submitted: Frames that were submitted.
        processed: Frames that became holograms.
        failed: Frames that could not be processed.
        refused: Frames that were refused because they were late or the session was closed.
        dropped: Frames that were dropped.
        pending: Frames that wait or are being processed.
        rate_hz: Holograms per second over the last 30.
        times: The mean times of the stages over the last 30 holograms.
        backend: The backend that computes the frames.
        backend_why: The reason for using this backend.
        quality_level: The quality level; 0 is the best.
        listener_failures: The number of errors that the listener threw.
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

def built_in_pair() -> DeepPair:
    """Returns the bundled int8 pair for a modulator in the middle of the volume and the default display's pitch, colours
    and volume. A network without a pre-filter displays more, at any offset.

    Errors: Returns an error if the library was built without networks.
    """

def display_from_toml(text: str) -> Display:
    """Reads a display from its TOML form. Missing keys have default values.

    Errors: Returns an error if the text is not TOML, a key is unknown, or a value is out of its range.
    """

def modulator_names() -> list[str]:
    """Returns the names of the modulators that the library knows."""

def phone_options(target: Target, rate_hz: float = 30.0, method: Method | None = ...) -> SessionOptions:
    """Returns options for a live session on a phone: the defaults of `session_options` with a target rate and three
    quality levels, at the modulator's resolution and at three quarters and half of it along each side. The session
    lowers the level when frames are too slow for the rate or the device is hot, and raises it when there is time left.
    """

def session_options(target: Target, method: Method | None = ...) -> SessionOptions:
    """Returns the default options for `target`: holograms at its modulator's resolution by `method` and AA-DPM with one
    correction step, smoothed brightness, near and far limits by percentiles. Without a method, the session chooses
    between the built-in network and the plane sweep by each frame's depth, as `Auto` does.
    """

def set_log_listener(level: LogLevel, listener: LogListener | None) -> None:
    """Sends messages of `level` and above to `listener`, and warnings and errors of the libraries that Phasefront uses.
    Without a listener, no messages are sent.

    Errors: Returns an error if the process already has another logger of Rust's `log`.
    """

def set_stage_listener(listener: StageListener | None) -> None:
    """Reports every stage of every session to `listener`. Without a listener, nothing is reported and nothing is spent.
    Set it between frames, because it may receive only the end of a stage that has already begun.

    Errors: Returns an error if the process already collects Rust's `tracing` elsewhere, where the spans of stages go.
    """

def version() -> str:
    """Returns the version of the library."""

class Network:
    """A hologram network. It is immutable and can be used by several sessions."""
    @classmethod
    def built_in(cls, name: str = 'rgbd-8') -> Network:
        """Returns the bundled int8 network called `name`, by default the one with 8 layers. It is for the default
        display's pitch, colours and volume.

        Errors: Returns an error if there is no such network, and if the library was built without networks.
        """
    @classmethod
    def from_bytes(cls, onnx: bytes) -> Network:
        """Reads a network from the bytes of an ONNX file.

        Errors: Returns an error that says what is wrong and what would be right if the bytes are not a hologram network.
        """
    @classmethod
    def from_file(cls, path: str) -> Network:
        """Reads a network from an ONNX file.

        Errors: Returns an error if the file cannot be read, and the errors of `from_bytes`.
        """
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def info(self) -> NetworkInfo:
        """Returns the properties of the network."""

class Target:
    """The target of holograms: a display and its calibration, if there is one: the modulator's response to phases, the
    light of the lasers, and the correction of the optics. It is immutable and can be used by several sessions.
    """
    @classmethod
    def from_bytes(cls, file: bytes) -> Target:
        """Reads a target from the bytes of a calibration file, as `phasefront calibrate pack` writes it.

        Errors: Returns an error that says what is wrong if the bytes are not such a file.
        """
    @classmethod
    def from_file(cls, path: str) -> Target:
        """Reads a target from a calibration file.

        Errors: Returns an error if the file cannot be read, and the errors of `from_bytes`.
        """
    @classmethod
    def of_display(cls, display: Display) -> Target:
        """Creates a target whose levels are equal steps of phase, with as many levels as the display's bits allow.

        Errors: Returns an error if the display is impossible.
        """
    @classmethod
    def with_look_up_table(cls, display: Display, levels: bytes) -> Target:
        """Creates a target whose modulator was calibrated as a whole. `levels` has 256 entries; the level at i displays
        the phase 2πi/256.

        Errors: Returns an error if the display is impossible or there are not 256 levels.
        """
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def display(self) -> Display:
        """Returns the display."""
    def to_bytes(self) -> bytes:
        """Returns the bytes of a calibration file, which `from_bytes` reads.

        Errors: Returns an error if the target cannot be written.
        """

class DepthNetwork:
    """A network that estimates relative inverse depth from colour alone, for frames without depth. It is immutable and can
    be used by several sessions.
    """
    @classmethod
    def from_bytes(cls, onnx: bytes, colours: ColourScale | None = ..., gives_distance: bool = False) -> DepthNetwork:
        """Reads the bytes of an ONNX file that holds its own weights. It takes one picture, (1, 3, H, W) or (1, H, W, 3),
        with colours of the scale `colours`, and gives one plane: inverse depth, or distance if `gives_distance`.

        Errors: Returns an error if the library does not read the file, and if it was built without tract.
        """
    def __init__(self, *args: object, **kwargs: object) -> None: ...

class LogListener:
    """A receiver of log messages, which is called on any thread. It may call the library. On a thread that computes for a
    session it cannot wait for a frame: `process`, `warm_up` and previews are refused, and closing does not wait. Errors
    that it throws are ignored.
    """
    def on_log(self, level: LogLevel, message: str) -> None:
        """Receives a message."""

class RawPlanes:
    """Numbers of 32 bits at each pixel of each colour, without gaps between rows or planes. The layers written by hand
    read them.
    """
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def colours(self) -> int:
        """Returns the number of planes: 3, or 1 for a display with one laser."""
    def height(self) -> int:
        """Returns the height in pixels."""
    def pixel_bytes(self) -> int:
        """Returns the number of bytes of a pixel: 4 for an amplitude, 8 for a real and an imaginary part."""
    def plane_address(self, colour: int) -> int:
        """Returns the address of the plane of one colour: 0 red, 1 green, 2 blue, or 0 for one laser. The address is valid
        as long as this object.

        Errors: Returns an error for other colours.
        """
    def share(self) -> RawPlanes:
        """Returns another handle to the same planes. Each reader of their memory holds one."""
    def width(self) -> int:
        """Returns the width in pixels."""

class RawHologram:
    """The hologram of one frame: modulator levels of three colours. The layers written by hand keep it alive while its
    planes are read.
    """
    @classmethod
    def from_levels(cls, levels: bytes, info: HologramInfo, target: Target) -> RawHologram:
        """Restores a hologram from its levels, the planes of the target's colours one after another without gaps, and its
        properties, of which it keeps the size and the scale.

        Errors: Returns an error if there is another number of levels, if the size or the scale is not possible, or if the
        target has more than 8 bits.
        """
    @classmethod
    def of_field(cls, field: bytes, width: int, height: int, z_mm: float, target: Target, options: EncoderOptions) -> RawHologram:
        """Makes the hologram of a complex field of `height` × `width` pixels at `z_mm`, 0 the midpoint: the real and the
        imaginary part of each pixel as 32-bit floats, planes of the target's colours row by row without gaps, one after
        another.

        Errors: A field of another size, one that is larger than the modulator, dark or not finite; a z too far away; options
        out of their range.
        """
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def field(self, z_mm: float) -> RawPlanes:
        """Returns the complex field that the levels produce behind the aperture at `z_mm`, where 0 is the midpoint: the
        real and the imaginary part of each pixel. The carrier is left out.

        Errors: Returns an error if z is too far away.
        """
    def info(self) -> HologramInfo:
        """Returns the properties of the hologram."""
    def output_size(self, layout: Layout) -> OutputSize:
        """Returns the size of the images of `layout` for the modulator."""
    def plane_address(self, colour: int) -> int:
        """Returns the address of the levels of one colour: 0 red, 1 green, 2 blue, or 0 for one laser. Each level is a
        byte; there are no gaps between rows or between colours. The address is valid as long as this object.

        Errors: Returns an error for other colours.
        """
    def plane_len(self) -> int:
        """Returns the number of bytes of a plane."""
    def refocus(self, z_mm: float) -> RawPlanes:
        """Returns the view of an eye focused at `z_mm` at full resolution, as amplitudes where 1 is white.

        Errors: Returns an error if z is too far away.
        """
    def share(self) -> RawHologram:
        """Returns another handle to the same hologram. Each reader of its memory holds one."""
    def srgb_of_light(self) -> list[float] | None:
        """Returns the matrix from the lasers' light to linear sRGB, three rows of a number for each laser, which a
        hologram's file holds; none if views are amplitudes.
        """
    def write_output(self, placement: Placement, image: int, to: RawMemory) -> None:
        """Writes image `image` of those that the modulator's driver takes, at the modulator's resolution. Levels with
        fewer bits than their place use its upper bits; `placement` positions the hologram.

        Errors: Returns an error if the layout does not have this image or the image does not fit.
        """
    def write_preview(self, z_mm: float, width: int, height: int, layout: Layout, to: RawMemory) -> None:
        """Writes the view of an eye focused at `z_mm` in sRGB, `width` × `height` pixels in `layout`, Rgb, Rgba or Bgra.

        Errors: Returns an error if the image is empty or does not fit, or z is too far away.
        """
    def z_at(self, x: float, y: float) -> float:
        """Returns the z in mm of the scene point at (`x`, `y`) of the picture, for example to focus where the user taps.
        Coordinates run from 0 to 1 from the upper left corner.
        """

class RawModulator:
    """A modulator: its display, the phases of its levels, and the images that its input takes. The layers written by hand
    use it.
    """
    @classmethod
    def from_toml(cls, text: str) -> RawModulator:
        """Reads a modulator's file.

        Errors: Returns an error if the text is not TOML, a key is unknown, a value is out of its range, or levels of more than
        8 bits are not evenly spaced.
        """
    @classmethod
    def named(cls, name: str) -> RawModulator:
        """Returns the modulator called `name`, one of `modulator_names`.

        Errors: Returns an error for another name.
        """
    def __init__(self, *args: object, **kwargs: object) -> None: ...
    def output_size(self) -> OutputSize:
        """Returns the size of the images that its input takes."""
    def read(self, images: bytes, width: int, height: int, to: RawMemory) -> None:
        """Reads the levels of a hologram of `height` × `width` pixels back from its images, which follow one another
        without gaps. Writes 2 bytes a level, planes of colours one after another without gaps.

        Errors: Returns an error for another number of bytes, or for cells that are those of no level.
        """
    def target(self) -> Target:
        """Returns the target of holograms for the modulator."""
    def write_output(self, hologram: RawHologram, image: int, to: RawMemory) -> None:
        """Writes image `image` of those that its input takes of `hologram`.

        Errors: Returns an error if there is no such image, it does not fit, or the hologram is larger than the modulator or for
        another number of lasers or bits; with bit planes, also if it has another size.
        """
    def write_pixels(self, hologram: RawHologram, image: int, layout: Layout, to: RawMemory) -> None:
        """Writes the same image in the pixels of a screen that drives the modulator, `layout` Rgba or Bgra. The red, green
        and blue of a grey image are its level.

        Errors: Returns an error in the cases of `write_output`, for another layout, and for images of 16 bits.
        """

class RawSession:
    """A session. All its methods can be called from any thread at any time."""
    def __init__(self, options: SessionOptions, mode: RunningMode, listener: SessionListener | None) -> None:
        """Creates a session that runs in `mode`. A live session needs a `listener`.

        Errors: Returns an error if the options are invalid or cannot be planned, if a live session has no listener or another
        session has one, or if threads cannot be started.
        """
    def pause(self) -> None:
        """Accepts no frames until `resume`."""
    def process(self, luma_or_colour: bytes, chroma: bytes, chroma_v: bytes, depth: bytes, confidence: bytes, info: FrameInfo) -> RawHologram:
        """Returns the hologram of a frame, in an image or a video session. `luma_or_colour` is the first plane of the
        colour image; `chroma` and `chroma_v` are the others. Memory that the frame does not have is empty.

        Errors: Returns an error if the frame is unusable or late, or if the session is live, paused or closed. Later frames are
        not affected.
        """
    def reset(self) -> None:
        """Forgets all previous frames, including one that is being processed. The next frame may have any timestamp."""
    def resume(self) -> None:
        """Accepts frames again."""
    def set_quality(self, quality: Quality) -> None:
        """Allows or forbids changes of the quality level.

        Errors: Returns an error if the session does not have the quality level.
        """
    def set_thermal(self, thermal: Thermal) -> None:
        """Sets the thermal state of the device."""
    def shut_down(self) -> None:
        """Closes the session: it accepts no more frames and frees its memory. When this returns, the listener has received
        all events, `on_closed` last, and is not called again. A call from a listener of any session, or from a log
        listener while a session computes, does not wait for that. Closing twice does nothing.
        """
    def statistics(self) -> Statistics:
        """Returns the statistics of the session, also after it was closed. Never waits for a frame."""
    def submit(self, luma_or_colour: bytes, chroma: bytes, chroma_v: bytes, depth: bytes, confidence: bytes, info: FrameInfo) -> DropReason | None:
        """Submits a frame to a live session, which copies it, without waiting for its hologram. Returns the reason if the
        frame is dropped at once, which the listener receives too. The planes are those of `process`.

        Errors: Returns an error if the frame is unusable or late, or if the session is not live or is closed. Later frames are
        not affected.
        """
    def warm_up(self) -> None:
        """Runs an empty frame through the stages and waits for it, so that the first real frame is as fast as later ones."""

class SessionListener:
    """A receiver of the events of a live session. Calls arrive one after another, on the session's own thread, in the
    order of the events. No frame is processed while the listener is busy. Errors that it throws are counted and logged.
    """
    def on_processed(self, hologram: RawHologram) -> None:
        """Reports that a frame became a hologram."""
    def on_dropped(self, timestamp_ns: int, reason: DropReason) -> None:
        """Reports that a frame was dropped."""
    def on_failed(self, timestamp_ns: int, message: str) -> None:
        """Reports that a frame could not be processed. The session continues."""
    def on_quality_changed(self, timestamp_ns: int, change: QualityChange) -> None:
        """Reports that the session uses another quality level after the frame of `timestamp_ns`."""
    def on_closed(self) -> None:
        """Reports that the session is closed and its memory is freed. This is the last call. It is made exactly once, even
        if shutting down does not wait for it.
        """

class StageListener:
    """A receiver of the begin and end of stages, which is called on the threads that compute them. The stages of one
    thread are nested. The receiver must not call the library. Errors that it throws are ignored.
    """
    def on_begin(self, stage: Stage) -> None:
        """Reports that a stage begins on this thread."""
    def on_end(self, stage: Stage) -> None:
        """Reports that the stage that began last on this thread ends."""
