package org.phasefront

import com.sun.jna.NativeLibrary
import com.sun.management.ThreadMXBean
import java.lang.management.ManagementFactory
import java.util.concurrent.Semaphore
import kotlin.test.Test
import kotlin.test.assertTrue

/**
 * Tests that a frame allocates nothing of an image's size, neither on Java's heap nor elsewhere. `android/test` loads
 * `tests/counting.c`, which counts what the process allocates: direct buffers and the library's memory.
 */
class AllocationTest {
    private val width = 640
    private val height = 480

    /** The bytes of the smallest image, the levels of one colour. */
    private val plane = width * height

    private val threads = ManagementFactory.getThreadMXBean() as ThreadMXBean
    private val counter = NativeLibrary.getProcess().getFunction("allocated_bytes")

    private fun heap(): Long = threads.getThreadAllocatedBytes(Thread.currentThread().id)

    private fun native(): Long = counter.invokeLong(emptyArray())

    /**
     * Prints the bytes that [call] allocates, on the heap by this thread and elsewhere by all threads, and checks them.
     * The first calls may grow memory that later ones use again. The call with the fewest bytes counts: the virtual
     * machine compiles meanwhile, and allocates megabytes for it, on a busy computer during many calls.
     */
    private fun count(what: String, call: () -> Unit) {
        repeat(3) { call() }
        var (heap, native) = Long.MAX_VALUE to Long.MAX_VALUE
        for (calls in 1..200) {
            val (heapBefore, nativeBefore) = heap() to native()
            call()
            heap = minOf(heap, heap() - heapBefore)
            native = minOf(native, native() - nativeBefore)
            if (calls >= 8 && heap < plane && native < plane) break
        }
        println("$what: $heap bytes on the heap, $native elsewhere")
        assertTrue(heap < plane && native < plane, "$what allocates $heap bytes on the heap, $native elsewhere")
    }

    @Test
    fun aFrameAllocatesNoImage() {
        val before = native()
        val colour = direct(4 * plane)
        assertTrue(native() - before >= 4 * plane, "allocations are counted")
        for (i in 0 until colour.capacity()) colour.put(i, (i * 37 % 251).toByte())
        val depth = direct(plane)
        for (i in 0 until plane) depth.put(i, (i / 700).toByte())
        var time = 0L
        fun frame() = CameraFrame(
            33_000_000L * ++time,
            ColourImage(ColourFormat.RGBA, width, height, colour),
            DepthImage(DepthFormat.NORMALIZED_U8, width, height, depth),
        )

        Modulator.fromToml("width = $width\nheight = $height").use { modulator ->
            val options = sessionOptions(modulator.target, HologramMethod.Sweep)
            HologramSession(options, RunningMode.VIDEO).use { session ->
                count("processBlocking, usePlane") {
                    session.processBlocking(frame()).use { hologram -> hologram.usePlane(Colour.BLUE) { it.get(0) } }
                }
                session.processBlocking(frame()).use { hologram -> views(hologram, modulator) }
            }
            val made = Semaphore(0)
            val live = HologramSession(options, RunningMode.LIVE) { event ->
                if (event is SessionEvent.Processed) {
                    event.hologram.close()
                    made.release()
                }
            }
            live.use {
                count("submit, until it is a hologram") {
                    it.submit(frame())
                    made.acquire()
                }
            }
        }
    }

    private fun views(hologram: Hologram, modulator: Modulator) {
        val pixels = direct(4 * plane)
        count("writeOutput") { hologram.writeOutput(Placement(ModulatorLayout.RGBA), pixels) }
        count("writePreview") { hologram.writePreview(0.0, width, height, pixels) }
        count("writeOutput of a modulator") { modulator.writeOutput(hologram, pixels) }
        count("writePixels of a modulator") { modulator.writePixels(hologram, pixels) }
    }
}
