import java.nio.ByteBuffer
import java.util.concurrent.CountDownLatch
import java.util.concurrent.TimeUnit
import org.phasefront.CameraFrame
import org.phasefront.Colour
import org.phasefront.ColourFormat
import org.phasefront.ColourImage
import org.phasefront.DepthFormat
import org.phasefront.DepthImage
import org.phasefront.HologramDisplay
import org.phasefront.HologramSession
import org.phasefront.PhasefrontException
import org.phasefront.RunningMode
import org.phasefront.SessionEvent
import org.phasefront.sessionOptions

private fun bytes(size: Int): ByteBuffer = ByteBuffer.allocateDirect(size).apply { repeat(size) { put((it % 251).toByte()) } }.flip()

private fun frame(timestampNs: Long, height: Int = 48) = CameraFrame(
    timestampNs,
    ColourImage(ColourFormat.RGBA, 64, height, bytes(4 * 64 * 48)),
    DepthImage(DepthFormat.NORMALIZED_U8, 64, 48, bytes(64 * 48)),
)

/** An app that R8 shrinks: prints what calls, callbacks and errors give. */
fun main() {
    val options = sessionOptions(HologramDisplay(width = 64, height = 48))
    HologramSession(options, RunningMode.IMAGE).use { session ->
        session.processBlocking(frame(0)).use { hologram ->
            println(hologram.usePlane(Colour.GREEN) { levels -> ByteArray(levels.remaining()).also(levels::get).contentHashCode() })
        }
        try {
            session.processBlocking(frame(1, height = 0))
        } catch (refused: PhasefrontException.Frame) {
            println(refused.message)
        }
    }
    val made = CountDownLatch(1)
    HologramSession(options, RunningMode.LIVE) { event -> if (event is SessionEvent.Processed) made.countDown() }.use { session ->
        session.submit(frame(2))
        println(made.await(60, TimeUnit.SECONDS))
    }
}
