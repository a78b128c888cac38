#if canImport(os)
    import Foundation
    import PhasefrontCore
    import os

    extension Log {
        /// Sends messages of `level` and above to the system's log, where Console and Xcode show them under the category
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

    extension Thermal {
        /// What `ProcessInfo.processInfo.thermalState` says.
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
#endif
