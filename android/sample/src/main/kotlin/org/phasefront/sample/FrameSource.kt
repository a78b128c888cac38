package org.phasefront.sample

import org.phasefront.CameraFrame

/** A source of frames. */
interface FrameSource : AutoCloseable {
    /** Calls [listener] on the source's own thread until it is closed. */
    fun start(listener: Listener)

    /** Returns when the camera is released and [listener][start] is not called again. May take a while. */
    override fun close()

    interface Listener {
        /** Takes a frame of a source that is called [source] on the screen. It is valid only during the call. */
        fun onFrame(frame: CameraFrame, source: String)

        /** Hears that no frames come for now, and why. */
        fun onInterrupted(why: String)

        /** Hears that no frames will come, and why. */
        fun onFailed(why: String)
    }
}
