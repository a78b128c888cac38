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
    private let screen = ExternalScreen()
    private let display = HologramDisplay(width: 960, height: 540)

    func run() async {
        do {
            try HologramLog.sendToSystem()
            var options = try SessionOptions(display: display)
            options.targetRateHz = 30
            let session = try HologramSession(options, mode: .live)
            let source: FrameSource = CameraSource.isSupported ? CameraSource() : SampleSource()
            source.start(session)
            defer { source.stop() }
            for await event in session.events {
                if Task.isCancelled { break }
                try session.setThermal(Thermal(ProcessInfo.processInfo.thermalState))
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
        let (zMm, display, needsLevels) = (zMm, display, screen.isConnected)
        // Takes some milliseconds, so it must not run on the main thread.
        let images = try await Task.detached {
            let view = try hologram.preview(zMm: zMm, width: display.width / 2, height: display.height / 2)
            return (try view.cgImage(), needsLevels ? try hologram.output().cgImage(colourSpace: nil) : nil)
        }.value
        latest = hologram
        preview = images.0
        if let levels = images.1 { screen.show(levels) }
        let of = session.statistics
        statistics = String(
            format: "%.1f holograms a second, %d dropped of %d\n%@: %.1f ms, of which the network takes %.1f",
            of.rateHz, of.dropped.total, of.submitted, of.backend, of.times.totalMs, of.times.methodMs)
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
