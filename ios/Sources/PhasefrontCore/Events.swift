import Foundation

/// What becomes of the frames of a live stream, in the order in which it happened.
public enum SessionEvent: Sendable {
    /// A frame became a hologram.
    case processed(Hologram)
    /// A frame was dropped.
    case dropped(timestampNs: UInt64, reason: DropReason)
    /// A frame could not be processed. The session goes on.
    case failed(timestampNs: UInt64, message: String)
    /// The frames after this one are made at another quality level.
    case qualityChanged(timestampNs: UInt64, change: QualityChange)
}

/// The events of a live stream, for one reader. Two holograms wait for it at most: the oldest gives way to a newer one
/// and is told as dropped, as ``DropReason/unread``, so a slow reader falls behind by little and memory stays flat.
public final class SessionEvents: AsyncSequence, Sendable {
    /// What is read: one event after another.
    public typealias Element = SessionEvent

    private static let mostHolograms = 2

    private struct State {
        var waiting: [SessionEvent] = []
        var reader: CheckedContinuation<SessionEvent?, Never>?
        var isFinished = false
    }

    private let state = Locked(State())

    func push(_ event: SessionEvent) {
        let reader = state.withLock { state -> CheckedContinuation<SessionEvent?, Never>? in
            if state.isFinished { return nil }
            if let reader = state.reader {
                state.reader = nil
                return reader
            }
            state.waiting.append(event)
            let holograms = state.waiting.indices.filter { state.waiting[$0].isProcessed }
            if holograms.count > Self.mostHolograms, case .processed(let oldest) = state.waiting[holograms[0]] {
                state.waiting[holograms[0]] = .dropped(timestampNs: oldest.info.timestampNs, reason: .unread)
            }
            return nil
        }
        reader?.resume(returning: event)
    }

    /// No more events come; those that wait can still be read.
    func finish() {
        let reader = state.withLock { state in
            state.isFinished = true
            defer { state.reader = nil }
            return state.reader
        }
        reader?.resume(returning: nil)
    }

    fileprivate func next() async -> SessionEvent? {
        await withTaskCancellationHandler {
            await withCheckedContinuation { continuation in
                let (answer, earlier): (SessionEvent??, CheckedContinuation<SessionEvent?, Never>?) = state.withLock {
                    state in
                    if !state.waiting.isEmpty { return (.some(state.waiting.removeFirst()), nil) }
                    if state.isFinished || Task.isCancelled { return (.some(nil), nil) }
                    defer { state.reader = continuation }
                    return (nil, state.reader)
                }
                // A second reader takes the first one's place, which ends.
                earlier?.resume(returning: nil)
                if let answer { continuation.resume(returning: answer) }
            }
        } onCancel: {
            let reader = state.withLock { state in
                defer { state.reader = nil }
                return state.reader
            }
            reader?.resume(returning: nil)
        }
    }

    /// Reads the events.
    public struct Iterator: AsyncIteratorProtocol {
        let events: SessionEvents

        /// The next event, which is waited for; nil when the session is closed or the task cancelled.
        public mutating func next() async -> SessionEvent? { await events.next() }
    }

    /// A reader. A second one takes the first one's place.
    public func makeAsyncIterator() -> Iterator { Iterator(events: self) }
}

extension SessionEvent {
    fileprivate var isProcessed: Bool {
        if case .hologram = self { true } else { false }
    }
}

/// A value under a lock.
final class Locked<Value>: @unchecked Sendable {
    private let lock = NSLock()
    private var value: Value

    init(_ value: Value) { self.value = value }

    func withLock<R>(_ body: (inout Value) throws -> R) rethrows -> R {
        lock.lock()
        defer { lock.unlock() }
        return try body(&value)
    }
}

/// Passes the library's calls on.
final class Listener: SessionListener {
    private let tell: @Sendable (SessionEvent) -> Void
    private let end: @Sendable () -> Void

    init(_ tell: @escaping @Sendable (SessionEvent) -> Void, end: @escaping @Sendable () -> Void = {}) {
        self.tell = tell
        self.end = end
    }

    func onProcessed(hologram: RawHologram) throws { tell(.processed(try Hologram(hologram))) }

    func onDropped(timestampNs: UInt64, reason: DropReason) throws {
        tell(.dropped(timestampNs: timestampNs, reason: reason))
    }

    func onFailed(timestampNs: UInt64, message: String) throws {
        tell(.failed(timestampNs: timestampNs, message: message))
    }

    func onQualityChanged(timestampNs: UInt64, change: QualityChange) throws {
        tell(.qualityChanged(timestampNs: timestampNs, change: change))
    }

    func onClosed() throws { end() }
}
