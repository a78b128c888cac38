package org.phasefront.sample

import org.phasefront.Frame

/** Where frames come from. */
interface FrameSource : AutoCloseable {
    /** Calls [onFrame] with frame after frame, on a thread of its own, until it is closed. A frame is valid in the call only. */
    fun start(onFrame: (Frame) -> Unit, onError: (String) -> Unit)
}
