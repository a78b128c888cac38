@_exported import CoreGraphics

public typealias CVPixelBuffer = CVBuffer
public typealias CVReturn = Int32
public typealias OSType = UInt32
public typealias CFTypeRef = Any
public let kCVReturnSuccess: CVReturn = 0
public let kCVPixelFormatType_32BGRA: OSType = 0x4247_5241
public let kCVPixelFormatType_32RGBA: OSType = 0x5247_4241
public let kCVPixelFormatType_420YpCbCr8BiPlanarFullRange: OSType = 0x3432_3066
public let kCVPixelFormatType_420YpCbCr8BiPlanarVideoRange: OSType = 0x3432_3076
public let kCVPixelFormatType_DepthFloat32: OSType = 0x6664_6570
public let kCVPixelFormatType_DepthFloat16: OSType = 0x6864_6570
public let kCVPixelFormatType_DisparityFloat32: OSType = 0x6664_6973
public let kCVPixelFormatType_DisparityFloat16: OSType = 0x6864_6973
public let kCVImageBufferYCbCrMatrixKey: CFString = "CVImageBufferYCbCrMatrix"
public let kCVImageBufferYCbCrMatrix_ITU_R_709_2: CFString = "ITU_R_709_2"
public let kCVImageBufferYCbCrMatrix_ITU_R_2020: CFString = "ITU_R_2020"
public let kCVImageBufferColorPrimariesKey: CFString = "CVImageBufferColorPrimaries"
public let kCVImageBufferColorPrimaries_P3_D65: CFString = "P3_D65"
public let kCVImageBufferColorPrimaries_ITU_R_2020: CFString = "ITU_R_2020"
public let kCVImageBufferTransferFunctionKey: CFString = "CVImageBufferTransferFunction"
public let kCVImageBufferTransferFunction_ITU_R_2100_HLG: CFString = "ITU_R_2100_HLG"
public let kCVImageBufferTransferFunction_SMPTE_ST_2084_PQ: CFString = "SMPTE_ST_2084_PQ"
public let kCVPixelBufferPixelFormatTypeKey: CFString = "PixelFormatType"
public let kCVPixelBufferWidthKey: CFString = "Width"
public let kCVPixelBufferHeightKey: CFString = "Height"
public enum CVAttachmentMode: UInt32 { case shouldPropagate }
public struct CVPixelBufferLockFlags: OptionSet, Sendable {
    public let rawValue: UInt64
    public init(rawValue: UInt64) { self.rawValue = rawValue }
    public static let readOnly = CVPixelBufferLockFlags(rawValue: 1)
}

/// A buffer whose addresses are nil unless it is locked: "You must call CVPixelBufferLockBaseAddress before accessing pixel
/// data with the CPU". https://developer.apple.com/documentation/corevideo/cvpixelbufferlockbaseaddress(_:_:)
public final class CVBuffer {
    let format: OSType
    let width, height: Int
    /// The offset, the row stride and the height of each plane.
    let planes: [(offset: Int, rowStride: Int, height: Int)]
    let memory: UnsafeMutableRawBufferPointer
    /// What the buffer says of its colours.
    public var attachments: [CFString: CFTypeRef] = [:]
    private let lock = NSLock()
    private var locks = 0

    public init(_ format: OSType, width: Int, height: Int) {
        (self.format, self.width, self.height) = (format, width, height)
        func padded(_ bytes: Int) -> Int { (bytes + 63) / 64 * 64 }
        switch format {
        case kCVPixelFormatType_420YpCbCr8BiPlanarFullRange, kCVPixelFormatType_420YpCbCr8BiPlanarVideoRange:
            planes = [(0, padded(width), height), (padded(width) * height, padded(width), height / 2)]
        case kCVPixelFormatType_DepthFloat16, kCVPixelFormatType_DisparityFloat16:
            planes = [(0, padded(2 * width), height)]
        default:
            planes = [(0, padded(4 * width), height)]
        }
        memory = .allocate(byteCount: planes.map { $0.rowStride * $0.height }.reduce(0, +), alignment: 64)
        memory.initializeMemory(as: UInt8.self, repeating: 0)
    }

    deinit {
        precondition(locks == 0, "a pixel buffer is released while it is locked")
        memory.deallocate()
    }

    func change(_ by: Int) {
        lock.withLock {
            locks += by
            precondition(locks >= 0, "a pixel buffer is unlocked more often than locked")
        }
    }

    func address(_ plane: Int) -> UnsafeMutableRawPointer? {
        lock.withLock { locks > 0 ? memory.baseAddress.map { $0 + planes[plane].offset } : nil }
    }

    /// Fills the buffer's memory.
    public func fill(_ body: (UnsafeMutableRawBufferPointer) -> Void) -> CVBuffer {
        body(memory)
        return self
    }
}
@available(*, unavailable)
extension CVBuffer: @unchecked Sendable {}
public func CVPixelBufferGetPixelFormatType(_ buffer: CVPixelBuffer) -> OSType { buffer.format }
public func CVPixelBufferGetWidth(_ buffer: CVPixelBuffer) -> Int { buffer.width }
public func CVPixelBufferGetHeight(_ buffer: CVPixelBuffer) -> Int { buffer.height }
public func CVPixelBufferGetHeightOfPlane(_ buffer: CVPixelBuffer, _ plane: Int) -> Int { buffer.planes[plane].height }
public func CVPixelBufferGetBytesPerRow(_ buffer: CVPixelBuffer) -> Int { buffer.planes[0].rowStride }
public func CVPixelBufferGetBytesPerRowOfPlane(_ buffer: CVPixelBuffer, _ plane: Int) -> Int { buffer.planes[plane].rowStride }
public func CVPixelBufferIsPlanar(_ buffer: CVPixelBuffer) -> Bool { buffer.planes.count > 1 }
public func CVPixelBufferGetBaseAddress(_ buffer: CVPixelBuffer) -> UnsafeMutableRawPointer? { buffer.address(0) }
public func CVPixelBufferGetBaseAddressOfPlane(_ buffer: CVPixelBuffer, _ plane: Int) -> UnsafeMutableRawPointer? {
    buffer.address(plane)
}
public func CVPixelBufferLockBaseAddress(_ buffer: CVPixelBuffer, _: CVPixelBufferLockFlags) -> CVReturn {
    buffer.change(1)
    return kCVReturnSuccess
}
@discardableResult
public func CVPixelBufferUnlockBaseAddress(_ buffer: CVPixelBuffer, _: CVPixelBufferLockFlags) -> CVReturn {
    buffer.change(-1)
    return kCVReturnSuccess
}
public func CVBufferCopyAttachment(
    _ buffer: CVBuffer, _ key: CFString, _: UnsafeMutablePointer<CVAttachmentMode>?
) -> CFTypeRef? { buffer.attachments[key] }

public final class CVPixelBufferPool {
    let width, height: Int
    let format: OSType

    init(_ attributes: CFDictionary) {
        width = attributes[kCVPixelBufferWidthKey] as? Int ?? 0
        height = attributes[kCVPixelBufferHeightKey] as? Int ?? 0
        format = attributes[kCVPixelBufferPixelFormatTypeKey] as? OSType ?? 0
    }
}
public struct CVPixelBufferPoolFlushFlags: OptionSet, Sendable {
    public let rawValue: UInt64
    public init(rawValue: UInt64) { self.rawValue = rawValue }
    public static let excessBuffers = CVPixelBufferPoolFlushFlags(rawValue: 1)
}
@discardableResult
public func CVPixelBufferPoolCreate(
    _: Any?, _: CFDictionary?, _ attributes: CFDictionary?, _ pool: UnsafeMutablePointer<CVPixelBufferPool?>
) -> CVReturn {
    pool.pointee = CVPixelBufferPool(attributes ?? [:])
    return kCVReturnSuccess
}
@discardableResult
public func CVPixelBufferPoolCreatePixelBuffer(
    _: Any?, _ pool: CVPixelBufferPool, _ buffer: UnsafeMutablePointer<CVPixelBuffer?>
) -> CVReturn {
    buffer.pointee = CVBuffer(pool.format, width: pool.width, height: pool.height)
    return kCVReturnSuccess
}
public func CVPixelBufferPoolFlush(_: CVPixelBufferPool, _: CVPixelBufferPoolFlushFlags) {}
