@_exported import Foundation

public final class CGColorSpace: @unchecked Sendable {
    public init?(name: CFString) { fatalError() }
    public static let sRGB: CFString = ""
}
public typealias CFString = String
public func CGColorSpaceCreateDeviceRGB() -> CGColorSpace { fatalError() }
public typealias CGDataProviderReleaseDataCallback = @convention(c) (UnsafeMutableRawPointer?, UnsafeRawPointer, Int) -> Void
public final class CGDataProvider {
    public init?(
        dataInfo: UnsafeMutableRawPointer?, data: UnsafeRawPointer, size: Int,
        releaseData: @escaping CGDataProviderReleaseDataCallback
    ) { fatalError() }
}
public enum CGImageAlphaInfo: UInt32, Sendable { case none, noneSkipLast, noneSkipFirst }
public struct CGBitmapInfo: OptionSet, Sendable {
    public let rawValue: UInt32
    public init(rawValue: UInt32) { self.rawValue = rawValue }
    public static let byteOrder32Little = CGBitmapInfo(rawValue: 2 << 12)
}
public enum CGColorRenderingIntent: Int32, Sendable { case defaultIntent }
public final class CGImage: @unchecked Sendable {
    public init?(
        width: Int, height: Int, bitsPerComponent: Int, bitsPerPixel: Int, bytesPerRow: Int, space: CGColorSpace,
        bitmapInfo: CGBitmapInfo, provider: CGDataProvider, decode: UnsafePointer<CGFloat>?, shouldInterpolate: Bool,
        intent: CGColorRenderingIntent
    ) { fatalError() }
}
