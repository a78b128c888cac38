package org.phasefront.sample

import android.Manifest
import android.app.Activity
import android.app.Application
import android.content.Intent
import android.graphics.Bitmap
import android.graphics.Canvas
import android.graphics.Color
import android.graphics.drawable.BitmapDrawable
import android.view.ViewGroup
import android.widget.Button
import android.widget.ImageView
import kotlin.test.assertContains
import kotlin.test.assertEquals
import kotlin.test.assertNotEquals
import kotlin.test.assertNotNull
import kotlin.test.assertTrue
import org.junit.Test
import org.junit.runner.RunWith
import org.robolectric.Robolectric
import org.robolectric.RobolectricTestRunner
import org.robolectric.RuntimeEnvironment
import org.robolectric.Shadows.shadowOf

@RunWith(RobolectricTestRunner::class)
class ActivitiesTest {
    private val app: Application = RuntimeEnvironment.getApplication()

    @Test
    fun theSampleSceneIsShownWithoutACamera() {
        val controller = Robolectric.buildActivity(MainActivity::class.java).setup()
        val activity = controller.get()
        assertEquals(listOf(Manifest.permission.CAMERA), shadowOf(activity).lastRequestedPermission.requestedPermissions.toList())
        // The dialogue pauses the activity.
        controller.pause()
        activity.onRequestPermissionsResult(0, arrayOf(Manifest.permission.CAMERA), intArrayOf(-1))
        controller.resume()

        val preview = activity.find<ImageView>()
        wait("a preview") { preview.drawable != null }
        assertContains(activity.text(), "Sample scene: the app may not use the camera")
        val bitmap = assertNotNull((preview.drawable as BitmapDrawable).bitmap)
        assertEquals(480 to 270, bitmap.width to bitmap.height)
        assertEquals(Bitmap.DENSITY_NONE, bitmap.density)
        assertNotEquals(bitmap.getPixel(0, 0), bitmap.getPixel(240, 135), "the preview is empty")
        assertContains(activity.text(), "the method takes")

        controller.pause().stop().destroy()
        wait("the end of the session") { Thread.getAllStackTraces().keys.none { it.name == "sample scene" } }
    }

    @Test
    fun levelsReachAScreenUnchanged() {
        val activity = Robolectric.buildActivity(Activity::class.java).setup().get()
        @Suppress("DEPRECATION")
        val display = activity.windowManager.defaultDisplay
        val output = display.mode.run { PhaseOutput(activity, display, physicalWidth, physicalHeight) }.apply { create() }
        assertEquals(display.mode.modeId, output.window?.attributes?.preferredDisplayModeId)
        val levels = Bitmaps(6, 4).next()
        for (y in 0 until 4) for (x in 0 until 6) levels.setPixel(x, y, Color.rgb(41 * x, 255 - 60 * y, 7 * x * y))
        output.show(levels)
        val view = output.findViewById<ViewGroup>(android.R.id.content).getChildAt(0)
        view.layout(0, 0, 8, 4)
        val screen = Bitmap.createBitmap(8, 4, Bitmap.Config.ARGB_8888).also { view.draw(Canvas(it)) }
        for (y in 0 until 4) for (x in 0 until 6) assertEquals(levels.getPixel(x, y), screen.getPixel(x + 1, y), "($x, $y)")
    }

    @Test
    fun bitmapsAreWrittenInTurn() {
        val bitmaps = Bitmaps(8, 4)
        val seen = List(4) { bitmaps.next() }
        assertEquals(3, seen.toSet().size)
        assertEquals(seen[0], seen[3])
        assertEquals(Bitmap.DENSITY_NONE, seen[0].density)
    }

    @Test
    fun theSceneMovesToAndFro() {
        val scene = SampleScene(app.assets)
        val margin = scene.frame(0).let { it.colour.width / 7 }
        val first = { step: Int -> scene.frame(step).colour.planes[0].buffer.let { it.getInt(it.position()) } }
        assertEquals(first(0), first(2 * margin - 1))
        assertEquals(scene.frame(0).colour.planes[0].buffer.position() + 4, scene.frame(1).colour.planes[0].buffer.position())
    }

    @Test
    fun theBenchmarkSharesARecord() {
        val folder = app.filesDir.resolve("benchmarks").apply { mkdirs() }
        folder.resolve("1.json").writeText("{}")
        val controller = Robolectric.buildActivity(BenchmarkActivity::class.java).setup()
        val activity = controller.get()
        val share = activity.find<Button> { "Share" in it.text }
        assertTrue(share.isEnabled)
        share.performClick()
        val sent = assertNotNull(shadowOf(activity).nextStartedActivity).getParcelableExtra(Intent.EXTRA_INTENT, Intent::class.java)
        assertEquals("{}", sent?.getStringExtra(Intent.EXTRA_TEXT))
        controller.pause().stop().destroy()
    }
}
