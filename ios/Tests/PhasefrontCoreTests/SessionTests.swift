import Foundation
import XCTest

@testable import PhasefrontCore

/// Tests sessions from Swift: threads, live streams, misuse and memory.
final class SessionTests: XCTestCase {
    /// Returns the message of the `PhasefrontError` that `call` throws.
    private func message<T>(_ call: () throws -> T, line: UInt = #line) -> String {
        do {
            _ = try call()
            XCTFail("nothing was thrown", line: line)
        } catch let error as PhasefrontError {
            XCTAssertFalse(error.message.contains("\n"), error.message, line: line)
            XCTAssertEqual(error.localizedDescription, error.message)
            return error.message
        } catch {
            XCTFail("\(error)", line: line)
        }
        return ""
    }

    private func assertRefused<T>(_ words: String, line: UInt = #line, _ call: () throws -> T) {
        let message = message(call, line: line)
        XCTAssert(message.contains(words), message, line: line)
    }

    func testLevelsAreReadInPlaceAndOutliveTheSession() throws {
        let hologram = try HologramSession(options(), mode: .image).process(still())
        let before = try hologram.levels()
        XCTAssertGreaterThan(Set(before).count, 100)
        try hologram.withPlane(.green) { XCTAssertEqual($0.count, 64 * 48) }
        let other = try HologramSession(options(), mode: .image).process(still(depth: depthBytes(metres: 2)))
        XCTAssertEqual(try hologram.levels(), before)
        XCTAssertEqual(other.info.width, 64)
    }

    func testSlicesAndForeignMemoryAreRespected() throws {
        let session = try HologramSession(options(), mode: .image)
        let want = try session.process(still()).levels()
        let padded = Data(repeating: 9, count: 60) + colourBytes() + Data(repeating: 9, count: 30)
        XCTAssertEqual(try session.process(still(colour: padded[60..<padded.count - 30])).levels(), want)
        try colourBytes().withUnsafeBytes { bytes in
            var frame = still()
            let address = try XCTUnwrap(bytes.baseAddress)
            frame.colour.planes = [ImagePlane(unsafeAddress: address, count: bytes.count, rowStride: 256, pixelStride: 4)]
            XCTAssertEqual(try session.process(frame).levels(), want)
        }
    }

    func testUnusableFramesAreNamed() throws {
        let session = try HologramSession(options(), mode: .image)
        func colour(_ width: Int, _ height: Int, _ planes: [ImagePlane]) -> CameraFrame {
            var frame = still()
            frame.colour = ColourImage(format: .rgba, width: width, height: height, planes: planes)
            return frame
        }
        func plane(_ rowStride: Int, _ pixelStride: Int) -> ImagePlane {
            ImagePlane(bytes: colourBytes(), rowStride: rowStride, pixelStride: pixelStride)
        }
        assertRefused("too few") { try session.process(still(colour: Data())) }
        assertRefused("too few") { try session.process(still(depth: Data())) }
        assertRefused("64×0") { try session.process(colour(64, 0, [plane(256, 4)])) }
        assertRefused("×48") { try session.process(colour(-64, 48, [plane(256, 4)])) }
        assertRefused("row stride") { try session.process(colour(64, 48, [plane(200, 4)])) }
        assertRefused("pixel stride") { try session.process(colour(64, 48, [plane(256, 1)])) }
        assertRefused("planes") { try session.process(colour(64, 48, [])) }
        assertRefused("planes") { try session.process(colour(64, 48, [ImagePlane](repeating: plane(256, 4), count: 4))) }
        _ = try session.process(still())
    }

    func testAPreviewShowsThePictureAndATapGivesZ() throws {
        let hologram = try HologramSession(options(), mode: .image).process(still())
        var bytes = [UInt8](repeating: 7, count: 4 * 32 * 24)
        try bytes.withUnsafeMutableBytes { try hologram.writePreview(zMm: 0, width: 32, height: 24, to: $0) }
        XCTAssert(stride(from: 3, to: bytes.count, by: 4).allSatisfy { bytes[$0] == 255 })
        XCTAssertGreaterThan(Set(bytes).count, 20)
        // Blue first, with gaps between rows, which stay as they are.
        var gaps = [UInt8](repeating: 7, count: 140 * 24)
        try gaps.withUnsafeMutableBytes {
            try hologram.writePreview(zMm: 0, width: 32, height: 24, layout: .bgra, to: $0, rowStride: 140)
        }
        XCTAssertEqual([gaps[0], gaps[1], gaps[2], gaps[128]], [bytes[2], bytes[1], bytes[0], 7])
        XCTAssertEqual(gaps[140 + 2], bytes[4 * 32])
        XCTAssertGreaterThan(hologram.z(atX: 0.5, y: 0.5), hologram.z(atX: 0.02, y: 0.02))
        let memory = UnsafeMutableRawBufferPointer.allocate(byteCount: 100, alignment: 1)
        defer { memory.deallocate() }
        assertRefused("0×24") { try hologram.writePreview(zMm: 0, width: 0, height: 24, to: memory) }
        assertRefused("24 rows") { try hologram.writePreview(zMm: 0, width: 32, height: 24, to: memory) }
    }

    func testNoticesComeAlong() throws {
        let notices = try thirdPartyNotices()
        XCTAssert(notices.hasPrefix("# Third-party notices") && notices.contains("uniffi"))
    }

    func testAWholeViewIsTheFieldWithoutItsPhases() throws {
        let hologram = try HologramSession(options(), mode: .image).process(still())
        let (seen, field) = try (hologram.refocus(zMm: 0), hologram.field())
        XCTAssertEqual([seen.width, seen.height, seen.colours, seen.numbers, field.numbers], [64, 48, 3, 1, 2])
        try seen.withPlane(.blue) { amplitudes in
            try field.withPlane(.blue) { parts in
                XCTAssertEqual([amplitudes.count, parts.count], [64 * 48, 2 * 64 * 48])
                for i in 0..<64 * 48 {
                    let (re, im) = (parts[2 * i], parts[2 * i + 1])
                    XCTAssertEqual(amplitudes[i], (re * re + im * im).squareRoot(), accuracy: 1e-6)
                }
            }
        }
        assertRefused("a shorter distance") { try hologram.refocus(zMm: 1e5) }
        assertRefused("must be finite") { try hologram.field(zMm: .nan) }
    }

    func testOutputIsWhatTheModulatorTakes() throws {
        let hologram = try HologramSession(options(), mode: .image).process(still())
        let levels = [UInt8](try hologram.levels())
        XCTAssertEqual(hologram.outputSize(.rgba), OutputSize(width: 64, height: 48, pixelBytes: 4, images: 1))
        var bytes = [UInt8](repeating: 0, count: 4 * 64 * 48)
        try bytes.withUnsafeMutableBytes { try hologram.writeOutput(Placement(layout: .rgba), to: $0) }
        XCTAssertEqual((0..<64 * 48).map { bytes[4 * $0] }, Array(levels[..<(64 * 48)]))
        try bytes.withUnsafeMutableBytes { memory in
            try hologram.writeOutput(Placement(layout: .grey, flipX: true), image: 2, to: memory)
            XCTAssertEqual(memory[0], levels[2 * 64 * 48 + 63])
            try hologram.writeOutput(Placement(layout: .grey16), to: memory)
            XCTAssertEqual([memory[0], memory[1]], [0, levels[0]])
            assertRefused("no image 1") { try hologram.writeOutput(Placement(layout: .rgba), image: 1, to: memory) }
            assertRefused("48 rows") {
                try hologram.writeOutput(Placement(layout: .rgba), to: .init(rebasing: memory[..<8]))
            }
        }
    }

    func testAModulatorIsTakenByItsName() throws {
        XCTAssert(modulatorNames().contains("ti-plm-p47"))
        assertRefused("holoeye-pluto") { try Modulator(named: "pluto") }
        let modulator = try Modulator(toml: "width = 64\nheight = 48\npacking = \"grey\"\nflip_x = true")
        XCTAssertEqual(modulator.outputSize, OutputSize(width: 64, height: 48, pixelBytes: 1, images: 3))
        let options = try SessionOptions(target: modulator.target, network: network.get())
        let hologram = try HologramSession(options, mode: .image).process(still())
        let levels = [UInt8](try hologram.levels())
        var green = [UInt8](repeating: 0, count: 64 * 48)
        try green.withUnsafeMutableBytes { memory in
            try modulator.writeOutput(hologram, image: 1, to: memory)
            assertRefused("no image 3") { try modulator.writeOutput(hologram, image: 3, to: memory) }
            let other = try Modulator(named: "ti-plm-p47")
            assertRefused("lasers") { try other.writeOutput(hologram, to: memory) }
        }
        XCTAssertEqual(green[0], levels[64 * 48 + 63])
        // In a screen's pixels, red, green and blue are the level.
        var pixels = [UInt8](repeating: 0, count: 4 * 64 * 48)
        try pixels.withUnsafeMutableBytes { memory in
            try modulator.writePixels(hologram, image: 1, layout: .bgra, to: memory)
            assertRefused("Rgba or Bgra") { try modulator.writePixels(hologram, layout: .rgb, to: memory) }
        }
        XCTAssertEqual(pixels, green.flatMap { [$0, $0, $0, 255] })
    }

    func testALiveStreamAnswersEveryFrameOnItsOwnThread() throws {
        let answered = Locked<(timestamps: [Int64], threads: Set<Thread>)>(([], []))
        let session = try HologramSession(options(), mode: .live) { event in
            answered.withLock {
                $0.threads.insert(Thread.current)
                switch event {
                case .processed(let hologram): $0.timestamps.append(hologram.info.timestampNs)
                case .dropped(let timestampNs, _): $0.timestamps.append(timestampNs)
                default: XCTFail("\(event)")
                }
            }
        }
        for i in 1000..<1050 as Range<Int64> { try session.submit(still(timestampNs: i)) }
        session.close()
        let (timestamps, threads) = answered.withLock { $0 }
        XCTAssertEqual(timestamps.sorted(), Array(1000..<1050))
        XCTAssertEqual(threads.count, 1)
        XCTAssertFalse(threads.contains(Thread.current))
        let statistics = session.statistics
        XCTAssertEqual(statistics.processed + statistics.dropped.total, 50)
    }

    func testAsyncEventsTellTheSame() async throws {
        let session = try HologramSession(options(), mode: .live)
        let submitting = Task.detached {
            for i in 1...50 as ClosedRange<Int64> { try session.submit(still(timestampNs: i)) }
            session.close()
        }
        var timestamps: [Int64] = []
        for await event in session.events {
            switch event {
            case .processed(let hologram): timestamps.append(hologram.info.timestampNs)
            case .dropped(let timestampNs, _): timestamps.append(timestampNs)
            default: XCTFail("\(event)")
            }
        }
        try await submitting.value
        XCTAssertEqual(timestamps.sorted(), Array(1...50))
    }

    func testUnreadEventsHoldTwoHologramsAtMost() async throws {
        let session = try HologramSession(options(), mode: .live)
        for i in 1...8 as ClosedRange<Int64> {
            try session.submit(still(timestampNs: i))
            while session.statistics.pending > 0 { usleep(1000) }
        }
        session.close()
        var (holograms, unread) = (0, 0)
        for await event in session.events {
            switch event {
            case .processed: holograms += 1
            case .dropped(_, .unread): unread += 1
            default: XCTFail("\(event)")
            }
        }
        XCTAssertEqual([holograms, unread], [2, 6])
    }

    func testEventsThatNobodyReadsTakeBoundedMemory() async throws {
        let session = try HologramSession(options(), mode: .live)
        // A paused session drops each frame at once, which is an event.
        try session.pause()
        var frame = CameraFrame(
            timestampNs: 0, colour: ColourImage(format: .rgba, width: 8, height: 6, bytes: Data(count: 4 * 8 * 6)),
            depth: DepthImage(format: .metresF32, width: 8, height: 6, bytes: Data(count: 4 * 8 * 6)))
        for i in 1...100_000 as ClosedRange<Int64> {
            frame.timestampNs = i
            try session.submit(frame)
        }
        session.close()
        var last: [Int64] = []
        for await event in session.events {
            guard case .dropped(let timestampNs, .paused) = event else { return XCTFail("\(event)") }
            last.append(timestampNs)
        }
        XCTAssertEqual(last, Array(99_937...100_000))
        XCTAssertEqual(session.statistics.dropped.paused, 100_000)
    }

    @MainActor func testACancelledCallThrowsAndItsFrameIsNotComputed() async throws {
        let session = try HologramSession(options(), mode: .image)
        // The calls belong to the main actor, so they begin when this test waits, after they were cancelled.
        let calls = (1...8 as ClosedRange<Int64>).map { i in
            Task { try await session.process(still(timestampNs: i)) }
        }
        calls.forEach { $0.cancel() }
        for call in calls {
            do {
                _ = try await call.value
                XCTFail("a cancelled call returned a hologram")
            } catch is CancellationError {}
        }
        XCTAssertEqual(session.statistics.processed, 0)
        _ = try await session.process(still())
    }

    func testACancelledReaderEnds() async throws {
        let session = try HologramSession(options(), mode: .live)
        let reading = Task { for await _ in session.events {} }
        try await Task.sleep(nanoseconds: 20_000_000)
        reading.cancel()
        await reading.value
        session.close()
    }

    func testALateFrameInAStreamHarmsNothing() throws {
        let made = DispatchSemaphore(value: 0)
        let session = try HologramSession(options(), mode: .live) { if case .processed = $0 { made.signal() } }
        try session.submit(still(timestampNs: 5))
        XCTAssertEqual(made.wait(timeout: .now() + 60), .success)
        assertRefused("5 ns") { try session.submit(still(timestampNs: 5)) }
        XCTAssertNil(try session.submit(still(timestampNs: 6)))
        XCTAssertEqual(made.wait(timeout: .now() + 60), .success)
    }

    func testAListenerMayCloseItsSession() throws {
        let closed = DispatchSemaphore(value: 0)
        let box = Locked<HologramSession?>(nil)
        let session = try HologramSession(options(), mode: .live) { _ in
            let own = box.withLock { $0 }
            own?.close()
            closed.signal()
        }
        box.withLock { $0 = session }
        try session.submit(still(timestampNs: 1))
        XCTAssertEqual(closed.wait(timeout: .now() + 60), .success)
        assertRefused("closed") { try session.submit(still(timestampNs: 2)) }
        session.close()
        box.withLock { $0 = nil }
    }

    func testThreadsShareASession() throws {
        let session = try HologramSession(options(), mode: .image)
        let want = try session.process(still()).levels()
        let wrong = Locked(0)
        DispatchQueue.concurrentPerform(iterations: 40) { _ in
            if (try? session.process(still()).levels()) != want { wrong.withLock { $0 += 1 } }
        }
        XCTAssertEqual(wrong.withLock { $0 }, 0)
    }

    func testProcessCanBeAwaited() async throws {
        let session = try HologramSession(options(), mode: .image)
        let (one, other) = try await (session.process(still()), session.process(still()))
        XCTAssertEqual(try one.levels(), try other.levels())
        session.close()
        do {
            _ = try await session.process(still())
            XCTFail("a closed session")
        } catch let error as PhasefrontError { XCTAssert(error.message.contains("closed"), error.message) }
    }

    func testHeatMovesThePhonesQualityLevel() async throws {
        let session = try HologramSession(SessionOptions.phone(display: smallDisplay), mode: .live)
        try session.setThermal(.critical)
        try session.submit(still(timestampNs: 1))
        var (change, sizes): (QualityChange?, [Int]) = (nil, [])
        for await event in session.events {
            switch event {
            case .processed(let hologram):
                sizes.append(hologram.info.width)
                if sizes.count == 1 { try session.submit(still(timestampNs: 40_000_000)) } else { session.close() }
            case .qualityChanged(_, let to): change = to
            default: XCTFail("\(event)")
            }
        }
        XCTAssertEqual(change, QualityChange(fromQualityLevel: 0, toQualityLevel: 2, reason: .thermal))
        XCTAssertEqual(sizes, [64, 32])
    }

    func testAClosedSessionSaysSo() throws {
        let session = try HologramSession(options(), mode: .image)
        _ = try session.process(still())
        session.close()
        session.close()
        for call in [session.warmUp, session.reset, session.pause, session.resume] {
            assertRefused("closed; make a new one") { try call() }
        }
        assertRefused("closed; make a new one") { try session.process(still()) }
        XCTAssertEqual(session.statistics.processed, 1)
    }

    func testAPausedSessionRefusesAndAResetLetsTimeBeginAnew() throws {
        let session = try HologramSession(options(), mode: .video)
        try session.warmUp()
        _ = try session.process(still(timestampNs: 100))
        assertRefused("99 ns") { try session.process(still(timestampNs: 99)) }
        try session.reset()
        _ = try session.process(still(timestampNs: 1))
        try session.pause()
        assertRefused("paused") { try session.process(still(timestampNs: 2)) }
        try session.resume()
        _ = try session.process(still(timestampNs: 3))
    }

    func testModesAreNotMixed() async throws {
        let image = try HologramSession(options(), mode: .image)
        assertRefused("not live") { try image.submit(still()) }
        for await event in image.events { XCTFail("\(event)") }
        let live = try HologramSession(options(), mode: .live)
        assertRefused("submitted") { try live.process(still()) }
        assertRefused("listener") { try HologramSession(options(), mode: .video) { _ in } }
    }

    func testNetworksThatAreNoneAreNamed() throws {
        assertRefused("nowhere.onnx") { try HologramNetwork.fromFile(path: "/nowhere.onnx") }
        assertRefused("network") { try HologramNetwork.fromBytes(onnx: Data()) }
        assertRefused("network") { try HologramNetwork.fromBytes(onnx: Data("not a network".utf8)) }
        let info = try network.get().info()
        XCTAssertEqual(info.layers, 8)
        XCTAssertEqual(info.pitchUm, 8)
    }

    func testSettingsThatCannotBeMeantAreNamed() throws {
        func make(_ change: @escaping (inout SessionOptions) -> Void) -> () throws -> HologramSession {
            {
                var changed = try options()
                change(&changed)
                return try HologramSession(changed, mode: .image)
            }
        }
        assertRefused("no quality levels", make { $0.qualityLevels = [] })
        assertRefused("0 threads", make { $0.threads = 0 })
        assertRefused("target rate", make { $0.targetRateHz = .nan })
        assertRefused("no quality level 3", make { $0.quality = .fixed(qualityLevel: 3) })
        let fine = try HologramTarget.ofDisplay(display: HologramDisplay(width: 64, height: 48, pitchUm: 3.74))
        assertRefused("pitch") { try HologramSession(SessionOptions(target: fine, network: network.get()), mode: .image) }
        let tiny = try HologramTarget.ofDisplay(display: HologramDisplay(width: 32, height: 24))
        assertRefused("the modulator's 32×24", make { $0.target = tiny })
        assertRefused("line 1") { try displayFromToml(text: "width = ") }
    }

    func testTargetsThatCannotBeAreNamed() throws {
        assertRefused("pitch_um") { try SessionOptions(display: HologramDisplay(pitchUm: -1)) }
        assertRefused("3 levels") { try HologramTarget.withLookUpTable(display: smallDisplay, levels: Data([1, 2, 3])) }
        assertRefused("nowhere.pfc") { try HologramTarget.fromFile(path: "/nowhere.pfc") }
        assertRefused("calibration") { try HologramTarget.fromBytes(file: Data("not a calibration".utf8)) }
    }

    func testATargetIsTakenAsItsDisplayIs() throws {
        let target = try HologramTarget.withLookUpTable(display: smallDisplay, levels: Data(0...255))
        let options = try SessionOptions(target: target)
        XCTAssertEqual(options.target.display(), smallDisplay)
        let levels = try HologramSession(options, mode: .image).process(still()).levels()
        // This table has equal steps.
        XCTAssertEqual(try HologramSession(SessionOptions(display: smallDisplay), mode: .image).process(still()).levels(), levels)
    }

    func testTheNetworkThatIsBuiltInIsTheDefault() throws {
        for offset in [0.0, 3, 12] {
            let defaults = try SessionOptions(display: HologramDisplay(width: 64, height: 48, offsetMm: offset))
            guard case .auto(network: nil) = defaults.qualityLevels[0].method else { return XCTFail("\(defaults.qualityLevels)") }
            guard case .antiAlias = defaults.encoding else { return XCTFail("\(defaults.encoding)") }
            _ = try HologramSession(defaults, mode: .image).process(still())
        }
    }

    func testThePairThatIsBuiltInCanBeTaken() throws {
        let pair = try builtInPair()
        let display = HologramDisplay(width: 64, height: 48)
        var options = try SessionOptions(display: display, network: pair.hologram)
        options.encoding = .deep(prefilter: pair.prefilter)
        _ = try HologramSession(options, mode: .image).process(still())
    }

    func testStepsAndDarkCanBeSet() throws {
        let defaults = try SessionOptions(display: smallDisplay)
        let levels = try HologramSession(defaults, mode: .image).process(still()).levels()
        var options = defaults
        (options.darkThreshold, options.localSteps) = (0.4, 1)
        XCTAssertEqual(try HologramSession(options, mode: .image).process(still()).levels(), levels)
        options.localSteps = 0
        XCTAssertNotEqual(try HologramSession(options, mode: .image).process(still()).levels(), levels)
        options = defaults
        options.midpointSteps = 1
        XCTAssertNotEqual(try HologramSession(options, mode: .image).process(still()).levels(), levels)
        options.midpointSteps = 0
        options.qualityLevels[0].midpointSteps = 1
        XCTAssertNotEqual(try HologramSession(options, mode: .image).process(still()).levels(), levels)
        options = defaults
        options.localSteps = 9
        assertRefused("at most 8") { try HologramSession(options, mode: .image) }
        (options.darkThreshold, options.localSteps) = (2, nil)
        assertRefused("from 0 to 1") { try HologramSession(options, mode: .image) }
    }

    func testWithoutANetworkTheSweepIsTheDefault() throws {
        let defaults = try SessionOptions(display: HologramDisplay(width: 64, height: 48, pitchUm: 3.74))
        let session = try HologramSession(defaults, mode: .image)
        _ = try session.process(still())
        XCTAssert(session.statistics.backendWhy.hasPrefix("the plane sweep"), session.statistics.backendWhy)
    }

    func testMessagesReachTheLog() throws {
        let messages = Locked<[(LogLevel, String)]>([])
        try HologramLog.send(.info) { level, message in messages.withLock { $0.append((level, message)) } }
        _ = try HologramSession(options(), mode: .image)
        try HologramLog.send(.info, to: nil)
        _ = try HologramSession(options(), mode: .image)
        let heard = messages.withLock { $0 }
        XCTAssertEqual(heard.map(\.0), [.info])
        XCTAssert(heard[0].1.contains("Image"))
    }

    func testStagesBeginAndEnd() throws {
        let stages = Locked<[(Stage, Bool)]>([])
        let session = try HologramSession(options(), mode: .image)
        try HologramTrace.send { stage, begins in stages.withLock { $0.append((stage, begins)) } }
        _ = try session.process(still())
        try HologramTrace.send(to: nil)
        _ = try session.process(still())
        let heard = stages.withLock { $0 }
        XCTAssertEqual(heard.first?.0, .frame)
        XCTAssertEqual(heard.filter(\.1).map(\.0), [.frame, .colour, .depth, .method, .propagate, .encode])
        XCTAssertEqual(heard.filter { !$0.1 }.map(\.0), [.colour, .depth, .method, .propagate, .encode, .frame])
    }

    // Only Linux reports it this way.
    #if os(Linux)
        func testMemoryOfTenThousandFramesIsFlat() throws {
            func residentMb() throws -> Double {
                let statm = try String(contentsOfFile: "/proc/self/statm", encoding: .utf8)
                return try XCTUnwrap(Double(statm.split(separator: " ")[1])) * 4096 / 1e6
            }
            var small = try options()
            small.threads = 1
            let session = try HologramSession(small, mode: .image)
            let frame = still()
            var sum = 0
            func frames(_ count: Int) throws {
                for _ in 0..<count { sum += try Int(session.process(frame).withPlane(.blue) { $0[0] }) }
            }
            try frames(1000)
            let before = try residentMb()
            try frames(9000)
            // The results of each frame take 15 KB. All of them would take 138 MB.
            XCTAssertLessThan(try residentMb() - before, 16)
            XCTAssertGreaterThan(sum, 0)
        }
    #endif
}
