package org.phasefront.sample

import android.app.Activity
import android.os.Looper
import android.view.View
import android.view.ViewGroup
import android.widget.TextView
import java.time.Duration
import kotlin.test.assertTrue
import org.robolectric.Shadows.shadowOf

fun View.all(): List<View> = if (this is ViewGroup) (0 until childCount).flatMap { getChildAt(it).all() } + this else listOf(this)

inline fun <reified T : View> Activity.find(which: (T) -> Boolean = { true }): T =
    window.decorView.all().filterIsInstance<T>().first(which)

/** All that the screen says. */
fun Activity.text(): String =
    window.decorView.all().filter { it.isShown || it.visibility == View.VISIBLE }.filterIsInstance<TextView>().joinToString("\n") { it.text }

/** Runs what is posted to the main thread until [done], or fails after a minute. */
fun wait(what: String, done: () -> Boolean) {
    val end = System.nanoTime() + 60_000_000_000
    while (!done()) {
        assertTrue(System.nanoTime() < end, "$what did not come")
        shadowOf(Looper.getMainLooper()).idleFor(Duration.ofMillis(10))
        Thread.sleep(10)
    }
}
