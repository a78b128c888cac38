package org.phasefront.sample

import android.app.Presentation
import android.content.Context
import android.graphics.Bitmap
import android.graphics.Canvas
import android.graphics.Paint
import android.os.Bundle
import android.view.Display
import android.view.View

/**
 * Shows the levels of a modulator of [width]×[height] pixels on an external screen, pixel for pixel. The screen drives
 * the modulator.
 */
class PhaseOutput(context: Context, display: Display, private val width: Int, private val height: Int) :
    Presentation(context, display) {
    private val view = LevelsView(getContext())

    override fun onCreate(savedInstanceState: Bundle?) {
        super.onCreate(savedInstanceState)
        // In another mode the screen would scale the levels.
        val mode = display.supportedModes.firstOrNull { it.physicalWidth == width && it.physicalHeight == height }
        mode?.let { window?.run { attributes = attributes.apply { preferredDisplayModeId = it.modeId } } }
        setContentView(view)
    }

    fun show(levels: Bitmap) {
        view.levels = levels
        view.invalidate()
    }

    private class LevelsView(context: Context) : View(context) {
        var levels: Bitmap? = null

        // Levels must not be filtered or scaled: a value between two levels is a different phase.
        private val exact = Paint().apply {
            isFilterBitmap = false
            isDither = false
        }

        override fun onDraw(canvas: Canvas) {
            val levels = levels ?: return
            canvas.drawBitmap(levels, (width - levels.width) / 2f, (height - levels.height) / 2f, exact)
        }
    }
}
