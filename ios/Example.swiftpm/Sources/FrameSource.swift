import Foundation
import Phasefront

/// A source of frames.
protocol FrameSource: Sendable {
    /// Submits frames to `feed` until `stop()`.
    func start(_ feed: Feed)
    func stop()
}

/// Takes the frames of a source to a session, and what happens to the source to the screen.
final class Feed: @unchecked Sendable {
    private let session: HologramSession
    private let events: AsyncStream<SourceEvent>.Continuation
    private let lock = NSLock()
    // The lock protects these.
    private var last: SourceEvent?
    private var failed = Failures()

    init(_ session: HologramSession, _ events: AsyncStream<SourceEvent>.Continuation) {
        self.session = session
        self.events = events
    }

    /// Frames that could not become holograms.
    struct Failures: Sendable {
        var count = 0
        var last = ""
    }

    var failures: Failures { lock.withLock { failed } }

    /// Submits a frame of a source that is called `source` on the screen.
    func frame(_ source: String, _ submit: (HologramSession) throws -> Void) {
        do {
            try submit(session)
        } catch {
            fail(error.localizedDescription)
        }
        tell(.frame(source))
    }

    /// Counts a frame that could not become a hologram.
    func fail(_ why: String) {
        lock.withLock { failed = Failures(count: failed.count + 1, last: why) }
    }

    /// Tells the screen, unless it is what was told last.
    func tell(_ event: SourceEvent) {
        let isNew = lock.withLock {
            defer { last = event }
            return last != event
        }
        if isNew { events.yield(event) }
    }
}
