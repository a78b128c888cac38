package org.phasefront

import kotlin.test.Test

/**
 * Measures the cost of a call to the library: a camera frame in, three planes of 1080p out. `tests/border` runs it for
 * many frames.
 */
class BorderTest {
    @Test
    fun cost() {
        val colour = direct(1920 * 1440 * 3 / 2)
        for (i in 0 until colour.capacity()) colour.put((i * 7 / 5).toByte())
        colour.flip()
        val chroma = colour.duplicate().position(1920 * 1440).slice()
        val frame = CameraFrame(
            0,
            ColourImage(ColourFormat.NV12, 1920, 1440, listOf(ImagePlane(colour, 1920, 1), ImagePlane(chroma, 1920, 2))),
            DepthImage(
                DepthFormat.METRES_F32,
                256,
                192,
                direct(4 * 256 * 192).apply { while (hasRemaining()) putFloat(0.5f + position() * 1e-6f) }.flip(),
            ),
        )
        HologramSession(sessionOptions(network = network), RunningMode.IMAGE).use { session ->
            val levels = ByteArray(1920 * 1080)
            val added = MutableList((System.getenv("PHASEFRONT_BORDER") ?: "1").toInt() + 5) {
                val start = System.nanoTime()
                val inside = session.processBlocking(frame).use { hologram ->
                    for (plane in Colour.entries) hologram.usePlane(plane) { bytes -> bytes.get(levels, 0, 1) }
                    hologram.info.times.totalMs
                }
                val all = (System.nanoTime() - start) / 1e6
                (all - inside) to inside
            }.drop(5)
            val (border, inside) = added.map { it.first }.sorted()[added.size / 2] to added.map { it.second }.sorted()[added.size / 2]
            println("Kotlin: %.3f ms beside the %.1f ms of the stages: %.2f %%".format(border, inside, 100 * border / inside))
        }
    }
}
