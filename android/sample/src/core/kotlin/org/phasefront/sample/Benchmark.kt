package org.phasefront.sample

import org.json.JSONArray
import org.json.JSONObject
import org.phasefront.CameraFrame
import org.phasefront.FrameTimes
import org.phasefront.HologramDisplay
import org.phasefront.HologramMethod
import org.phasefront.HologramNetwork
import org.phasefront.HologramSession
import org.phasefront.PhasefrontException
import org.phasefront.RunningMode
import org.phasefront.SessionOptions
import org.phasefront.sessionOptions
import org.phasefront.version

/** The stages of a frame that a session measures. */
enum class Stage(val ms: (FrameTimes) -> Double) {
    COLOUR(FrameTimes::colourMs),
    DEPTH(FrameTimes::depthMs),
    METHOD(FrameTimes::methodMs),
    PROPAGATE(FrameTimes::propagateMs),
    ENCODE(FrameTimes::encodeMs),
    TOTAL(FrameTimes::totalMs),
    ;

    /** The name of the stage in a record. */
    val key: String = name.lowercase()
}

/** The times of one stage in milliseconds. */
data class Spread(val least: Double, val lower: Double, val median: Double, val upper: Double, val most: Double) {
    /** Returns the spread in the form of a record. */
    fun json(): JSONObject = JSONObject()
        .put("least", least).put("lower", lower).put("median", median).put("upper", upper).put("most", most)

    companion object {
        /** Computes the minimum, quartiles and maximum of at least one time; each is one of [times]. */
        fun of(times: List<Double>): Spread {
            val sorted = times.sorted()
            val at = { quarters: Int -> sorted[(sorted.size - 1) * quarters / 4] }
            return Spread(at(0), at(1), at(2), at(3), at(4))
        }
    }
}

/**
 * A benchmark run: the [method] and the correction steps [localSteps] of its frames, and the [stage] that it measures.
 * null means the default; with steps, there is no other correction.
 */
class Run(val name: String, val stage: Stage, val method: HologramMethod? = null, val localSteps: Int? = 0) {
    /** Returns the options of the run for [display]. */
    fun options(display: HologramDisplay): SessionOptions {
        val defaults = sessionOptions(display, method)
        return if (localSteps == null) defaults else defaults.copy(darkThreshold = 0f, localSteps = localSteps)
    }

    companion object {
        /**
         * Returns the runs: networks of 8, 15 and [deep]'s layers, the plane sweep, one correction step, and the
         * default.
         */
        fun all(deep: HologramNetwork): List<Run> {
            val shallow = HologramMethod.Trained(HologramNetwork.builtIn("rgbd-8"))
            return listOf(
                Run("8 layers", Stage.METHOD, shallow),
                Run("15 layers", Stage.METHOD, HologramMethod.Trained(HologramNetwork.builtIn("rgbd-15"))),
                Run("${deep.info().layers} layers", Stage.METHOD, HologramMethod.Trained(deep)),
                Run("plane sweep", Stage.METHOD, HologramMethod.Sweep),
                Run("encoder with one step", Stage.ENCODE, shallow, localSteps = 1),
                Run("whole frame", Stage.TOTAL, localSteps = null),
            )
        }
    }
}

/** The result of one run, as a line and for the record. */
class Outcome(val line: String, val json: JSONObject)

/**
 * Measures [runs] at every size of [displays]: two frames to warm up, then [frames] frames. [scene] returns the frame
 * to process, and [conditions] the thermal and power state, which is read before and after each run.
 */
class Benchmark(
    private val runs: List<Run>,
    private val displays: List<HologramDisplay>,
    private val frames: Int,
    private val scene: () -> CameraFrame,
    private val conditions: () -> JSONObject,
) {
    /**
     * Returns the record of all runs on [device], the description of the phone, and passes the line of each run to
     * [told]. A refused run records the reason, and the others continue. Returns the results so far once [isWanted] is
     * false.
     */
    fun record(device: JSONObject, isWanted: () -> Boolean, told: (String) -> Unit): JSONObject {
        val outcomes = JSONArray()
        for (display in displays) {
            for (run in runs) {
                if (!isWanted()) break
                val outcome = time(run, display)
                told("${display.width}×${display.height} ${outcome.line}")
                outcomes.put(outcome.json)
            }
        }
        return JSONObject().put("phasefront", version()).put("device", device).put("runs", outcomes)
    }

    private fun time(run: Run, display: HologramDisplay): Outcome {
        val json = JSONObject().put("name", run.name).put("stage", run.stage.key)
            .put("width", display.width).put("height", display.height).put("before", conditions())
        return try {
            val spreads = spreads(run, display, json)
            val of = spreads.getValue(run.stage)
            json.put("stages_ms", JSONObject(spreads.mapKeys { it.key.key }.mapValues { it.value.json() }))
            Outcome("%s: %.1f ms (%.1f to %.1f)".format(run.name, of.median, of.lower, of.upper), json)
        } catch (refused: PhasefrontException) {
            Outcome("${run.name}: ${refused.message}", json.put("refused", refused.message))
        }
    }

    /** Returns the times of each stage and adds the total time and the backend to [json]. */
    private fun spreads(run: Run, display: HologramDisplay, json: JSONObject): Map<Stage, Spread> {
        return HologramSession(run.options(display), RunningMode.IMAGE).use { session ->
            repeat(WARM) { session.processBlocking(scene()).close() }
            val begun = System.nanoTime()
            val times = List(frames) { session.processBlocking(scene()).use { it.info.times } }
            val statistics = session.statistics
            json.put("frames", frames).put("seconds", (System.nanoTime() - begun) / 1e9).put("behind", conditions())
                .put("backend", statistics.backend).put("why", statistics.backendWhy)
            Stage.entries.associateWith { stage -> Spread.of(times.map(stage.ms)) }
        }
    }

    companion object {
        private const val WARM = 2

        /** The modulator of the documentation, and the size of the sample app's holograms. */
        val DISPLAYS = listOf(HologramDisplay(), HologramDisplay(width = 960, height = 540))

        /** With this count, each quartile is the time of one frame. */
        const val FRAMES = 9
    }
}
