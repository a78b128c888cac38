#if canImport(os)
    import Foundation
    import PhasefrontCore
    import os

    extension HologramLog {
        /// Sends messages of `level` and above to the system log. Console and Xcode show them under the category
        /// "phasefront".
        public static func sendToSystem(_ level: LogLevel = .info) throws {
            let logger = Logger(subsystem: Bundle.main.bundleIdentifier ?? "phasefront", category: "phasefront")
            try send(level) { level, message in
                switch level {
                case .error: logger.error("\(message, privacy: .public)")
                case .warning: logger.warning("\(message, privacy: .public)")
                case .info: logger.info("\(message, privacy: .public)")
                case .debug: logger.debug("\(message, privacy: .public)")
                }
            }
        }
    }

    extension HologramTrace {
        /// Sends the stages to Instruments, which shows them under os_signpost in the category "phasefront".
        public static func sendToInstruments() throws {
            let log = OSLog(subsystem: Bundle.main.bundleIdentifier ?? "phasefront", category: "phasefront")
            try send { stage, begins in
                // The stages of one thread share an identifier.
                let id = OSSignpostID(log: log, object: Thread.current)
                os_signpost(begins ? .begin : .end, log: log, name: stage.signpost, signpostID: id)
            }
        }
    }

    extension Stage {
        /// The name of the signpost, which must be known at compile time.
        fileprivate var signpost: StaticString {
            switch self {
            case .frame: "frame"
            case .colour: "colour"
            case .depth: "depth"
            case .method: "method"
            case .propagate: "propagate"
            case .encode: "encode"
            case .midpoint: "midpoint"
            case .gpu: "gpu"
            case .plan: "plan"
            case .preview: "preview"
            }
        }
    }

    extension Thermal {
        /// Converts `ProcessInfo.processInfo.thermalState`.
        public init(_ state: ProcessInfo.ThermalState) {
            self =
                switch state {
                case .nominal: .nominal
                case .fair: .fair
                case .serious: .serious
                case .critical: .critical
                @unknown default: .fair
                }
        }
    }

    extension HologramSession {
        /// Passes the device's thermal state to ``setThermal(_:)`` now and whenever it changes, until the returned object
        /// is released. The object does not retain the session.
        public func followThermalState() -> ThermalFollower {
            let tell = { @Sendable [weak self] in
                // A closed session needs no state.
                _ = try? self?.setThermal(Thermal(ProcessInfo.processInfo.thermalState))
            }
            tell()
            return ThermalFollower(
                NotificationCenter.default.addObserver(
                    forName: ProcessInfo.thermalStateDidChangeNotification, object: nil, queue: nil
                ) { _ in tell() })
        }
    }

    /// Follows the thermal state of the device for a session, as long as it is retained.
    public final class ThermalFollower {
        private let observer: NSObjectProtocol

        init(_ observer: NSObjectProtocol) { self.observer = observer }

        deinit { NotificationCenter.default.removeObserver(observer) }
    }
#endif
