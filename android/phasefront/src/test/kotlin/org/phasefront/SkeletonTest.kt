package org.phasefront

import java.nio.ByteBuffer
import kotlin.test.Test
import kotlin.test.assertEquals
import kotlin.test.assertFailsWith

class SkeletonTest {
    @Test
    fun version() {
        assertEquals("0.1.0", org.phasefront.version())
        val b = ByteBuffer.allocateDirect(3).put(1).put(2).put(250.toByte()).flip()
        assertEquals(253UL, sum(b, false))
        println(assertFailsWith<PhasefrontException> { sum(b, true) })
    }
}
