import Foundation

/// The log messages of the library.
public enum HologramLog {
    /// Sends messages of `level` and above to `handler`, which may be called on any thread. nil turns them off.
    public static func send(_ level: LogLevel, to handler: (@Sendable (LogLevel, String) -> Void)?) throws {
        try setLogListener(level: level, listener: handler.map(Handler.init))
    }

    private final class Handler: LogListener {
        let handle: @Sendable (LogLevel, String) -> Void

        init(_ handle: @escaping @Sendable (LogLevel, String) -> Void) { self.handle = handle }

        func onLog(level: LogLevel, message: String) throws { handle(level, message) }
    }
}
