import java.awt.image.BufferedImage
import java.io.File
import java.nio.ByteBuffer
import java.nio.ByteOrder
import javax.imageio.ImageIO
import kotlin.math.sqrt
import kotlin.test.Test
import kotlin.test.assertContains
import kotlin.test.assertTrue
import org.phasefront.CameraFrame
import org.phasefront.ColourFormat
import org.phasefront.ColourImage
import org.phasefront.DepthFormat
import org.phasefront.DepthImage
import org.phasefront.HologramDisplay
import org.phasefront.HologramSession
import org.phasefront.ImagePlane
import org.phasefront.RunningMode
import org.phasefront.sessionOptions
import org.phasefront.thirdPartyNotices

/** Makes the hologram of the sample scene with the artefact from the repository. */
class SampleTest {
    private fun image(name: String): BufferedImage = ImageIO.read(File(System.getProperty("samples"), name))

    /** Calls [put] with each number of [image], row by row, and returns the filled buffer of [size] bytes. */
    private fun direct(image: BufferedImage, size: Int, put: ByteBuffer.(Int) -> Unit): ByteBuffer {
        val bytes = ByteBuffer.allocateDirect(size).order(ByteOrder.nativeOrder())
        for (y in 0 until image.height) {
            for (x in 0 until image.width) {
                repeat(image.raster.numBands) { band -> bytes.put(image.raster.getSample(x, y, band)) }
            }
        }
        return bytes.flip()
    }

    @Test
    fun theSampleBecomesAHologramThatShowsIt() {
        val (colour, depth) = image("scene_rgb.jpg") to image("scene_depth.png")
        val rgb = direct(colour, 3 * colour.width * colour.height) { put(it.toByte()) }
        val d = direct(depth, 2 * depth.width * depth.height) { putShort(it.toShort()) }
        val frame = CameraFrame(
            0,
            ColourImage(ColourFormat.RGB, colour.width, colour.height, rgb),
            DepthImage(DepthFormat.NORMALIZED_U16, depth.width, depth.height, ImagePlane(d, 2 * depth.width, 2)),
        )
        // The sides of the image are twelve times those of the view.
        val (width, height) = 160 to 90
        val options = sessionOptions(HologramDisplay(width = 480, height = 270))
        HologramSession(options, RunningMode.IMAGE).use { session ->
            session.processBlocking(frame).use { hologram ->
                val seen = ByteBuffer.allocateDirect(4 * width * height)
                hologram.writePreview(hologram.zAt(0.5, 0.5), width, height, seen)
                val shown = List(width * height) { seen.get(4 * it + 1).toUByte().toDouble() }
                val wanted = List(width * height) {
                    val (x, y) = it % width * 12 to it / width * 12
                    colour.raster.getSamples(x, y, 12, 12, 1, null as IntArray?).average()
                }
                assertTrue(correlation(shown, wanted) > 0.9, "${correlation(shown, wanted)}")
            }
        }
        assertContains(thirdPartyNotices(), "uniffi")
    }

    private fun correlation(a: List<Double>, b: List<Double>): Double {
        val (meanA, meanB) = a.average() to b.average()
        val together = a.zip(b).sumOf { (p, q) -> (p - meanA) * (q - meanB) }
        return together / sqrt(a.sumOf { (it - meanA) * (it - meanA) } * b.sumOf { (it - meanB) * (it - meanB) })
    }
}
