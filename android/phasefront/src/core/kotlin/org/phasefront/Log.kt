package org.phasefront

/** What the library has to say while it works. */
public object Log {
    /** Sends messages of [level] and above to [handler], which is called on any thread; null for silence. */
    public fun send(level: LogLevel, handler: ((LogLevel, String) -> Unit)?) {
        setLogListener(level, handler?.let { Handler(it) })
    }

    private class Handler(private val handle: (LogLevel, String) -> Unit) : LogListener {
        override fun onLog(level: LogLevel, message: String) = handle(level, message)
    }
}
