package org.phasefront.sample

import android.Manifest
import android.app.Application
import android.graphics.ImageFormat
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraManager
import android.hardware.camera2.CameraMetadata
import android.hardware.camera2.params.StreamConfiguration
import android.hardware.display.DisplayManager
import android.os.Bundle
import android.os.PowerManager
import android.provider.Settings
import android.util.Size
import android.util.SparseIntArray
import android.view.Display
import android.widget.Button
import android.widget.SeekBar
import com.google.ar.core.ArCoreApk.Availability
import com.google.ar.core.Phone
import com.google.ar.core.TrackingFailureReason
import java.util.concurrent.LinkedBlockingQueue
import java.util.concurrent.TimeUnit
import kotlin.test.assertContains
import kotlin.test.assertEquals
import kotlin.test.assertFalse
import kotlin.test.assertNotNull
import kotlin.test.assertNull
import kotlin.test.assertTrue
import org.junit.After
import org.junit.Before
import org.junit.Test
import org.junit.runner.RunWith
import org.phasefront.CameraFrame
import org.phasefront.HologramDisplay
import org.phasefront.HologramSession
import org.phasefront.QualityChange
import org.phasefront.QualityReason
import org.phasefront.Rotation
import org.phasefront.RunningMode
import org.phasefront.SessionEvent
import org.phasefront.followThermalState
import org.phasefront.phoneOptions
import org.robolectric.Robolectric
import org.robolectric.RobolectricTestRunner
import org.robolectric.RuntimeEnvironment
import org.robolectric.Shadows.shadowOf
import org.robolectric.android.controller.ActivityController
import org.robolectric.shadows.ShadowCameraCharacteristics
import org.robolectric.shadows.ShadowDialog
import org.robolectric.shadows.ShadowDisplayManager
import org.robolectric.shadows.StreamConfigurationMapBuilder
import org.robolectric.util.ReflectionHelpers

/** A day in the app's life, on a phone with the stand-in of ARCore. docs/android.md has it as a table. */
@RunWith(RobolectricTestRunner::class)
class DayTest {
    private val app: Application = RuntimeEnvironment.getApplication()
    private lateinit var controller: ActivityController<MainActivity>
    private val activity: MainActivity get() = controller.get()

    @Before
    fun aNewPhone() {
        Phone.reset(Availability.SUPPORTED_INSTALLED)
        ThermalContract.reset()
        val camera = ShadowCameraCharacteristics.newCameraCharacteristics()
        shadowOf(camera).set(CameraCharacteristics.SENSOR_ORIENTATION, 90)
        shadowOf(app.getSystemService(CameraManager::class.java)).addCamera("0", camera)
    }

    /** Whatever happened, leaving the app releases everything. */
    @After
    fun nothingStaysOpen() {
        controller.pause().stop().destroy()
        wait("the release of the camera") { Phone.openSessions == 0 && Phone.runningSessions == 0 }
        wait("the release of the listeners") { ThermalContract.listeners.isEmpty() }
        assertEquals(0, Phone.openImages)
    }

    private fun launch(saved: Bundle? = null) {
        controller = Robolectric.buildActivity(MainActivity::class.java)
        controller.create(saved).start().postCreate(saved).resume().visible()
    }

    private fun allow() = shadowOf(app).grantPermissions(Manifest.permission.CAMERA)

    private fun launchWithCamera() {
        allow()
        launch()
        shows(CAMERA)
    }

    /** The system's dialogue is answered, and the activity comes to the front again. */
    private fun answer(vararg results: Int) {
        activity.onRequestPermissionsResult(0, arrayOf(Manifest.permission.CAMERA).copyOf(results.size).requireNoNulls(), results)
        controller.resume()
    }

    private fun home() {
        controller.pause().stop()
    }

    private fun back() {
        controller.restart().start().resume()
    }

    private fun shows(words: String) = wait("'$words'") { words in activity.text() }

    @Test
    fun theFirstLaunchAsksAndTheCameraStartsAfterYes() {
        launch()
        shows("Waiting for your permission to use the camera")
        controller.pause()
        allow()
        answer(0)
        shows(CAMERA)
    }

    @Test
    fun homeAndBackDuringTheDialogueOfTheFirstLaunch() {
        launch()
        controller.pause().stop()
        controller.restart().start()
        // The dialogue went away without an answer, so the app asks again.
        answer()
        shows("Waiting for your permission to use the camera")
        controller.pause()
        allow()
        answer(0)
        shows(CAMERA)
        assertEquals(1, ThermalContract.listeners.size)
    }

    @Test
    fun aDeniedCameraIsSaidAndCanBeAllowedLater() {
        launch()
        controller.pause()
        answer(-1)
        shows("Sample scene: the app may not use the camera")
        activity.find<Button> { it.text == "Allow the camera" }.performClick()
        assertEquals(Settings.ACTION_APPLICATION_DETAILS_SETTINGS, shadowOf(activity).nextStartedActivity.action)
        home()
        allow()
        back()
        shows(CAMERA)
        assertFalse("Allow the camera" in activity.text())
    }

    @Test
    fun homeReleasesTheCameraAndBackTakesItAgain() {
        launchWithCamera()
        home()
        wait("the release of the camera") { Phone.openSessions == 0 }
        wait("the end of the session") { ThermalContract.listeners.isEmpty() }
        back()
        shows(CAMERA)
        // And at once again, as quickly as a user can.
        repeat(3) {
            home()
            back()
        }
        shows(CAMERA)
        assertEquals(1, Phone.openSessions)
    }

    @Test
    fun aCallTakesTheScreenAndTheCamera() {
        launchWithCamera()
        // Over the app, the call only pauses it.
        controller.pause()
        Phone.isCameraTaken = true
        shows("Interrupted: another app uses the camera")
        Phone.isCameraTaken = false
        controller.resume()
        shows(CAMERA)
    }

    @Test
    fun anotherAppTakesTheCameraAndReturnsIt() {
        launchWithCamera()
        Phone.isCameraTaken = true
        shows("Interrupted: another app uses the camera")
        assertEquals(0, Phone.runningSessions)
        Phone.isCameraTaken = false
        shows(CAMERA)
    }

    @Test
    fun aCoveredLensIsSaidAndTheAppGoesOn() {
        launchWithCamera()
        Phone.lost = TrackingFailureReason.INSUFFICIENT_LIGHT
        shows("Interrupted: it is too dark, or the lens is covered")
        Phone.lost = TrackingFailureReason.EXCESSIVE_MOTION
        shows("Interrupted: move the phone more slowly")
        Phone.lost = null
        shows(CAMERA)
    }

    @Test
    fun framesThatAreTooOldAreLeftOut() {
        launchWithCamera()
        Phone.isLate = true
        val from = Phone.images
        wait("more images") { Phone.images > from + 5 }
        Phone.isLate = false
        shows(CAMERA)
    }

    @Test
    fun aRotationTurnsTheFrames() {
        val frames = LinkedBlockingQueue<Rotation>()
        val listener = object : FrameSource.Listener {
            override fun onFrame(frame: CameraFrame, source: String) = frames.put(frame.orientation.rotation)

            override fun onInterrupted(why: String) = Unit

            override fun onFailed(why: String) = error(why)
        }
        launchWithCamera()
        home()
        var degrees = 0
        ArCoreSource(app) { degrees }.use { source ->
            source.start(listener)
            assertEquals(Rotation.CLOCKWISE90, frames.poll(10, TimeUnit.SECONDS))
            degrees = 90
            wait("a turned frame") { frames.poll() == Rotation.UPRIGHT }
        }
        back()
    }

    @Test
    fun missingArCoreIsInstalledIfTheUserWants() {
        Phone.availability = Availability.SUPPORTED_NOT_INSTALLED
        allow()
        launch()
        shows("Waiting for your permission to install Google Play Services for AR")
        home()
        Phone.availability = Availability.SUPPORTED_INSTALLED
        back()
        shows(CAMERA)
        assertEquals(1, Phone.installations)
    }

    @Test
    fun oldArCoreThatTheUserDoesNotUpdateGivesTheSampleScene() {
        Phone.availability = Availability.SUPPORTED_APK_TOO_OLD
        allow()
        launch()
        controller.pause().resume()
        shows("Sample scene: Google Play Services for AR is not installed")
        home()
        back()
        shows("Sample scene")
        assertEquals(1, Phone.installations, "the user is asked once")
    }

    @Test
    fun aPhoneThatArCoreDoesNotKnowGivesTheSampleScene() {
        Phone.availability = Availability.UNSUPPORTED_DEVICE_NOT_CAPABLE
        allow()
        launch()
        shows("Sample scene: ARCore does not know this phone")
    }

    @Test
    fun aPhoneWithoutDepthFailsWithAReason() {
        Phone.hasDepth = false
        allow()
        launch()
        shows("Failed: ARCore gives no depth on this phone")
        Phone.hasDepth = true
        activity.find<Button> { it.text == "Try again" }.performClick()
        shows(CAMERA)
    }

    /** A camera without BACKWARD_COMPATIBLE may give depth and nothing else. */
    @Test
    fun aCameraOfDepthAloneLeavesTheColourToArCore() {
        val depthAlone = cameraOfDepth()
        shadowOf(app.getSystemService(CameraManager::class.java)).addCamera("1", depthAlone)
        assertNull(DepthCamera.of("1", depthAlone))
        assertEquals(Size(640, 480), DepthCamera.of("2", cameraOfDepth(ImageFormat.YUV_420_888))?.depth)
        launchWithCamera()
    }

    /** A camera of depth that also gives images of [formats]. */
    private fun cameraOfDepth(vararg formats: Int): CameraCharacteristics {
        val sizes = StreamConfigurationMapBuilder.newBuilder()
        for (format in formats) sizes.addOutputSize(format, Size(640, 480))
        // Robolectric's builder keeps depth's sizes where the framework does not look for them.
        val depths = arrayOf(StreamConfiguration(Y16, 640, 480, false))
        val map = sizes.build()
        ReflectionHelpers.setField(map, "mDepthConfigurations", depths)
        ReflectionHelpers.getField<SparseIntArray>(map, "mDepthOutputFormats").put(Y16, depths.size)
        val camera = ShadowCameraCharacteristics.newCameraCharacteristics()
        shadowOf(camera).set(CameraCharacteristics.LENS_FACING, CameraMetadata.LENS_FACING_BACK)
        shadowOf(camera).set(CameraCharacteristics.SCALER_STREAM_CONFIGURATION_MAP, map)
        return camera
    }

    @Test
    fun aScreenIsPluggedInAndUnplugged() {
        launchWithCamera()
        val id = ShadowDisplayManager.addDisplay("w1920dp-h1080dp", Display.TYPE_EXTERNAL)
        shadowOf(activity.getSystemService(DisplayManager::class.java).getDisplay(id)).setFlags(Display.FLAG_PRESENTATION)
        wait("the levels on the screen") { shown()?.display?.displayId == id }
        ShadowDisplayManager.removeDisplay(id)
        wait("the end of the levels") { shown() == null }
        shows(CAMERA)
    }

    private fun shown() = ShadowDialog.getShownDialogs().filterIsInstance<PhaseOutput>().firstOrNull { it.isShowing }

    @Test
    fun theAppWaitsWhileArCoreAsksItsServer() {
        Phone.availability = Availability.UNKNOWN_CHECKING
        allow()
        launch()
        assertContains(activity.text(), "Starting…")
        shows(CAMERA)
    }

    @Test
    fun heatReachesTheSession() {
        launch()
        val changes = LinkedBlockingQueue<QualityChange>()
        val heard = { event: SessionEvent ->
            when (event) {
                is SessionEvent.Processed -> event.hologram.close()
                is SessionEvent.QualityChanged -> changes.put(event.change)
                else -> Unit
            }
        }
        HologramSession(phoneOptions(HologramDisplay(width = 64, height = 48)), RunningMode.LIVE, heard).use { session ->
            session.followThermalState(app).use {
                ThermalContract.become(PowerManager.THERMAL_STATUS_CRITICAL)
                val scene = SampleScene(app.assets)
                wait("another quality level") {
                    session.submit(scene.frame(0))
                    changes.poll()?.reason == QualityReason.THERMAL
                }
            }
        }
    }

    @Test
    fun aWarningOfLowMemoryReleasesTheHologram() {
        launchWithCamera()
        wait("a hologram") { activity.zAt(0.5, 0.5) != null }
        activity.onLowMemory()
        assertNull(activity.zAt(0.5, 0.5))
        wait("a hologram") { activity.zAt(0.5, 0.5) != null }
    }

    @Test
    fun aKilledAppComesBackAsItWas() {
        launch()
        activity.find<SeekBar>().progress = 150
        controller.pause()
        answer(-1)
        val saved = Bundle()
        controller.saveInstanceState(saved).pause().stop().destroy()
        launch(saved)
        assertEquals(150, activity.find<SeekBar>().progress)
        // It does not ask again.
        assertNull(shadowOf(activity).lastRequestedPermission)
        shows("Sample scene")
    }

    @Test
    fun theViewsSayWhatTheyAre() {
        launchWithCamera()
        val seekBar = activity.find<SeekBar>()
        seekBar.progress = 200
        assertContains(assertNotNull(seekBar.contentDescription), "Focus")
        assertEquals("3.0 millimetres", seekBar.stateDescription)
    }

    private companion object {
        const val CAMERA = "Camera with depth by ARCore"

        /** The camera service's format of DEPTH16: HAL_PIXEL_FORMAT_Y16 of system/graphics.h. */
        const val Y16 = 0x20363159
    }
}
