import Foundation
import XCTest

@testable import PhasefrontCore

/// Runs the conformance suite from Swift: the levels must match the suite, and match Rust bit for bit.
final class ConformanceTests: XCTestCase {
    private struct Suite: Decodable {
        let cases: [Case]
    }

    private struct Case: Decodable {
        let name, method, mode, display, encoding: String
        let levels: Int
        let lut: [UInt8]?
        let calibration, depth_network: String?
        let brightness: Float?
        let focus_steps: Int?
        let range: [Float]?
        let frames: [Still]
    }

    private struct Still: Decodable {
        let timestamp_ns: Int64
        let colour: Colours
        let depth: Image?
        let confidence: Image?
        let rotation: Int
        let mirrored: Bool
    }

    private struct Memory: Decodable {
        let offset, length, row_stride, pixel_stride: Int

        func plane(_ frames: Data) -> ImagePlane {
            // A slice whose indices do not start at 0.
            ImagePlane(bytes: frames[offset..<offset + length], rowStride: row_stride, pixelStride: pixel_stride)
        }
    }

    private struct Colours: Decodable {
        let format, matrix, encoding: String
        let width, height: Int
        let video_range: Bool
        let planes: [Memory]
    }

    private struct Image: Decodable {
        let format: String
        let width, height: Int
        let plane: Memory
    }

    private static let colours: [String: ColourFormat] = [
        "rgba": .rgba, "bgra": .bgra, "rgb": .rgb, "nv12": .nv12, "yuv420": .yuv420,
    ]
    private static let depths: [String: DepthFormat] = [
        "metres-f32": .metresF32, "metres-f16": .metresF16, "disparity-f32": .disparityF32,
        "disparity-f16": .disparityF16, "millimetres-u16": .millimetresU16, "android-depth16": .androidDepth16,
        "normalized-u8": .normalizedU8, "normalized-u16": .normalizedU16,
        "relative-f32": .relativeF32, "relative-f16": .relativeF16,
    ]
    private static let confidences: [String: ConfidenceFormat] = ["low-medium-high": .lowMediumHigh, "u8": .u8]
    private static let matrices: [String: YuvMatrix] = ["bt601": .bt601, "bt709": .bt709]
    private static let encodings: [String: RgbEncoding] = [
        "srgb": .srgb, "display-p3": .displayP3, "bt2020": .bt2020, "bt2020-hlg": .bt2020Hlg,
        "bt2020-pq": .bt2020Pq, "amplitude": .amplitude,
    ]
    private static let rotations: [Int: Rotation] = [0: .upright, 90: .clockwise90, 180: .half, 270: .clockwise270]
    private static let modes: [String: RunningMode] = ["image": .image, "video": .video]

    private func frame(_ still: Still, _ frames: Data) throws -> CameraFrame {
        let confidence = try still.confidence.map {
            ConfidenceMap(
                format: try XCTUnwrap(Self.confidences[$0.format]), width: $0.width, height: $0.height,
                plane: $0.plane.plane(frames))
        }
        let colour = ColourImage(
            format: try XCTUnwrap(Self.colours[still.colour.format]), width: still.colour.width,
            height: still.colour.height, planes: still.colour.planes.map { $0.plane(frames) },
            matrix: try XCTUnwrap(Self.matrices[still.colour.matrix]), videoRange: still.colour.video_range,
            encoding: try XCTUnwrap(Self.encodings[still.colour.encoding]))
        let depth = try still.depth.map {
            DepthImage(
                format: try XCTUnwrap(Self.depths[$0.format]), width: $0.width, height: $0.height,
                plane: $0.plane.plane(frames), confidence: confidence)
        }
        let rotation = try XCTUnwrap(Self.rotations[still.rotation])
        return CameraFrame(
            timestampNs: still.timestamp_ns, colour: colour, depth: depth,
            orientation: Orientation(rotation: rotation, mirrored: still.mirrored))
    }

    private static let root = URL(fileURLWithPath: #filePath).appendingPathComponent("../../../..").standardized

    private func model(_ file: String) throws -> HologramNetwork {
        try HologramNetwork.fromFile(path: Self.root.appendingPathComponent("models/\(file)").path)
    }

    private func method(_ name: String) throws -> HologramMethod? {
        switch name {
        case "default": nil
        case "network": .trained(network: try network.get())
        case "sweep": .sweep
        case "auto": .auto(network: try network.get())
        default: .trained(network: try model(name))
        }
    }

    private func encoding(_ name: String) throws -> Encoding {
        switch name {
        case "double-phase": .doublePhase
        case "anti-alias": .antiAlias(sigma: 0.7, width: 3)
        case "band-limit": .bandLimit(k: 1)
        default: .deep(prefilter: try model(name))
        }
    }

    private func target(_ one: Case) throws -> HologramTarget {
        if let file = one.calibration {
            return try HologramTarget.fromFile(path: Self.root.appendingPathComponent("tests/conformance/\(file)").path)
        }
        let display = try displayFromToml(text: one.display)
        guard let levels = one.lut else { return try HologramTarget.ofDisplay(display: display) }
        return try HologramTarget.withLookUpTable(display: display, levels: Data(levels))
    }

    /// Returns the levels of a case's frames and appends their displayed images to `seen`.
    private func levels(_ one: Case, _ frames: Data, _ seen: inout Data) throws -> Data {
        var options = try SessionOptions(target: target(one), method: method(one.method))
        options.encoding = try encoding(one.encoding)
        if let scale = one.brightness { options.brightness = .fixed(scale: scale) }
        if let range = one.range { options.depthRange = .fixed(nearM: range[0], farM: range[1]) }
        if let steps = one.focus_steps { options.focus = .natural(steps: steps) }
        if let file = one.depth_network {
            let onnx = try Data(contentsOf: Self.root.appendingPathComponent("tests/conformance/\(file)"))
            options.depthNetwork = try DepthNetwork.fromBytes(onnx: onnx, colours: .unit)
        }
        let session = try HologramSession(options, mode: try XCTUnwrap(Self.modes[one.mode]))
        var all = Data()
        for still in one.frames {
            let hologram = try session.process(try frame(still, frames))
            try all.append(hologram.levels())
            try seen.append(hologram.refocus(zMm: 1.5).bytes())
            try seen.append(hologram.field(zMm: -1).bytes())
        }
        return all
    }

    private func floats(_ bytes: Data) -> [Float] {
        bytes.withUnsafeBytes { Array($0.bindMemory(to: Float.self)) }
    }

    func testFramesBecomeTheLevelsThatAreExpected() throws {
        let folder = Self.root.appendingPathComponent("tests/conformance")
        let suite = try JSONDecoder().decode(Suite.self, from: Data(contentsOf: folder.appendingPathComponent("cases.json")))
        let frames = try Data(contentsOf: folder.appendingPathComponent("frames.bin"))
        var seen = Data()
        let got = try suite.cases.map { try levels($0, frames, &seen) }
        if let rust = ProcessInfo.processInfo.environment["PHASEFRONT_CONFORMANCE"] {
            let rust = URL(fileURLWithPath: rust)
            let levels = try Data(contentsOf: rust.appendingPathComponent("levels.bin"))
            XCTAssertEqual(got.reduce(Data(), +), levels, "not the bits that Rust has")
            // Sines come from the C library, which may differ from that of the Rust run.
            let apart = try zip(floats(seen), floats(Data(contentsOf: rust.appendingPathComponent("seen.bin"))))
                .map { abs($0 - $1) }
            XCTAssertEqual(4 * apart.count, seen.count)
            XCTAssertLessThan(apart.max() ?? 1, 1e-4, "not what Rust sees")
        }
        let expected = [UInt8](try Data(contentsOf: folder.appendingPathComponent("levels.bin")))
        var from = 0
        for (one, levels) in zip(suite.cases, got) {
            let apart = zip(levels, expected[from...]).map { a, b in
                let apart = abs(Int(a) - Int(b))
                return min(apart, one.levels - apart)
            }
            let differ = apart.filter { $0 != 0 }.count
            XCTAssertLessThanOrEqual(differ * 200, levels.count, "\(one.name): \(differ) levels differ")
            if one.lut == nil && one.calibration == nil { XCTAssertLessThanOrEqual(apart.max() ?? 0, 1, one.name) }
            from += levels.count
        }
        XCTAssertEqual(from, expected.count)
    }
}
