import Foundation

// Beside the app this is compiled on Linux too, where its tests run and only the core is.
#if canImport(Phasefront)
    import Phasefront
#else
    import PhasefrontCore
#endif

/// The stages of a frame, as a session times them.
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

/// Times of one stage, milliseconds: median, quartiles and ends, each one of the times.
struct Spread: Codable, Equatable, Sendable {
    let least, lower, median, upper, most: Double

    /// Of at least one time.
    init(_ times: [Double]) {
        let sorted = times.sorted()
        let at = { (quarters: Int) in sorted[(sorted.count - 1) * quarters / 4] }
        (least, lower, median, upper, most) = (at(0), at(1), at(2), at(3), at(4))
    }
}

/// What is timed: frames by `method`, corrected by `localSteps` and nothing else, and the stage that the run is about;
/// where one is nil, the default.
struct Run: Sendable {
    let name: String
    let stage: Stage
    var method: Method?
    var localSteps: UInt32? = 0

    /// Its options on `display`.
    func options(_ display: Display) throws -> SessionOptions {
        var options = try SessionOptions(display: display, method: method)
        if let localSteps { (options.darkThreshold, options.localSteps) = (0, localSteps) }
        return options
    }

    /// Networks of 8, 15 and `deep`'s layers, the plane sweep, one step of correction, and the default.
    static func all(deep: Network) throws -> [Run] {
        let shallow = try Method.trained(network: Network.builtIn(name: "rgbd-8"))
        return try [
            Run(name: "8 layers", stage: .method, method: shallow),
            Run(name: "15 layers", stage: .method, method: .trained(network: Network.builtIn(name: "rgbd-15"))),
            Run(name: "\(deep.info().layers) layers", stage: .method, method: .trained(network: deep)),
            Run(name: "plane sweep", stage: .method, method: .sweep),
            Run(name: "encoder with one step", stage: .encode, method: shallow, localSteps: 1),
            Run(name: "whole frame", stage: .total, localSteps: nil),
        ]
    }
}

/// What the system tells of heat and energy; what it does not know is left out.
struct Conditions: Codable, Equatable, Sendable {
    /// nominal, fair, serious or critical.
    var thermal: String?
    var batteryPercent: Double?
    var charging: Bool?
    var savesPower: Bool?
}

/// What was timed in one run, or why it was refused.
struct Outcome: Codable, Sendable {
    let name: String
    let stage: Stage
    let width, height: UInt32
    let before: Conditions
    var behind: Conditions?
    var frames: Int?
    var seconds: Double?
    var backend, why: String?
    /// By the names of the stages.
    var stagesMs: [String: Spread]?
    var refused: String?

    /// For the screen.
    var line: String {
        let size = "\(width)×\(height) \(name): "
        guard let of = stagesMs?[stage.rawValue] else { return size + (refused ?? "") }
        return size + String(format: "%.1f ms (%.1f to %.1f)", of.median, of.lower, of.upper)
    }
}

/// What an app knows of its device.
struct Device: Codable, Sendable {
    let model, system: String
    let cores: Int
}

/// What is kept and shared.
struct Record: Codable, Sendable {
    let phasefront: String
    let device: Device
    /// ISO 8601.
    let begun: String
    let runs: [Outcome]

    /// Its JSON, whose names are those of Android's record.
    func json() throws -> Data {
        let encoder = JSONEncoder()
        encoder.keyEncodingStrategy = .convertToSnakeCase
        encoder.outputFormatting = [.prettyPrinted, .sortedKeys]
        return try encoder.encode(self)
    }
}

/// Times `runs` at every size of `displays`: two frames to warm up, then `frames` of them. `scene` gives the frame to
/// time, and `conditions` what the system tells, which each run asks for before and behind it.
struct Benchmark: Sendable {
    let runs: [Run]
    /// The modulator of the documents, and the size of the example app's holograms.
    var displays = [Display(), Display(width: 960, height: 540)]
    /// So many that the quartiles are times of frames.
    var frames = 9
    let scene: @Sendable () throws -> Frame
    let conditions: @Sendable () async -> Conditions

    /// What all runs gave; `told` hears the line of each. A run that is refused says why, and the others go on. Ends
    /// early, with what there is, where its task is cancelled.
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

    private func time(_ run: Run, _ display: Display, _ outcome: inout Outcome) throws {
        let session = try Session(run.options(display), mode: .image)
        for _ in 0..<2 { _ = try session.process(scene()) }
        var times: [FrameTimes] = []
        let took = try ContinuousClock().measure {
            for _ in 0..<frames { times.append(try session.process(scene()).info.times) }
        }
        let statistics = try session.statistics()
        (outcome.frames, outcome.seconds) = (frames, took / .seconds(1))
        (outcome.backend, outcome.why) = (statistics.backend, statistics.backendWhy)
        outcome.stagesMs = Dictionary(
            uniqueKeysWithValues: Stage.allCases.map { stage in (stage.rawValue, Spread(times.map(stage.ms))) })
    }
}
