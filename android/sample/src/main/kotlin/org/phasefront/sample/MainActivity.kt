package org.phasefront.sample

import android.Manifest
import android.app.Activity
import android.content.Intent
import android.content.pm.PackageManager
import android.hardware.display.DisplayManager
import android.net.Uri
import android.os.Bundle
import android.os.Handler
import android.os.Looper
import android.provider.Settings
import android.view.Surface
import android.view.WindowManager
import org.phasefront.Hologram
import org.phasefront.HologramDisplay
import org.phasefront.HologramLog
import org.phasefront.sendToLogcat
import org.phasefront.writeOutput
import org.phasefront.writePreview

/**
 * Converts the camera or the sample scene to holograms. Shows the displayed image focused by the slider or a tap, the
 * levels on an external screen if there is one, and what the camera and the session do.
 */
class MainActivity : Activity(), Holograms.Screen, MainView.Actions {
    private lateinit var view: MainView
    private lateinit var holograms: Holograms
    private val main = Handler(Looper.getMainLooper())
    private val display = HologramDisplay(width = 960, height = 540)
    private val views = Bitmaps(display.width / 2, display.height / 2)
    private val levels = Bitmaps(display.width, display.height)
    private var output: PhaseOutput? = null

    /** The latest hologram, for taps. Only the main thread uses it. */
    private var latest: Hologram? = null

    /** Whether the user was asked for the camera, and for ARCore's installation. */
    private var wasAsked = false
    private var wasAskedForArCore = false

    /** The display's rotation, written on the main thread and read on the camera's. */
    @Volatile private var displayDegrees = 0

    /** Whether an external screen shows the levels, written on the main thread and read on the session's thread. */
    @Volatile private var needsLevels = false

    private val screens = object : DisplayManager.DisplayListener {
        override fun onDisplayAdded(id: Int) = showOnExternalScreen()

        override fun onDisplayRemoved(id: Int) = showOnExternalScreen()

        // Also a rotation by half a turn, which changes no configuration, and a screen that stops or begins to mirror.
        override fun onDisplayChanged(id: Int) {
            rotate()
            showOnExternalScreen()
        }
    }

    override fun onCreate(saved: Bundle?) {
        super.onCreate(saved)
        HologramLog.sendToLogcat()
        window.addFlags(WindowManager.LayoutParams.FLAG_KEEP_SCREEN_ON)
        view = MainView(this, display.volumeDepthMm, this)
        holograms = Holograms(applicationContext, display, this)
        saved?.let {
            view.zMm = it.getDouble(FOCUS)
            wasAsked = it.getBoolean(ASKED)
            wasAskedForArCore = it.getBoolean(ASKED_FOR_ARCORE)
        }
        setContentView(view.root)
    }

    override fun onSaveInstanceState(to: Bundle) {
        super.onSaveInstanceState(to)
        to.putDouble(FOCUS, view.zMm)
        to.putBoolean(ASKED, wasAsked)
        to.putBoolean(ASKED_FOR_ARCORE, wasAskedForArCore)
    }

    override fun onStart() {
        super.onStart()
        getSystemService(DisplayManager::class.java).registerDisplayListener(screens, null)
        rotate()
        showOnExternalScreen()
    }

    // Also after each dialogue of the system.
    override fun onResume() {
        super.onResume()
        begin()
    }

    /** Starts what can be started now: asks for the camera, waits for ARCore, or starts a source. */
    private fun begin() {
        main.removeCallbacks(again)
        if (holograms.isRunning) return
        if (!hasCamera() && !wasAsked) return ask()
        if (!hasCamera()) return start { SampleSource(assets, "the app may not use the camera") }
        CameraSource.find(this, ::displayDegrees)?.let { camera -> return start { camera } }
        when (val arCore = ArCore.prepare(this, mayAsk = !wasAskedForArCore)) {
            ArCore.Ready -> start { ArCoreSource(applicationContext, ::displayDegrees) }
            ArCore.Checking -> {
                holograms.tell(SourceEvent.Started)
                main.postDelayed(again, CHECK_MS)
            }
            ArCore.Installing -> {
                wasAskedForArCore = true
                holograms.tell(SourceEvent.Asked("install Google Play Services for AR"))
            }
            is ArCore.Missing -> start { SampleSource(assets, arCore.why) }
        }
    }

    private val again = Runnable(::begin)

    private fun start(source: () -> FrameSource) {
        view.offer(if (hasCamera()) null else "Allow the camera")
        holograms.start(source)
    }

    private fun hasCamera(): Boolean = checkSelfPermission(Manifest.permission.CAMERA) == PackageManager.PERMISSION_GRANTED

    private fun ask() {
        wasAsked = true
        holograms.tell(SourceEvent.Asked("use the camera"))
        requestPermissions(arrayOf(Manifest.permission.CAMERA), 0)
    }

    override fun onRequestPermissionsResult(request: Int, permissions: Array<out String>, results: IntArray) {
        super.onRequestPermissionsResult(request, permissions, results)
        // Empty if the dialogue went away without an answer. The activity is resumed after this.
        wasAsked = results.isNotEmpty()
    }

    /** Asks for the camera once more. Android no longer shows its dialogue after two refusals, but the app's settings. */
    override fun retry() {
        holograms.stop(::forget)
        if (hasCamera()) return begin()
        if (shouldShowRequestPermissionRationale(Manifest.permission.CAMERA)) return ask()
        startActivity(Intent(Settings.ACTION_APPLICATION_DETAILS_SETTINGS, Uri.fromParts("package", packageName, null)))
    }

    override fun show(state: SourceState) {
        view.state = state.text
        if (state is SourceState.Failed) view.offer("Try again")
    }

    override fun show(hologram: Hologram, told: String) {
        val seen = views.next().also { hologram.writePreview(view.zMm, it) }
        val image = if (needsLevels) levels.next().also { hologram.writeOutput(it) } else null
        runOnUiThread {
            forget()
            latest = hologram
            view.show(seen, told)
            image?.let { output?.show(it) }
        }
    }

    private fun forget() {
        latest?.close()
        latest = null
    }

    override fun zAt(x: Double, y: Double): Double? = latest?.zAt(x, y)

    // The session is closed during the benchmark, so that nothing else computes.
    override fun measure() = startActivity(Intent(this, BenchmarkActivity::class.java))

    @Suppress("DEPRECATION") // The newer call needs API 30.
    private fun rotate() {
        displayDegrees = when (windowManager.defaultDisplay.rotation) {
            Surface.ROTATION_90 -> 90
            Surface.ROTATION_180 -> 180
            Surface.ROTATION_270 -> 270
            else -> 0
        }
    }

    /** Shows the levels on the first external screen, which may have come or gone. */
    private fun showOnExternalScreen() {
        val found = getSystemService(DisplayManager::class.java).getDisplays(DisplayManager.DISPLAY_CATEGORY_PRESENTATION).firstOrNull()
        if (output != null && output?.display?.displayId == found?.displayId) return
        output?.dismiss()
        output = found?.let {
            try {
                PhaseOutput(this, it, display.width, display.height).apply { show() }
            } catch (_: WindowManager.InvalidDisplayException) {
                // It was unplugged just now.
                null
            }
        }
        needsLevels = output != null
    }

    // The system needs memory.
    override fun onLowMemory() {
        super.onLowMemory()
        forget()
    }

    override fun onStop() {
        super.onStop()
        main.removeCallbacks(again)
        getSystemService(DisplayManager::class.java).unregisterDisplayListener(screens)
        holograms.stop(::forget)
        output?.dismiss()
        output = null
        needsLevels = false
    }

    override fun onDestroy() {
        super.onDestroy()
        holograms.close()
    }

    private companion object {
        const val FOCUS = "focus"
        const val ASKED = "asked"
        const val ASKED_FOR_ARCORE = "asked for ARCore"

        /** Between two questions to ARCore, in ms. */
        const val CHECK_MS = 200L
    }
}
