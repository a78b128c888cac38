@_exported import CoreMedia

/// The device that these frameworks play. A test changes it.
public final class StandInDevice: @unchecked Sendable {
    public static let shared = StandInDevice()
    private let lock = NSLock()
    private var state = State()

    public struct State: Sendable {
        public init() {}
        public var hasLidar = false
        public var hasDualCamera = false
        public var authorization = AVAuthorizationStatus.notDetermined
        /// What the user answers to the system's dialogue. nil while it is shown.
        public var answer: Bool?
        /// Why no app gets frames now.
        public var interruption: AVCaptureSession.InterruptionReason?
        /// The number of sessions that run.
        public var running = 0
        /// The number of dialogues that the system showed.
        public var dialogues = 0
        public var frames: Int64 = 0
        /// An error that ends the session of AVFoundation that runs.
        public var failure: AVError.Code?
    }

    public var now: State { lock.withLock { state } }
    public func change(_ body: (inout State) -> Void) { lock.withLock { body(&state) } }

    /// A colour image of 64×48 pixels.
    public static func colour() -> CVBuffer {
        CVBuffer(kCVPixelFormatType_420YpCbCr8BiPlanarFullRange, width: 64, height: 48).fill { memory in
            for i in memory.indices { memory[i] = UInt8(i % 251) }
        }
    }

    /// Depth of 32×24 pixels, 1 m to 2.5 m.
    public static func depth() -> CVBuffer {
        CVBuffer(kCVPixelFormatType_DepthFloat32, width: 32, height: 24).fill { memory in
            let metres = memory.bindMemory(to: Float.self)
            for i in metres.indices { metres[i] = 1 + Float(i % 4) / 2 }
        }
    }
}

public struct AVMediaType: Sendable { public static let video = AVMediaType() }
public enum AVAuthorizationStatus: Int, Sendable { case notDetermined, restricted, denied, authorized }

/// Errors of the domain AVFoundationErrorDomain.
public struct AVError: Error {
    public enum Code: Int, Sendable { case unknown = -11800, mediaServicesWereReset = -11819 }
    public let code: Code
    public init(_ code: Code) { self.code = code }
    public var localizedDescription: String { "AVError \(code.rawValue)" }
}

public final class AVCaptureDevice: NSObject, Sendable {
    public struct DeviceType: Equatable, Sendable {
        let name: String
        public static let builtInDualWideCamera = DeviceType(name: "dual wide")
    }
    public enum Position: Int, Sendable { case back = 1 }

    /// https://developer.apple.com/documentation/avfoundation/avcapturedevice/authorizationstatus(for:)
    public static func authorizationStatus(for _: AVMediaType) -> AVAuthorizationStatus { StandInDevice.shared.now.authorization }

    /// Asks once: "If you've previously prompted the user for access permissions, this method immediately returns the
    /// previous result". https://developer.apple.com/documentation/avfoundation/avcapturedevice/requestaccess(for:completionhandler:)
    public static func requestAccess(for _: AVMediaType) async -> Bool {
        if StandInDevice.shared.now.authorization == .notDetermined {
            StandInDevice.shared.change { $0.dialogues += 1 }
            while StandInDevice.shared.now.answer == nil { try? await Task.sleep(nanoseconds: 1_000_000) }
            StandInDevice.shared.change { $0.authorization = $0.answer == true ? .authorized : .denied }
        }
        return StandInDevice.shared.now.authorization == .authorized
    }

    public static func `default`(_ type: DeviceType, for _: AVMediaType?, position _: Position) -> AVCaptureDevice? {
        type == .builtInDualWideCamera && StandInDevice.shared.now.hasDualCamera ? AVCaptureDevice() : nil
    }
}
open class AVCaptureInput: NSObject {}
public final class AVCaptureDeviceInput: AVCaptureInput { public init(device _: AVCaptureDevice) throws {} }
open class AVCaptureOutput: NSObject {}
public final class AVCaptureVideoDataOutput: AVCaptureOutput { public var videoSettings: [String: Any]! = [:] }
public final class AVCaptureDepthDataOutput: AVCaptureOutput { public var isFilteringEnabled = true }
public let AVCaptureSessionInterruptionReasonKey = "AVCaptureSessionInterruptionReasonKey"
public let AVCaptureSessionErrorKey = "AVCaptureSessionErrorKey"

/// Goes on by itself after an interruption, and stops after a runtime error.
/// https://developer.apple.com/documentation/avfoundation/avcapturesession
open class AVCaptureSession: NSObject {
    public struct Preset: Sendable { public static let vga640x480 = Preset() }
    /// https://developer.apple.com/documentation/avfoundation/avcapturesession/interruptionreason
    public enum InterruptionReason: Int, Sendable {
        case videoDeviceNotAvailableInBackground = 1, audioDeviceInUseByAnotherClient, videoDeviceInUseByAnotherClient
        case videoDeviceNotAvailableWithMultipleForegroundApps, videoDeviceNotAvailableDueToSystemPressure
    }
    public static let wasInterruptedNotification = Notification.Name("AVCaptureSessionWasInterrupted")
    public static let interruptionEndedNotification = Notification.Name("AVCaptureSessionInterruptionEnded")
    public static let runtimeErrorNotification = Notification.Name("AVCaptureSessionRuntimeError")
    public var sessionPreset = Preset()
    private var inputs: [AVCaptureInput] = []
    private var outputs: [AVCaptureOutput] = []
    private var isConfiguring = false
    private var runs: Runs?

    public func beginConfiguration() { isConfiguring = true }
    public func commitConfiguration() {
        precondition(isConfiguring, "commitConfiguration without beginConfiguration")
        isConfiguring = false
    }
    public func canAddInput(_: AVCaptureInput) -> Bool { inputs.isEmpty }
    public func addInput(_ input: AVCaptureInput) { inputs.append(input) }
    public func canAddOutput(_: AVCaptureOutput) -> Bool { !inputs.isEmpty }
    public func addOutput(_ output: AVCaptureOutput) { outputs.append(output) }

    /// "This method is synchronous and blocks until the session starts running or it fails", so not on the main thread;
    /// calling it between beginConfiguration and commitConfiguration throws an exception.
    /// https://developer.apple.com/documentation/avfoundation/avcapturesession/startrunning()
    public func startRunning() {
        precondition(!Thread.isMainThread, "startRunning on the main thread")
        precondition(!isConfiguring, "startRunning before commitConfiguration")
        if runs == nil { runs = Runs(self, outputs) }
    }

    public func stopRunning() {
        precondition(!Thread.isMainThread, "stopRunning on the main thread")
        runs = nil
    }

    /// Gives frames until it is released.
    private final class Runs: @unchecked Sendable {
        private weak var session: AVCaptureSession?
        private let timer = DispatchSource.makeTimerSource(queue: .global())
        private var isInterrupted = false

        init(_ session: AVCaptureSession, _ outputs: [AVCaptureOutput]) {
            self.session = session
            StandInDevice.shared.change { $0.running += 1 }
            timer.schedule(deadline: .now(), repeating: .milliseconds(10))
            timer.setEventHandler { [weak self] in self?.tick() }
            timer.resume()
        }

        deinit {
            timer.cancel()
            StandInDevice.shared.change { $0.running -= 1 }
        }

        private func tick() {
            let now = StandInDevice.shared.now
            if let failure = now.failure {
                // The session has stopped; startRunning starts it again.
                StandInDevice.shared.change { $0.failure = nil }
                session?.runs = nil
                return post(AVCaptureSession.runtimeErrorNotification, [AVCaptureSessionErrorKey: AVError(failure)])
            }
            if (now.interruption != nil) != isInterrupted {
                isInterrupted.toggle()
                if let reason = now.interruption {
                    post(AVCaptureSession.wasInterruptedNotification, [AVCaptureSessionInterruptionReasonKey: reason.rawValue])
                } else {
                    post(AVCaptureSession.interruptionEndedNotification, [:])
                }
            }
            // Without permission frames are black, so an app must not start then.
            precondition(now.authorization == .authorized, "a capture session runs without permission")
            if isInterrupted { return }
            StandInDevice.shared.change { $0.frames += 1 }
            AVCaptureDataOutputSynchronizer.deliver(timeNs: StandInDevice.shared.now.frames * 33_000_000)
        }

        private func post(_ name: Notification.Name, _ info: [String: Any]) {
            NotificationCenter.default.post(name: name, object: session, userInfo: info)
        }
    }
}

open class AVDepthData: NSObject {
    public let depthDataMap: CVPixelBuffer
    public init(_ map: CVPixelBuffer) { depthDataMap = map }
    public init(fromDictionaryRepresentation _: [AnyHashable: Any]) throws { depthDataMap = StandInDevice.depth() }
}
open class AVCaptureSynchronizedData: NSObject {}
public final class AVCaptureSynchronizedSampleBufferData: AVCaptureSynchronizedData {
    public let sampleBuffer: CMSampleBuffer
    public let sampleBufferWasDropped = false
    init(_ buffer: CMSampleBuffer) { sampleBuffer = buffer }
}
public final class AVCaptureSynchronizedDepthData: AVCaptureSynchronizedData {
    public let depthData: AVDepthData
    public let depthDataWasDropped = false
    init(_ data: AVDepthData) { depthData = data }
}
public final class AVCaptureSynchronizedDataCollection: NSObject {
    let timeNs: Int64
    init(timeNs: Int64) { self.timeNs = timeNs }
    public func synchronizedData(for output: AVCaptureOutput) -> AVCaptureSynchronizedData? {
        switch output {
        case is AVCaptureVideoDataOutput: AVCaptureSynchronizedSampleBufferData(CMSampleBuffer(StandInDevice.colour(), timeNs: timeNs))
        case is AVCaptureDepthDataOutput: AVCaptureSynchronizedDepthData(AVDepthData(StandInDevice.depth()))
        default: nil
        }
    }
}
public protocol AVCaptureDataOutputSynchronizerDelegate: NSObjectProtocol {
    func dataOutputSynchronizer(
        _ synchronizer: AVCaptureDataOutputSynchronizer,
        didOutput synchronizedDataCollection: AVCaptureSynchronizedDataCollection)
}
/// Calls its delegate, which it does not retain, on the queue that was set with it.
/// https://developer.apple.com/documentation/avfoundation/avcapturedataoutputsynchronizer
public final class AVCaptureDataOutputSynchronizer: NSObject, @unchecked Sendable {
    private weak var delegate: (any AVCaptureDataOutputSynchronizerDelegate)?
    private var queue: DispatchQueue?
    private static let lock = NSLock()
    nonisolated(unsafe) private static weak var current: AVCaptureDataOutputSynchronizer?

    public init(dataOutputs: [AVCaptureOutput]) { super.init() }

    public func setDelegate(_ delegate: (any AVCaptureDataOutputSynchronizerDelegate)?, queue: DispatchQueue?) {
        (self.delegate, self.queue) = (delegate, queue)
        Self.lock.withLock { Self.current = self }
    }

    static func deliver(timeNs: Int64) {
        guard let current = lock.withLock({ current }) else { return }
        current.queue?.sync { current.delegate?.dataOutputSynchronizer(current, didOutput: .init(timeNs: timeNs)) }
    }
}
