import Foundation

/// A session that turns frames into holograms. Every method may be called from any thread at any time.
/// `process`, ``warmUp()`` and ``close()`` wait for a frame, so do not call them on the main thread.
///
/// ```swift
/// let session = try HologramSession(SessionOptions(), mode: .image)
/// let hologram = try session.process(frame)
/// try hologram.withPlane(.green) { levels in print(levels.count) }
/// ```
public final class HologramSession: Sendable {
    /// The events of a live stream, for one reader. Empty if the session has a listener, and in the other running
    /// modes.
    public let events: SessionEvents
    private let raw: RawSession
    /// The frames of asynchronous calls.
    private let queue = DispatchQueue(label: "org.phasefront.session", qos: .userInitiated)

    /// Creates a session that runs in `mode`. A live stream calls `listener` on its own thread, one event after
    /// another, and processes no frame during the call. Without a listener, read ``events``.
    ///
    /// - Throws: ``PhasefrontError`` if the options are invalid or cannot be planned for.
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
        // Closing waits for the last events, which a thread that releases the session must not.
        let raw = raw
        DispatchQueue.global().async { raw.shutDown() }
    }

    /// Returns the hologram of `frame`, in an image or a video session. Blocks until it is done.
    ///
    /// - Throws: ``PhasefrontError`` if the frame is unusable or late, or if the session is a live stream, paused or
    ///   closed. Later frames are not affected.
    public func process(_ frame: CameraFrame) throws -> Hologram {
        try Hologram(
            raw.process(
                lumaOrColour: frame.colourBytes(0), chroma: frame.colourBytes(1), chromaV: frame.colourBytes(2),
                depth: frame.depthBytes, confidence: frame.confidenceBytes, info: frame.info))
    }

    /// Returns the hologram of `frame`, in an image or a video session, without blocking the caller's thread. Frames are
    /// computed one after another. The frame's memory must stay valid until the call ends. A call whose task is cancelled
    /// throws `CancellationError`: its frame is not computed unless that has begun, and then it is finished first.
    ///
    /// - Throws: ``PhasefrontError`` if the frame is unusable or late, or if the session is a live stream, paused or closed.
    public func process(_ frame: CameraFrame) async throws -> Hologram {
        let isCancelled = Locked(false)
        let hologram = try await withTaskCancellationHandler {
            try await withCheckedThrowingContinuation { continuation in
                queue.async {
                    continuation.resume(
                        with: Result {
                            if isCancelled.withLock({ $0 }) { throw CancellationError() }
                            return try self.process(frame)
                        })
                }
            }
        } onCancel: {
            isCancelled.withLock { $0 = true }
        }
        try Task.checkCancellation()
        return hologram
    }

    /// Submits `frame` to a live stream, which copies it. Never waits for a frame to be processed. Returns the reason
    /// if the frame was dropped at once; that is also an event.
    ///
    /// - Throws: ``PhasefrontError`` if the frame is unusable or late, or if the session is not a live stream or is
    ///   closed. Later frames are not affected.
    @discardableResult
    public func submit(_ frame: CameraFrame) throws -> DropReason? {
        try raw.submit(
            lumaOrColour: frame.colourBytes(0), chroma: frame.colourBytes(1), chromaV: frame.colourBytes(2),
            depth: frame.depthBytes, confidence: frame.confidenceBytes, info: frame.info)
    }

    /// Processes an empty frame, so that the first real frame is as fast as the later ones. Blocks until it is done.
    public func warmUp() throws { try raw.warmUp() }

    /// Discards all earlier frames, including one in progress. The next frame may have any timestamp.
    public func reset() throws { try raw.reset() }

    /// Stops accepting frames until ``resume()``.
    public func pause() throws { try raw.pause() }

    /// Accepts frames again.
    public func resume() throws { try raw.resume() }

    /// Reports how hot the device is.
    public func setThermal(_ thermal: Thermal) throws { try raw.setThermal(thermal: thermal) }

    /// Sets whether the session may change its quality level.
    public func setQuality(_ quality: Quality) throws { try raw.setQuality(quality: quality) }

    /// The session's statistics, also after it is closed. Never blocks on a frame.
    public var statistics: Statistics { raw.statistics() }

    /// Stops accepting frames and frees the memory. Returned holograms stay valid. Waits until all events are
    /// delivered, unless a session's listener calls it; then it returns at once. ``events`` ends after the last event.
    /// Closing twice does nothing.
    public func close() { raw.shutDown() }
}

extension SessionOptions {
    /// Creates the default options for `display`: holograms at its resolution by `method` and AA-DPM. Without a method,
    /// the session chooses between the built-in network and the plane sweep by each frame's depth.
    ///
    /// - Throws: ``PhasefrontError/display(message:)`` for an impossible display.
    public init(display: HologramDisplay = HologramDisplay(), method: HologramMethod? = nil) throws {
        try self.init(target: HologramTarget.ofDisplay(display: display), method: method)
    }

    /// Creates the default options for `display` and `network`.
    public init(display: HologramDisplay = HologramDisplay(), network: HologramNetwork) throws {
        try self.init(display: display, method: .trained(network: network))
    }

    /// Returns options for a live session on a phone: the defaults for `display` with a target rate and three quality
    /// levels, at the display's resolution and at three quarters and half of it along each side. The session changes the
    /// level as the frame times and ``HologramSession/setThermal(_:)`` require.
    ///
    /// - Throws: ``PhasefrontError/display(message:)`` for an impossible display.
    public static func phone(
        display: HologramDisplay = HologramDisplay(), rateHz: Double = 30, method: HologramMethod? = nil
    ) throws -> SessionOptions {
        try phoneOptions(target: HologramTarget.ofDisplay(display: display), rateHz: rateHz, method: method)
    }

    /// Creates the default options for `target`, a calibrated display.
    public init(target: HologramTarget, method: HologramMethod? = nil) throws {
        self = try sessionOptions(target: target, method: method)
    }

    /// Creates the default options for `target` and `network`.
    public init(target: HologramTarget, network: HologramNetwork) throws {
        try self.init(target: target, method: .trained(network: network))
    }
}

extension PhasefrontError: LocalizedError, CustomStringConvertible {
    /// The error message: one line that names the problem and the remedy.
    public var message: String {
        switch self {
        case .display(let message), .frame(let message), .timestamp(let message), .setting(let message),
            .network(let message), .file(let message), .session(let message), .internal(let message):
            message
        }
    }

    /// The error message, as ``message``.
    public var errorDescription: String? { message }
    /// The error message, as ``message``.
    public var description: String { message }
}
