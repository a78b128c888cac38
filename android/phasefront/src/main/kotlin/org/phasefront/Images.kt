package org.phasefront

import android.graphics.Bitmap
import android.graphics.ImageFormat
import android.hardware.HardwareBuffer
import android.media.Image

/**
 * Returns a camera image without a copy. Its format is YUV_420_888, as from Camera2 and ARCore. Keep the [Image] open
 * while the frame is used.
 *
 * @throws PhasefrontException.Frame for any other format. The message names it.
 */
public fun Image.toColourImage(matrix: YuvMatrix = YuvMatrix.BT601, videoRange: Boolean = false): ColourImage {
    if (format != ImageFormat.YUV_420_888) {
        throw PhasefrontException.Frame("frame: colour is of Android's format $format; YUV_420_888 (${ImageFormat.YUV_420_888}) is needed")
    }
    return ColourImage(ColourFormat.YUV420, width, height, planes.map { it.toPlane() }, matrix, videoRange)
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
 * Copies the image into a bitmap: into [to] if it is mutable and has the same size and the configuration ARGB_8888,
 * else into a new one.
 *
 * @throws PhasefrontException.Setting if the image does not have 4 bytes per pixel.
 */
public fun PixelImage.toBitmap(to: Bitmap? = null): Bitmap {
    if (pixelBytes != 4) {
        throw PhasefrontException.Setting("an image of $pixelBytes bytes a pixel; the layout RGBA is needed for a bitmap")
    }
    val fits = to?.takeIf { it.width == width && it.height == height && it.config == Bitmap.Config.ARGB_8888 && it.isMutable }
    val bitmap = fits ?: Bitmap.createBitmap(width, height, Bitmap.Config.ARGB_8888)
    useBytes { bitmap.copyPixelsFromBuffer(it) }
    return bitmap
}
