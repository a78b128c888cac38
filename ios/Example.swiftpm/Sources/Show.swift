import AVFoundation
import Combine
import Phasefront
import UIKit

/// Converts the camera or the sample scene to holograms. Shows the displayed image focused by the slider or a tap, the
/// levels on an external screen if there is one, and what the camera and the session do.
@MainActor
final class Show: ObservableObject {
    @Published private(set) var preview: CGImage?
    @Published private(set) var state = SourceState.stopped
    @Published private(set) var statistics = ""
    /// Whether the user has forbidden the camera.
    @Published private(set) var isForbidden = false
    @Published var zMm = 0.0
    private var latest: Hologram?
    private let screen = ExternalScreen(size: CGSize(width: 960, height: 540))
    private let display = HologramDisplay(width: 960, height: 540)
    private let views = PixelBuffers(width: 480, height: 270)
    private let outputs = PixelBuffers(width: 960, height: 540)

    /// Runs a session with the device's camera until its task is cancelled.
    func run() async {
        tell(.started)
        defer { tell(.stopped) }
        do {
            try HologramLog.sendToSystem()
            let session = try HologramSession(SessionOptions.phone(display: display), mode: .live)
            let heat = session.followThermalState()
            defer { withExtendedLifetime(heat) {} }
            let source = await source()
            if Task.isCancelled { return }
            let (changes, changed) = AsyncStream.makeStream(of: SourceEvent.self)
            let feed = Feed(session, changed)
            let following = Task { for await event in changes { tell(event) } }
            source.start(feed)
            defer {
                source.stop()
                following.cancel()
            }
            for await event in session.events {
                if Task.isCancelled { break }
                switch event {
                case .processed(let hologram): try await show(hologram, of: session, failures: feed.failures)
                case .failed(_, let message): feed.fail(message)
                case .dropped, .qualityChanged: break
                }
            }
        } catch {
            tell(.failed(error.localizedDescription))
        }
    }

    /// Shows the hologram of a photo with depth, such as a portrait.
    func show(photo: Data) async {
        tell(.started)
        do {
            let session = try HologramSession(SessionOptions(display: display), mode: .image)
            let hologram = try await Task.detached { try session.process(photo: photo) }.value
            try await show(hologram, of: session)
            tell(.frame("Photo"))
        } catch {
            tell(.failed(error.localizedDescription))
        }
    }

    /// Focuses on the scene point at (`x`, `y`) of the image, each 0...1.
    func focus(atX x: Double, y: Double) {
        if let z = latest?.z(atX: x, y: y) { zMm = z }
    }

    /// Releases what can be made again. The system needs memory.
    func freeMemory() {
        latest = nil
        views.flush()
        outputs.flush()
    }

    /// Returns the source for this device. Asks for the camera on the first launch.
    private func source() async -> any FrameSource {
        guard CameraSource.isSupported || DepthCameraSource.isSupported else {
            return SampleSource(why: "this device has no camera with depth")
        }
        if AVCaptureDevice.authorizationStatus(for: .video) == .notDetermined {
            tell(.asked(to: "use the camera"))
            _ = await AVCaptureDevice.requestAccess(for: .video)
            tell(.started)
        }
        isForbidden = AVCaptureDevice.authorizationStatus(for: .video) != .authorized
        if isForbidden { return SampleSource(why: "the app may not use the camera") }
        return CameraSource.isSupported ? CameraSource() : DepthCameraSource()
    }

    private func tell(_ event: SourceEvent) {
        // Nothing changes for most frames, and a view is drawn for each change.
        let next = state.after(event)
        if next != state { state = next }
    }

    private func show(_ hologram: Hologram, of session: HologramSession, failures: Feed.Failures = .init()) async throws {
        let (zMm, needsLevels) = (zMm, screen.isConnected)
        // Takes some milliseconds, so it must not run on the main thread.
        let images = try await Task.detached { [views, outputs] () throws -> (CGImage, CGImage?) in
            let view = try views.next()
            try hologram.writePreview(zMm: zMm, to: view)
            guard needsLevels else { return (try cgImage(of: view), nil) }
            let levels = try outputs.next()
            try hologram.writeOutput(to: levels)
            return (try cgImage(of: view), try cgImage(of: levels, colourSpace: nil))
        }.value
        latest = hologram
        preview = images.0
        if let levels = images.1 { screen.show(levels) }
        let of = session.statistics
        statistics = String(
            format: "%.1f holograms a second, %lld dropped of %lld\n%@: %.1f ms, of which the method takes %.1f",
            of.rateHz, of.dropped.total, of.submitted, of.backend, of.times.totalMs, of.times.methodMs)
        if failures.count > 0 { statistics += "\n\(failures.count) frames failed, the last one: \(failures.last)" }
    }
}
