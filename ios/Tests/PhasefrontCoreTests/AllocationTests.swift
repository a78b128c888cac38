#if canImport(Glibc)
    import Foundation
    import Glibc
    import XCTest

    @testable import PhasefrontCore

    /// Tests that a frame allocates nothing of an image's size, neither in Swift nor in the library. `ios/test` loads
    /// `tests/counting.c`, which counts what the process allocates.
    final class AllocationTests: XCTestCase {
        private static let (width, height) = (640, 480)
        /// The bytes of the smallest image, the levels of one colour.
        private static let plane = UInt64(width * height)

        private func counter() throws -> @convention(c) () -> UInt64 {
            let symbol = try XCTUnwrap(
                dlsym(nil, "allocated_bytes"), "nothing counts: run ios/test, which loads tests/counting.c")
            return unsafeBitCast(symbol, to: (@convention(c) () -> UInt64).self)
        }

        /// Prints the bytes that `call` allocates on all threads, and checks them. The first calls may grow memory that
        /// later ones use again.
        private func count(_ what: String, _ call: () throws -> Void) throws {
            let allocated = try counter()
            for _ in 0..<3 { try call() }
            let counts = try (0..<5).map { _ in
                let before = allocated()
                try call()
                return allocated() - before
            }
            let least = counts.min() ?? 0
            print("\(what): \(least) bytes")
            XCTAssertLessThan(least, Self.plane, what)
        }

        private func frame(_ timestampNs: Int64, _ colour: Data, _ depth: Data) -> CameraFrame {
            CameraFrame(
                timestampNs: timestampNs,
                colour: ColourImage(format: .rgba, width: Self.width, height: Self.height, bytes: colour),
                depth: DepthImage(format: .normalizedU8, width: Self.width, height: Self.height, bytes: depth))
        }

        func testAFrameAllocatesNoImage() throws {
            let allocated = try counter()
            let before = allocated()
            let colour = Data((0..<4 * Int(Self.plane)).map { UInt8($0 * 37 % 251) })
            XCTAssertGreaterThanOrEqual(allocated() - before, 4 * Self.plane, "allocations are counted")
            let depth = Data((0..<Int(Self.plane)).map { UInt8($0 / 700 % 256) })
            let modulator = try Modulator(toml: "width = 640\nheight = 480")
            let options = try SessionOptions(target: modulator.target, method: .sweep)
            let session = try HologramSession(options, mode: .video)
            var time: Int64 = 0
            func process() throws -> Hologram {
                time += 33_000_000
                return try session.process(frame(time, colour, depth))
            }
            try count("process, withPlane") { try process().withPlane(.blue) { _ = $0[0] } }
            let hologram = try process()
            let pixels = UnsafeMutableRawBufferPointer.allocate(byteCount: 4 * Int(Self.plane), alignment: 16)
            defer { pixels.deallocate() }
            try count("writeOutput") { try hologram.writeOutput(Placement(layout: .rgba), to: pixels) }
            try count("writePreview") {
                try hologram.writePreview(zMm: 0, width: Self.width, height: Self.height, to: pixels)
            }
            try count("writeOutput of a modulator") { try modulator.writeOutput(hologram, to: pixels) }
            try count("writePixels of a modulator") { try modulator.writePixels(hologram, to: pixels) }

            let made = DispatchSemaphore(value: 0)
            let live = try HologramSession(options, mode: .live) { event in
                if case .processed = event { made.signal() }
            }
            try count("submit, until it is a hologram") {
                time += 33_000_000
                try live.submit(frame(time, colour, depth))
                made.wait()
            }
            live.close()
        }
    }
#endif
