@_exported import Foundation

public typealias CFString = String
public typealias CFData = Data
public typealias CFDictionary = [AnyHashable: Any]
public final class CGColorSpace: @unchecked Sendable {
    public init?(name: CFString) {}
    init() {}
    public static let sRGB: CFString = "sRGB"
}
public func CGColorSpaceCreateDeviceRGB() -> CGColorSpace { CGColorSpace() }
public func CGColorSpaceCreateDeviceGray() -> CGColorSpace { CGColorSpace() }
public typealias CGDataProviderReleaseDataCallback = @convention(c) (UnsafeMutableRawPointer?, UnsafeRawPointer, Int) -> Void
/// Calls `releaseData` once, when it is released.
/// https://developer.apple.com/documentation/coregraphics/cgdataproviderreleasedatacallback
public final class CGDataProvider {
    private let release: () -> Void

    public init?(
        dataInfo: UnsafeMutableRawPointer?, data: UnsafeRawPointer, size: Int,
        releaseData: @escaping CGDataProviderReleaseDataCallback
    ) {
        release = { releaseData(dataInfo, data, size) }
    }

    deinit { release() }
}
public enum CGImageAlphaInfo: UInt32, Sendable { case none, noneSkipLast, noneSkipFirst }
public struct CGBitmapInfo: OptionSet, Sendable {
    public let rawValue: UInt32
    public init(rawValue: UInt32) { self.rawValue = rawValue }
    public static let byteOrder32Little = CGBitmapInfo(rawValue: 2 << 12)
}
public enum CGColorRenderingIntent: Int32, Sendable { case defaultIntent }
public final class CGImage: @unchecked Sendable {
    public let width, height: Int
    private let provider: CGDataProvider?

    public init?(
        width: Int, height: Int, bitsPerComponent: Int, bitsPerPixel: Int, bytesPerRow: Int, space: CGColorSpace,
        bitmapInfo: CGBitmapInfo, provider: CGDataProvider, decode: UnsafePointer<CGFloat>?, shouldInterpolate: Bool,
        intent: CGColorRenderingIntent
    ) {
        guard bytesPerRow >= width * bitsPerPixel / 8 else { return nil }
        (self.width, self.height, self.provider) = (width, height, provider)
    }

    /// An image of a file, which is not read.
    public init(ofFileWith width: Int, _ height: Int) { (self.width, self.height, provider) = (width, height, nil) }
}
public final class CGContext {
    private let memory: UnsafeMutableRawPointer?
    private let size: Int

    public init?(
        data: UnsafeMutableRawPointer?, width: Int, height: Int, bitsPerComponent: Int, bytesPerRow: Int,
        space: CGColorSpace, bitmapInfo: UInt32
    ) {
        (memory, size) = (data, bytesPerRow * height)
    }

    public func draw(_: CGImage, in _: CGRect) {
        for i in 0..<size { memory?.storeBytes(of: UInt8(truncatingIfNeeded: i / 4 % 251), toByteOffset: i, as: UInt8.self) }
    }
}

// What Foundation has on Apple's systems alone.
extension URL { public static var documentsDirectory: URL { FileManager.default.temporaryDirectory } }
extension ProcessInfo { public var isLowPowerModeEnabled: Bool { false } }
