package org.phasefront

import com.sun.jna.Native
import kotlinx.coroutines.CancellationException
import kotlinx.coroutines.Dispatchers
import kotlinx.coroutines.channels.Channel
import kotlinx.coroutines.flow.Flow
import kotlinx.coroutines.flow.flow
import kotlinx.coroutines.sync.Mutex
import kotlinx.coroutines.sync.withLock
import kotlinx.coroutines.withContext

/**
 * A session that turns frames into holograms. Every method may be called from any thread at any time.
 * [processBlocking], [warmUp] and [close] wait for a frame, so do not call them on the main thread.
 *
 * ```kotlin
 * HologramSession(sessionOptions(), RunningMode.IMAGE).use { session ->
 *     session.processBlocking(frame).use { hologram -> hologram.usePlane(Colour.GREEN) { println(it.remaining()) } }
 * }
 * ```
 *
 * A live stream calls [listener] on its own thread, one event after another, and processes no frame during the call.
 * Without a listener, read [events].
 *
 * @throws PhasefrontException if the options are invalid or cannot be planned for.
 */
public class HologramSession(
    options: SessionOptions,
    mode: RunningMode,
    listener: ((SessionEvent) -> Unit)? = null,
) : AutoCloseable {
    private val queue = EventQueue()

    /** Belongs to the frame of [process] that is computed. */
    private val turn = Mutex()
    private val raw: RawSession = when {
        listener != null -> RawSession(options, mode, Listener(listener))
        mode == RunningMode.LIVE -> RawSession(options, mode, Listener(queue::push, queue::finish))
        else -> RawSession(options, mode, null)
    }

    init {
        if (listener != null || mode != RunningMode.LIVE) queue.finish()
    }

    /**
     * The events of a live stream, for one reader. Empty if the session has a listener, and in the other running modes.
     * At most two holograms wait in the queue. A newer one replaces the oldest, which is reported as dropped with
     * [DropReason.UNREAD]. At most 64 events wait; a newer one replaces the oldest that is no hologram. So memory stays
     * constant if nobody reads, and [statistics] counts every frame.
     */
    public val events: Flow<SessionEvent> = flow {
        while (true) emit(queue.take() ?: break)
    }

    /**
     * Returns the hologram of [frame], in an image or a video session, without blocking the caller's thread. Frames are
     * computed one after another. The frame's memory must stay valid until the call ends. A call that is cancelled throws
     * `CancellationException`: at once while its frame waits for an earlier one, which is then not computed, otherwise
     * when its frame is done.
     *
     * @throws PhasefrontException if the frame is unusable or late, or if the session is a live stream, paused or
     * closed. Later frames are not affected.
     */
    public suspend fun process(frame: CameraFrame): Hologram = turn.withLock {
        var made: Hologram? = null
        try {
            withContext(Dispatchers.Default) { processBlocking(frame).also { made = it } }
        } catch (cancelled: CancellationException) {
            // Nobody receives the hologram.
            made?.close()
            throw cancelled
        }
    }

    /**
     * Returns the hologram of [frame], in an image or a video session. Blocks until it is done.
     *
     * @throws PhasefrontException if the frame is unusable or late, or if the session is a live stream, paused or
     * closed. Later frames are not affected.
     */
    public fun processBlocking(frame: CameraFrame): Hologram = Hologram(
        raw.process(
            frame.colourBytes(0),
            frame.colourBytes(1),
            frame.colourBytes(2),
            frame.depthBytes(),
            frame.confidenceBytes(),
            frame.info(),
        ),
    )

    /**
     * Submits [frame] to a live stream, which copies it. Never waits for a frame to be processed. Returns the reason if
     * the frame was dropped at once; that is also an event.
     *
     * @throws PhasefrontException if the frame is unusable or late, or if the session is not a live stream or is
     * closed. Later frames are not affected.
     */
    public fun submit(frame: CameraFrame): DropReason? = raw.submit(
        frame.colourBytes(0),
        frame.colourBytes(1),
        frame.colourBytes(2),
        frame.depthBytes(),
        frame.confidenceBytes(),
        frame.info(),
    )

    /** Processes an empty frame, so that the first real frame is as fast as the later ones. Blocks until it is done. */
    public fun warmUp(): Unit = raw.warmUp()

    /** Discards all earlier frames, including one in progress. The next frame may have any timestamp. */
    public fun reset(): Unit = raw.reset()

    /** Stops accepting frames until [resume]. */
    public fun pause(): Unit = raw.pause()

    /** Accepts frames again. */
    public fun resume(): Unit = raw.resume()

    /** Reports how hot the device is. */
    public fun setThermal(thermal: Thermal): Unit = raw.setThermal(thermal)

    /** Sets whether the session may change its quality level. */
    public fun setQuality(quality: Quality): Unit = raw.setQuality(quality)

    /** The session's statistics, also after it is closed. Never blocks on a frame. */
    public val statistics: Statistics get() = raw.statistics()

    /**
     * Stops accepting frames and frees the memory. Returned holograms stay valid. Waits until all events are delivered,
     * unless a session's listener calls it; then it returns at once. [events] ends after the last event. Closing twice
     * does nothing.
     */
    override fun close(): Unit = raw.shutDown()
}

/** An event of a live stream. Events come in the order in which they happen. */
public sealed interface SessionEvent {
    /** A frame became a hologram. The receiver must close it. */
    public class Processed(public val hologram: Hologram) : SessionEvent

    /** A frame was dropped. */
    public data class Dropped(val timestampNs: Long, val reason: DropReason) : SessionEvent

    /** A frame could not be processed. The session continues. */
    public data class Failed(val timestampNs: Long, val message: String) : SessionEvent

    /** The session processes the frames after this one at another quality level. */
    public data class QualityChanged(val timestampNs: Long, val change: QualityChange) : SessionEvent
}

/**
 * Returns the default options for [display]: holograms at its resolution by [method] and AA-DPM. Without a method, the
 * session chooses between the built-in network and the plane sweep by each frame's depth. Change fields with `copy`.
 *
 * @throws PhasefrontException.Display for an impossible display.
 */
public fun sessionOptions(display: HologramDisplay = HologramDisplay(), method: HologramMethod? = null): SessionOptions =
    HologramTarget.ofDisplay(display).use { sessionOptions(it, method) }

/**
 * Returns options for a live session on a phone: the defaults for [display] with a target rate and three quality levels,
 * at the display's resolution and at three quarters and half of it along each side. The session changes the level as the
 * frame times and [HologramSession.setThermal] require.
 *
 * @throws PhasefrontException.Display for an impossible display.
 */
public fun phoneOptions(
    display: HologramDisplay = HologramDisplay(),
    rateHz: Double = 30.0,
    method: HologramMethod? = null,
): SessionOptions = HologramTarget.ofDisplay(display).use { phoneOptions(it, rateHz, method) }

/** Returns the default options for [display] and [network]. */
public fun sessionOptions(display: HologramDisplay = HologramDisplay(), network: HologramNetwork): SessionOptions =
    sessionOptions(display, HologramMethod.Trained(network))

/** Returns the default options for [target], a calibrated display, and [network]. */
public fun sessionOptions(target: HologramTarget, network: HologramNetwork): SessionOptions = sessionOptions(target, HologramMethod.Trained(network))

/** Forwards the library's callbacks. */
private class Listener(
    private val tell: (SessionEvent) -> Unit,
    private val end: () -> Unit = {},
) : SessionListener {
    override fun onProcessed(hologram: RawHologram) = attached { tell(SessionEvent.Processed(Hologram(hologram))) }

    override fun onDropped(timestampNs: Long, reason: DropReason) = attached {
        tell(SessionEvent.Dropped(timestampNs, reason))
    }

    override fun onFailed(timestampNs: Long, message: String) = attached {
        tell(SessionEvent.Failed(timestampNs, message))
    }

    override fun onQualityChanged(timestampNs: Long, change: QualityChange) = attached {
        tell(SessionEvent.QualityChanged(timestampNs, change))
    }

    override fun onClosed() = attached(end)

    /**
     * Keeps the session's thread attached to the virtual machine. Otherwise JNA attaches it, at a cost, for every call.
     */
    private inline fun attached(call: () -> Unit) {
        Native.detach(false)
        call()
    }
}

/** A queue of events for one reader. Its length is bounded, and with it the memory and the time of a call. */
internal class EventQueue {
    private val waiting = ArrayDeque<SessionEvent>()
    private var holograms = 0
    private var finished = false
    private val changed = Channel<Unit>(Channel.CONFLATED)

    fun push(event: SessionEvent) {
        val unread = synchronized(waiting) { if (finished) event.hologram else add(event) }
        unread?.close()
        changed.trySend(Unit)
    }

    /** Adds [event] and returns the hologram that had to go, if any. */
    private fun add(event: SessionEvent): Hologram? {
        waiting.addLast(event)
        if (waiting.size > MOST_EVENTS) waiting.removeAt(waiting.indexOfFirst { it !is SessionEvent.Processed })
        if (event !is SessionEvent.Processed || ++holograms <= MOST_HOLOGRAMS) return null
        holograms--
        val oldest = waiting.indexOfFirst { it is SessionEvent.Processed }
        val unread = waiting[oldest].hologram
        unread?.let { waiting[oldest] = SessionEvent.Dropped(it.info.timestampNs, DropReason.UNREAD) }
        return unread
    }

    private val SessionEvent.hologram: Hologram? get() = (this as? SessionEvent.Processed)?.hologram

    /** Waits for the next event. Returns null after the last one. */
    suspend fun take(): SessionEvent? {
        while (true) {
            synchronized(waiting) {
                waiting.removeFirstOrNull()?.let {
                    if (it is SessionEvent.Processed) holograms--
                    return it
                }
                if (finished) return null
            }
            changed.receiveCatching()
        }
    }

    /** Ends the events. Those in the queue can still be read. */
    fun finish() {
        synchronized(waiting) { finished = true }
        changed.close()
    }

    private companion object {
        const val MOST_HOLOGRAMS = 2
        const val MOST_EVENTS = 64
    }
}
