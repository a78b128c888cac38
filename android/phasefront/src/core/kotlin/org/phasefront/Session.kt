package org.phasefront

import com.sun.jna.Native
import java.util.ArrayDeque
import kotlinx.coroutines.channels.Channel
import kotlinx.coroutines.flow.Flow
import kotlinx.coroutines.flow.flow

/**
 * Frames in, holograms out. Every call may come from any thread, at any moment. [process], [warmUp] and [close] wait
 * for a frame: not for the main thread.
 *
 * ```kotlin
 * Session(sessionOptions(), RunningMode.IMAGE).use { session ->
 *     session.process(frame).use { hologram -> hologram.usePlane(Colour.GREEN) { println(it.remaining()) } }
 * }
 * ```
 *
 * In a live stream [listener] is called on the session's own thread, one event after another, and no frame is processed
 * while it is busy; without one, read [events].
 *
 * @throws PhasefrontException for options that cannot be meant or planned for.
 */
public class Session(
    options: SessionOptions,
    mode: RunningMode,
    listener: ((SessionEvent) -> Unit)? = null,
) : AutoCloseable {
    private val queue = EventQueue()
    private val raw: RawSession = when {
        listener != null -> RawSession(options, mode, Listener(listener))
        mode == RunningMode.LIVE -> RawSession(options, mode, Listener(queue::push, queue::finish))
        else -> RawSession(options, mode, null)
    }

    init {
        if (listener != null || mode != RunningMode.LIVE) queue.finish()
    }

    /**
     * What becomes of the frames of a live stream; for one reader. Empty where a listener hears it, and in the other
     * running modes. Two holograms wait for the reader at most: the oldest gives way to a newer one and is told as
     * dropped, as [DropReason.UNREAD], so a slow reader falls behind by little and memory stays flat.
     */
    public val events: Flow<SessionEvent> = flow {
        while (true) emit(queue.take() ?: break)
    }

    /**
     * The hologram of [frame], in an image or a video session. Waits for it.
     *
     * @throws PhasefrontException for a frame that is not usable or late, or a session that is a live stream, paused or
     * closed. None of them harms the frames that follow.
     */
    public fun process(frame: Frame): Hologram = Hologram(
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
     * Hands [frame] to a live stream, which copies it and goes on by itself: it never waits for a frame to be
     * processed. Gives why the frame was dropped, if it was at once; that is an event, too.
     *
     * @throws PhasefrontException for a frame that is not usable or late, or a session that is no live stream or is
     * closed. None of them harms the frames that follow.
     */
    public fun submit(frame: Frame): DropReason? = raw.submit(
        frame.colourBytes(0),
        frame.colourBytes(1),
        frame.colourBytes(2),
        frame.depthBytes(),
        frame.confidenceBytes(),
        frame.info(),
    )

    /** Runs an empty frame through the stages, so that the first real one is as fast as the others. Waits for it. */
    public fun warmUp(): Unit = raw.warmUp()

    /** Forgets all frames so far, one in the making too; the next, of any timestamp, is the first again. */
    public fun reset(): Unit = raw.reset()

    /** Takes no frames until [resume]. */
    public fun pause(): Unit = raw.pause()

    /** Takes frames again. */
    public fun resume(): Unit = raw.resume()

    /** Says how hot the device is. */
    public fun setThermal(thermal: Thermal): Unit = raw.setThermal(thermal)

    /** Allows or forbids changes of the quality level. */
    public fun setQuality(quality: Quality): Unit = raw.setQuality(quality)

    /** What the session has done so far; of a closed one, what it did. Never waits for a frame. */
    public fun statistics(): Statistics = raw.statistics()

    /**
     * Takes no more frames and gives the memory back; holograms that were handed out stay valid. When it returns, all
     * events have been told; called by the listener of a session, it returns at once. [events] ends behind the last.
     * Closing twice does nothing.
     */
    override fun close(): Unit = raw.shutDown()
}

/** What becomes of the frames of a live stream, in the order in which it happened. */
public sealed interface SessionEvent {
    /** A frame became a hologram, which is the receiver's to close. */
    public class Processed(public val hologram: Hologram) : SessionEvent

    /** A frame was dropped. */
    public data class Dropped(val timestampNs: Long, val reason: DropReason) : SessionEvent

    /** A frame could not be processed. The session goes on. */
    public data class Failed(val timestampNs: Long, val message: String) : SessionEvent

    /** The frames after this one are made at another quality level. */
    public data class QualityChanged(val timestampNs: Long, val change: QualityChange) : SessionEvent
}

/**
 * The default options for [display]: holograms of its resolution by [method] and AA-DPM, or, without one, by the
 * network that is built in, by the plane sweep where that was not trained for it. Change what is not with `copy`.
 *
 * @throws PhasefrontException.Display for a display that cannot be.
 */
public fun sessionOptions(display: Display = Display(), method: Method? = null): SessionOptions =
    Target.ofDisplay(display).use { sessionOptions(it, method) }

/** The same by [network]. */
public fun sessionOptions(display: Display = Display(), network: Network): SessionOptions =
    sessionOptions(display, Method.Trained(network))

/** The same for [target], a display that is calibrated, by [network]. */
public fun sessionOptions(target: Target, network: Network): SessionOptions = sessionOptions(target, Method.Trained(network))

/** Passes the library's calls on. */
private class Listener(
    private val tell: (SessionEvent) -> Unit,
    private val end: () -> Unit = {},
) : SessionListener {
    override fun onProcessed(hologram: RawHologram) = attached { tell(SessionEvent.Processed(Hologram(hologram))) }

    override fun onDropped(timestampNs: ULong, reason: DropReason) = attached {
        tell(SessionEvent.Dropped(timestampNs.toLong(), reason))
    }

    override fun onFailed(timestampNs: ULong, message: String) = attached {
        tell(SessionEvent.Failed(timestampNs.toLong(), message))
    }

    override fun onQualityChanged(timestampNs: ULong, change: QualityChange) = attached {
        tell(SessionEvent.QualityChanged(timestampNs.toLong(), change))
    }

    override fun onClosed() = attached(end)

    /** Attaching the session's thread to the virtual machine is costly; without this, JNA would do it for every call. */
    private inline fun attached(call: () -> Unit) {
        Native.detach(false)
        call()
    }
}

/** Events that wait for their reader. */
internal class EventQueue {
    private val waiting = ArrayDeque<SessionEvent>()
    private var holograms = 0
    private var finished = false
    private val changed = Channel<Unit>(Channel.CONFLATED)

    fun push(event: SessionEvent) {
        val given = synchronized(waiting) {
            if (finished) return@synchronized event
            waiting.add(event)
            if (event !is SessionEvent.Processed || ++holograms <= MOST_HOLOGRAMS) return@synchronized null
            holograms--
            val oldest = waiting.first { it is SessionEvent.Processed } as SessionEvent.Processed
            val dropped = SessionEvent.Dropped(oldest.hologram.info.timestampNs.toLong(), DropReason.UNREAD)
            val kept = waiting.map { if (it === oldest) dropped else it }
            waiting.clear()
            waiting.addAll(kept)
            oldest
        }
        (given as? SessionEvent.Processed)?.hologram?.close()
        changed.trySend(Unit)
    }

    /** The next event; null behind the last. */
    suspend fun take(): SessionEvent? {
        while (true) {
            synchronized(waiting) {
                waiting.poll()?.let {
                    if (it is SessionEvent.Processed) holograms--
                    return it
                }
                if (finished) return null
            }
            changed.receiveCatching()
        }
    }

    /** No more events come; those that wait can still be read. */
    fun finish() {
        synchronized(waiting) { finished = true }
        changed.close()
    }

    private companion object {
        const val MOST_HOLOGRAMS = 2
    }
}
