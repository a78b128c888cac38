package org.phasefront.sample

import android.Manifest
import android.app.Activity
import android.content.Intent
import android.content.pm.PackageManager
import android.graphics.Bitmap
import android.hardware.display.DisplayManager
import android.os.Build
import android.os.Bundle
import android.os.PowerManager
import android.view.Gravity
import android.view.MotionEvent
import android.view.Surface
import android.view.View
import android.widget.Button
import android.widget.ImageView
import android.widget.LinearLayout
import android.widget.SeekBar
import android.widget.TextView
import android.widget.Toast
import org.phasefront.Hologram
import org.phasefront.HologramDisplay
import org.phasefront.HologramLog
import org.phasefront.HologramSession
import org.phasefront.PhasefrontException
import org.phasefront.RunningMode
import org.phasefront.SessionEvent
import org.phasefront.sendToLogcat
import org.phasefront.sessionOptions
import org.phasefront.thermalOf
import org.phasefront.toBitmap

/**
 * Converts the camera or the sample scene to holograms. Shows the displayed image focused by the slider or a tap, the
 * levels on an external screen if there is one, and statistics.
 */
class MainActivity : Activity() {
    private lateinit var preview: ImageView
    private lateinit var focus: SeekBar
    private lateinit var statistics: TextView
    private var session: HologramSession? = null
    private var source: FrameSource? = null
    private var output: PhaseOutput? = null
    private val hologramDisplay = HologramDisplay(width = 960, height = 540)

    /** The focus, written on the main thread and read on the session's thread. */
    @Volatile private var zMm = 0.0

    /** The latest hologram, for taps. Only the main thread uses it. */
    private var latest: Hologram? = null

    override fun onCreate(savedInstanceState: Bundle?) {
        super.onCreate(savedInstanceState)
        HologramLog.sendToLogcat()
        preview = ImageView(this).apply {
            adjustViewBounds = true
            setOnTouchListener { view, event -> event.action == MotionEvent.ACTION_UP && tapped(view, event) }
        }
        focus = SeekBar(this).apply {
            max = FOCUS_STEPS
            progress = FOCUS_STEPS / 2
            setOnSeekBarChangeListener(object : SeekBar.OnSeekBarChangeListener {
                override fun onProgressChanged(bar: SeekBar, progress: Int, fromUser: Boolean) {
                    zMm = hologramDisplay.volumeDepthMm * (progress.toDouble() / FOCUS_STEPS - 0.5)
                }

                override fun onStartTrackingTouch(bar: SeekBar) = Unit

                override fun onStopTrackingTouch(bar: SeekBar) = Unit
            })
        }
        statistics = TextView(this).apply { setPadding(24, 24, 24, 24) }
        val benchmark = Button(this).apply {
            text = "Benchmark"
            // The session is closed during the benchmark, so that nothing else computes.
            setOnClickListener { startActivity(Intent(context, BenchmarkActivity::class.java)) }
        }
        setContentView(
            LinearLayout(this).apply {
                orientation = LinearLayout.VERTICAL
                gravity = Gravity.CENTER_VERTICAL
                for (view in listOf(preview, focus, statistics, benchmark)) addView(view)
            },
        )
    }

    override fun onStart() {
        super.onStart()
        if (checkSelfPermission(Manifest.permission.CAMERA) == PackageManager.PERMISSION_GRANTED) {
            run()
        } else {
            requestPermissions(arrayOf(Manifest.permission.CAMERA), 0)
        }
    }

    override fun onRequestPermissionsResult(request: Int, permissions: Array<out String>, results: IntArray) {
        super.onRequestPermissionsResult(request, permissions, results)
        run()
    }

    private fun run() {
        if (session != null) return
        try {
            session = HologramSession(sessionOptions(hologramDisplay).copy(targetRateHz = 30.0), RunningMode.LIVE, ::heard)
        } catch (refused: PhasefrontException) {
            return say(refused.message.orEmpty())
        }
        showOnExternalScreen()
        if (Build.VERSION.SDK_INT >= Build.VERSION_CODES.Q) {
            getSystemService(PowerManager::class.java).addThermalStatusListener(mainExecutor) { session?.setThermal(thermalOf(it)) }
        }
        val granted = checkSelfPermission(Manifest.permission.CAMERA) == PackageManager.PERMISSION_GRANTED
        val camera = if (granted) CameraSource.find(this, displayDegrees()) else null
        if (camera == null) say("no camera with depth: this is the sample scene")
        source = (camera ?: SampleSource(assets)).also { source ->
            source.start({ frame ->
                try {
                    session?.submit(frame)
                } catch (refused: PhasefrontException) {
                    android.util.Log.w("sample", refused.message.orEmpty())
                }
            }, { message -> runOnUiThread { say(message) } })
        }
    }

    /** Handles an event on the session's thread. */
    private fun heard(event: SessionEvent) {
        if (event !is SessionEvent.Processed) return
        val hologram = event.hologram
        val view = hologram.preview(zMm, hologramDisplay.width / 2, hologramDisplay.height / 2).use { it.toBitmap() }
        val levels: Bitmap? = output?.let { hologram.output().use { image -> image.toBitmap() } }
        runOnUiThread {
            latest?.close()
            latest = hologram
            preview.setImageBitmap(view)
            levels?.let { output?.show(it) }
            statistics.text = describe()
        }
    }

    private fun describe(): String {
        val of = session?.statistics ?: return ""
        return "%.1f holograms a second, %d dropped of %d\n%s: %.1f ms, of which the network takes %.1f".format(
            of.rateHz,
            of.dropped.total,
            of.submitted,
            of.backend,
            of.times.totalMs,
            of.times.methodMs,
        )
    }

    private fun tapped(view: View, event: MotionEvent): Boolean {
        val z = latest?.zAt(event.x.toDouble() / view.width, event.y.toDouble() / view.height) ?: return false
        focus.progress = ((z / hologramDisplay.volumeDepthMm + 0.5) * FOCUS_STEPS).toInt()
        view.performClick()
        return true
    }

    private fun showOnExternalScreen() {
        val screens = getSystemService(DisplayManager::class.java).getDisplays(DisplayManager.DISPLAY_CATEGORY_PRESENTATION)
        output = screens.firstOrNull()?.let { PhaseOutput(this, it).apply { show() } }
    }

    @Suppress("DEPRECATION") // The newer call needs API 30.
    private fun displayDegrees(): Int = when (windowManager.defaultDisplay.rotation) {
        Surface.ROTATION_90 -> 90
        Surface.ROTATION_180 -> 180
        Surface.ROTATION_270 -> 270
        else -> 0
    }

    private fun say(message: String) = Toast.makeText(this, message, Toast.LENGTH_LONG).show()

    override fun onStop() {
        super.onStop()
        source?.close()
        source = null
        // Closing waits for the listener, which only posts to this thread and therefore never blocks on it.
        session?.close()
        session = null
        output?.dismiss()
        output = null
        latest?.close()
        latest = null
    }

    private companion object {
        const val FOCUS_STEPS = 200
    }
}
