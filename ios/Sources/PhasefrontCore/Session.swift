import Foundation

/// Frames in, holograms out. Every call may come from any thread, at any moment. ``process(_:)``, ``warmUp()`` and
/// ``close()`` wait for a frame: not for the main thread.
///
/// ```swift
/// let session = try Session(SessionOptions(), mode: .image)
/// let hologram = try session.process(frame)
/// try hologram.withPlane(.green) { levels in print(levels.count) }
/// ```
public final class Session: Sendable {
    /// What becomes of the frames of a live stream; for one reader. Empty where a listener hears it, and in the other
    /// running modes.
    public let events: SessionEvents
    private let raw: RawSession

    /// A session that runs in `mode`. In a live stream `listener` is called on the session's own thread, one event
    /// after another, and no frame is processed while it is busy; without one, read ``events``.
    ///
    /// - Throws: ``PhasefrontError``: options that cannot be meant or planned for.
    public init(
        _ options: SessionOptions, mode: RunningMode, listener: (@Sendable (SessionEvent) -> Void)? = nil
    ) throws {
        let events = SessionEvents()
        self.events = events
        switch (mode, listener) {
        case (.live, nil):
            let listener = Listener({ events.push($0) }, end: { events.finish() })
            raw = try RawSession(options: options, mode: mode, listener: listener)
        case (_, let listener):
            events.finish()
            raw = try RawSession(options: options, mode: mode, listener: listener.map { Listener($0) })
        }
    }

    deinit {
        // Nobody is left to tell what went wrong.
        try? close()
    }

    /// The hologram of `frame`, in an image or a video session. Waits for it.
    ///
    /// - Throws: ``PhasefrontError``: a frame that is not usable or late, or a session that is a live stream, paused or
    ///   closed. None of them harms the frames that follow.
    public func process(_ frame: Frame) throws -> Hologram {
        try Hologram(
            raw.process(
                lumaOrColour: frame.colourBytes(0), chroma: frame.colourBytes(1), chromaV: frame.colourBytes(2),
                depth: frame.depth.plane.bytes, confidence: frame.confidenceBytes, info: frame.info))
    }

    /// Hands `frame` to a live stream, which copies it and goes on by itself: it never waits for a frame to be
    /// processed. Gives why the frame was dropped, if it was at once; that is an event, too.
    ///
    /// - Throws: ``PhasefrontError``: a frame that is not usable or late, or a session that is no live stream or is
    ///   closed. None of them harms the frames that follow.
    @discardableResult
    public func submit(_ frame: Frame) throws -> DropReason? {
        try raw.submit(
            lumaOrColour: frame.colourBytes(0), chroma: frame.colourBytes(1), chromaV: frame.colourBytes(2),
            depth: frame.depth.plane.bytes, confidence: frame.confidenceBytes, info: frame.info)
    }

    /// Runs an empty frame through the stages, so that the first real one is as fast as the others. Waits for it.
    public func warmUp() throws { try raw.warmUp() }

    /// Forgets all frames so far, one in the making too; the next, of any timestamp, is the first again.
    public func reset() throws { try raw.reset() }

    /// Takes no frames until ``resume()``.
    public func pause() throws { try raw.pause() }

    /// Takes frames again.
    public func resume() throws { try raw.resume() }

    /// Says how hot the device is.
    public func setThermal(_ thermal: Thermal) throws { try raw.setThermal(thermal: thermal) }

    /// Allows or forbids changes of the quality level.
    public func setQuality(_ quality: Quality) throws { try raw.setQuality(quality: quality) }

    /// What the session has done so far; of a closed one, what it did. Never waits for a frame.
    public func statistics() throws -> Statistics { try raw.statistics() }

    /// Takes no more frames and gives the memory back; holograms that were handed out stay valid. When it returns, all
    /// events have been told; called by the listener of a session, it returns at once. ``events`` ends behind the last.
    /// Closing twice does nothing.
    public func close() throws { try raw.shutDown() }
}

extension SessionOptions {
    /// The default options for `display`: holograms of its resolution by `method` and AA-DPM, or, without one, by the
    /// network that is built in, by the plane sweep where that was not trained for it. Change what is not.
    ///
    /// - Throws: ``PhasefrontError/Display(message:)`` for a display that cannot be.
    public init(display: Display = Display(), method: Method? = nil) throws {
        try self.init(target: Target.ofDisplay(display: display), method: method)
    }

    /// The same by `network`.
    public init(display: Display = Display(), network: Network) throws {
        try self.init(display: display, method: .trained(network: network))
    }

    /// The same for `target`, a display that is calibrated.
    public init(target: Target, method: Method? = nil) throws {
        self = try sessionOptions(target: target, method: method)
    }

    /// The same for `target` by `network`.
    public init(target: Target, network: Network) throws {
        try self.init(target: target, method: .trained(network: network))
    }
}

extension PhasefrontError: LocalizedError, CustomStringConvertible {
    /// The message: one line that names what is wrong and what would be right.
    public var message: String {
        switch self {
        case .Display(let message), .Frame(let message), .Timestamp(let message), .Setting(let message),
            .Network(let message), .File(let message), .Session(let message), .Internal(let message):
            message
        }
    }

    /// The message.
    public var errorDescription: String? { message }
    /// The message.
    public var description: String { message }
}
