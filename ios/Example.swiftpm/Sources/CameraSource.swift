import ARKit
import Phasefront

/// A source of colour and depth from ARKit, on devices with LiDAR. ARKit goes on by itself after an interruption.
final class CameraSource: NSObject, FrameSource, ARSessionDelegate, @unchecked Sendable {
    static var isSupported: Bool { ARWorldTrackingConfiguration.supportsFrameSemantics(.smoothedSceneDepth) }

    private let camera = ARSession()
    private let queue = DispatchQueue(label: "camera")
    /// Written before the camera runs, and read on its queue.
    private var feed: Feed?

    func start(_ feed: Feed) {
        self.feed = feed
        let configuration = ARWorldTrackingConfiguration()
        configuration.frameSemantics.insert(.smoothedSceneDepth)
        camera.delegate = self
        camera.delegateQueue = queue
        camera.run(configuration)
    }

    func stop() { camera.pause() }

    func session(_: ARSession, didUpdate frame: ARFrame) {
        // The first frames have no depth.
        guard frame.smoothedSceneDepth != nil else { return }
        feed?.frame("LiDAR camera") { try $0.submit(frame) }
    }

    func session(_: ARSession, didFailWithError error: any Error) {
        let why =
            switch (error as? ARError)?.code {
            case .cameraUnauthorized: "the app may not use the camera"
            case .sensorUnavailable, .sensorFailed: "the camera does not answer; try again, or restart the device"
            default: error.localizedDescription
            }
        feed?.tell(.failed(why))
    }

    func sessionWasInterrupted(_: ARSession) { feed?.tell(.interrupted("a call or another app uses the camera")) }

    func sessionInterruptionEnded(_: ARSession) { feed?.tell(.started) }
}
