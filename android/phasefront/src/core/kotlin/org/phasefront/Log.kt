package org.phasefront

/** The log messages of the library. */
public object HologramLog {
    /** Sends messages of [level] and above to [handler], which may be called on any thread. null turns them off. */
    public fun send(level: LogLevel, handler: ((LogLevel, String) -> Unit)?) {
        setLogListener(level, handler?.let { Handler(it) })
    }

    private class Handler(private val handle: (LogLevel, String) -> Unit) : LogListener {
        override fun onLog(level: LogLevel, message: String) = handle(level, message)
    }
}
