import Foundation

/// One plane of an image in memory that the platform owns. A session reads it only during the call that takes the
/// frame.
public struct ImagePlane: Sendable {
    /// The memory, starting at the first pixel of the first row.
    public var bytes: Data
    /// The strides of rows and pixels.
    public var info: PlaneInfo

    /// Creates a plane whose rows are `rowStride` bytes apart and whose pixels are `pixelStride` bytes apart.
    public init(bytes: Data, rowStride: Int, pixelStride: Int) {
        self.bytes = bytes
        info = PlaneInfo(rowStride: rowStride, pixelStride: pixelStride)
    }

    /// Creates a plane at `address` without a copy. The memory must stay valid as long as the plane is used.
    public init(unsafeAddress address: UnsafeRawPointer, count: Int, rowStride: Int, pixelStride: Int) {
        let memory = UnsafeMutableRawPointer(mutating: address)
        self.init(
            bytes: Data(bytesNoCopy: memory, count: count, deallocator: .none),
            rowStride: rowStride, pixelStride: pixelStride)
    }
}

/// A colour image from a camera.
public struct ColourImage: Sendable {
    /// The memory layout.
    public var format: ColourFormat
    /// The width in pixels, in the sensor's orientation.
    public var width: Int
    /// The height in pixels.
    public var height: Int
    /// The planes, in the order of the format.
    public var planes: [ImagePlane]
    /// The matrix of luma and chroma. RGB formats ignore it.
    public var matrix: YuvMatrix
    /// Whether luma spans 16...235 and chroma 16...240. RGB formats ignore it.
    public var videoRange: Bool
    /// The meaning of red, green and blue.
    public var encoding: RgbEncoding

    /// Creates an image of planes with any strides.
    public init(
        format: ColourFormat, width: Int, height: Int, planes: [ImagePlane], matrix: YuvMatrix = .bt601,
        videoRange: Bool = false, encoding: RgbEncoding = .srgb
    ) {
        self.format = format
        self.width = width
        self.height = height
        self.planes = planes
        self.matrix = matrix
        self.videoRange = videoRange
        self.encoding = encoding
    }

    /// Creates an image of one plane without gaps.
    public init(format: ColourFormat, width: Int, height: Int, bytes: Data, encoding: RgbEncoding = .srgb) {
        let pixel = format == .rgb ? 3 : 4
        self.init(
            format: format, width: width, height: height,
            planes: [ImagePlane(bytes: bytes, rowStride: pixel * width, pixelStride: pixel)], encoding: encoding)
    }
}

/// The confidence of each reading of a depth image.
public struct ConfidenceMap: Sendable {
    /// The memory layout.
    public var format: ConfidenceFormat
    /// The width in pixels, equal to that of the depth image.
    public var width: Int
    /// The height in pixels, equal to that of the depth image.
    public var height: Int
    /// The plane.
    public var plane: ImagePlane

    /// Creates a map whose plane has any strides.
    public init(format: ConfidenceFormat, width: Int, height: Int, plane: ImagePlane) {
        self.format = format
        self.width = width
        self.height = height
        self.plane = plane
    }
}

/// A depth image from a sensor.
public struct DepthImage: Sendable {
    /// The memory layout.
    public var format: DepthFormat
    /// The width in pixels, in the sensor's orientation.
    public var width: Int
    /// The height in pixels.
    public var height: Int
    /// The plane.
    public var plane: ImagePlane
    /// The confidence of the readings, if known.
    public var confidence: ConfidenceMap?

    /// Creates an image whose plane has any strides.
    public init(
        format: DepthFormat, width: Int, height: Int, plane: ImagePlane, confidence: ConfidenceMap? = nil
    ) {
        self.format = format
        self.width = width
        self.height = height
        self.plane = plane
        self.confidence = confidence
    }

    /// Creates an image of one plane without gaps.
    public init(format: DepthFormat, width: Int, height: Int, bytes: Data) {
        let plane = ImagePlane(bytes: bytes, rowStride: format.pixelBytes * width, pixelStride: format.pixelBytes)
        self.init(format: format, width: width, height: height, plane: plane)
    }
}

extension DepthFormat {
    /// The number of bytes per pixel.
    public var pixelBytes: Int {
        switch self {
        case .normalizedU8: 1
        case .metresF32, .disparityF32, .relativeF32: 4
        case .metresF16, .disparityF16, .millimetresU16, .androidDepth16, .normalizedU16, .relativeF16: 2
        }
    }
}

extension Orientation {
    /// The orientation of an image that is already upright.
    public static let upright = Orientation(rotation: .upright, mirrored: false)
}

/// A colour image and a depth image of the same moment. The session's depth network estimates depth that is missing.
public struct CameraFrame: Sendable {
    /// The capture time in nanoseconds of any monotonic clock.
    public var timestampNs: Int64
    /// The colour image.
    public var colour: ColourImage
    /// The depth image; nil if the session's depth network estimates it.
    public var depth: DepthImage?
    /// The rotation that brings both images upright.
    public var orientation: Orientation
    /// The two cameras, if they are apart; nil if both images show the same field of view.
    public var cameras: Cameras?

    /// Creates a frame of both images. By default they are upright and share a field of view.
    public init(
        timestampNs: Int64, colour: ColourImage, depth: DepthImage?, orientation: Orientation = .upright,
        cameras: Cameras? = nil
    ) {
        self.timestampNs = timestampNs
        self.colour = colour
        self.depth = depth
        self.orientation = orientation
        self.cameras = cameras
    }

    var info: FrameInfo {
        FrameInfo(
            timestampNs: timestampNs,
            colour: ColourInfo(
                format: colour.format, width: colour.width, height: colour.height,
                planes: colour.planes.map(\.info), matrix: colour.matrix, videoRange: colour.videoRange,
                encoding: colour.encoding),
            depth: depth.map {
                DepthInfo(format: $0.format, width: $0.width, height: $0.height, plane: $0.plane.info)
            },
            confidence: depth?.confidence.map {
                ConfidenceInfo(format: $0.format, width: $0.width, height: $0.height, plane: $0.plane.info)
            },
            orientation: orientation,
            cameras: cameras)
    }

    var depthBytes: Data { depth?.plane.bytes ?? Data() }

    var confidenceBytes: Data { depth?.confidence?.plane.bytes ?? Data() }

    /// Returns the bytes of colour plane `index`, or no bytes if there is no such plane.
    func colourBytes(_ index: Int) -> Data {
        index < colour.planes.count ? colour.planes[index].bytes : Data()
    }
}
