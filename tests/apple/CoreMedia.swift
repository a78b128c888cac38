@_exported import CoreVideo

public struct CMTime: Sendable { public var value: Int64 }
public enum CMTimeRoundingMethod: UInt32 { case roundTowardZero }
public func CMTimeConvertScale(_: CMTime, timescale: Int32, method: CMTimeRoundingMethod) -> CMTime { fatalError() }
public class CMSampleBuffer {}
public func CMSampleBufferGetImageBuffer(_: CMSampleBuffer) -> CVBuffer? { fatalError() }
public func CMSampleBufferGetPresentationTimeStamp(_: CMSampleBuffer) -> CMTime { fatalError() }
