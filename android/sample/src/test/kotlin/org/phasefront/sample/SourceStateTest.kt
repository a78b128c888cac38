package org.phasefront.sample

import kotlin.test.Test
import kotlin.test.assertEquals

/** iOS's sample has the same table, in ios/stand-ins/Day.swift. */
class SourceStateTest {
    private val states = listOf(
        SourceState.Stopped,
        SourceState.WaitingForPermission("x"),
        SourceState.Starting,
        SourceState.Running("a"),
        SourceState.Interrupted("a"),
        SourceState.Failed("a"),
    )

    /** The state behind an event in each of [states], by its letter; a dot stands for no change. */
    private fun check(event: SourceEvent, letters: String) {
        val told = states.map { state ->
            when (val next = state.after(event)) {
                state -> '.'
                else -> next.toString().first()
            }
        }
        assertEquals(letters, told.joinToString(""), "$event")
    }

    @Test
    fun eventsLeadFromStateToState() {
        check(SourceEvent.Asked("y"), "WWWWWW")
        check(SourceEvent.Started, "SS.SSS")
        check(SourceEvent.Stopped, ".SSSSS")
        check(SourceEvent.Frame("b"), "..RRR.")
        check(SourceEvent.Interrupted("b"), "..III.")
        check(SourceEvent.Failed("b"), "..FFF.")
    }
}
