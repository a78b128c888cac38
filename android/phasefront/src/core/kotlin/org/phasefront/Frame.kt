package org.phasefront

import java.nio.ByteBuffer

/**
 * One plane of an image in memory that the platform owns: the bytes of [buffer] from its position to its limit. It must
 * be a direct buffer, as the platform's buffers are. A session reads it only during the call that takes the frame.
 */
public class ImagePlane(
    public val buffer: ByteBuffer,
    /** The bytes from one row to the next. */
    public val rowStride: Int,
    /** The bytes from one pixel to the next in a row. */
    public val pixelStride: Int,
) {
    internal fun info(what: String): PlaneInfo {
        if (rowStride < 0 || pixelStride < 0) {
            throw PhasefrontException.Frame("frame: $what: strides of $rowStride and $pixelStride bytes; they must not be negative")
        }
        return PlaneInfo(rowStride, pixelStride)
    }

    /** Returns the bytes in a buffer that begins with them. */
    internal fun bytes(what: String): ByteBuffer = buffer.direct {
        PhasefrontException.Frame("frame: $what is $it; a direct one is needed, from the camera or ByteBuffer.allocateDirect")
    }
}

/** Returns the bytes of a direct buffer from its position to its limit, in a buffer that begins with them. */
internal fun ByteBuffer.direct(refused: (String) -> PhasefrontException): ByteBuffer {
    if (!isDirect) throw refused("in a buffer on the Java heap")
    // The generated code passes the address of the buffer's start and ignores the position.
    return slice()
}

/** A colour image from a camera. */
public class ColourImage(
    public val format: ColourFormat,
    /** The width in pixels, in the sensor's orientation. */
    public val width: Int,
    /** The height in pixels. */
    public val height: Int,
    /** The planes, in the order of the format. */
    public val planes: List<ImagePlane>,
    /** The matrix of luma and chroma. RGB formats ignore it. */
    public val matrix: YuvMatrix = YuvMatrix.BT601,
    /** Whether luma spans 16..235 and chroma 16..240. RGB formats ignore it. */
    public val videoRange: Boolean = false,
    /** The meaning of red, green and blue. */
    public val encoding: RgbEncoding = RgbEncoding.SRGB,
) {
    /** Creates an image of one plane without gaps. */
    public constructor(
        format: ColourFormat,
        width: Int,
        height: Int,
        bytes: ByteBuffer,
        encoding: RgbEncoding = RgbEncoding.SRGB,
    ) : this(
        format,
        width,
        height,
        if (format == ColourFormat.RGB) listOf(ImagePlane(bytes, 3 * width, 3)) else listOf(ImagePlane(bytes, 4 * width, 4)),
        encoding = encoding,
    )
}

/** The confidence of each reading of a depth image. */
public class ConfidenceMap(
    public val format: ConfidenceFormat,
    /** The width in pixels, equal to that of the depth image. */
    public val width: Int,
    /** The height in pixels, equal to that of the depth image. */
    public val height: Int,
    public val plane: ImagePlane,
)

/** A depth image from a sensor. */
public class DepthImage(
    public val format: DepthFormat,
    /** The width in pixels, in the sensor's orientation. */
    public val width: Int,
    /** The height in pixels. */
    public val height: Int,
    public val plane: ImagePlane,
    /** The confidence of the readings, if known. */
    public val confidence: ConfidenceMap? = null,
) {
    /** Creates an image of one plane without gaps. */
    public constructor(format: DepthFormat, width: Int, height: Int, bytes: ByteBuffer) : this(
        format,
        width,
        height,
        ImagePlane(bytes, format.pixelBytes * width, format.pixelBytes),
    )
}

/** The number of bytes per pixel. */
public val DepthFormat.pixelBytes: Int
    get() = when (this) {
        DepthFormat.NORMALIZED_U8 -> 1
        DepthFormat.METRES_F32, DepthFormat.DISPARITY_F32, DepthFormat.RELATIVE_F32 -> 4
        else -> 2
    }

/** A colour image and a depth image of the same moment. */
public class CameraFrame(
    /** The capture time in nanoseconds of any monotonic clock. */
    public val timestampNs: Long,
    public val colour: ColourImage,
    /** The depth image; null if the session's depth network estimates it. */
    public val depth: DepthImage?,
    /** The rotation that brings both images upright. */
    public val orientation: Orientation = Orientation(Rotation.UPRIGHT, false),
    /** The two cameras, if they are apart; null if both images show the same field of view. */
    public val cameras: Cameras? = null,
) {
    internal fun info(): FrameInfo = FrameInfo(
        timestampNs = timestampNs,
        colour = ColourInfo(
            format = colour.format,
            width = size("colour", colour.width),
            height = size("colour", colour.height),
            planes = colour.planes.map { it.info("colour") },
            matrix = colour.matrix,
            videoRange = colour.videoRange,
            encoding = colour.encoding,
        ),
        depth = depth?.let { DepthInfo(it.format, size("depth", it.width), size("depth", it.height), it.plane.info("depth")) },
        confidence = depth?.confidence?.let {
            ConfidenceInfo(it.format, size("confidence", it.width), size("confidence", it.height), it.plane.info("confidence"))
        },
        orientation = orientation,
        cameras = cameras,
    )

    internal fun colourBytes(index: Int): ByteBuffer = colour.planes.getOrNull(index)?.bytes("colour") ?: empty

    internal fun depthBytes(): ByteBuffer = depth?.plane?.bytes("depth") ?: empty

    internal fun confidenceBytes(): ByteBuffer = depth?.confidence?.plane?.bytes("confidence") ?: empty

    private fun size(what: String, pixels: Int): Int {
        if (pixels < 0) throw PhasefrontException.Frame("frame: $what has a side of $pixels pixels; it must be at least 1")
        return pixels
    }
}

/** The memory of a missing plane. */
private val empty: ByteBuffer = ByteBuffer.allocateDirect(0)
