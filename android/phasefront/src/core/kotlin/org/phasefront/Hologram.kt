package org.phasefront

import com.sun.jna.Native
import com.sun.jna.Pointer
import java.nio.ByteBuffer
import java.nio.ByteOrder
import java.nio.FloatBuffer

/** A colour of a hologram. */
public enum class Colour {
    /** The red laser. */
    RED,

    /** The green laser. */
    GREEN,

    /** The blue laser. */
    BLUE,
    ;

    public companion object {
        /** The colour of a display with a single laser. */
        public val LASER: Colour = RED
    }
}

/**
 * The hologram of one frame: modulator levels of three colours or of a single laser, with metadata. Close it to return
 * its memory to the session at once instead of at the next garbage collection.
 */
public class Hologram internal constructor(private val raw: RawHologram) : AutoCloseable {
    /** The metadata of the hologram. */
    public val info: HologramInfo = raw.info()

    /**
     * Reads the levels of [colour] in place: width × height bytes, row by row without gaps. The buffer is valid only in
     * [body], even if another thread closes the hologram meanwhile.
     */
    public fun <R> usePlane(colour: Colour, body: (ByteBuffer) -> R): R = open {
        it.share().use { shared ->
            body(memory(shared.planeAddress(colour.ordinal), shared.planeLen()))
        }
    }

    /**
     * Returns the z in mm of the scene point at ([x], [y]) of the image, each 0 to 1 from the upper left corner. Use it
     * to focus on a tapped point.
     */
    public fun zAt(x: Double, y: Double): Double = open { it.zAt(x, y) }

    /**
     * Writes the displayed image in sRGB for an eye focused at [zMm] into [to]: [width] × [height] pixels in [layout],
     * RGB, RGBA or BGRA, from the position of a direct buffer, with rows [rowStride] bytes apart. Allocates no image. It
     * takes some milliseconds, so do not call it on the main thread.
     *
     * @throws PhasefrontException.Setting if the image is empty or does not fit, or if z is too far away.
     */
    public fun writePreview(
        zMm: Double,
        width: Int,
        height: Int,
        to: ByteBuffer,
        layout: ModulatorLayout = ModulatorLayout.RGBA,
        rowStride: Int = width * if (layout == ModulatorLayout.RGB) 3 else 4,
    ) {
        if (width < 1 || height < 1) {
            throw PhasefrontException.Setting("a preview of $width×$height is empty; each side must be at least 1")
        }
        to.lend(rowStride) { memory -> open { it.writePreview(zMm, width, height, layout, memory) } }
    }

    /**
     * Returns the displayed image of the whole hologram for an eye focused at [zMm], as amplitudes; 1 is white. It
     * transforms the whole hologram, so do not call it on the main thread.
     *
     * @throws PhasefrontException.Setting if z is too far away.
     */
    public fun refocus(zMm: Double): Planes = Planes(open { it.refocus(zMm) })

    /**
     * Returns the complex field of the levels behind the aperture at [zMm] (0 is the midpoint), without the carrier:
     * the real and imaginary part of each pixel. It transforms the whole hologram, so do not call it on the main
     * thread.
     *
     * @throws PhasefrontException.Setting if z is too far away.
     */
    public fun field(zMm: Double = 0.0): Planes = Planes(open { it.field(zMm) })

    /** Returns the size of the images of [layout] for the modulator. All layouts except grey have one image. */
    public fun outputSize(layout: ModulatorLayout): OutputSize = open { it.outputSize(layout) }

    /**
     * Writes image [index] of the images for the modulator's driver, with unchanged levels, into [to]: [outputSize] has
     * its size. It begins at the position of a direct buffer, and its rows are [rowStride] bytes apart, by default
     * without gaps. Allocates no image.
     *
     * @throws PhasefrontException.Setting if the layout has no such image or the image does not fit.
     */
    public fun writeOutput(placement: Placement, to: ByteBuffer, index: Int = 0, rowStride: Int? = null) {
        val stride = rowStride ?: outputSize(placement.layout).run { width * pixelBytes }
        to.lend(stride) { memory -> open { it.writeOutput(placement, index, memory) } }
    }

    /** Frees the memory. Closing twice does nothing. */
    override fun close(): Unit = raw.destroy()

    internal fun <R> open(call: (RawHologram) -> R): R {
        if (raw.uniffiIsDestroyed) throw PhasefrontException.Session("hologram: it is closed; read it before closing it")
        return call(raw)
    }
}

/** The amplitudes or the complex field of a hologram, for each pixel and colour. Close it as you close a hologram. */
public class Planes internal constructor(private val raw: RawPlanes) : AutoCloseable {
    /** The width in pixels. */
    public val width: Int = raw.width()

    /** The height in pixels. */
    public val height: Int = raw.height()

    /** The number of planes: 3, or 1 for a display with a single laser. */
    public val colours: Int = raw.colours()

    /** The numbers per pixel: 1 for an amplitude, 2 for a real and an imaginary part. */
    public val numbers: Int = raw.pixelBytes() / Float.SIZE_BYTES

    /**
     * Reads the plane of [colour] in place: [height] rows of [width] pixels without gaps. The buffer is valid only in
     * [body], even if another thread closes the planes meanwhile.
     *
     * @throws PhasefrontException.Setting if there is no plane of this colour.
     */
    public fun <R> usePlane(colour: Colour, body: (FloatBuffer) -> R): R {
        if (raw.uniffiIsDestroyed) {
            throw PhasefrontException.Session("planes: they are closed; read them before closing them")
        }
        return raw.share().use {
            val len = Float.SIZE_BYTES.toULong() * (numbers.toLong() * width * height).toULong()
            val bytes = memory(it.planeAddress(colour.ordinal), len)
            body(bytes.order(ByteOrder.nativeOrder()).asFloatBuffer())
        }
    }

    /** Frees the memory. Closing twice does nothing. */
    override fun close(): Unit = raw.destroy()
}

/** Returns a read-only view of the library's memory. */
private fun memory(address: ULong, len: ULong): ByteBuffer =
    Pointer(address.toLong()).getByteBuffer(0, len.toLong()).asReadOnlyBuffer()

/**
 * Lends the bytes of a direct buffer from its position to its limit to [call], as memory of an image whose rows are
 * [rowStride] bytes apart.
 */
internal inline fun ByteBuffer.lend(rowStride: Int, call: (RawMemory) -> Unit) {
    if (isReadOnly) throw PhasefrontException.Setting("the image is in a buffer that is read-only")
    val bytes = direct { PhasefrontException.Setting("the image is $it; a direct one is needed, from ByteBuffer.allocateDirect") }
    val address = if (bytes.hasRemaining()) Pointer.nativeValue(Native.getDirectBufferPointer(bytes)) else 0
    // A lock keeps the buffer, and with it its memory, until the call has returned.
    synchronized(this) { call(RawMemory(address.toULong(), bytes.remaining().toULong(), rowStride)) }
}
