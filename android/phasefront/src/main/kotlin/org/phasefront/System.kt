package org.phasefront

import android.content.Context
import android.os.Build
import android.os.PowerManager
import java.util.concurrent.atomic.AtomicBoolean

/** Sends messages of [level] and above to logcat, under the tag "phasefront". */
public fun HologramLog.sendToLogcat(level: LogLevel = LogLevel.INFO) {
    send(level) { of, message ->
        val priority = when (of) {
            LogLevel.ERROR -> android.util.Log.ERROR
            LogLevel.WARNING -> android.util.Log.WARN
            LogLevel.INFO -> android.util.Log.INFO
            LogLevel.DEBUG -> android.util.Log.DEBUG
        }
        android.util.Log.println(priority, "phasefront", message)
    }
}

/** Sends the stages to Perfetto and Android Studio's profiler as sections of the app's trace. */
public fun HologramTrace.sendToSystem() {
    send { stage, begins ->
        when {
            begins -> android.os.Trace.beginSection("phasefront ${stage.name.lowercase()}")
            else -> android.os.Trace.endSection()
        }
    }
}

/** Converts `PowerManager.currentThermalStatus` (API 29). */
public fun thermalOf(status: Int): Thermal = when (status) {
    PowerManager.THERMAL_STATUS_NONE -> Thermal.NOMINAL
    PowerManager.THERMAL_STATUS_LIGHT, PowerManager.THERMAL_STATUS_MODERATE -> Thermal.FAIR
    PowerManager.THERMAL_STATUS_SEVERE -> Thermal.SERIOUS
    else -> Thermal.CRITICAL
}

/**
 * Passes the device's thermal state to [HologramSession.setThermal] now and whenever it changes, until the returned object
 * is closed. Close it before the session. Does nothing before API 29, where Android does not tell the state.
 */
public fun HologramSession.followThermalState(context: Context): AutoCloseable {
    if (Build.VERSION.SDK_INT < Build.VERSION_CODES.Q) return AutoCloseable {}
    val power = context.getSystemService(PowerManager::class.java)
    val isFollowed = AtomicBoolean(true)
    val listener = PowerManager.OnThermalStatusChangedListener { status ->
        try {
            if (isFollowed.get()) setThermal(thermalOf(status))
        } catch (_: PhasefrontException.Session) {
            // A closed session needs no state.
        }
    }
    listener.onThermalStatusChanged(power.currentThermalStatus)
    power.addThermalStatusListener(Runnable::run, listener)
    // Android refuses to remove a listener twice.
    return AutoCloseable { if (isFollowed.getAndSet(false)) power.removeThermalStatusListener(listener) }
}
