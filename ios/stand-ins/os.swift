@_exported import Foundation

public struct OSLogPrivacy: Sendable { public static let `public` = OSLogPrivacy() }
public struct OSLogMessage: ExpressibleByStringInterpolation, ExpressibleByStringLiteral {
    public struct StringInterpolation: StringInterpolationProtocol {
        public init(literalCapacity: Int, interpolationCount: Int) {}
        public mutating func appendLiteral(_: String) {}
        public mutating func appendInterpolation(_: @autoclosure @escaping () -> String, privacy: OSLogPrivacy) {}
    }
    public init(stringInterpolation: StringInterpolation) {}
    public init(stringLiteral: String) {}
}
public struct Logger: Sendable {
    public init(subsystem: String, category: String) {}
    public func error(_: OSLogMessage) {}
    public func warning(_: OSLogMessage) {}
    public func info(_: OSLogMessage) {}
    public func debug(_: OSLogMessage) {}
}
public final class OSLog: Sendable { public init(subsystem: String, category: String) {} }
public struct OSSignpostType: Sendable {
    public static let begin = OSSignpostType()
    public static let end = OSSignpostType()
}
public struct OSSignpostID: Sendable { public init(log: OSLog, object: AnyObject) {} }
public func os_signpost(_: OSSignpostType, log: OSLog, name: StaticString, signpostID: OSSignpostID) {}
extension ProcessInfo {
    public enum ThermalState: Int, Sendable { case nominal, fair, serious, critical }
    /// The state that a test sets, and whose change it posts:
    /// https://developer.apple.com/documentation/foundation/processinfo/thermalstatedidchangenotification
    nonisolated(unsafe) public static var thermal = ThermalState.nominal
    public var thermalState: ThermalState { Self.thermal }
    public static var thermalStateDidChangeNotification: Notification.Name { Notification.Name("NSProcessInfoThermalStateDidChange") }
}
