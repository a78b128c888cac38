import ARKit
import Phasefront
import UIKit

/// Converts the camera or the sample scene to holograms. Shows the displayed image focused by the slider or a tap, the
/// levels on an external screen if there is one, and statistics.
@MainActor
final class Show: ObservableObject {
    @Published var preview: CGImage?
    @Published var statistics = ""
    @Published var zMm = 0.0
    @Published var hasError = false
    private(set) var message = ""
    private var latest: Hologram?
    private let screen = ExternalScreen(size: CGSize(width: 960, height: 540))
    private let display = HologramDisplay(width: 960, height: 540)
    private let views = PixelBuffers(width: 480, height: 270)
    private let outputs = PixelBuffers(width: 960, height: 540)

    func run() async {
        do {
            try HologramLog.sendToSystem()
            let session = try HologramSession(SessionOptions.phone(display: display), mode: .live)
            let heat = session.followThermalState()
            defer { withExtendedLifetime(heat) {} }
            let source: FrameSource =
                if CameraSource.isSupported { CameraSource() } else { DepthCameraSource() ?? SampleSource() }
            source.start(session)
            defer { source.stop() }
            for await event in session.events {
                if Task.isCancelled { break }
                switch event {
                case .processed(let hologram): try await show(hologram, of: session)
                case .failed(_, let message): say(message)
                case .dropped, .qualityChanged: break
                }
            }
        } catch {
            say(error.localizedDescription)
        }
    }

    private func show(_ hologram: Hologram, of session: HologramSession) async throws {
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
    }

    /// Shows the hologram of a photo with depth, such as a portrait.
    func show(photo: Data) async {
        do {
            let session = try HologramSession(SessionOptions(display: display), mode: .image)
            let hologram = try await Task.detached { try session.process(photo: photo) }.value
            try await show(hologram, of: session)
        } catch {
            say(error.localizedDescription)
        }
    }

    /// Focuses on the scene point at (`x`, `y`) of the image, each 0...1.
    func focus(atX x: Double, y: Double) {
        if let z = latest?.z(atX: x, y: y) { zMm = z }
    }

    private func say(_ message: String) {
        self.message = message
        hasError = true
    }
}
