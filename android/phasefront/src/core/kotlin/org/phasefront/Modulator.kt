package org.phasefront

import java.nio.ByteBuffer

/**
 * A modulator: its display, the phases of its levels, and the images that its input takes. [modulatorNames] lists those
 * that the library knows.
 */
public class Modulator private constructor(private val raw: RawModulator) : AutoCloseable {
    /** The target of holograms for the modulator. */
    public val target: HologramTarget = raw.target()

    /** The size of the images that its input takes. */
    public val outputSize: OutputSize = raw.outputSize()

    /**
     * Writes image [index] of the images that its input takes of [hologram] into [to], from the position of a direct
     * buffer, with rows [rowStride] bytes apart.
     *
     * @throws PhasefrontException.Setting if the hologram does not fit the modulator or the image does not fit.
     */
    public fun writeOutput(
        hologram: Hologram,
        to: ByteBuffer,
        index: Int = 0,
        rowStride: Int = outputSize.width * outputSize.pixelBytes,
    ): Unit = to.lend(rowStride) { memory -> hologram.open { raw.writeOutput(it, index, memory) } }

    /**
     * Writes the same image in the pixels of a screen that drives the modulator, in [layout] RGBA or BGRA, into [to], as
     * [writeOutput] does. The red, green and blue of a grey image are its level.
     *
     * @throws PhasefrontException.Setting in the cases of [writeOutput], for another layout, and for a modulator whose
     * images have 16 bits.
     */
    public fun writePixels(
        hologram: Hologram,
        to: ByteBuffer,
        index: Int = 0,
        layout: ModulatorLayout = ModulatorLayout.RGBA,
        rowStride: Int = 4 * outputSize.width,
    ): Unit = to.lend(rowStride) { memory -> hologram.open { raw.writePixels(it, index, layout, memory) } }

    /** Frees the memory. Closing twice does nothing. */
    override fun close() {
        target.destroy()
        raw.destroy()
    }

    public companion object {
        /**
         * Returns the modulator called [name], for example "holoeye-pluto".
         *
         * @throws PhasefrontException.Display for a name that [modulatorNames] does not have.
         */
        public fun named(name: String): Modulator = Modulator(RawModulator.named(name))

        /**
         * Reads the [text] of a modulator's file, with keys such as packing and levels_turns.
         *
         * @throws PhasefrontException.Display if it is not such a text.
         */
        public fun fromToml(text: String): Modulator = Modulator(RawModulator.fromToml(text))
    }
}
