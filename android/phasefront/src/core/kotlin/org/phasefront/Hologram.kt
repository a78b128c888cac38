package org.phasefront

import com.sun.jna.Pointer
import java.nio.ByteBuffer
import java.nio.ByteOrder
import java.nio.FloatBuffer

/** A colour of a hologram. */
public enum class Colour {
    /** The red laser's. */
    RED,

    /** The green laser's. */
    GREEN,

    /** The blue laser's. */
    BLUE,
    ;

    public companion object {
        /** The one of a display of one laser. */
        public val LASER: Colour = RED
    }
}

/**
 * The hologram of one frame: modulator levels of three colours, or of one laser, and what is known of them. Close it, so
 * that its memory goes back to the session at once and not whenever garbage is collected.
 */
public class Hologram internal constructor(private val raw: RawHologram) : AutoCloseable {
    /** What is known of it. */
    public val info: HologramInfo = raw.info()

    /**
     * Reads the levels of [colour] in place: width × height bytes, row by row without gaps. The buffer is valid in [body]
     * only, also while another thread closes the hologram.
     */
    public fun <R> usePlane(colour: Colour, body: (ByteBuffer) -> R): R = open {
        it.share().use { shared ->
            body(memory(shared.planeAddress(colour.ordinal.toUInt()), shared.planeLen()))
        }
    }

    /**
     * z of what is seen at ([x], [y]) of the picture, each 0 to 1 from its upper left corner, in mm: where to focus when it
     * is tapped on.
     */
    public fun zAt(x: Double, y: Double): Double = open { it.zAt(x, y) }

    /** What an eye focused at [zMm] sees: red, green, blue, alpha. Takes some milliseconds; not for the main thread. */
    public fun preview(zMm: Double, width: Int, height: Int): PixelImage {
        if (width < 1 || height < 1) {
            throw PhasefrontException.Setting("a preview of $width×$height is empty; each side must be at least 1")
        }
        return PixelImage(open { it.preview(zMm, width.toUInt(), height.toUInt()) })
    }

    /**
     * What an eye focused at [zMm] sees of the whole hologram: amplitudes, of which 1 is white. Transforms all of it;
     * not for the main thread.
     *
     * @throws PhasefrontException.Setting for a z too far away.
     */
    public fun refocus(zMm: Double): Planes = Planes(open { it.refocus(zMm) })

    /**
     * The complex field that the levels make behind the aperture at [zMm], 0 the midpoint, without the carrier: real
     * and imaginary part of each pixel. Transforms all of the hologram; not for the main thread.
     *
     * @throws PhasefrontException.Setting for a z too far away.
     */
    public fun field(zMm: Double = 0.0): Planes = Planes(open { it.field(zMm) })

    /**
     * Image [index] of those that the modulator's driver takes, of the modulator's resolution, levels as they are; all
     * layouts but grey have one.
     */
    public fun output(placement: Placement = Placement(Layout.RGBA), index: Int = 0): PixelImage {
        if (index < 0) throw PhasefrontException.Setting("there is no image $index; the first is 0")
        return PixelImage(open { it.output(placement, index.toUInt()) })
    }

    /** Gives the memory back. Closing twice does nothing. */
    override fun close(): Unit = raw.destroy()

    private fun <R> open(call: (RawHologram) -> R): R {
        if (raw.uniffiIsDestroyed) throw PhasefrontException.Session("hologram: it is closed; read it before closing it")
        return call(raw)
    }
}

/** Numbers at each pixel of each colour of a hologram: amplitudes, or a field. Close it, as a hologram. */
public class Planes internal constructor(private val raw: RawPlanes) : AutoCloseable {
    /** Pixels along x. */
    public val width: Int = raw.width().toInt()

    /** Pixels along y. */
    public val height: Int = raw.height().toInt()

    /** How many planes there are: 3, or 1 of a display of one laser. */
    public val colours: Int = raw.colours().toInt()

    /** Numbers of a pixel: 1, an amplitude, or 2, a real and an imaginary part. */
    public val numbers: Int = raw.pixelBytes().toInt() / Float.SIZE_BYTES

    /**
     * Reads the plane of [colour] in place: [height] rows of [width] pixels without gaps. The buffer is valid in [body]
     * only, also while another thread closes the planes.
     *
     * @throws PhasefrontException.Setting for a colour that it has not.
     */
    public fun <R> usePlane(colour: Colour, body: (FloatBuffer) -> R): R {
        if (raw.uniffiIsDestroyed) {
            throw PhasefrontException.Session("planes: they are closed; read them before closing them")
        }
        return raw.share().use {
            val len = Float.SIZE_BYTES.toULong() * (numbers.toLong() * width * height).toULong()
            val bytes = memory(it.planeAddress(colour.ordinal.toUInt()), len)
            body(bytes.order(ByteOrder.nativeOrder()).asFloatBuffer())
        }
    }

    /** Gives the memory back. Closing twice does nothing. */
    override fun close(): Unit = raw.destroy()
}

/** An image, row by row without gaps. */
public class PixelImage internal constructor(private val raw: RawImage) : AutoCloseable {
    public val width: Int = raw.width().toInt()
    public val height: Int = raw.height().toInt()

    /** Bytes of a pixel. */
    public val pixelBytes: Int = raw.pixelBytes().toInt()

    /** Reads the image in place. The buffer is valid in [body] only, also while another thread closes the image. */
    public fun <R> useBytes(body: (ByteBuffer) -> R): R {
        if (raw.uniffiIsDestroyed) throw PhasefrontException.Session("image: it is closed; read it before closing it")
        return raw.share().use { body(memory(it.address(), it.byteLen())) }
    }

    /** Gives the memory back. Closing twice does nothing. */
    override fun close(): Unit = raw.destroy()
}

/** The library's memory, read only. */
private fun memory(address: ULong, len: ULong): ByteBuffer =
    Pointer(address.toLong()).getByteBuffer(0, len.toLong()).asReadOnlyBuffer()
