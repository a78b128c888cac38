package org.phasefront

import android.graphics.Bitmap
import android.graphics.ColorSpace
import android.graphics.ImageFormat
import android.hardware.DataSpace
import android.hardware.HardwareBuffer
import android.media.Image
import java.nio.ByteBuffer
import java.nio.ByteOrder
import kotlin.test.assertContains
import kotlin.test.assertEquals
import kotlin.test.assertFailsWith
import org.junit.Test
import org.junit.runner.RunWith
import org.robolectric.RobolectricTestRunner

/** An image as a camera gives it: of a format, with planes that have strides. */
private class CameraImage(private val format: Int, private val width: Int, private val height: Int, vararg planes: Plane) : Image() {
    private val all = arrayOf(*planes)

    override fun getFormat(): Int = format

    override fun getWidth(): Int = width

    override fun getHeight(): Int = height

    override fun getTimestamp(): Long = 1

    override fun getTransform(): Int = 0

    override fun getScalingMode(): Int = 0

    override fun getPlanes(): Array<Plane> = all

    var space: Int = DataSpace.DATASPACE_UNKNOWN

    override fun getDataSpace(): Int = space

    override fun close(): Unit = Unit

    class Bytes(private val bytes: ByteBuffer, private val row: Int, private val pixel: Int) : Plane() {
        override fun getRowStride(): Int = row

        override fun getPixelStride(): Int = pixel

        override fun getBuffer(): ByteBuffer = bytes
    }
}

@RunWith(RobolectricTestRunner::class)
class ImagesTest {
    private val display = HologramDisplay(width = 64, height = 48)

    private fun bytes(size: Int, value: (Int) -> Int): ByteBuffer =
        ByteBuffer.allocateDirect(size).apply { repeat(size) { put(value(it).toByte()) } }.flip()

    /** Returns 64×48 pixels of luma that is not uniform and of grey chroma, with gaps behind the rows. */
    private fun colour(): CameraImage {
        val luma = bytes(80 * 48) { (it % 80) * 3 + it / 80 }
        val chroma = bytes(64 * 24) { 128 }
        return CameraImage(
            ImageFormat.YUV_420_888, 64, 48,
            CameraImage.Bytes(luma, 80, 1), CameraImage.Bytes(chroma, 64, 2), CameraImage.Bytes(chroma.duplicate(), 64, 2),
        )
    }

    /** Returns 32×24 depths of [format]: an object at 500 mm in front of a wall at 1000 mm. [flags] are its upper bits. */
    private fun depth(format: Int, flags: Int = 0): Image {
        val mm = ByteBuffer.allocateDirect(2 * 32 * 24).order(ByteOrder.LITTLE_ENDIAN)
        for (y in 0 until 24) {
            for (x in 0 until 32) mm.putShort((flags or if (y in 6..17 && x in 8..23) 500 else 1000).toShort())
        }
        return CameraImage(format, 32, 24, CameraImage.Bytes(mm.flip(), 64, 2))
    }

    private fun hologram(frame: CameraFrame): Hologram =
        HologramSession(sessionOptions(display), RunningMode.IMAGE).use { it.processBlocking(frame) }

    private fun levels(of: Hologram): ByteArray = of.usePlane(Colour.GREEN) { plane -> ByteArray(plane.remaining()).also(plane::get) }

    @Test
    fun depthIsReadByItsFormat() {
        // Confidence 0 of DEPTH16 is full confidence; that of 16 bits of millimetres would be another depth.
        val sensor = depth(ImageFormat.DEPTH16).toDepthImage()
        val arcore = depth(HardwareBuffer.D_16).toDepthImage()
        assertEquals(DepthFormat.ANDROID_DEPTH16, sensor.format)
        assertEquals(DepthFormat.MILLIMETRES_U16, arcore.format)
        val made = listOf(sensor, arcore).map { depth -> hologram(CameraFrame(0, colour().toColourImage(), depth)).use(::levels) }
        assertEquals(made[0].toList(), made[1].toList())
        val doubtful = CameraFrame(0, colour().toColourImage(), depth(ImageFormat.DEPTH16, flags = 1 shl 13).toDepthImage())
        assertContains(assertFailsWith<PhasefrontException.Frame> { hologram(doubtful) }.message.orEmpty(), "confidence")
    }

    @Test
    fun imagesKeepTheirStridesAndConfidence() {
        val image = colour().toColourImage(YuvMatrix.BT709, videoRange = true)
        assertEquals(listOf(80 to 1, 64 to 2, 64 to 2), image.planes.map { it.rowStride to it.pixelStride })
        assertEquals(YuvMatrix.BT709, image.matrix)
        assertEquals(true, image.videoRange)
        val confidence = CameraImage(ImageFormat.Y8, 32, 24, CameraImage.Bytes(bytes(32 * 24) { 255 }, 32, 1))
        val depth = depth(HardwareBuffer.D_16).toDepthImage(confidence)
        assertEquals(32 to 24, depth.confidence?.run { width to height })
    }

    @Test
    fun imagesSayTheMeaningOfTheirColours() {
        val range = DataSpace.RANGE_LIMITED
        for ((space, encoding) in listOf(
            DataSpace.DATASPACE_UNKNOWN to RgbEncoding.SRGB,
            DataSpace.DATASPACE_JFIF to RgbEncoding.SRGB,
            DataSpace.DATASPACE_DISPLAY_P3 to RgbEncoding.DISPLAY_P3,
            DataSpace.pack(DataSpace.STANDARD_BT2020, DataSpace.TRANSFER_HLG, range) to RgbEncoding.BT2020_HLG,
            DataSpace.pack(DataSpace.STANDARD_BT2020, DataSpace.TRANSFER_ST2084, range) to RgbEncoding.BT2020_PQ,
            DataSpace.pack(DataSpace.STANDARD_BT2020, DataSpace.TRANSFER_SMPTE_170M, range) to RgbEncoding.BT2020,
        )) {
            assertEquals(encoding, colour().also { it.space = space }.toColourImage().encoding, "$space")
        }
        for ((standard, matrix) in listOf(
            DataSpace.STANDARD_BT601_625 to YuvMatrix.BT601,
            DataSpace.STANDARD_BT709 to YuvMatrix.BT709,
            DataSpace.STANDARD_BT2020 to YuvMatrix.BT2020,
        )) {
            for ((of, isVideo) in listOf(DataSpace.RANGE_FULL to false, range to true)) {
                val space = DataSpace.pack(standard, DataSpace.TRANSFER_SMPTE_170M, of)
                val image = colour().also { it.space = space }.toColourImage()
                assertEquals(matrix to isVideo, image.matrix to image.videoRange, "$space")
            }
        }
        assertEquals(YuvMatrix.BT601 to false, colour().toColourImage().run { matrix to videoRange })
        assertEquals(RgbEncoding.AMPLITUDE, colour().toColourImage(encoding = RgbEncoding.AMPLITUDE).encoding)
    }

    @Test
    fun bitmapsAreCopiedInTheirOwnColours() {
        for ((space, encoding) in listOf(
            ColorSpace.Named.SRGB to RgbEncoding.SRGB,
            ColorSpace.Named.DISPLAY_P3 to RgbEncoding.DISPLAY_P3,
        )) {
            val bitmap = Bitmap.createBitmap(3, 2, Bitmap.Config.ARGB_8888, true, ColorSpace.get(space))
            bitmap.copyPixelsFromBuffer(bytes(24) { if (it % 4 == 3) 255 else 9 * it })
            val image = bitmap.toColourImage()
            assertEquals(Triple(3, 2, encoding), Triple(image.width, image.height, image.encoding))
            val plane = image.planes.single()
            assertEquals(listOf(72, 81, 90), List(3) { plane.buffer.get(8 + it).toInt() and 0xff })
        }
        val wide = Bitmap.createBitmap(3, 2, Bitmap.Config.RGBA_F16, true, ColorSpace.get(ColorSpace.Named.SRGB))
        assertContains(assertFailsWith<PhasefrontException.Frame> { wide.toColourImage() }.message.orEmpty(), "ARGB_8888")
    }

    @Test
    fun otherFormatsAreRefusedInOneLine() {
        val colour = assertFailsWith<PhasefrontException.Frame> { depth(ImageFormat.DEPTH16).toColourImage() }
        assertContains(colour.message.orEmpty(), "YUV_420_888 (35) is needed")
        val depth = assertFailsWith<PhasefrontException.Frame> { colour().toDepthImage() }
        assertContains(depth.message.orEmpty(), "DEPTH16")
    }

    @Test
    fun bitmapsHaveThePixelsOfTheBuffers() {
        hologram(CameraFrame(0, colour().toColourImage(), depth(HardwareBuffer.D_16).toDepthImage())).use { hologram ->
            val bitmap = Bitmap.createBitmap(64, 48, Bitmap.Config.ARGB_8888).apply { density = Bitmap.DENSITY_NONE }
            hologram.writeOutput(bitmap)
            val levels = levels(hologram)
            for ((x, y) in listOf(0 to 0, 63 to 0, 17 to 31, 63 to 47)) {
                assertEquals(levels[64 * y + x].toInt() and 0xff, bitmap.getPixel(x, y) shr 8 and 0xff, "($x, $y)")
            }
            hologram.writeOutput(bitmap, flipX = true)
            assertEquals(levels[63].toInt() and 0xff, bitmap.getPixel(0, 0) shr 8 and 0xff)

            val small = Bitmap.createBitmap(32, 24, Bitmap.Config.ARGB_8888)
            hologram.writePreview(0.0, small)
            val preview = ByteBuffer.allocateDirect(4 * 32 * 24)
            hologram.writePreview(0.0, 32, 24, preview)
            // In memory: Robolectric's `getPixel` takes blue for red where Android has red first.
            val held = ByteBuffer.allocateDirect(4 * 32 * 24).also { small.copyPixelsToBuffer(it) }
            assertEquals(List(preview.capacity()) { preview.get(it) }, List(held.capacity()) { held.get(it) })
        }
    }

    @Test
    fun bitmapsThatCannotTakePixelsAreRefused() {
        hologram(CameraFrame(0, colour().toColourImage(), depth(HardwareBuffer.D_16).toDepthImage())).use { hologram ->
            val bitmaps = listOf(
                Bitmap.createBitmap(64, 48, Bitmap.Config.RGB_565) to "ARGB_8888",
                Bitmap.createBitmap(64, 47, Bitmap.Config.ARGB_8888) to "64×48",
            )
            for ((bitmap, right) in bitmaps) {
                assertContains(assertFailsWith<PhasefrontException.Setting> { hologram.writeOutput(bitmap) }.message.orEmpty(), right)
            }
        }
    }

    @Test
    fun anImageOfAWriterIsWrittenInPlace() {
        hologram(CameraFrame(0, colour().toColourImage(), depth(HardwareBuffer.D_16).toDepthImage())).use { hologram ->
            val pixels = ByteBuffer.allocateDirect(48 * 300)
            hologram.writeOutput(CameraImage(1, 64, 48, CameraImage.Bytes(pixels, 300, 4)))
            assertEquals(levels(hologram)[64 * 31 + 17], pixels.get(31 * 300 + 17 * 4 + 1))
            assertFailsWith<PhasefrontException.Setting> { hologram.writeOutput(colour()) }
        }
    }

    @Test
    fun aModulatorsImageFillsABitmapAndAWritersImage() {
        Modulator.fromToml("width = 64\nheight = 48\nwavelengths_nm = [532]\npacking = \"grey\"").use { modulator ->
            val options = sessionOptions(modulator.target, HologramMethod.Sweep)
            val frame = CameraFrame(0, colour().toColourImage(), depth(HardwareBuffer.D_16).toDepthImage())
            HologramSession(options, RunningMode.IMAGE).use { it.processBlocking(frame) }.use { hologram ->
                val grey = ByteBuffer.allocateDirect(64 * 48).also { modulator.writeOutput(hologram, it) }
                val bitmap = Bitmap.createBitmap(64, 48, Bitmap.Config.ARGB_8888)
                modulator.writePixels(hologram, bitmap)
                val pixels = ByteBuffer.allocateDirect(48 * 300)
                modulator.writePixels(hologram, CameraImage(1, 64, 48, CameraImage.Bytes(pixels, 300, 4)))
                for ((x, y) in listOf(0 to 0, 63 to 0, 17 to 31, 63 to 47)) {
                    val level = grey.get(64 * y + x).toInt() and 0xff
                    assertEquals(255 shl 24 or level * 0x10101, bitmap.getPixel(x, y), "($x, $y)")
                    assertEquals(listOf(level, level, level, 255), List(4) { pixels.get(y * 300 + 4 * x + it).toInt() and 0xff })
                }
                val other = Bitmap.createBitmap(64, 47, Bitmap.Config.ARGB_8888)
                val refused = assertFailsWith<PhasefrontException.Setting> { modulator.writePixels(hologram, other) }
                assertContains(refused.message.orEmpty(), "64×48")
            }
        }
    }

    @Test
    fun aCameraTurnsUpright() {
        assertEquals(Orientation(Rotation.CLOCKWISE90, false), sensorOrientation(90, 0, isFront = false))
        assertEquals(Orientation(Rotation.UPRIGHT, false), sensorOrientation(90, 90, isFront = false))
        assertEquals(Orientation(Rotation.CLOCKWISE270, true), sensorOrientation(270, 0, isFront = true))
        assertFailsWith<PhasefrontException.Frame> { sensorOrientation(45, 0, isFront = false) }
    }
}
