@_exported import AVFoundation

open class ARDepthData: NSObject {
    public let depthMap: CVPixelBuffer
    public let confidenceMap: CVPixelBuffer? = nil
    init(_ map: CVPixelBuffer) { depthMap = map }
}
open class ARFrame: NSObject {
    public let timestamp: TimeInterval
    public let capturedImage: CVPixelBuffer
    public let sceneDepth: ARDepthData?
    public var smoothedSceneDepth: ARDepthData? { sceneDepth }

    init(timestamp: TimeInterval, hasDepth: Bool) {
        self.timestamp = timestamp
        capturedImage = StandInDevice.colour()
        sceneDepth = hasDepth ? ARDepthData(StandInDevice.depth()) : nil
    }
}
open class ARConfiguration: NSObject {
    public struct FrameSemantics: OptionSet, Sendable {
        public let rawValue: UInt
        public init(rawValue: UInt) { self.rawValue = rawValue }
        public static let sceneDepth = FrameSemantics(rawValue: 8)
        public static let smoothedSceneDepth = FrameSemantics(rawValue: 16)
    }
    public var frameSemantics: FrameSemantics = [] {
        // "An exception is raised if the option is not supported": the header of ARConfiguration.frameSemantics.
        didSet { precondition(Self.supportsFrameSemantics(frameSemantics), "frame semantics without a LiDAR") }
    }
    /// https://developer.apple.com/documentation/arkit/arconfiguration/supportsframesemantics(_:)
    public static func supportsFrameSemantics(_ semantics: FrameSemantics) -> Bool {
        semantics.isEmpty || StandInDevice.shared.now.hasLidar
    }
}
open class ARWorldTrackingConfiguration: ARConfiguration {}

/// https://developer.apple.com/documentation/arkit/arerror/code
public struct ARError: Error {
    public enum Code: Int, Sendable {
        case unsupportedConfiguration = 100, sensorUnavailable, sensorFailed, cameraUnauthorized
    }
    public let code: Code
    init(_ code: Code) { self.code = code }
}

/// All methods are optional. https://developer.apple.com/documentation/arkit/arsessionobserver
public protocol ARSessionObserver: NSObjectProtocol {
    func session(_ session: ARSession, didFailWithError error: any Error)
    func sessionWasInterrupted(_ session: ARSession)
    func sessionInterruptionEnded(_ session: ARSession)
}
extension ARSessionObserver {
    public func session(_: ARSession, didFailWithError _: any Error) {}
    public func sessionWasInterrupted(_: ARSession) {}
    public func sessionInterruptionEnded(_: ARSession) {}
}
public protocol ARSessionDelegate: ARSessionObserver {
    func session(_ session: ARSession, didUpdate frame: ARFrame)
}
extension ARSessionDelegate {
    public func session(_: ARSession, didUpdate _: ARFrame) {}
}

/// Calls its delegate, which it does not retain, on `delegateQueue`, by default the main queue.
/// https://developer.apple.com/documentation/arkit/arsession/delegatequeue
/// An interrupted session "automatically resumes running whenever the conditions that caused the interruption improve":
/// https://developer.apple.com/documentation/arkit/arsessionobserver/sessioninterruptionended(_:)
open class ARSession: NSObject, @unchecked Sendable {
    public weak var delegate: (any ARSessionDelegate)?
    public var delegateQueue: DispatchQueue?
    private let lock = NSLock()
    private var timer: (any DispatchSourceTimer)?
    private var isInterrupted = false
    private var frames = 0

    /// Without permission the session fails: `ARError.Code.cameraUnauthorized`.
    public func run(_ configuration: ARConfiguration) {
        pause()
        StandInDevice.shared.change { $0.running += 1 }
        let timer = DispatchSource.makeTimerSource(queue: delegateQueue ?? .main)
        timer.schedule(deadline: .now(), repeating: .milliseconds(10))
        timer.setEventHandler { [weak self] in self?.tick() }
        lock.withLock { self.timer = timer }
        timer.resume()
    }

    public func pause() {
        let timer = lock.withLock {
            defer { self.timer = nil }
            return self.timer
        }
        guard let timer else { return }
        timer.cancel()
        StandInDevice.shared.change { $0.running -= 1 }
    }

    /// Ends the session with an error.
    private func fail(_ code: ARError.Code) {
        pause()
        delegate?.session(self, didFailWithError: ARError(code))
    }

    private func tick() {
        let now = StandInDevice.shared.now
        if now.authorization != .authorized { return fail(.cameraUnauthorized) }
        if (now.interruption != nil) != isInterrupted {
            isInterrupted.toggle()
            if isInterrupted { delegate?.sessionWasInterrupted(self) } else { delegate?.sessionInterruptionEnded(self) }
        }
        if isInterrupted { return }
        StandInDevice.shared.change { $0.frames += 1 }
        frames += 1
        // The first frames have no depth: sceneDepth is nil until there is some.
        let frame = ARFrame(timestamp: Double(StandInDevice.shared.now.frames) * 0.033, hasDepth: frames > 2)
        delegate?.session(self, didUpdate: frame)
    }

    deinit { pause() }
}
