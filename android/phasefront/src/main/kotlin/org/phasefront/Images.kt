package org.phasefront

import android.graphics.Bitmap
import android.graphics.ColorSpace
import android.graphics.ImageFormat
import android.hardware.DataSpace
import android.hardware.HardwareBuffer
import android.media.Image
import android.os.Build
import java.nio.ByteBuffer

/**
 * Returns a camera image without a copy. Its format is YUV_420_888, as from Camera2 and ARCore. Its [matrix],
 * [videoRange] and [encoding] are by default what its `dataSpace` says, which is known since Android 13, else those of
 * JPEG: BT.601, full range and sRGB. Keep the [Image] open while the frame is used.
 *
 * @throws PhasefrontException.Frame for any other format. The message names it.
 */
public fun Image.toColourImage(
    matrix: YuvMatrix = yuvMatrix(),
    videoRange: Boolean = isVideoRange(),
    encoding: RgbEncoding = rgbEncoding(),
): ColourImage {
    if (format != ImageFormat.YUV_420_888) {
        throw PhasefrontException.Frame("frame: colour is of Android's format $format; YUV_420_888 (${ImageFormat.YUV_420_888}) is needed")
    }
    return ColourImage(ColourFormat.YUV420, width, height, planes.map { it.toPlane() }, matrix, videoRange, encoding)
}

/** Returns the `dataSpace` of an image of a camera or a decoder, or `null` where it is not known. */
private fun Image.knownDataSpace(): Int? {
    if (Build.VERSION.SDK_INT < Build.VERSION_CODES.TIRAMISU) return null
    return try {
        dataSpace
    } catch (_: IllegalStateException) {
        null // An open image of ARCore says that it is closed: https://github.com/google-ar/arcore-android-sdk/issues/1578
    }
}

private fun Image.yuvMatrix(): YuvMatrix = when (knownDataSpace()?.let(DataSpace::getStandard)) {
    DataSpace.STANDARD_BT709 -> YuvMatrix.BT709
    DataSpace.STANDARD_BT2020 -> YuvMatrix.BT2020
    else -> YuvMatrix.BT601
}

private fun Image.isVideoRange(): Boolean = knownDataSpace()?.let(DataSpace::getRange) == DataSpace.RANGE_LIMITED

/** Returns the meaning of the colours of an image of a camera or a decoder. */
private fun Image.rgbEncoding(): RgbEncoding {
    val space = knownDataSpace() ?: return RgbEncoding.SRGB
    return when (DataSpace.getStandard(space)) {
        DataSpace.STANDARD_DCI_P3 -> RgbEncoding.DISPLAY_P3
        DataSpace.STANDARD_BT2020, DataSpace.STANDARD_BT2020_CONSTANT_LUMINANCE -> when (DataSpace.getTransfer(space)) {
            DataSpace.TRANSFER_HLG -> RgbEncoding.BT2020_HLG
            DataSpace.TRANSFER_ST2084 -> RgbEncoding.BT2020_PQ
            else -> RgbEncoding.BT2020
        }
        else -> RgbEncoding.SRGB
    }
}

/**
 * Returns a copy of the pixels of a bitmap of ARGB_8888 in its own colour space, sRGB or Display P3.
 *
 * @throws PhasefrontException.Frame for a bitmap of another configuration or colour space: `Bitmap.copy`, or
 * `BitmapFactory.Options.inPreferredColorSpace`, makes one.
 */
public fun Bitmap.toColourImage(): ColourImage {
    if (config != Bitmap.Config.ARGB_8888) {
        throw PhasefrontException.Frame("frame: the bitmap's configuration is $config; ARGB_8888 is needed")
    }
    val encoding = when (colorSpace) {
        null, ColorSpace.get(ColorSpace.Named.SRGB) -> RgbEncoding.SRGB
        ColorSpace.get(ColorSpace.Named.DISPLAY_P3) -> RgbEncoding.DISPLAY_P3
        else -> throw PhasefrontException.Frame("frame: the bitmap's colours are ${colorSpace?.name}; sRGB or Display P3 are needed")
    }
    val bytes = ByteBuffer.allocateDirect(byteCount).also(::copyPixelsToBuffer)
    bytes.flip()
    return ColourImage(ColourFormat.RGBA, width, height, listOf(ImagePlane(bytes, rowBytes, 4)), encoding = encoding)
}

/**
 * Returns a depth image without a copy. The format is read from the image: DEPTH16 of Camera2 and old ARCore has 13
 * bits of millimetres and 3 of confidence, and D_16 of ARCore's `acquireDepthImage16Bits` has 16 bits of millimetres.
 * Keep the [Image] open while the frame is used.
 *
 * @param confidence the image of ARCore's `acquireRawDepthConfidenceImage`.
 * @throws PhasefrontException.Frame for any other format. The message names it.
 */
public fun Image.toDepthImage(confidence: Image? = null): DepthImage {
    val depthFormat = when (format) {
        ImageFormat.DEPTH16 -> DepthFormat.ANDROID_DEPTH16
        HardwareBuffer.D_16 -> DepthFormat.MILLIMETRES_U16
        else -> throw PhasefrontException.Frame(
            "frame: depth is of Android's format $format; DEPTH16 (${ImageFormat.DEPTH16}) or D_16 (${HardwareBuffer.D_16}) is needed",
        )
    }
    val map = confidence?.let { ConfidenceMap(ConfidenceFormat.U8, it.width, it.height, it.planes[0].toPlane()) }
    return DepthImage(depthFormat, width, height, planes[0].toPlane(), map)
}

/**
 * Returns the rotation that brings a camera image upright, from `CameraCharacteristics.SENSOR_ORIENTATION` and the
 * display's rotation.
 */
public fun sensorOrientation(sensorDegrees: Int, displayDegrees: Int, isFront: Boolean): Orientation {
    val degrees = if (isFront) sensorDegrees + displayDegrees else sensorDegrees - displayDegrees
    val rotation = when (Math.floorMod(degrees, 360)) {
        0 -> Rotation.UPRIGHT
        90 -> Rotation.CLOCKWISE90
        180 -> Rotation.HALF
        270 -> Rotation.CLOCKWISE270
        else -> throw PhasefrontException.Frame("frame: a sensor at $sensorDegrees° and a display at $displayDegrees°; multiples of 90 are right")
    }
    return Orientation(rotation, isFront)
}

private fun Image.Plane.toPlane(): ImagePlane = ImagePlane(buffer, rowStride, pixelStride)

/**
 * Writes the displayed image in sRGB for an eye focused at [zMm] into [to], a mutable bitmap of the configuration
 * ARGB_8888, with one copy through memory that is kept for the next call on the thread.
 *
 * @throws PhasefrontException.Setting for another bitmap.
 */
public fun Hologram.writePreview(zMm: Double, to: Bitmap): Unit = to.fill { writePreview(zMm, to.width, to.height, it) }

/**
 * Writes the image for the modulator's driver into [to], as [writePreview] does. The bitmap has the modulator's size.
 * Create it with `density = Bitmap.DENSITY_NONE`, so that views do not scale it. [flipX] and [flipY] flip the image,
 * [shiftX] and [shiftY] move the hologram.
 *
 * @throws PhasefrontException.Setting for another bitmap.
 */
public fun Hologram.writeOutput(
    to: Bitmap,
    flipX: Boolean = false,
    flipY: Boolean = false,
    shiftX: Int = 0,
    shiftY: Int = 0,
) {
    to.check(outputSize(ModulatorLayout.RGBA))
    to.fill { writeOutput(Placement(ModulatorLayout.RGBA, flipX, flipY, shiftX, shiftY), it) }
}

/**
 * Writes the image for the modulator's driver into an image of an `ImageWriter` of RGBA_8888, in place, which sends it
 * to a surface: no copy. The image has the modulator's size.
 *
 * @throws PhasefrontException.Setting for another image.
 */
public fun Hologram.writeOutput(to: Image) {
    val plane = to.pixels()
    writeOutput(Placement(ModulatorLayout.RGBA), plane.buffer, rowStride = plane.rowStride)
}

/**
 * Writes image [index] of the images that the modulator takes of [hologram] into [to], a mutable bitmap of the
 * configuration ARGB_8888 and of the size [Modulator.outputSize], for a screen that drives the modulator. Create it with
 * `density = Bitmap.DENSITY_NONE`, so that views do not scale it.
 *
 * @throws PhasefrontException.Setting for another bitmap, if the hologram does not fit the modulator, and for a modulator
 * whose images have 16 bits.
 */
public fun Modulator.writePixels(hologram: Hologram, to: Bitmap, index: Int = 0) {
    to.check(outputSize)
    to.fill { writePixels(hologram, it, index) }
}

/**
 * Writes the same image into an image of an `ImageWriter` of RGBA_8888, in place.
 *
 * @throws PhasefrontException.Setting for another image, and as [writePixels] does.
 */
public fun Modulator.writePixels(hologram: Hologram, to: Image, index: Int = 0) {
    val plane = to.pixels()
    writePixels(hologram, plane.buffer, index, rowStride = plane.rowStride)
}

private fun Image.pixels(): Image.Plane = planes.singleOrNull()?.takeIf { it.pixelStride == 4 }
    ?: throw PhasefrontException.Setting("an image of Android's format $format; RGBA_8888 is needed")

private fun Bitmap.check(size: OutputSize) {
    if (width != size.width || height != size.height) {
        throw PhasefrontException.Setting("a bitmap of $width×$height; the modulator's ${size.width}×${size.height} are needed")
    }
}

/** The memory of each thread's bitmaps. */
private val memory = ThreadLocal<ByteBuffer>()

private fun Bitmap.fill(write: (ByteBuffer) -> Unit) {
    if (config != Bitmap.Config.ARGB_8888 || !isMutable) {
        throw PhasefrontException.Setting("a bitmap of $config; a mutable one of ARGB_8888 is needed")
    }
    val bytes = memory.get()?.takeIf { it.capacity() >= byteCount } ?: ByteBuffer.allocateDirect(byteCount).also(memory::set)
    bytes.clear().limit(byteCount)
    write(bytes)
    copyPixelsFromBuffer(bytes)
}
