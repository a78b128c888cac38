import Combine
import Phasefront
import SwiftUI

/// Measures every stage on the sample scene, saves the record as a file and shares it.
struct BenchmarkView: View {
    @StateObject private var bench = Bench()
    @Environment(\.dismiss) private var dismiss

    var body: some View {
        VStack(alignment: .leading) {
            HStack {
                Button("Run the benchmark") { bench.run() }
                    .disabled(bench.isRunning)
                if let record = bench.record { ShareLink("Share the record", item: record) }
                Spacer()
                Button("Done") { dismiss() }
            }
            ScrollView {
                Text(bench.lines.joined(separator: "\n"))
                    .font(.caption.monospacedDigit())
                    .frame(maxWidth: .infinity, alignment: .leading)
            }
        }
        .padding()
        .onDisappear { bench.stop() }
    }
}

@MainActor
final class Bench: ObservableObject {
    @Published private(set) var lines: [String] = []
    @Published private(set) var record: URL?
    @Published private(set) var isRunning = false
    private var task: Task<Void, Never>?

    func run() {
        isRunning = true
        (lines, record) = ([], nil)
        UIDevice.current.isBatteryMonitoringEnabled = true
        // The processor may sleep when the screen turns off.
        UIApplication.shared.isIdleTimerDisabled = true
        task = Task {
            do {
                record = try await measure()
                if let record { lines.append("kept as \(record.lastPathComponent)") }
            } catch {
                lines.append(error.localizedDescription)
            }
            UIApplication.shared.isIdleTimerDisabled = false
            isRunning = false
        }
    }

    func stop() { task?.cancel() }

    private func measure() async throws -> URL? {
        let begun = Date()
        guard let scene = SampleScene(), let deep = Bundle.module.path(forResource: "rgbd-30-int8", ofType: "onnx")
        else { throw CocoaError(.fileReadNoSuchFile) }
        let benchmark = Benchmark(
            runs: try Run.all(deep: HologramNetwork.fromFile(path: deep)), scene: { scene.frame(0) },
            conditions: { await Self.conditions() })
        // Processing blocks, so it must not run on the main thread.
        let work = Task.detached {
            try await benchmark.outcomes { [weak self] line in await self?.say(line) }
        }
        let runs = try await withTaskCancellationHandler {
            try await work.value
        } onCancel: {
            work.cancel()
        }
        // A cancelled run leaves no record.
        if Task.isCancelled { return nil }
        let record = Record(
            phasefront: version(), device: Self.device(), begun: begun.formatted(.iso8601), runs: runs)
        let folder = URL.documentsDirectory.appending(path: "benchmarks")
        try FileManager.default.createDirectory(at: folder, withIntermediateDirectories: true)
        let file = folder.appending(path: "\(Int(begun.timeIntervalSince1970)).json")
        try record.json().write(to: file, options: .atomic)
        return file
    }

    private func say(_ line: String) { lines.append(line) }

    private static func device() -> Device {
        var name = utsname()
        uname(&name)
        let model = withUnsafeBytes(of: &name.machine) { String(decoding: $0.prefix { $0 != 0 }, as: UTF8.self) }
        let system = "\(UIDevice.current.systemName) \(UIDevice.current.systemVersion)"
        return Device(model: model, system: system, cores: ProcessInfo.processInfo.activeProcessorCount)
    }

    private static func conditions() -> Conditions {
        let (device, process) = (UIDevice.current, ProcessInfo.processInfo)
        let isKnown = device.batteryState != .unknown
        return Conditions(
            thermal: "\(Thermal(process.thermalState))",
            batteryPercent: isKnown ? Double(100 * device.batteryLevel) : nil,
            charging: isKnown ? device.batteryState != .unplugged : nil,
            savesPower: process.isLowPowerModeEnabled)
    }
}
