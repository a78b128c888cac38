package org.phasefront.sample

import android.content.Context
import android.os.Handler
import android.os.Looper
import java.util.concurrent.Executors
import org.phasefront.CameraFrame
import org.phasefront.Hologram
import org.phasefront.HologramDisplay
import org.phasefront.HologramSession
import org.phasefront.PhasefrontException
import org.phasefront.RunningMode
import org.phasefront.SessionEvent
import org.phasefront.followThermalState
import org.phasefront.phoneOptions

/**
 * A live session and the source of its frames, from [start] to [stop]. Both are called on the main thread and return at
 * once: planning and closing sessions and opening cameras take long, so another thread does it.
 */
class Holograms(private val context: Context, private val display: HologramDisplay, private val screen: Screen) : AutoCloseable {
    interface Screen {
        /** Shows the state of the source. Called on the main thread. */
        fun show(state: SourceState)

        /** Shows a hologram, which it must close, and what is [told] of the session. Called on the session's thread. */
        fun show(hologram: Hologram, told: String)
    }

    private val main = Handler(Looper.getMainLooper())

    /** Opens and closes, one after another. */
    private val work = Executors.newSingleThreadExecutor()
    private var current: Run? = null

    /** The state of the source, which changes on the main thread. */
    @Volatile
    var state: SourceState = SourceState.Stopped
        private set

    /** Changes the state. */
    fun tell(event: SourceEvent) {
        val next = state.after(event)
        if (next == state) return
        state = next
        screen.show(next)
    }

    val isRunning: Boolean get() = current != null

    /** Starts a session with the frames of [source]. */
    fun start(source: () -> FrameSource) {
        tell(SourceEvent.Started)
        current = Run(source).also { work.execute(it::begin) }
    }

    /** Stops the session and releases the camera. [afterwards] runs on the main thread, behind the last hologram. */
    fun stop(afterwards: () -> Unit) {
        tell(SourceEvent.Stopped)
        val run = current
        current = null
        work.execute {
            run?.end()
            main.post(afterwards)
        }
    }

    override fun close(): Unit = work.shutdown()

    private inner class Run(private val open: () -> FrameSource) : FrameSource.Listener {
        @Volatile private var session: HologramSession? = null
        private var source: FrameSource? = null
        private var heat: AutoCloseable? = null

        /** Frames that could not become holograms, and the reason of the last one. */
        @Volatile private var failures = 0
        @Volatile private var lastFailure = ""

        fun begin() {
            try {
                val opened = HologramSession(phoneOptions(display), RunningMode.LIVE, ::heard)
                session = opened
                heat = opened.followThermalState(context)
            } catch (refused: PhasefrontException) {
                return onFailed(refused.message.orEmpty())
            }
            source = open().also { it.start(this) }
        }

        fun end() {
            source?.close()
            heat?.close()
            session?.close()
        }

        override fun onFrame(frame: CameraFrame, source: String) {
            try {
                session?.submit(frame)
            } catch (refused: PhasefrontException) {
                fail(refused.message.orEmpty())
            }
            post(SourceEvent.Frame(source))
        }

        override fun onInterrupted(why: String) = post(SourceEvent.Interrupted(why))

        override fun onFailed(why: String) = post(SourceEvent.Failed(why))

        /** Changes the state on the main thread, unless this run is over by then. Most events change nothing. */
        private fun post(event: SourceEvent) {
            if (state.after(event) != state) main.post { if (current === this) tell(event) }
        }

        /** Handles an event on the session's thread. */
        private fun heard(event: SessionEvent) {
            when (event) {
                is SessionEvent.Processed -> screen.show(event.hologram, describe())
                is SessionEvent.Failed -> fail(event.message)
                is SessionEvent.Dropped, is SessionEvent.QualityChanged -> Unit
            }
        }

        private fun fail(why: String) {
            failures++
            lastFailure = why
        }

        private fun describe(): String {
            val of = session?.statistics ?: return ""
            val told = "%.1f holograms a second, %d dropped of %d\n%s: %.1f ms, of which the method takes %.1f".format(
                of.rateHz,
                of.dropped.total,
                of.submitted,
                of.backend,
                of.times.totalMs,
                of.times.methodMs,
            )
            return if (failures == 0) told else "$told\n$failures frames failed, the last one: $lastFailure"
        }
    }
}
