package org.phasefront.sample

import android.content.res.AssetManager
import android.graphics.Bitmap
import android.graphics.BitmapFactory
import java.nio.ByteBuffer
import kotlin.concurrent.thread
import org.phasefront.CameraFrame
import org.phasefront.ColourFormat
import org.phasefront.ColourImage
import org.phasefront.DepthFormat
import org.phasefront.DepthImage
import org.phasefront.ImagePlane

/**
 * A source for phones without depth: a window that moves over the project's sample scene, 30 times per second. [why] says
 * on the screen why it is not the camera.
 */
class SampleSource(private val assets: AssetManager, private val why: String) : FrameSource {
    private var worker: Thread? = null

    override fun start(listener: FrameSource.Listener) {
        worker = thread(name = "sample scene") {
            val scene = SampleScene(assets)
            var step = 0
            try {
                while (true) {
                    listener.onFrame(scene.frame(step++), "Sample scene: $why")
                    Thread.sleep(33)
                }
            } catch (_: InterruptedException) {
                // It is closed.
            }
        }
    }

    override fun close() {
        worker?.run {
            interrupt()
            join()
        }
    }
}

/** Seven eighths of the project's sample scene. */
class SampleScene(assets: AssetManager) {
    private val colour = assets.bitmap("scene_rgb.jpg")
    private val depth = assets.bitmap("scene_depth.png")
    private val colours = ByteBuffer.allocateDirect(colour.byteCount).also { colour.copyPixelsToBuffer(it) }
    private val depths = ByteBuffer.allocateDirect(depth.width * depth.height).also {
        for (y in 0 until depth.height) {
            for (x in 0 until depth.width) it.put((depth.getPixel(x, y) and 0xff).toByte())
        }
    }

    /** Returns a frame with the current time, of a window that has moved [step] pixels to and fro. */
    fun frame(step: Int): CameraFrame {
        val margin = colour.width / 8
        val x = if (step / margin % 2 == 0) step % margin else margin - 1 - step % margin
        val depthX = x * depth.width / colour.width
        val depthMargin = margin * depth.width / colour.width
        return CameraFrame(
            System.nanoTime(),
            ColourImage(
                ColourFormat.RGBA,
                colour.width - margin,
                colour.height - margin * colour.height / colour.width,
                listOf(ImagePlane(window(colours, 4 * x), 4 * colour.width, 4)),
            ),
            DepthImage(
                DepthFormat.NORMALIZED_U8,
                depth.width - depthMargin,
                depth.height - depthMargin * depth.height / depth.width,
                ImagePlane(window(depths, depthX), depth.width, 1),
            ),
        )
    }

    private fun window(bytes: ByteBuffer, from: Int): ByteBuffer = bytes.duplicate().apply {
        clear()
        position(from)
    }

    private fun AssetManager.bitmap(name: String): Bitmap = open(name).use {
        val options = BitmapFactory.Options().apply { inPreferredConfig = Bitmap.Config.ARGB_8888 }
        BitmapFactory.decodeStream(it, null, options) ?: error("the asset $name is no image")
    }
}
