package org.phasefront.sample

import org.phasefront.CameraFrame

/** A source of frames. */
interface FrameSource : AutoCloseable {
    /** Calls [onFrame] with each frame on its own thread until it is closed. A frame is valid only during the call. */
    fun start(onFrame: (CameraFrame) -> Unit, onError: (String) -> Unit)
}
