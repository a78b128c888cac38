import Foundation
import XCTest

@testable import PhasefrontCore

/// Measures the cost of a call to the library: a camera frame in, three planes of 1080p out. `tests/border` runs it for
/// many frames.
final class BorderTests: XCTestCase {
    func testCost() throws {
        let count = 5 + (ProcessInfo.processInfo.environment["PHASEFRONT_BORDER"].flatMap(Int.init) ?? 1)
        let luma = Data((0..<1920 * 1440).map { UInt8(truncatingIfNeeded: $0 * 7 / 5) })
        let metres = (0..<256 * 192).map { 0.5 + Float($0) * 4e-6 }.withUnsafeBytes { Data($0) }
        let frame = CameraFrame(
            timestampNs: 0,
            colour: ColourImage(
                format: .nv12, width: 1920, height: 1440,
                planes: [
                    ImagePlane(bytes: luma, rowStride: 1920, pixelStride: 1),
                    ImagePlane(bytes: luma.prefix(1920 * 720), rowStride: 1920, pixelStride: 2),
                ]),
            depth: DepthImage(format: .metresF32, width: 256, height: 192, bytes: metres))
        let session = try HologramSession(SessionOptions(network: try network.get()), mode: .image)
        var (added, inside): ([Double], [Double]) = ([], [])
        for i in 0..<count {
            let start = DispatchTime.now().uptimeNanoseconds
            let hologram = try session.process(frame)
            for colour in Colour.allCases { _ = try hologram.withPlane(colour) { $0[0] } }
            let all = Double(DispatchTime.now().uptimeNanoseconds - start) / 1e6
            if i < 5 { continue }
            inside.append(hologram.info.times.totalMs)
            added.append(all - hologram.info.times.totalMs)
        }
        let (border, stages) = (added.sorted()[added.count / 2], inside.sorted()[inside.count / 2])
        print(
            String(
                format: "Swift: %.3f ms beside the %.1f ms of the stages: %.2f %%", border, stages, 100 * border / stages))
    }
}
