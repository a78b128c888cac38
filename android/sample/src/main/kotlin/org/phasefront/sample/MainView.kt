package org.phasefront.sample

import android.content.Context
import android.graphics.Bitmap
import android.graphics.Matrix
import android.os.Build
import android.view.Gravity
import android.view.MotionEvent
import android.view.View
import android.widget.Button
import android.widget.ImageView
import android.widget.LinearLayout
import android.widget.LinearLayout.LayoutParams
import android.widget.LinearLayout.LayoutParams.MATCH_PARENT
import android.widget.LinearLayout.LayoutParams.WRAP_CONTENT
import android.widget.SeekBar
import android.widget.TextView

/** The views of the main screen: a preview, the focus, the state, statistics and buttons. */
class MainView(context: Context, private val volumeDepthMm: Double, private val actions: Actions) {
    interface Actions {
        /** Returns the z of the scene's point at ([x], [y]) of the image, each 0..1, if there is an image. */
        fun zAt(x: Double, y: Double): Double?

        fun retry()

        fun measure()
    }

    private val preview = ImageView(context).apply {
        contentDescription = "What an eye sees of the hologram. Tap to focus on a point."
        setOnTouchListener { _, event -> event.action != MotionEvent.ACTION_UP || tapped(event) }
    }
    private val focus = SeekBar(context).apply {
        contentDescription = "Focus, from far to near"
        max = FOCUS_STEPS
        progress = FOCUS_STEPS / 2
        setOnSeekBarChangeListener(object : SeekBar.OnSeekBarChangeListener {
            override fun onProgressChanged(bar: SeekBar, progress: Int, fromUser: Boolean) {
                focusedMm = volumeDepthMm * (progress.toDouble() / FOCUS_STEPS - 0.5)
                if (Build.VERSION.SDK_INT >= Build.VERSION_CODES.R) bar.stateDescription = "%.1f millimetres".format(focusedMm)
            }

            override fun onStartTrackingTouch(bar: SeekBar) = Unit

            override fun onStopTrackingTouch(bar: SeekBar) = Unit
        })
    }
    private val stateText = TextView(context).apply {
        setPadding(24, 24, 24, 0)
        // Read aloud when it changes.
        accessibilityLiveRegion = View.ACCESSIBILITY_LIVE_REGION_POLITE
    }
    private val statistics = TextView(context).apply { setPadding(24, 24, 24, 24) }
    private val retry = Button(context).apply {
        visibility = View.GONE
        setOnClickListener { actions.retry() }
    }
    private val benchmark = Button(context).apply {
        text = "Benchmark"
        setOnClickListener { actions.measure() }
    }

    val root: View = LinearLayout(context).apply {
        orientation = LinearLayout.VERTICAL
        gravity = Gravity.CENTER_VERTICAL
        // Not under the system's bars.
        fitsSystemWindows = true
        addView(preview, LayoutParams(MATCH_PARENT, 0, 1f))
        for (view in listOf(focus, stateText, statistics, retry, benchmark)) addView(view, LayoutParams(MATCH_PARENT, WRAP_CONTENT))
    }

    /** The focus, written on the main thread and read on any. */
    @Volatile private var focusedMm = 0.0

    var zMm: Double
        get() = focusedMm
        set(z) {
            focus.progress = ((z / volumeDepthMm + 0.5) * FOCUS_STEPS).toInt()
        }

    var state: CharSequence by stateText::text

    fun show(seen: Bitmap, told: String) {
        preview.setImageBitmap(seen)
        statistics.text = told
    }

    /** Shows a button called [name] that tries again, or none. */
    fun offer(name: String?) {
        retry.text = name.orEmpty()
        retry.visibility = if (name == null) View.GONE else View.VISIBLE
    }

    private fun tapped(event: MotionEvent): Boolean {
        val image = preview.drawable ?: return false
        val at = floatArrayOf(event.x - preview.paddingLeft, event.y - preview.paddingTop)
        Matrix().also { preview.imageMatrix.invert(it) }.mapPoints(at)
        val (x, y) = listOf(at[0] / image.intrinsicWidth, at[1] / image.intrinsicHeight)
        if (x !in 0f..1f || y !in 0f..1f) return false
        actions.zAt(x.toDouble(), y.toDouble())?.let { zMm = it }
        return preview.performClick()
    }

    private companion object {
        const val FOCUS_STEPS = 200
    }
}
