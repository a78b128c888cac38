package org.phasefront

import java.io.ByteArrayOutputStream
import java.io.File
import java.nio.ByteBuffer
import kotlin.math.abs
import kotlin.math.min
import kotlin.test.Test
import kotlin.test.assertContentEquals
import kotlin.test.assertEquals
import kotlin.test.assertTrue
import org.json.JSONArray
import org.json.JSONObject

/** Runs the conformance suite from Kotlin: the levels must match the suite, and match Rust bit for bit. */
class ConformanceTest {
    private val folder = File(System.getProperty("phasefront.suite"))
    private val memory: ByteBuffer = folder.resolve("frames.bin").readBytes().let { direct(it.size).put(it).flip() }

    private fun JSONArray.objects(): List<JSONObject> = List(length()) { getJSONObject(it) }

    private fun plane(plane: JSONObject): ImagePlane {
        // Not sliced, because the wrapper must handle positions itself.
        val bytes = memory.duplicate()
        bytes.position(plane.getInt("offset")).limit(plane.getInt("offset") + plane.getInt("length"))
        return ImagePlane(bytes, plane.getInt("row_stride"), plane.getInt("pixel_stride"))
    }

    private fun frame(case: JSONObject): CameraFrame {
        val colour = case.getJSONObject("colour")
        val depth = case.optJSONObject("depth")
        val confidence = case.optJSONObject("confidence")?.let {
            val format = when (val name = it.getString("format")) {
                "low-medium-high" -> ConfidenceFormat.LOW_MEDIUM_HIGH
                "u8" -> ConfidenceFormat.U8
                else -> error(name)
            }
            ConfidenceMap(format, it.getInt("width"), it.getInt("height"), plane(it.getJSONObject("plane")))
        }
        val depthFormat = when (val name = depth?.getString("format")) {
            null -> null
            "metres-f32" -> DepthFormat.METRES_F32
            "metres-f16" -> DepthFormat.METRES_F16
            "disparity-f32" -> DepthFormat.DISPARITY_F32
            "disparity-f16" -> DepthFormat.DISPARITY_F16
            "millimetres-u16" -> DepthFormat.MILLIMETRES_U16
            "android-depth16" -> DepthFormat.ANDROID_DEPTH16
            "normalized-u8" -> DepthFormat.NORMALIZED_U8
            "normalized-u16" -> DepthFormat.NORMALIZED_U16
            "relative-f32" -> DepthFormat.RELATIVE_F32
            "relative-f16" -> DepthFormat.RELATIVE_F16
            else -> error(name)
        }
        val rotation = when (val degrees = case.getInt("rotation")) {
            0 -> Rotation.UPRIGHT
            90 -> Rotation.CLOCKWISE90
            180 -> Rotation.HALF
            270 -> Rotation.CLOCKWISE270
            else -> error("$degrees")
        }
        return CameraFrame(
            case.getLong("timestamp_ns"),
            ColourImage(
                ColourFormat.valueOf(colour.getString("format").uppercase()),
                colour.getInt("width"),
                colour.getInt("height"),
                colour.getJSONArray("planes").objects().map(::plane),
                YuvMatrix.valueOf(colour.getString("matrix").uppercase()),
                colour.getBoolean("video_range"),
                RgbEncoding.valueOf(colour.getString("encoding").uppercase().replace('-', '_')),
            ),
            depth?.let { DepthImage(depthFormat!!, it.getInt("width"), it.getInt("height"), plane(it.getJSONObject("plane")), confidence) },
            Orientation(rotation, case.getBoolean("mirrored")),
        )
    }

    private fun method(case: JSONObject): HologramMethod? = when (val name = case.getString("method")) {
        "default" -> null
        "network" -> HologramMethod.Trained(network)
        "sweep" -> HologramMethod.Sweep
        "auto" -> HologramMethod.Auto(network)
        else -> HologramMethod.Trained(model(name))
    }

    private fun model(file: String): HologramNetwork = HologramNetwork.fromFile(folder.resolve("../../models/$file").path)

    private fun depthNetwork(file: String): DepthNetwork =
        DepthNetwork.fromBytes(folder.resolve(file).readBytes().let { direct(it.size).put(it).flip() }, ColourScale.UNIT)

    private fun target(case: JSONObject): HologramTarget {
        if (!case.isNull("calibration")) return HologramTarget.fromFile(folder.resolve(case.getString("calibration")).path)
        val display = displayFromToml(case.getString("display"))
        val levels = case.optJSONArray("lut") ?: return HologramTarget.ofDisplay(display)
        return HologramTarget.withLookUpTable(display, ByteArray(levels.length()) { levels.getInt(it).toByte() })
    }

    private fun options(case: JSONObject): SessionOptions = sessionOptions(target(case), method(case)).copy(
        encoding = when (val name = case.getString("encoding")) {
            "double-phase" -> Encoding.DoublePhase
            "anti-alias" -> Encoding.AntiAlias(0.7f, 3)
            "band-limit" -> Encoding.BandLimit(1.0f)
            else -> Encoding.Deep(model(name))
        },
        brightness = if (case.isNull("brightness")) Brightness.Smoothed else Brightness.Fixed(case.getDouble("brightness").toFloat()),
        depthRange = case.optJSONArray("range")?.let { DepthRange.Fixed(it.getDouble(0).toFloat(), it.getDouble(1).toFloat()) }
            ?: DepthRange.Percentiles,
        focus = if (case.isNull("focus_steps")) Focus.Coherent else Focus.Natural(case.getInt("focus_steps")),
        depthNetwork = if (case.isNull("depth_network")) null else depthNetwork(case.getString("depth_network")),
    )

    /** Returns the levels of a case's frames and appends their displayed images to [seen]. */
    private fun levels(case: JSONObject, seen: ByteArrayOutputStream): ByteArray =
        HologramSession(options(case), RunningMode.valueOf(case.getString("mode").uppercase())).use { session ->
            val all = ByteArrayOutputStream()
            for (frame in case.getJSONArray("frames").objects()) {
                session.processBlocking(frame(frame)).use { hologram ->
                    all.write(hologram.levels())
                    hologram.refocus(1.5).use { seen.write(it.bytes()) }
                    hologram.field(-1.0).use { seen.write(it.bytes()) }
                }
            }
            all.toByteArray()
        }

    @Test
    fun framesBecomeTheLevelsThatAreExpected() {
        val cases = JSONObject(folder.resolve("cases.json").readText()).getJSONArray("cases").objects()
        val seen = ByteArrayOutputStream()
        val got = cases.map { levels(it, seen) }
        System.getenv("PHASEFRONT_CONFORMANCE")?.let {
            val rust = File(it).resolve("levels.bin").readBytes()
            assertContentEquals(rust, got.reduce(ByteArray::plus), "not the bits that Rust has")
            assertContentEquals(File(it).resolve("seen.bin").readBytes(), seen.toByteArray(), "not what Rust sees")
        }
        val expected = folder.resolve("levels.bin").readBytes()
        var from = 0
        for ((case, levels) in cases zip got) {
            val differ = levels.indices.count { levels[it] != expected[from + it] }
            assertTrue(differ * 200 <= levels.size, "${case.getString("name")}: $differ of ${levels.size} levels differ")
            if (case.isNull("lut") && case.isNull("calibration")) {
                val n = case.getInt("levels")
                val most = levels.indices.maxOf {
                    val apart = abs(levels[it].toUByte().toInt() - expected[from + it].toUByte().toInt())
                    min(apart, n - apart)
                }
                assertTrue(most <= 1, "${case.getString("name")}: a level differs by $most")
            }
            from += levels.size
        }
        assertEquals(expected.size, from)
    }
}
