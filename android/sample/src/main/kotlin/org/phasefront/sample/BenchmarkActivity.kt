package org.phasefront.sample

import android.app.Activity
import android.content.Intent
import android.os.BatteryManager
import android.os.Build
import android.os.Bundle
import android.os.PowerManager
import android.view.WindowManager
import android.widget.Button
import android.widget.LinearLayout
import android.widget.ScrollView
import android.widget.TextView
import java.io.File
import java.nio.ByteBuffer
import java.time.Instant
import kotlin.concurrent.thread
import org.json.JSONObject
import org.phasefront.HologramNetwork
import org.phasefront.PhasefrontException
import org.phasefront.fromBytes
import org.phasefront.thermalOf

/** Measures every stage on the sample scene, saves the record as a file and shares it. */
class BenchmarkActivity : Activity() {
    private lateinit var start: Button
    private lateinit var share: Button
    private lateinit var lines: TextView

    /** Whether to continue, written on the main thread and read on the benchmark's thread. */
    @Volatile private var isWanted = false
    private var record: File? = null

    override fun onCreate(savedInstanceState: Bundle?) {
        super.onCreate(savedInstanceState)
        // The processor may sleep when the screen turns off.
        window.addFlags(WindowManager.LayoutParams.FLAG_KEEP_SCREEN_ON)
        start = Button(this).apply {
            text = "Run the benchmark"
            setOnClickListener { run() }
        }
        share = Button(this).apply {
            text = "Share the record"
            setOnClickListener { share() }
        }
        lines = TextView(this).apply { setPadding(24, 24, 24, 24) }
        val column = LinearLayout(this).apply {
            orientation = LinearLayout.VERTICAL
            for (view in listOf(start, share, lines)) addView(view)
        }
        setContentView(ScrollView(this).apply { addView(column) })
        show(kept().maxByOrNull { it.name })
    }

    private fun run() {
        isWanted = true
        start.isEnabled = false
        share.isEnabled = false
        lines.text = ""
        thread(name = "benchmark") {
            try {
                val made = measure()
                runOnUiThread { show(made) }
            } catch (refused: PhasefrontException) {
                say(refused.message.orEmpty())
            }
            runOnUiThread { start.isEnabled = true }
        }
    }

    private fun measure(): File? {
        val begun = Instant.now()
        val scene = SampleScene(assets)
        val runs = Run.all(HologramNetwork.fromBytes(asset("rgbd-30-int8.onnx")))
        val benchmark = Benchmark(runs, Benchmark.DISPLAYS, Benchmark.FRAMES, { scene.frame(0) }, ::conditions)
        val record = benchmark.record(device(), { isWanted }, ::say).put("begun", begun.toString())
        // A cancelled run leaves no record.
        if (!isWanted) return null
        return folder().resolve("${begun.epochSecond}.json").apply { writeText(record.toString(2)) }
    }

    private fun asset(name: String): ByteBuffer = assets.open(name).use {
        val bytes = it.readBytes()
        ByteBuffer.allocateDirect(bytes.size).put(bytes).flip()
    }

    private fun device(): JSONObject {
        val device = JSONObject().put("model", "${Build.MANUFACTURER} ${Build.MODEL}")
            .put("system", "Android ${Build.VERSION.RELEASE}").put("cores", Runtime.getRuntime().availableProcessors())
        if (Build.VERSION.SDK_INT >= Build.VERSION_CODES.S) {
            device.put("processor", "${Build.SOC_MANUFACTURER} ${Build.SOC_MODEL}")
        }
        return device
    }

    /** Returns the current thermal and power state, without unknown values. */
    private fun conditions(): JSONObject {
        val battery = getSystemService(BatteryManager::class.java)
        val power = getSystemService(PowerManager::class.java)
        val told = JSONObject().put("charging", battery.isCharging).put("saves_power", power.isPowerSaveMode)
        val properties = mapOf(
            "battery_percent" to BatteryManager.BATTERY_PROPERTY_CAPACITY,
            "charge_uah" to BatteryManager.BATTERY_PROPERTY_CHARGE_COUNTER,
            "current_ua" to BatteryManager.BATTERY_PROPERTY_CURRENT_NOW,
            "energy_nwh" to BatteryManager.BATTERY_PROPERTY_ENERGY_COUNTER,
        )
        for ((name, property) in properties) {
            battery.getLongProperty(property).takeIf { it != Long.MIN_VALUE }?.let { told.put(name, it) }
        }
        if (Build.VERSION.SDK_INT >= Build.VERSION_CODES.Q) {
            told.put("thermal", thermalOf(power.currentThermalStatus).name.lowercase())
        }
        if (Build.VERSION.SDK_INT >= Build.VERSION_CODES.R) {
            power.getThermalHeadroom(0).takeIf { it.isFinite() }?.let { told.put("thermal_headroom", it.toDouble()) }
        }
        return told
    }

    private fun say(line: String) = runOnUiThread { lines.append("$line\n") }

    private fun folder(): File = filesDir.resolve("benchmarks").apply { mkdirs() }

    private fun kept(): List<File> = folder().listFiles().orEmpty().toList()

    /** Shows the record that can be shared. */
    private fun show(file: File?) {
        record = file ?: record
        share.isEnabled = record != null
        record?.let { lines.append("kept as ${it.path}\n") }
    }

    private fun share() {
        val text = record?.readText() ?: return
        val send = Intent(Intent.ACTION_SEND).setType("text/plain")
            .putExtra(Intent.EXTRA_SUBJECT, "Phasefront on ${Build.MODEL}").putExtra(Intent.EXTRA_TEXT, text)
        startActivity(Intent.createChooser(send, null))
    }

    override fun onStop() {
        super.onStop()
        isWanted = false
    }
}
