import Foundation

/// The begin and end of each stage of a frame.
public enum HologramTrace {
    /// Calls `handler` with each stage that begins (true) or ends (false), on the thread that computes it. Stages on a
    /// thread are nested. nil turns the calls off. The handler must not call the library.
    public static func send(to handler: (@Sendable (Stage, Bool) -> Void)?) throws {
        try setStageListener(listener: handler.map(Handler.init))
    }

    private final class Handler: StageListener {
        let handle: @Sendable (Stage, Bool) -> Void

        init(_ handle: @escaping @Sendable (Stage, Bool) -> Void) { self.handle = handle }

        func onBegin(stage: Stage) throws { handle(stage, true) }

        func onEnd(stage: Stage) throws { handle(stage, false) }
    }
}
