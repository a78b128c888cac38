package org.phasefront.sample

import android.Manifest
import android.app.Activity
import android.content.Intent
import android.content.pm.PackageManager
import android.hardware.display.DisplayManager
import android.os.Build
import android.os.Bundle
import android.os.PowerManager
import android.util.Log
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
import java.util.concurrent.Executors
import org.phasefront.CameraFrame
import org.phasefront.Hologram
import org.phasefront.HologramDisplay
import org.phasefront.HologramLog
import org.phasefront.HologramSession
import org.phasefront.PhasefrontException
import org.phasefront.RunningMode
import org.phasefront.SessionEvent
import org.phasefront.phoneOptions
import org.phasefront.sendToLogcat
import org.phasefront.thermalOf
import org.phasefront.writeOutput
import org.phasefront.writePreview

/**
 * Converts the camera or the sample scene to holograms. Shows the displayed image focused by the slider or a tap, the
 * levels on an external screen if there is one, and statistics.
 */
class MainActivity : Activity() {
    private lateinit var preview: ImageView
    private lateinit var focus: SeekBar
    private lateinit var statistics: TextView

    /** Plans and closes sessions and opens cameras, one after another, because each takes long. */
    private val work = Executors.newSingleThreadExecutor()

    /** Written on the thread of [work]. */
    @Volatile private var session: HologramSession? = null
    private var source: FrameSource? = null
    private var output: PhaseOutput? = null
    private val hologramDisplay = HologramDisplay(width = 960, height = 540)
    private val views = Bitmaps(hologramDisplay.width / 2, hologramDisplay.height / 2)
    private val levels = Bitmaps(hologramDisplay.width, hologramDisplay.height)
    private var wasAsked = false

    /** The focus, written on the main thread and read on the session's thread. */
    @Volatile private var zMm = 0.0

    /** Whether an external screen shows the levels, written on the main thread and read on the session's thread. */
    @Volatile private var needsLevels = false

    /** The latest hologram, for taps. Only the main thread uses it. */
    private var latest: Hologram? = null

    private val screens = object : DisplayManager.DisplayListener {
        override fun onDisplayAdded(id: Int) = showOnExternalScreen()

        override fun onDisplayRemoved(id: Int) = showOnExternalScreen()

        override fun onDisplayChanged(id: Int) = Unit
    }
    private val thermal = if (Build.VERSION.SDK_INT < Build.VERSION_CODES.Q) {
        null
    } else {
        PowerManager.OnThermalStatusChangedListener { status -> work.execute { session?.setThermal(thermalOf(status)) } }
    }

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
        getSystemService(DisplayManager::class.java).registerDisplayListener(screens, null)
        showOnExternalScreen()
        if (hasCamera() || wasAsked) {
            run()
        } else {
            wasAsked = true
            requestPermissions(arrayOf(Manifest.permission.CAMERA), 0)
        }
    }

    override fun onRequestPermissionsResult(request: Int, permissions: Array<out String>, results: IntArray) {
        super.onRequestPermissionsResult(request, permissions, results)
        if (!hasCamera()) say("without the permission for the camera, this is the sample scene")
        run()
    }

    private fun hasCamera(): Boolean = checkSelfPermission(Manifest.permission.CAMERA) == PackageManager.PERMISSION_GRANTED

    private fun run() {
        val degrees = displayDegrees()
        work.execute {
            if (session != null) return@execute
            try {
                session = HologramSession(phoneOptions(hologramDisplay), RunningMode.LIVE, ::heard)
            } catch (refused: PhasefrontException) {
                return@execute runOnUiThread { say(refused.message.orEmpty()) }
            }
            val camera = if (hasCamera()) CameraSource.find(this, degrees) ?: ArCoreSource.find(this, degrees) else null
            source = (camera ?: SampleSource(assets)).also { it.start(::submit) { message -> runOnUiThread { say(message) } } }
        }
        if (Build.VERSION.SDK_INT >= Build.VERSION_CODES.Q && thermal != null) {
            getSystemService(PowerManager::class.java).addThermalStatusListener(thermal)
        }
    }

    private fun submit(frame: CameraFrame) {
        try {
            session?.submit(frame)
        } catch (refused: PhasefrontException) {
            Log.w("sample", refused.message.orEmpty())
        }
    }

    /** Handles an event on the session's thread. */
    private fun heard(event: SessionEvent) {
        if (event !is SessionEvent.Processed) return
        val hologram = event.hologram
        val view = views.next().also { hologram.writePreview(zMm, it) }
        val image = if (needsLevels) levels.next().also { hologram.writeOutput(it) } else null
        val told = describe()
        runOnUiThread {
            latest?.close()
            latest = hologram
            preview.setImageBitmap(view)
            image?.let { output?.show(it) }
            statistics.text = told
        }
    }

    private fun describe(): String {
        val of = session?.statistics ?: return ""
        return "%.1f holograms a second, %d dropped of %d\n%s: %.1f ms, of which the method takes %.1f".format(
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

    /** Shows the levels on the first external screen, which may have come or gone. */
    private fun showOnExternalScreen() {
        val found = getSystemService(DisplayManager::class.java).getDisplays(DisplayManager.DISPLAY_CATEGORY_PRESENTATION)
        if (output?.display?.displayId == found.firstOrNull()?.displayId) return
        output?.dismiss()
        output = found.firstOrNull()?.let { PhaseOutput(this, it, hologramDisplay.width, hologramDisplay.height).apply { show() } }
        needsLevels = output != null
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
        getSystemService(DisplayManager::class.java).unregisterDisplayListener(screens)
        if (Build.VERSION.SDK_INT >= Build.VERSION_CODES.Q && thermal != null) {
            getSystemService(PowerManager::class.java).removeThermalStatusListener(thermal)
        }
        work.execute {
            source?.close()
            source = null
            session?.close()
            session = null
            // Behind what the listener has posted.
            runOnUiThread {
                latest?.close()
                latest = null
            }
        }
        output?.dismiss()
        output = null
        needsLevels = false
    }

    override fun onDestroy() {
        super.onDestroy()
        work.shutdown()
    }

    private companion object {
        const val FOCUS_STEPS = 200
    }
}
