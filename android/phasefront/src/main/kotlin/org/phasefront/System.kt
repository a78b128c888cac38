package org.phasefront

import android.os.PowerManager

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
