import Foundation

// This file is also compiled on Linux for its tests, where only the core is available.
#if canImport(Phasefront)
    import Phasefront
#else
    import PhasefrontCore
#endif

/// The stages of a frame that a session measures.
enum Stage: String, CaseIterable, Codable, Sendable {
    case colour, depth, method, propagate, encode, total

    func ms(_ times: FrameTimes) -> Double {
        switch self {
        case .colour: times.colourMs
        case .depth: times.depthMs
        case .method: times.methodMs
        case .propagate: times.propagateMs
        case .encode: times.encodeMs
        case .total: times.totalMs
        }
    }
}

/// The times of one stage in milliseconds: minimum, quartiles and maximum, each a measured time.
struct Spread: Codable, Equatable, Sendable {
    let least, lower, median, upper, most: Double

    /// Computes the spread of at least one time.
    init(_ times: [Double]) {
        let sorted = times.sorted()
        let at = { (quarters: Int) in sorted[(sorted.count - 1) * quarters / 4] }
        (least, lower, median, upper, most) = (at(0), at(1), at(2), at(3), at(4))
    }
}

/// A benchmark run: the method and the correction steps of its frames, and the stage that it measures. nil means the
/// default; with steps, there is no other correction.
struct Run: Sendable {
    let name: String
    let stage: Stage
    var method: HologramMethod?
    var localSteps: Int? = 0

    /// Returns the options of the run for `display`.
    func options(_ display: HologramDisplay) throws -> SessionOptions {
        var options = try SessionOptions(display: display, method: method)
        if let localSteps { (options.darkThreshold, options.localSteps) = (0, localSteps) }
        return options
    }

    /// Returns the runs: networks of 8, 15 and `deep`'s layers, the plane sweep, one correction step, and the default.
    static func all(deep: HologramNetwork) throws -> [Run] {
        let shallow = try HologramMethod.trained(network: HologramNetwork.builtIn(name: "rgbd-8"))
        return try [
            Run(name: "8 layers", stage: .method, method: shallow),
            Run(name: "15 layers", stage: .method, method: .trained(network: HologramNetwork.builtIn(name: "rgbd-15"))),
            Run(name: "\(deep.info().layers) layers", stage: .method, method: .trained(network: deep)),
            Run(name: "plane sweep", stage: .method, method: .sweep),
            Run(name: "encoder with one step", stage: .encode, method: shallow, localSteps: 1),
            Run(name: "whole frame", stage: .total, localSteps: nil),
        ]
    }
}

/// The thermal and power state of the device. Unknown values are nil.
struct Conditions: Codable, Equatable, Sendable {
    /// The thermal state: nominal, fair, serious or critical.
    var thermal: String?
    var batteryPercent: Double?
    var charging: Bool?
    var savesPower: Bool?
}

/// The result of one run: its times, or the reason why it was refused.
struct Outcome: Codable, Sendable {
    let name: String
    let stage: Stage
    let width, height: Int
    let before: Conditions
    var behind: Conditions?
    var frames: Int?
    var seconds: Double?
    var backend, why: String?
    /// The times by stage name.
    var stagesMs: [String: Spread]?
    var refused: String?

    /// The line for the screen.
    var line: String {
        let size = "\(width)×\(height) \(name): "
        guard let of = stagesMs?[stage.rawValue] else { return size + (refused ?? "") }
        return size + String(format: "%.1f ms (%.1f to %.1f)", of.median, of.lower, of.upper)
    }
}

/// The description of the device.
struct Device: Codable, Sendable {
    let model, system: String
    let cores: Int
}

/// The record that the app saves and shares.
struct Record: Codable, Sendable {
    let phasefront: String
    let device: Device
    /// The start time in ISO 8601.
    let begun: String
    let runs: [Outcome]

    /// Returns the record as JSON with the same keys as on Android.
    func json() throws -> Data {
        let encoder = JSONEncoder()
        encoder.keyEncodingStrategy = .convertToSnakeCase
        encoder.outputFormatting = [.prettyPrinted, .sortedKeys]
        return try encoder.encode(self)
    }
}

/// Measures `runs` at every size of `displays`: two frames to warm up, then `frames` frames. `scene` returns the frame
/// to process, and `conditions` the state of the device, which is read before and after each run.
struct Benchmark: Sendable {
    let runs: [Run]
    /// The modulator of the documentation, and the size of the example app's holograms.
    var displays = [HologramDisplay(), HologramDisplay(width: 960, height: 540)]
    /// With this count, each quartile is the time of one frame.
    var frames = 9
    let scene: @Sendable () throws -> CameraFrame
    let conditions: @Sendable () async -> Conditions

    /// Returns the results of all runs and passes the line of each to `told`. A refused run records the reason, and the
    /// others continue. Returns the results so far if the task is cancelled.
    func outcomes(_ told: @Sendable (String) async -> Void) async throws -> [Outcome] {
        var outcomes: [Outcome] = []
        for display in displays {
            for run in runs where !Task.isCancelled {
                var outcome = Outcome(
                    name: run.name, stage: run.stage, width: display.width, height: display.height,
                    before: await conditions())
                do {
                    try time(run, display, &outcome)
                    outcome.behind = await conditions()
                } catch let refused as PhasefrontError {
                    outcome.refused = refused.message
                }
                await told(outcome.line)
                outcomes.append(outcome)
            }
        }
        return outcomes
    }

    private func time(_ run: Run, _ display: HologramDisplay, _ outcome: inout Outcome) throws {
        let session = try HologramSession(run.options(display), mode: .image)
        for _ in 0..<2 { _ = try session.process(scene()) }
        var times: [FrameTimes] = []
        let took = try ContinuousClock().measure {
            for _ in 0..<frames { times.append(try session.process(scene()).info.times) }
        }
        let statistics = session.statistics
        (outcome.frames, outcome.seconds) = (frames, took / .seconds(1))
        (outcome.backend, outcome.why) = (statistics.backend, statistics.backendWhy)
        outcome.stagesMs = Dictionary(
            uniqueKeysWithValues: Stage.allCases.map { stage in (stage.rawValue, Spread(times.map(stage.ms))) })
    }
}
