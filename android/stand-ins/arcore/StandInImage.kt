package com.google.ar.core

import android.graphics.ImageFormat
import android.hardware.HardwareBuffer
import android.media.Image
import java.nio.ByteBuffer
import java.util.concurrent.atomic.AtomicInteger

/** An image of the stand-in, of 64×48 pixels. */
internal class StandInImage private constructor(private val format: Int, private vararg val all: Plane) : Image() {
    init {
        open.incrementAndGet()
    }

    override fun getFormat(): Int = format

    override fun getWidth(): Int = WIDTH

    override fun getHeight(): Int = HEIGHT

    override fun getTimestamp(): Long = 1

    override fun getTransform(): Int = 0

    override fun getScalingMode(): Int = 0

    override fun getPlanes(): Array<out Plane> = all

    override fun close() {
        open.decrementAndGet()
    }

    private class Bytes(private val bytes: ByteBuffer, private val row: Int, private val pixel: Int) : Plane() {
        override fun getRowStride(): Int = row

        override fun getPixelStride(): Int = pixel

        override fun getBuffer(): ByteBuffer = bytes
    }

    companion object {
        private const val WIDTH = 64
        private const val HEIGHT = 48

        /** Images that are not closed. */
        val open = AtomicInteger()

        private fun bytes(row: Int, rows: Int, pixel: Int, value: (Int) -> Int): Plane =
            Bytes(ByteBuffer.allocateDirect(row * rows).apply { repeat(row * rows) { put(value(it).toByte()) } }.flip(), row, pixel)

        fun camera(): Image = StandInImage(
            ImageFormat.YUV_420_888,
            bytes(WIDTH, HEIGHT, 1) { it % 251 },
            bytes(WIDTH, HEIGHT / 2, 2) { 128 },
            bytes(WIDTH, HEIGHT / 2, 2) { 128 },
        )

        /** Millimetres, 1 m to 2.2 m, in little-endian order. */
        fun depth(): Image = StandInImage(HardwareBuffer.D_16, bytes(2 * WIDTH, HEIGHT, 2) { if (it % 2 == 1) 4 + it / 2 % WIDTH / 16 else 0 })

        fun confidence(): Image = StandInImage(ImageFormat.Y8, bytes(WIDTH, HEIGHT, 1) { 255 })
    }
}
