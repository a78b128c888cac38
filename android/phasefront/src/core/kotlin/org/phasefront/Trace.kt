package org.phasefront

/** The begin and end of each stage of a frame. */
public object HologramTrace {
    /**
     * Calls [handler] with each stage that begins (true) or ends (false), on the thread that computes it. Stages on a
     * thread are nested. null turns the calls off. The handler must not call the library.
     */
    public fun send(handler: ((Stage, Boolean) -> Unit)?) {
        setStageListener(handler?.let { Handler(it) })
    }

    private class Handler(private val handle: (Stage, Boolean) -> Unit) : StageListener {
        override fun onBegin(stage: Stage) = handle(stage, true)

        override fun onEnd(stage: Stage) = handle(stage, false)
    }
}
