package org.phasefront

import java.nio.ByteBuffer
import kotlin.math.abs
import kotlin.test.Test
import kotlin.test.assertContains
import kotlin.test.assertEquals
import kotlin.test.assertFailsWith
import kotlin.test.assertTrue

/** A phone whose camera's image is 4:3 and whose texture shows its middle in 16:9, as many do. */
class ArCoreTest {
    private val image = ArIntrinsics(floatArrayOf(500f, 500f), floatArrayOf(320f, 240f), intArrayOf(640, 480))
    private val texture = ArIntrinsics(floatArrayOf(1500f, 1500f), floatArrayOf(960f, 540f), intArrayOf(1920, 1080))

    private fun grey(level: (Int, Int) -> Int): ColourImage {
        val bytes = ByteBuffer.allocateDirect(4 * 640 * 480)
        for (y in 0 until 480) for (x in 0 until 640) level(x, y).toByte().let { bytes.put(it).put(it).put(it).put(0) }
        return ColourImage(ColourFormat.RGBA, 640, 480, bytes.flip())
    }

    /** Depth of 160×90: a wall at 1 m, and at 0.5 m what [isNear] says of a pixel of the camera's image. */
    private fun depth(isNear: (Double, Double) -> Boolean): DepthImage {
        val bytes = direct(2 * 160 * 90)
        for (v in 0 until 90) {
            for (u in 0 until 160) {
                // By the pinhole model, from the texture's pixel to the ray and to the image's pixel.
                val x = ((u + 0.5) * 12 - 960) / 1500 * 500 + 320
                val y = ((v + 0.5) * 12 - 540) / 1500 * 500 + 240
                bytes.putShort(if (isNear(x, y)) 500 else 1000)
            }
        }
        return DepthImage(DepthFormat.MILLIMETRES_U16, 160, 90, bytes.flip())
    }

    @Test
    fun intrinsicsFollowTheImagesSize() {
        val cameras = arCameras(image, grey { _, _ -> 0 }, texture, depth { _, _ -> false })
        assertEquals(Intrinsics(500.0, 500.0, 319.5, 239.5), cameras.colour)
        assertEquals(Intrinsics(125.0, 125.0, 79.5, 44.5), cameras.depth)
        assertEquals(null, cameras.pose)
    }

    @Test
    fun edgesOfDepthLieOnThoseOfColour() {
        // A near square at the right of the image.
        val isNear = { x: Double, y: Double -> x in 440.0..560.0 && y in 180.0..300.0 }
        val colour = grey { x, y -> if (isNear(x + 0.5, y + 0.5)) 220 else 60 }
        val depth = depth(isNear)
        val options = sessionOptions(HologramDisplay(width = 640, height = 480), HologramMethod.Sweep)
        fun z(cameras: Cameras?): (Int, Int) -> Double {
            val frame = CameraFrame(0, colour, depth, cameras = cameras)
            val hologram = HologramSession(options, RunningMode.IMAGE).use { it.processBlocking(frame) }
            return { x, y -> hologram.zAt((x + 0.5) / 640, (y + 0.5) / 480) }
        }
        val z = z(arCameras(image, colour, texture, depth))
        val edges = listOf(446 to 240, 554 to 240, 500 to 186, 500 to 294)
        val outside = listOf(434 to 240, 566 to 240, 500 to 174, 500 to 306)
        val near = z(500, 240)
        val far = z(100, 240)
        assertTrue(near - far > 1, "$near mm and $far mm")
        for ((x, y) in edges) assertTrue(abs(z(x, y) - near) < 0.5, "($x, $y) is at ${z(x, y)} mm")
        for ((x, y) in outside) assertTrue(abs(z(x, y) - far) < 0.5, "($x, $y) is at ${z(x, y)} mm")
        val refused = assertFailsWith<PhasefrontException.Frame> { z(null) }
        assertContains(refused.message.orEmpty(), "aspect ratios differ")
    }
}
