import Foundation

/// An event of a live stream. Events come in the order in which they happen.
public enum SessionEvent: Sendable {
    /// A frame became a hologram.
    case processed(Hologram)
    /// A frame was dropped.
    case dropped(timestampNs: Int64, reason: DropReason)
    /// A frame could not be processed. The session continues.
    case failed(timestampNs: Int64, message: String)
    /// The session processes the frames after this one at another quality level.
    case qualityChanged(timestampNs: Int64, change: QualityChange)
}

/// The events of a live stream, for one reader. At most two holograms wait in the queue. A newer one replaces the
/// oldest, which is reported as dropped with ``DropReason/unread``. At most 64 events wait; a newer one replaces the
/// oldest that is no hologram. So memory stays constant if nobody reads, and ``HologramSession/statistics`` counts every
/// frame.
public final class SessionEvents: AsyncSequence, Sendable {
    /// The element type: an event.
    public typealias Element = SessionEvent

    static let mostHolograms = 2
    static let mostEvents = 64

    private struct State {
        var waiting: [SessionEvent] = []
        var holograms = 0
        var reader: CheckedContinuation<SessionEvent?, Never>?
        var isFinished = false

        /// Adds an event. The time and the memory of a call are bounded.
        mutating func append(_ event: SessionEvent) {
            waiting.append(event)
            if waiting.count > SessionEvents.mostEvents, let oldest = waiting.firstIndex(where: { !$0.isProcessed }) {
                waiting.remove(at: oldest)
            }
            if event.isProcessed { holograms += 1 }
            if holograms > SessionEvents.mostHolograms, let oldest = waiting.firstIndex(where: \.isProcessed),
                case .processed(let hologram) = waiting[oldest]
            {
                holograms -= 1
                waiting[oldest] = .dropped(timestampNs: hologram.info.timestampNs, reason: .unread)
            }
        }

        mutating func removeFirst() -> SessionEvent {
            let event = waiting.removeFirst()
            if event.isProcessed { holograms -= 1 }
            return event
        }
    }

    private let state = Locked(State())

    func push(_ event: SessionEvent) {
        let reader = state.withLock { state -> CheckedContinuation<SessionEvent?, Never>? in
            if state.isFinished { return nil }
            if let reader = state.reader {
                state.reader = nil
                return reader
            }
            state.append(event)
            return nil
        }
        reader?.resume(returning: event)
    }

    /// Ends the events. Those in the queue can still be read.
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
                    if !state.waiting.isEmpty { return (.some(state.removeFirst()), nil) }
                    if state.isFinished || Task.isCancelled { return (.some(nil), nil) }
                    defer { state.reader = continuation }
                    return (nil, state.reader)
                }
                // A second reader replaces the first, whose iteration ends.
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

    /// An iterator over the events.
    public struct Iterator: AsyncIteratorProtocol {
        let events: SessionEvents

        /// Waits for the next event. Returns nil when the session is closed or the task is cancelled.
        public mutating func next() async -> SessionEvent? { await events.next() }
    }

    /// Returns an iterator. A second iterator replaces the first.
    public func makeAsyncIterator() -> Iterator { Iterator(events: self) }
}

extension SessionEvent {
    fileprivate var isProcessed: Bool {
        if case .processed = self { true } else { false }
    }
}

/// A value protected by a lock.
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

/// Forwards the library's callbacks.
final class Listener: SessionListener {
    private let tell: @Sendable (SessionEvent) -> Void
    private let end: @Sendable () -> Void

    init(_ tell: @escaping @Sendable (SessionEvent) -> Void, end: @escaping @Sendable () -> Void = {}) {
        self.tell = tell
        self.end = end
    }

    func onProcessed(hologram: RawHologram) throws { tell(.processed(Hologram(hologram))) }

    func onDropped(timestampNs: Int64, reason: DropReason) throws {
        tell(.dropped(timestampNs: timestampNs, reason: reason))
    }

    func onFailed(timestampNs: Int64, message: String) throws {
        tell(.failed(timestampNs: timestampNs, message: message))
    }

    func onQualityChanged(timestampNs: Int64, change: QualityChange) throws {
        tell(.qualityChanged(timestampNs: timestampNs, change: change))
    }

    func onClosed() throws { end() }
}
