import Foundation

/// One plane of an image in memory that the platform handed out. It is read while the call lasts that the frame is
/// given to, and not kept.
public struct Plane: Sendable {
    /// The memory, from the first pixel of the first row on.
    public var bytes: Data
    /// Where the pixels lie in it.
    public var info: PlaneInfo

    /// A plane of rows `rowStride` bytes apart, pixels `pixelStride` bytes apart.
    public init(bytes: Data, rowStride: Int, pixelStride: Int) {
        self.bytes = bytes
        info = PlaneInfo(rowStride: UInt32(clamping: rowStride), pixelStride: UInt32(clamping: pixelStride))
    }

    /// A plane at `address`, which is not copied: the memory must stay as long as the plane is used.
    public init(unsafeAddress address: UnsafeRawPointer, count: Int, rowStride: Int, pixelStride: Int) {
        let memory = UnsafeMutableRawPointer(mutating: address)
        self.init(
            bytes: Data(bytesNoCopy: memory, count: count, deallocator: .none),
            rowStride: rowStride, pixelStride: pixelStride)
    }
}

/// A colour image as a camera gives it.
public struct ColourImage: Sendable {
    /// How it lies in memory.
    public var format: ColourFormat
    /// Pixels along x, as the sensor gives them.
    public var width: Int
    /// Pixels along y.
    public var height: Int
    /// Its planes, in the format's order.
    public var planes: [Plane]
    /// The matrix of luma and chroma; other formats do not look at it.
    public var matrix: YuvMatrix
    /// Whether luma runs over 16...235 and chroma over 16...240; other formats do not look at it.
    public var videoRange: Bool

    /// An image of planes that lie anywhere.
    public init(
        format: ColourFormat, width: Int, height: Int, planes: [Plane], matrix: YuvMatrix = .bt601,
        videoRange: Bool = false
    ) {
        self.format = format
        self.width = width
        self.height = height
        self.planes = planes
        self.matrix = matrix
        self.videoRange = videoRange
    }

    /// An image of one plane without gaps.
    public init(format: ColourFormat, width: Int, height: Int, bytes: Data) {
        let pixel = format == .rgb ? 3 : 4
        self.init(
            format: format, width: width, height: height,
            planes: [Plane(bytes: bytes, rowStride: pixel * width, pixelStride: pixel)])
    }
}

/// How sure a depth image's readings are.
public struct ConfidenceMap: Sendable {
    /// How it lies in memory.
    public var format: ConfidenceFormat
    /// Pixels along x: as many as the depth has.
    public var width: Int
    /// Pixels along y: as many as the depth has.
    public var height: Int
    /// Its plane.
    public var plane: Plane

    /// A map whose plane lies anywhere.
    public init(format: ConfidenceFormat, width: Int, height: Int, plane: Plane) {
        self.format = format
        self.width = width
        self.height = height
        self.plane = plane
    }
}

/// A depth image as a sensor gives it.
public struct DepthImage: Sendable {
    /// How it lies in memory.
    public var format: DepthFormat
    /// Pixels along x, as the sensor gives them.
    public var width: Int
    /// Pixels along y.
    public var height: Int
    /// Its plane.
    public var plane: Plane
    /// How sure its readings are, where that is known.
    public var confidence: ConfidenceMap?

    /// An image whose plane lies anywhere.
    public init(
        format: DepthFormat, width: Int, height: Int, plane: Plane, confidence: ConfidenceMap? = nil
    ) {
        self.format = format
        self.width = width
        self.height = height
        self.plane = plane
        self.confidence = confidence
    }

    /// An image of one plane without gaps.
    public init(format: DepthFormat, width: Int, height: Int, bytes: Data) {
        let plane = Plane(bytes: bytes, rowStride: format.pixelBytes * width, pixelStride: format.pixelBytes)
        self.init(format: format, width: width, height: height, plane: plane)
    }
}

extension DepthFormat {
    /// Bytes of a pixel.
    public var pixelBytes: Int {
        switch self {
        case .normalizedU8: 1
        case .metresF32, .disparityF32: 4
        case .metresF16, .disparityF16, .millimetresU16, .androidDepth16, .normalizedU16: 2
        }
    }
}

extension Orientation {
    /// As the sensor gives it.
    public static let upright = Orientation(rotation: .upright, mirrored: false)
}

/// Colour and depth of one moment.
public struct Frame: Sendable {
    /// When it was taken, in nanoseconds of any clock that runs forward.
    public var timestampNs: UInt64
    /// The colour image.
    public var colour: ColourImage
    /// The depth image.
    public var depth: DepthImage
    /// How both must be turned to stand upright.
    public var orientation: Orientation
    /// How the pixels of depth and colour correspond; nil where both show the same field of view.
    public var cameras: Cameras?

    /// A frame of both, upright and of one field of view unless it is said.
    public init(
        timestampNs: UInt64, colour: ColourImage, depth: DepthImage, orientation: Orientation = .upright,
        cameras: Cameras? = nil
    ) {
        self.timestampNs = timestampNs
        self.colour = colour
        self.depth = depth
        self.orientation = orientation
        self.cameras = cameras
    }

    var info: FrameInfo {
        func size(_ count: Int) -> UInt32 { UInt32(clamping: count) }
        return FrameInfo(
            timestampNs: timestampNs,
            colour: ColourInfo(
                format: colour.format, width: size(colour.width), height: size(colour.height),
                planes: colour.planes.map(\.info), matrix: colour.matrix, videoRange: colour.videoRange),
            depth: DepthInfo(
                format: depth.format, width: size(depth.width), height: size(depth.height), plane: depth.plane.info),
            confidence: depth.confidence.map {
                ConfidenceInfo(format: $0.format, width: size($0.width), height: size($0.height), plane: $0.plane.info)
            },
            orientation: orientation,
            cameras: cameras)
    }

    var confidenceBytes: Data { depth.confidence?.plane.bytes ?? Data() }

    /// The bytes of colour plane `index`; empty behind the last.
    func colourBytes(_ index: Int) -> Data {
        index < colour.planes.count ? colour.planes[index].bytes : Data()
    }
}
