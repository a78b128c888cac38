import Foundation
import PhasefrontCore
import XCTest

@testable import Benchmark

final class BenchmarkTests: XCTestCase {
    private let device = Device(model: "a test", system: "Linux", cores: 2)

    private func benchmark(_ runs: [Run], _ display: HologramDisplay) -> Benchmark {
        Benchmark(
            runs: runs, displays: [display], frames: 3,
            scene: {
                let bytes = { (count: Int) in Data((0..<count).map { UInt8($0 % 251) }) }
                return CameraFrame(
                    timestampNs: 0,
                    colour: ColourImage(format: .rgba, width: 32, height: 24, bytes: bytes(4 * 32 * 24)),
                    depth: DepthImage(format: .normalizedU8, width: 32, height: 24, bytes: bytes(32 * 24)))
            },
            conditions: { Conditions(thermal: "nominal", savesPower: false) })
    }

    func testQuartilesAreTimesOfFrames() {
        let nine = Spread([9, 1, 8, 2, 7, 3, 6, 4, 5])
        XCTAssertEqual([nine.least, nine.lower, nine.median, nine.upper, nine.most], [1, 3, 5, 7, 9])
        XCTAssertEqual(Spread([4]), Spread([4, 4, 4]))
    }

    func testARecordHasEveryRunWithItsStagesAndConditions() async throws {
        let runs = try Run.all(deep: HologramNetwork.builtIn(name: "rgbd-15"))
        let outcomes = try await benchmark(runs, HologramDisplay(width: 64, height: 48)).outcomes { line in
            XCTAssert(line.hasPrefix("64×48 ") && line.contains(" ms ("), line)
        }
        let record = Record(phasefront: version(), device: device, begun: "now", runs: outcomes)
        let read = try XCTUnwrap(JSONSerialization.jsonObject(with: record.json()) as? [String: Any])
        XCTAssertEqual(Set(read.keys), ["phasefront", "device", "begun", "runs"])
        let told = try XCTUnwrap(read["runs"] as? [[String: Any]])
        XCTAssertEqual(told.map { $0["name"] as? String }, runs.map(\.name))
        for one in told {
            let keys = "name stage width height before behind frames seconds backend why stages_ms"
            XCTAssertEqual(Set(one.keys), Set(keys.split(separator: " ").map(String.init)))
            for when in ["before", "behind"] {
                let conditions = try XCTUnwrap(one[when] as? [String: Any])
                XCTAssertEqual(Set(conditions.keys), ["thermal", "saves_power"])
            }
            let stages = try XCTUnwrap(one["stages_ms"] as? [String: [String: Double]])
            XCTAssertEqual(Set(stages.keys), Set(Stage.allCases.map(\.rawValue)))
            let of = try XCTUnwrap(stages[try XCTUnwrap(one["stage"] as? String)])
            let spread = ["least", "lower", "median", "upper", "most"].compactMap { of[$0] }
            XCTAssert(spread.count == 5 && spread[0] > 0 && spread == spread.sorted(), "\(spread)")
        }
    }

    func testWhatIsRefusedIsSaidAndTheOthersGoOn() async throws {
        // No network was trained for this display.
        let display = HologramDisplay(width: 64, height: 48, pitchUm: 3.74)
        let network = try HologramNetwork.builtIn(name: "rgbd-8")
        let runs = [
            Run(name: "8 layers", stage: .method, method: .trained(network: network)),
            Run(name: "sweep", stage: .method, method: .sweep),
        ]
        let refusing = benchmark(runs, display)
        let outcomes = try await refusing.outcomes { _ in }
        XCTAssert(outcomes[0].refused?.contains("trained for") == true, "\(outcomes[0])")
        XCTAssertNotNil(outcomes[1].stagesMs)
        let cancelled = Task {
            while !Task.isCancelled { await Task.yield() }
            return try await refusing.outcomes { _ in }
        }
        cancelled.cancel()
        let none = try await cancelled.value
        XCTAssertEqual(none.count, 0)
    }
}
