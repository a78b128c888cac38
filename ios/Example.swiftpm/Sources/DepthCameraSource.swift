import AVFoundation
import Phasefront

/// A source of colour and depth from AVFoundation, on devices with two back cameras and without LiDAR.
final class DepthCameraSource: NSObject, FrameSource, AVCaptureDataOutputSynchronizerDelegate {
    private let capture = AVCaptureSession()
    private let colour = AVCaptureVideoDataOutput()
    private let depth = AVCaptureDepthDataOutput()
    private let queue = DispatchQueue(label: "camera")
    private let synchronizer: AVCaptureDataOutputSynchronizer
    /// The session, written before the camera runs and read on its queue.
    nonisolated(unsafe) private var session: HologramSession?

    /// Creates a source, or returns nil if the device has no such cameras.
    override init?() {
        guard let device = AVCaptureDevice.default(.builtInDualWideCamera, for: .video, position: .back),
            let input = try? AVCaptureDeviceInput(device: device)
        else { return nil }
        capture.beginConfiguration()
        capture.sessionPreset = .vga640x480
        guard capture.canAddInput(input) else { return nil }
        capture.addInput(input)
        guard capture.canAddOutput(colour), capture.canAddOutput(depth) else { return nil }
        capture.addOutput(colour)
        capture.addOutput(depth)
        // Phasefront fills holes itself.
        depth.isFilteringEnabled = false
        colour.videoSettings = [kCVPixelBufferPixelFormatTypeKey as String: kCVPixelFormatType_420YpCbCr8BiPlanarFullRange]
        capture.commitConfiguration()
        synchronizer = AVCaptureDataOutputSynchronizer(dataOutputs: [colour, depth])
        super.init()
        synchronizer.setDelegate(self, queue: queue)
    }

    func start(_ session: HologramSession) {
        self.session = session
        // Takes long, so it must not run on the main thread.
        queue.async { [capture] in capture.startRunning() }
    }

    func stop() { queue.async { [capture] in capture.stopRunning() } }

    nonisolated func dataOutputSynchronizer(
        _: AVCaptureDataOutputSynchronizer, didOutput collection: AVCaptureSynchronizedDataCollection
    ) {
        guard let image = collection.synchronizedData(for: colour) as? AVCaptureSynchronizedSampleBufferData,
            let depth = collection.synchronizedData(for: depth) as? AVCaptureSynchronizedDepthData,
            !image.sampleBufferWasDropped, !depth.depthDataWasDropped
        else { return }
        do {
            try session?.submit(image.sampleBuffer, depth: depth.depthData)
        } catch {
            print(error.localizedDescription)
        }
    }
}
