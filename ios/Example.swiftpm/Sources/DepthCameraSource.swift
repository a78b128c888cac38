import AVFoundation
import Phasefront

/// A source of colour and depth from AVFoundation, on devices with two back cameras and without LiDAR.
final class DepthCameraSource: NSObject, FrameSource, AVCaptureDataOutputSynchronizerDelegate, @unchecked Sendable {
    // Only the queue uses what follows.
    private let capture = AVCaptureSession()
    private let colour = AVCaptureVideoDataOutput()
    private let depth = AVCaptureDepthDataOutput()
    private let queue = DispatchQueue(label: "camera")
    private var synchronizer: AVCaptureDataOutputSynchronizer?
    private var feed: Feed?
    private var observers: [any NSObjectProtocol] = []

    static var isSupported: Bool { device != nil }

    private static var device: AVCaptureDevice? {
        AVCaptureDevice.default(.builtInDualWideCamera, for: .video, position: .back)
    }

    /// Why the camera cannot be configured.
    private struct Refused: Error {
        let why: String
    }

    func start(_ feed: Feed) {
        // Takes long, so it must not run on the main thread.
        queue.async { [self] in
            self.feed = feed
            do {
                try configure()
                observe()
                capture.startRunning()
            } catch let refused as Refused {
                feed.tell(.failed(refused.why))
            } catch {
                feed.tell(.failed(error.localizedDescription))
            }
        }
    }

    func stop() {
        queue.async { [self] in
            observers.forEach(NotificationCenter.default.removeObserver)
            observers = []
            capture.stopRunning()
            feed = nil
        }
    }

    private func configure() throws {
        guard let device = Self.device else { throw Refused(why: "the device has no camera with depth") }
        let input = try AVCaptureDeviceInput(device: device)
        capture.beginConfiguration()
        defer { capture.commitConfiguration() }
        capture.sessionPreset = .vga640x480
        guard capture.canAddInput(input) else { throw Refused(why: "the camera takes no session") }
        capture.addInput(input)
        guard capture.canAddOutput(colour) else { throw Refused(why: "the camera gives no colour") }
        capture.addOutput(colour)
        guard capture.canAddOutput(depth) else { throw Refused(why: "the camera gives no depth with its colour") }
        capture.addOutput(depth)
        // Phasefront fills holes itself.
        depth.isFilteringEnabled = false
        colour.videoSettings = [kCVPixelBufferPixelFormatTypeKey as String: kCVPixelFormatType_420YpCbCr8BiPlanarFullRange]
        let synchronizer = AVCaptureDataOutputSynchronizer(dataOutputs: [colour, depth])
        synchronizer.setDelegate(self, queue: queue)
        self.synchronizer = synchronizer
    }

    /// Follows interruptions, after which AVFoundation goes on by itself, and errors, which end the session.
    private func observe() {
        observe(AVCaptureSession.wasInterruptedNotification) { source, note in
            let reason = (note.userInfo?[AVCaptureSessionInterruptionReasonKey] as? Int)
                .flatMap(AVCaptureSession.InterruptionReason.init)
            source.feed?.tell(.interrupted(why(reason)))
        }
        observe(AVCaptureSession.interruptionEndedNotification) { source, _ in source.feed?.tell(.started) }
        observe(AVCaptureSession.runtimeErrorNotification) { source, note in
            let error = note.userInfo?[AVCaptureSessionErrorKey] as? AVError
            if error?.code == .mediaServicesWereReset {
                source.capture.startRunning()
            } else {
                source.feed?.tell(.failed(error?.localizedDescription ?? "the camera failed; try again"))
            }
        }
    }

    private func observe(
        _ name: Notification.Name, _ act: @escaping @Sendable (DepthCameraSource, Notification) -> Void
    ) {
        // Notifications come on any thread. This one is only read.
        observers.append(
            NotificationCenter.default.addObserver(forName: name, object: capture, queue: nil) { [weak self] note in
                nonisolated(unsafe) let note = note
                self?.queue.async { [weak self] in
                    if let self { act(self, note) }
                }
            })
    }

    func dataOutputSynchronizer(
        _: AVCaptureDataOutputSynchronizer, didOutput collection: AVCaptureSynchronizedDataCollection
    ) {
        guard let image = collection.synchronizedData(for: colour) as? AVCaptureSynchronizedSampleBufferData,
            let depth = collection.synchronizedData(for: depth) as? AVCaptureSynchronizedDepthData,
            !image.sampleBufferWasDropped, !depth.depthDataWasDropped
        else { return }
        feed?.frame("Dual camera with depth") { try $0.submit(image.sampleBuffer, depth: depth.depthData) }
    }
}

/// Says in words of a user why AVFoundation interrupts a session.
private func why(_ reason: AVCaptureSession.InterruptionReason?) -> String {
    switch reason {
    case .videoDeviceNotAvailableInBackground: "the app is in the background"
    case .videoDeviceNotAvailableWithMultipleForegroundApps: "the camera needs the whole screen"
    case .videoDeviceNotAvailableDueToSystemPressure: "the device is too hot for its camera"
    default: "a call or another app uses the camera"
    }
}
