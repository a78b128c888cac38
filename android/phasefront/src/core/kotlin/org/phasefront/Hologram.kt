package org.phasefront

import com.sun.jna.Pointer
import java.nio.ByteBuffer

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
