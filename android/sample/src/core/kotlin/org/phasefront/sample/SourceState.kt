package org.phasefront.sample

/** What a source of frames is doing, with a [text] for the screen. iOS's sample has the same states. */
sealed interface SourceState {
    val text: String

    data object Stopped : SourceState {
        override val text: String get() = "Stopped"
    }

    /** The system asks the user whether the app may do [what]. */
    data class WaitingForPermission(val what: String) : SourceState {
        override val text: String get() = "Waiting for your permission to $what"
    }

    data object Starting : SourceState {
        override val text: String get() = "Starting…"
    }

    /** Frames come from [what]. */
    data class Running(val what: String) : SourceState {
        override val text: String get() = what
    }

    /** No frames come now. They will by themselves once the reason, [why], is gone. */
    data class Interrupted(val why: String) : SourceState {
        override val text: String get() = "Interrupted: $why"
    }

    /** No frames come before somebody tries again. */
    data class Failed(val why: String) : SourceState {
        override val text: String get() = "Failed: $why"
    }
}

/** What happens to a source of frames. */
sealed interface SourceEvent {
    /** The user is asked whether the app may do [what]. */
    data class Asked(val what: String) : SourceEvent

    data object Started : SourceEvent

    /** A frame came from [what]. */
    data class Frame(val what: String) : SourceEvent

    data class Interrupted(val why: String) : SourceEvent

    data class Failed(val why: String) : SourceEvent

    data object Stopped : SourceEvent
}

/** Returns the state behind [event]. What a source says after it was stopped or has failed changes nothing. */
fun SourceState.after(event: SourceEvent): SourceState {
    val isActive = this is SourceState.Starting || this is SourceState.Running || this is SourceState.Interrupted
    return when (event) {
        is SourceEvent.Asked -> SourceState.WaitingForPermission(event.what)
        SourceEvent.Started -> SourceState.Starting
        SourceEvent.Stopped -> SourceState.Stopped
        is SourceEvent.Frame -> if (isActive) SourceState.Running(event.what) else this
        is SourceEvent.Interrupted -> if (isActive) SourceState.Interrupted(event.why) else this
        is SourceEvent.Failed -> if (isActive) SourceState.Failed(event.why) else this
    }
}
