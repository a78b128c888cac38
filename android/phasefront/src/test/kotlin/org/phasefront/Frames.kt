package org.phasefront

import java.nio.ByteBuffer
import java.nio.ByteOrder
import kotlin.test.assertEquals

/** Returns a direct buffer of [size] bytes in little-endian order. */
internal fun direct(size: Int): ByteBuffer = ByteBuffer.allocateDirect(size).order(ByteOrder.LITTLE_ENDIAN)

internal val network: HologramNetwork by lazy { HologramNetwork.builtIn() }
internal val display: HologramDisplay = HologramDisplay(width = 64, height = 48)

internal fun options(): SessionOptions = sessionOptions(display, network)

/** Returns an RGBA image of 64×48 pixels that is not uniform. */
internal fun colourBytes(): ByteBuffer {
    val bytes = direct(4 * 64 * 48)
    for (y in 0 until 48) {
        for (x in 0 until 64) {
            bytes.put((x * 4).toByte()).put((y * 5).toByte()).put((255 - x * 3).toByte()).put(0)
        }
    }
    return bytes.flip().order(ByteOrder.LITTLE_ENDIAN)
}

/** Returns 32×24 depths in metres: an object in front of a wall. */
internal fun depthBytes(metres: Float = 0.5f): ByteBuffer {
    val bytes = direct(4 * 32 * 24)
    for (y in 0 until 24) {
        for (x in 0 until 32) bytes.putFloat(if (y in 6..17 && x in 8..23) metres / 2 else metres)
    }
    return bytes.flip().order(ByteOrder.LITTLE_ENDIAN)
}

internal fun still(
    timestampNs: Long = 0,
    colour: ByteBuffer = colourBytes(),
    depth: ByteBuffer = depthBytes(),
): CameraFrame = CameraFrame(
    timestampNs,
    ColourImage(ColourFormat.RGBA, 64, 48, colour),
    DepthImage(DepthFormat.METRES_F32, 32, 24, depth),
)

/** The levels of all colours. */
internal fun Hologram.levels(): ByteArray {
    val size = info.width * info.height
    val colours = Colour.entries.take(info.colours)
    val all = ByteArray(colours.size * size)
    for (colour in colours) usePlane(colour) { it.get(all, colour.ordinal * size, size) }
    return all
}

/** The numbers of all planes, in memory order. */
internal fun Planes.bytes(): ByteArray {
    val all = direct(Float.SIZE_BYTES * numbers * width * height * colours)
    for (colour in Colour.entries.take(colours)) {
        usePlane(colour) { plane ->
            assertEquals(numbers * width * height, plane.remaining())
            repeat(plane.remaining()) { all.putFloat(plane.get()) }
        }
    }
    return ByteArray(all.capacity()).also { all.flip().get(it) }
}
