package org.phasefront

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
     * Returns the displayed image for an eye focused at [zMm]: red, green, blue, alpha. It takes some milliseconds, so
     * do not call it on the main thread.
     */
    public fun preview(zMm: Double, width: Int, height: Int): PixelImage {
        if (width < 1 || height < 1) {
            throw PhasefrontException.Setting("a preview of $width×$height is empty; each side must be at least 1")
        }
        return PixelImage(open { it.preview(zMm, width, height) })
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

    /**
     * Returns image [index] of the images for the modulator's driver, at the modulator's resolution, with unchanged
     * levels. All layouts except grey have one image.
     */
    public fun output(placement: Placement = Placement(ModulatorLayout.RGBA), index: Int = 0): PixelImage {
        if (index < 0) throw PhasefrontException.Setting("there is no image $index; the first is 0")
        return PixelImage(open { it.output(placement, index) })
    }

    /** Frees the memory. Closing twice does nothing. */
    override fun close(): Unit = raw.destroy()

    private fun <R> open(call: (RawHologram) -> R): R {
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

/** An image whose rows have no gaps. */
public class PixelImage internal constructor(private val raw: RawImage) : AutoCloseable {
    public val width: Int = raw.width()
    public val height: Int = raw.height()

    /** The number of bytes per pixel. */
    public val pixelBytes: Int = raw.pixelBytes()

    /**
     * Reads the image in place. The buffer is valid only in [body], even if another thread closes the image meanwhile.
     */
    public fun <R> useBytes(body: (ByteBuffer) -> R): R {
        if (raw.uniffiIsDestroyed) throw PhasefrontException.Session("image: it is closed; read it before closing it")
        return raw.share().use { body(memory(it.address(), it.byteLen())) }
    }

    /** Frees the memory. Closing twice does nothing. */
    override fun close(): Unit = raw.destroy()
}

/** Returns a read-only view of the library's memory. */
private fun memory(address: ULong, len: ULong): ByteBuffer =
    Pointer(address.toLong()).getByteBuffer(0, len.toLong()).asReadOnlyBuffer()
