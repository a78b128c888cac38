package org.phasefront

import java.nio.ByteBuffer

/**
 * One plane of an image in memory that the platform handed out: the bytes of [buffer] from its position to its limit. It
 * must be a direct buffer, as the platform's are. It is read while the call lasts that the frame is given to, and not kept.
 */
public class Plane(
    public val buffer: ByteBuffer,
    /** Bytes from one row to the next. */
    public val rowStride: Int,
    /** Bytes from one pixel to the next in a row. */
    public val pixelStride: Int,
) {
    internal fun info(what: String): PlaneInfo {
        if (rowStride < 0 || pixelStride < 0) {
            throw PhasefrontException.Frame("frame: $what: strides of $rowStride and $pixelStride bytes; they must not be negative")
        }
        return PlaneInfo(rowStride.toUInt(), pixelStride.toUInt())
    }

    /** The bytes, in a buffer that begins with them. */
    internal fun bytes(what: String): ByteBuffer = buffer.direct {
        PhasefrontException.Frame("frame: $what is $it; a direct one is needed, from the camera or ByteBuffer.allocateDirect")
    }
}

/** The bytes from the position to the limit of a direct buffer, in a buffer that begins with them. */
internal fun ByteBuffer.direct(refused: (String) -> PhasefrontException): ByteBuffer {
    if (!isDirect) throw refused("in a buffer on the Java heap")
    // What is generated passes the address of a buffer's beginning, whatever its position.
    return slice()
}

/** A colour image as a camera gives it. */
public class ColourImage(
    public val format: ColourFormat,
    /** Pixels along x, as the sensor gives them. */
    public val width: Int,
    /** Pixels along y. */
    public val height: Int,
    /** Its planes, in the format's order. */
    public val planes: List<Plane>,
    /** The matrix of luma and chroma; other formats do not look at it. */
    public val matrix: YuvMatrix = YuvMatrix.BT601,
    /** Whether luma runs over 16..235 and chroma over 16..240; other formats do not look at it. */
    public val videoRange: Boolean = false,
) {
    /** An image of one plane without gaps. */
    public constructor(format: ColourFormat, width: Int, height: Int, bytes: ByteBuffer) : this(
        format,
        width,
        height,
        if (format == ColourFormat.RGB) listOf(Plane(bytes, 3 * width, 3)) else listOf(Plane(bytes, 4 * width, 4)),
    )
}

/** How sure a depth image's readings are. */
public class ConfidenceMap(
    public val format: ConfidenceFormat,
    /** Pixels along x: as many as the depth has. */
    public val width: Int,
    /** Pixels along y: as many as the depth has. */
    public val height: Int,
    public val plane: Plane,
)

/** A depth image as a sensor gives it. */
public class DepthImage(
    public val format: DepthFormat,
    /** Pixels along x, as the sensor gives them. */
    public val width: Int,
    /** Pixels along y. */
    public val height: Int,
    public val plane: Plane,
    /** How sure its readings are, where that is known. */
    public val confidence: ConfidenceMap? = null,
) {
    /** An image of one plane without gaps. */
    public constructor(format: DepthFormat, width: Int, height: Int, bytes: ByteBuffer) : this(
        format,
        width,
        height,
        Plane(bytes, format.pixelBytes * width, format.pixelBytes),
    )
}

/** Bytes of a pixel. */
public val DepthFormat.pixelBytes: Int
    get() = when (this) {
        DepthFormat.NORMALIZED_U8 -> 1
        DepthFormat.METRES_F32, DepthFormat.DISPARITY_F32 -> 4
        else -> 2
    }

/** Colour and depth of one moment. */
public class Frame(
    /** When it was taken, in nanoseconds of any clock that runs forward. */
    public val timestampNs: Long,
    public val colour: ColourImage,
    public val depth: DepthImage,
    /** How both must be turned to stand upright. */
    public val orientation: Orientation = Orientation(Rotation.UPRIGHT, false),
    /** How the pixels of depth and colour correspond; null where both show the same field of view. */
    public val cameras: Cameras? = null,
) {
    internal fun info(): FrameInfo = FrameInfo(
        timestampNs = timestampNs.toULong(),
        colour = ColourInfo(
            format = colour.format,
            width = size("colour", colour.width),
            height = size("colour", colour.height),
            planes = colour.planes.map { it.info("colour") },
            matrix = colour.matrix,
            videoRange = colour.videoRange,
        ),
        depth = DepthInfo(
            format = depth.format,
            width = size("depth", depth.width),
            height = size("depth", depth.height),
            plane = depth.plane.info("depth"),
        ),
        confidence = depth.confidence?.let {
            ConfidenceInfo(it.format, size("confidence", it.width), size("confidence", it.height), it.plane.info("confidence"))
        },
        orientation = orientation,
        cameras = cameras,
    )

    internal fun colourBytes(index: Int): ByteBuffer = colour.planes.getOrNull(index)?.bytes("colour") ?: empty

    internal fun depthBytes(): ByteBuffer = depth.plane.bytes("depth")

    internal fun confidenceBytes(): ByteBuffer = depth.confidence?.plane?.bytes("confidence") ?: empty

    private fun size(what: String, pixels: Int): UInt {
        if (pixels < 0) throw PhasefrontException.Frame("frame: $what has a side of $pixels pixels; it must be at least 1")
        return pixels.toUInt()
    }
}

/** Memory of a plane that a frame has not. */
private val empty: ByteBuffer = ByteBuffer.allocateDirect(0)
