@_exported import CoreVideo

public struct CMTime: Sendable { public var value: Int64 }
public enum CMTimeRoundingMethod: UInt32 { case roundTowardZero }
public func CMTimeConvertScale(_ time: CMTime, timescale: Int32, method: CMTimeRoundingMethod) -> CMTime { time }
public final class CMSampleBuffer {
    let image: CVBuffer
    let time: CMTime

    public init(_ image: CVBuffer, timeNs: Int64) { (self.image, time) = (image, CMTime(value: timeNs)) }
}
public func CMSampleBufferGetImageBuffer(_ buffer: CMSampleBuffer) -> CVBuffer? { buffer.image }
public func CMSampleBufferGetPresentationTimeStamp(_ buffer: CMSampleBuffer) -> CMTime { buffer.time }
