package org.phasefront.sample

import android.graphics.Bitmap

/** Bitmaps of one size that are written in turn, so that none is written while it is shown. */
class Bitmaps(width: Int, height: Int) {
    private val all = List(3) {
        // Without a density, so that no canvas scales its pixels.
        Bitmap.createBitmap(width, height, Bitmap.Config.ARGB_8888).apply { density = Bitmap.DENSITY_NONE }
    }
    private var written = 0

    fun next(): Bitmap = all[written++ % all.size]
}
