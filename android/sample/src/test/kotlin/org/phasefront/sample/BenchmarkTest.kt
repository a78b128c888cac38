package org.phasefront.sample

import java.io.File
import java.nio.ByteBuffer
import kotlin.test.Test
import kotlin.test.assertContains
import kotlin.test.assertEquals
import kotlin.test.assertTrue
import org.json.JSONObject
import org.phasefront.CameraFrame
import org.phasefront.ColourFormat
import org.phasefront.ColourImage
import org.phasefront.DepthFormat
import org.phasefront.DepthImage
import org.phasefront.HologramDisplay
import org.phasefront.HologramMethod
import org.phasefront.HologramNetwork

class BenchmarkTest {
    private fun scene(): CameraFrame {
        val bytes = { size: Int ->
            ByteBuffer.allocateDirect(size).apply { repeat(size) { put((it % 251).toByte()) } }.flip()
        }
        return CameraFrame(
            0,
            ColourImage(ColourFormat.RGBA, 32, 24, bytes(4 * 32 * 24)),
            DepthImage(DepthFormat.NORMALIZED_U8, 32, 24, bytes(32 * 24)),
        )
    }

    private fun benchmark(runs: List<Run>, display: HologramDisplay): Benchmark {
        var asked = 0
        return Benchmark(runs, listOf(display), 3, ::scene) { JSONObject().put("asked", ++asked) }
    }

    @Test
    fun quartilesAreTimesOfFrames() {
        assertEquals(Spread(1.0, 3.0, 5.0, 7.0, 9.0), Spread.of(listOf(9.0, 1.0, 8.0, 2.0, 7.0, 3.0, 6.0, 4.0, 5.0)))
        assertEquals(Spread(4.0, 4.0, 4.0, 4.0, 4.0), Spread.of(listOf(4.0)))
    }

    @Test
    fun aRecordHasEveryRunWithItsStagesAndConditions() {
        val lines = mutableListOf<String>()
        val runs = Run.all(HologramNetwork.fromFile(System.getProperty("phasefront.suite") + "/../../models/unbundled/rgbd-30-int8.onnx"))
        val record = benchmark(runs, HologramDisplay(width = 64, height = 48))
            .record(JSONObject().put("model", "a test"), { true }, lines::add)
        // android/test converts it to a table.
        File(System.getProperty("phasefront.record")).writeText(record.toString())
        val read = JSONObject(record.toString())
        assertEquals(setOf("phasefront", "device", "runs"), read.keySet())
        val outcomes = read.getJSONArray("runs").map { it as JSONObject }
        assertEquals(runs.map { it.name }, outcomes.map { it.getString("name") })
        assertEquals(runs.size, lines.size)
        assertContains(lines.first(), "64×48 8 layers: ")
        outcomes.forEachIndexed { i, outcome ->
            val keys = "name stage width height before behind frames seconds backend why stages_ms".split(" ").toSet()
            assertEquals(keys, outcome.keySet())
            val asked = listOf("before", "behind").map { outcome.getJSONObject(it).getInt("asked") }
            assertEquals(listOf(2 * i + 1, 2 * i + 2), asked)
            val stages = outcome.getJSONObject("stages_ms")
            assertEquals("colour depth method propagate encode total".split(" ").toSet(), stages.keySet())
            val of = stages.getJSONObject(outcome.getString("stage"))
            val spread = listOf("least", "lower", "median", "upper", "most").map(of::getDouble)
            assertTrue(spread.first() > 0 && spread == spread.sorted(), "$spread")
        }
    }

    @Test
    fun whatIsRefusedIsSaidAndTheOthersGoOn() {
        // No network was trained for this display.
        val display = HologramDisplay(width = 64, height = 48, pitchUm = 3.74)
        val network = HologramMethod.Trained(HologramNetwork.builtIn("rgbd-8"))
        val runs = listOf(Run("8 layers", Stage.METHOD, network), Run("sweep", Stage.METHOD, HologramMethod.Sweep))
        val record = benchmark(runs, display).record(JSONObject(), { true }) {}.getJSONArray("runs")
        assertContains(record.getJSONObject(0).getString("refused"), "trained for")
        assertTrue(record.getJSONObject(1).has("stages_ms"))
        assertEquals(0, benchmark(runs, display).record(JSONObject(), { false }) {}.getJSONArray("runs").length())
    }
}
