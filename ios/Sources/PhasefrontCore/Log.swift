import Foundation

/// What the library has to say while it works.
public enum Log {
    /// Sends messages of `level` and above to `handler`, which is called on any thread; nil for silence.
    public static func send(_ level: LogLevel, to handler: (@Sendable (LogLevel, String) -> Void)?) throws {
        try setLogListener(level: level, listener: handler.map(Handler.init))
    }

    private final class Handler: LogListener {
        let handle: @Sendable (LogLevel, String) -> Void

        init(_ handle: @escaping @Sendable (LogLevel, String) -> Void) { self.handle = handle }

        func onLog(level: LogLevel, message: String) throws { handle(level, message) }
    }
}
