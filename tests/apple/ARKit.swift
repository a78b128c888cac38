@_exported import AVFoundation

open class ARDepthData: NSObject {
    public var depthMap: CVPixelBuffer { fatalError() }
    public var confidenceMap: CVPixelBuffer? { fatalError() }
}
open class ARFrame: NSObject {
    public var timestamp: TimeInterval { fatalError() }
    public var capturedImage: CVPixelBuffer { fatalError() }
    public var sceneDepth: ARDepthData? { fatalError() }
    public var smoothedSceneDepth: ARDepthData? { fatalError() }
}
open class ARConfiguration: NSObject {
    public struct FrameSemantics: OptionSet, Sendable {
        public let rawValue: UInt
        public init(rawValue: UInt) { self.rawValue = rawValue }
        public static let sceneDepth = FrameSemantics(rawValue: 8)
        public static let smoothedSceneDepth = FrameSemantics(rawValue: 16)
    }
    public var frameSemantics: FrameSemantics = []
}
open class ARWorldTrackingConfiguration: ARConfiguration {}
public protocol ARSessionDelegate: NSObjectProtocol {
    func session(_ session: ARSession, didUpdate frame: ARFrame)
}
open class ARSession: NSObject {
    public weak var delegate: ARSessionDelegate?
    public func run(_ configuration: ARConfiguration) { fatalError() }
}
