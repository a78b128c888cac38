package org.phasefront

/** When the stages of frames begin and end. */
public object Trace {
    /**
     * Calls [handler] with each stage that begins (true) or ends (false), on the thread that computes it, where stages lie
     * within one another; null for silence. It must not call the library.
     */
    public fun send(handler: ((Stage, Boolean) -> Unit)?) {
        setStageListener(handler?.let { Handler(it) })
    }

    private class Handler(private val handle: (Stage, Boolean) -> Unit) : StageListener {
        override fun onBegin(stage: Stage) = handle(stage, true)

        override fun onEnd(stage: Stage) = handle(stage, false)
    }
}
