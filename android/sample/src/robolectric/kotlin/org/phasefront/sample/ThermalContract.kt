package org.phasefront.sample

import android.os.PowerManager
import java.util.concurrent.Executor
import org.robolectric.annotation.Implementation
import org.robolectric.annotation.Implements
import org.robolectric.shadows.ShadowPowerManager

/**
 * The thermal listeners as Android keeps them: adding one twice and removing one that was not added throw, and a new one is
 * called with the current status. Robolectric's own does neither. Source: `addThermalStatusListener` and
 * `removeThermalStatusListener` in frameworks/base/core/java/android/os/PowerManager.java and `registerThermalStatusListener`
 * in services/core/java/com/android/server/power/ThermalManagerService.java of AOSP, Android 15.
 */
@Implements(PowerManager::class)
class ThermalContract : ShadowPowerManager() {
    @Implementation
    fun addThermalStatusListener(executor: Executor, listener: PowerManager.OnThermalStatusChangedListener) {
        require(listeners.putIfAbsent(listener, executor) == null) { "Listener already registered: $listener" }
        executor.execute { listener.onThermalStatusChanged(status) }
    }

    @Implementation
    override fun addThermalStatusListener(listener: Any) =
        addThermalStatusListener(Runnable::run, listener as PowerManager.OnThermalStatusChangedListener)

    @Implementation
    override fun removeThermalStatusListener(listener: Any) {
        requireNotNull(listeners.remove(listener)) { "Listener was not added" }
    }

    @Implementation
    override fun getCurrentThermalStatus(): Int = status

    companion object {
        val listeners = mutableMapOf<PowerManager.OnThermalStatusChangedListener, Executor>()
        private var status = PowerManager.THERMAL_STATUS_NONE

        /** Heats or cools the phone. */
        fun become(now: Int) {
            status = now
            for ((listener, executor) in listeners) executor.execute { listener.onThermalStatusChanged(now) }
        }

        fun reset() {
            listeners.clear()
            status = PowerManager.THERMAL_STATUS_NONE
        }
    }
}
