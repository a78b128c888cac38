package org.phasefront.sample

import org.phasefront.Frame

/** A source of frames. */
interface FrameSource : AutoCloseable {
    /** Calls [onFrame] with each frame on its own thread until it is closed. A frame is valid only during the call. */
    fun start(onFrame: (Frame) -> Unit, onError: (String) -> Unit)
}
