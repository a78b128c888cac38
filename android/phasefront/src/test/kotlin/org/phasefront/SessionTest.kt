package org.phasefront

import java.io.File
import java.lang.ref.Reference
import java.nio.ByteBuffer
import java.util.Collections
import java.util.concurrent.CountDownLatch
import java.util.concurrent.LinkedBlockingQueue
import java.util.concurrent.TimeUnit
import kotlin.concurrent.thread
import kotlin.math.hypot
import kotlin.test.Test
import kotlin.test.assertContains
import kotlin.test.assertContentEquals
import kotlin.test.assertEquals
import kotlin.test.assertFailsWith
import kotlin.test.assertFalse
import kotlin.test.assertIs
import kotlin.test.assertNull
import kotlin.test.assertTrue
import kotlinx.coroutines.CancellationException
import kotlinx.coroutines.CoroutineStart
import kotlinx.coroutines.async
import kotlinx.coroutines.flow.toList
import kotlinx.coroutines.runBlocking

/** Tests sessions from Kotlin: threads, live streams, misuse and memory. */
class SessionTest {
    private fun <T> image(use: (HologramSession) -> T): T = HologramSession(options(), RunningMode.IMAGE).use(use)

    private inline fun <reified E : PhasefrontException> assertRefused(words: String, noinline call: () -> Any?) {
        val message = assertFailsWith<E> { call() }.message.orEmpty()
        assertContains(message, words)
        assertFalse(message.contains('\n'), message)
    }

    @Test
    fun levelsAreReadInPlaceAndOutliveTheSession() {
        val hologram = image { it.processBlocking(still()) }
        val before = hologram.levels()
        assertTrue(before.toSet().size > 100)
        hologram.usePlane(Colour.GREEN) { plane ->
            assertTrue(plane.isDirect && plane.isReadOnly)
            assertEquals(64 * 48, plane.remaining())
            // Another thread closes it during the read.
            thread { hologram.close() }.join()
            val bytes = ByteArray(64 * 48).also { plane.get(it) }
            assertContentEquals(before.copyOfRange(64 * 48, 2 * 64 * 48), bytes)
        }
        assertRefused<PhasefrontException.Session>("closed") { hologram.usePlane(Colour.RED) {} }
        assertRefused<PhasefrontException.Session>("closed") { hologram.writePreview(0.0, 8, 8, direct(256)) }
        hologram.close()
    }

    @Test
    fun positionsAndSlicesOfBuffersAreRespected() = image { session ->
        val want = session.processBlocking(still()).use { it.levels() }
        val colour = colourBytes()
        val positioned = direct(colour.capacity() + 100).position(60).put(colour.duplicate())
        positioned.flip().position(60)
        assertContentEquals(want, session.processBlocking(still(colour = positioned)).use { it.levels() })
        assertEquals(60, positioned.position())
        assertContentEquals(want, session.processBlocking(still(colour = positioned.slice())).use { it.levels() })
        assertContentEquals(want, session.processBlocking(still(colour = positioned.asReadOnlyBuffer())).use { it.levels() })
        positioned.limit(positioned.limit() - 4)
        assertRefused<PhasefrontException.Frame>("too few") { session.processBlocking(still(colour = positioned)) }
        assertRefused<PhasefrontException.Frame>("too few") { session.processBlocking(still(depth = direct(0))) }
    }

    @Test
    fun buffersOnTheHeapAreRefused() = image { session ->
        assertRefused<PhasefrontException.Frame>("allocateDirect") { session.processBlocking(still(depth = ByteBuffer.allocate(4 * 32 * 24))) }
    }

    @Test
    fun unusableFramesAreNamed() = image { session ->
        fun colour(width: Int, height: Int, vararg planes: ImagePlane) =
            CameraFrame(0, ColourImage(ColourFormat.RGBA, width, height, planes.toList()), still().depth)
        val bytes = colourBytes()
        assertRefused<PhasefrontException.Frame>("64×0") { session.processBlocking(colour(64, 0, ImagePlane(bytes, 256, 4))) }
        assertRefused<PhasefrontException.Frame>("-64") { session.processBlocking(colour(-64, 48, ImagePlane(bytes, 256, 4))) }
        assertRefused<PhasefrontException.Frame>("must not be negative") { session.processBlocking(colour(64, 48, ImagePlane(bytes, -256, 4))) }
        assertRefused<PhasefrontException.Frame>("row stride") { session.processBlocking(colour(64, 48, ImagePlane(bytes, 200, 4))) }
        assertRefused<PhasefrontException.Frame>("pixel stride") { session.processBlocking(colour(64, 48, ImagePlane(bytes, 256, 1))) }
        assertRefused<PhasefrontException.Frame>("planes") { session.processBlocking(colour(64, 48)) }
        assertRefused<PhasefrontException.Frame>("planes") { session.processBlocking(colour(64, 48, *Array(4) { ImagePlane(bytes, 256, 4) })) }
        session.processBlocking(still()).close()
    }

    @Test
    fun aPreviewShowsThePictureAndATapGivesZ() {
        image { it.processBlocking(still()) }.use { hologram ->
            val rgba = direct(4 * 32 * 24).also { hologram.writePreview(0.0, 32, 24, it) }
            val values = ByteArray(rgba.remaining()).also { rgba.get(it) }
            assertTrue(values.indices.filter { it % 4 == 3 }.all { values[it] == 255.toByte() })
            assertTrue(values.toSet().size > 20)
            // Blue first, with gaps between rows, which stay as they are.
            val gaps = direct(140 * 24)
            hologram.writePreview(0.0, 32, 24, gaps, ModulatorLayout.BGRA, rowStride = 140)
            assertEquals(listOf(values[2], values[1], values[0], 0), listOf(gaps[0], gaps[1], gaps[2], gaps[128]))
            assertEquals(values[4 * 32], gaps[140 + 2])
            assertTrue(hologram.zAt(0.5, 0.5) > hologram.zAt(0.02, 0.02))
            assertRefused<PhasefrontException.Setting>("0×24") { hologram.writePreview(0.0, 0, 24, direct(8)) }
            assertRefused<PhasefrontException.Setting>("24 rows") { hologram.writePreview(0.0, 32, 24, direct(100)) }
            assertRefused<PhasefrontException.Setting>("allocateDirect") { hologram.writePreview(0.0, 1, 1, ByteBuffer.allocate(4)) }
            assertRefused<PhasefrontException.Setting>("read-only") { hologram.writePreview(0.0, 1, 1, direct(4).asReadOnlyBuffer()) }
        }
    }

    @Test
    fun noticesComeAlong() {
        assertContains(thirdPartyNotices(), "# Third-party notices")
        assertContains(thirdPartyNotices(), "uniffi")
    }

    @Test
    fun aWholeViewIsTheFieldWithoutItsPhases() {
        image { it.processBlocking(still()) }.use { hologram ->
            hologram.field().use { field ->
                hologram.refocus(0.0).use { seen ->
                    assertEquals(listOf(64, 48, 3, 1), listOf(seen.width, seen.height, seen.colours, seen.numbers))
                    assertEquals(2, field.numbers)
                    seen.usePlane(Colour.BLUE) { amplitudes ->
                        field.usePlane(Colour.BLUE) { parts ->
                            for (i in 0 until 64 * 48) {
                                assertEquals(hypot(parts.get(2 * i), parts.get(2 * i + 1)), amplitudes.get(i), 1e-6f)
                            }
                        }
                    }
                }
                field.close()
                assertRefused<PhasefrontException.Session>("closed") { field.usePlane(Colour.RED) {} }
            }
            assertRefused<PhasefrontException.Setting>("a shorter distance") { hologram.refocus(1e5) }
            assertRefused<PhasefrontException.Setting>("must be finite") { hologram.field(Double.NaN) }
        }
    }

    @Test
    fun outputIsWhatTheModulatorTakes() {
        image { it.processBlocking(still()) }.use { hologram ->
            val levels = hologram.levels()
            assertEquals(OutputSize(width = 64, height = 48, pixelBytes = 4, images = 1), hologram.outputSize(ModulatorLayout.RGBA))
            val rgba = direct(4 * 64 * 48).also { hologram.writeOutput(Placement(ModulatorLayout.RGBA), it) }
            assertContentEquals(levels.copyOf(64 * 48), ByteArray(64 * 48) { rgba[4 * it] })
            val blue = direct(64 * 48).also { hologram.writeOutput(Placement(ModulatorLayout.GREY, flipX = true), it, index = 2) }
            assertEquals(levels[2 * 64 * 48 + 63], blue[0])
            val words = direct(2 * 64 * 48).also { hologram.writeOutput(Placement(ModulatorLayout.GREY16), it) }
            assertEquals(levels[0], words[1])
            assertRefused<PhasefrontException.Setting>("no image 1") { hologram.writeOutput(Placement(ModulatorLayout.RGBA), rgba, index = 1) }
            assertRefused<PhasefrontException.Setting>("48 rows") { hologram.writeOutput(Placement(ModulatorLayout.RGBA), direct(8)) }
        }
    }

    @Test
    fun aModulatorIsTakenByItsName() {
        assertTrue("ti-plm-p47" in modulatorNames())
        assertRefused<PhasefrontException.Display>("holoeye-pluto") { Modulator.named("pluto") }
        Modulator.fromToml("width = 64\nheight = 48\npacking = \"grey\"\nflip_x = true").use { modulator ->
            assertEquals(OutputSize(width = 64, height = 48, pixelBytes = 1, images = 3), modulator.outputSize)
            HologramSession(sessionOptions(modulator.target, network), RunningMode.IMAGE).use { it.processBlocking(still()) }.use { hologram ->
                val green = direct(64 * 48).also { modulator.writeOutput(hologram, it, index = 1) }
                assertEquals(hologram.levels()[64 * 48 + 63], green[0])
                assertRefused<PhasefrontException.Setting>("no image 3") { modulator.writeOutput(hologram, green, index = 3) }
                Modulator.named("ti-plm-p47").use { other ->
                    assertRefused<PhasefrontException.Setting>("lasers") { other.writeOutput(hologram, green) }
                }
                // In a screen's pixels, red, green and blue are the level.
                val pixels = direct(4 * 64 * 48).also { modulator.writePixels(hologram, it, index = 1, layout = ModulatorLayout.BGRA) }
                for (at in 0 until 64 * 48) assertEquals(List(3) { green[at] } + (-1).toByte(), List(4) { pixels[4 * at + it] })
                assertRefused<PhasefrontException.Setting>("Rgba or Bgra") {
                    modulator.writePixels(hologram, pixels, layout = ModulatorLayout.RGB)
                }
            }
        }
    }

    @Test
    fun aLiveStreamAnswersEveryFrameOnItsOwnThread() {
        val answered = Collections.synchronizedList(mutableListOf<Long>())
        val threads = Collections.synchronizedSet(mutableSetOf<Thread>())
        val session = HologramSession(options(), RunningMode.LIVE) { event ->
            threads.add(Thread.currentThread())
            when (event) {
                is SessionEvent.Processed -> event.hologram.use { answered.add(it.info.timestampNs) }
                is SessionEvent.Dropped -> answered.add(event.timestampNs)
                else -> error("$event")
            }
        }
        session.use { for (i in 1000L until 1050L) it.submit(still(i)) }
        assertEquals((1000L until 1050L).toList(), answered.sorted())
        assertEquals(1, threads.size, "the thread is attached once, not for every call")
        assertFalse(Thread.currentThread() in threads)
        val statistics = session.statistics
        assertEquals(50, statistics.submitted)
        assertEquals(50, statistics.processed + statistics.dropped.total)
        assertEquals(0, statistics.listenerFailures)
    }

    @Test
    fun processCanSuspend() = runBlocking {
        HologramSession(options(), RunningMode.IMAGE).use { session ->
            val levels = session.process(still()).use { it.levels() }
            assertContentEquals(session.processBlocking(still()).use { it.levels() }, levels)
        }
    }

    @Test
    fun heatMovesThePhonesQualityLevel() = runBlocking {
        val session = HologramSession(phoneOptions(display), RunningMode.LIVE)
        session.setThermal(Thermal.CRITICAL)
        session.submit(still(1))
        val sizes = mutableListOf<Int>()
        var change: QualityChange? = null
        session.events.collect { event ->
            when (event) {
                is SessionEvent.Processed -> {
                    sizes += event.hologram.use { it.info.width }
                    if (sizes.size == 1) session.submit(still(40_000_000)) else session.close()
                }
                is SessionEvent.QualityChanged -> change = event.change
                else -> error("$event")
            }
        }
        assertEquals(QualityChange(0, 2, QualityReason.THERMAL), change)
        assertEquals(listOf(64, 32), sizes)
    }

    @Test
    fun aFlowTellsTheSame() = runBlocking {
        val session = HologramSession(options(), RunningMode.LIVE)
        val submitting = thread {
            for (i in 1L..50L) session.submit(still(i))
            session.close()
        }
        val events = session.events.toList()
        submitting.join()
        val timestamps = events.map {
            when (it) {
                is SessionEvent.Processed -> it.hologram.use { hologram -> hologram.info.timestampNs }
                is SessionEvent.Dropped -> it.timestampNs
                else -> error("$it")
            }
        }
        assertEquals((1L..50L).toList(), timestamps.sorted())
    }

    @Test
    fun anUnreadFlowHoldsTwoHologramsAtMost() = runBlocking {
        val session = HologramSession(options(), RunningMode.LIVE)
        for (i in 1L..8L) {
            session.submit(still(i))
            while (session.statistics.pending > 0) Thread.sleep(1)
        }
        session.close()
        val events = session.events.toList()
        assertEquals(8, events.size)
        assertEquals(2, events.count { it is SessionEvent.Processed })
        assertEquals(6, events.count { it is SessionEvent.Dropped && it.reason == DropReason.UNREAD })
    }

    @Test
    fun eventsThatNobodyReadsTakeBoundedMemory() = runBlocking {
        val session = HologramSession(options(), RunningMode.LIVE)
        // A paused session drops each frame at once, which is an event.
        session.pause()
        val colour = ColourImage(ColourFormat.RGBA, 8, 6, direct(4 * 8 * 6))
        val depth = DepthImage(DepthFormat.METRES_F32, 8, 6, direct(4 * 8 * 6))
        for (i in 1L..100_000L) session.submit(CameraFrame(i, colour, depth))
        session.close()
        assertEquals((99_937L..100_000L).map { SessionEvent.Dropped(it, DropReason.PAUSED) }, session.events.toList())
        assertEquals(100_000, session.statistics.dropped.paused.toInt())
    }

    @Test
    fun aCancelledCallThrowsAndItsFrameIsNotComputed() = runBlocking {
        image { session ->
            val ended = runBlocking {
                // Each call begins in this thread. One that is not at its end here can end only when it waits below.
                val calls = (1L..8L).map { async(start = CoroutineStart.UNDISPATCHED) { session.process(still(it)) } }
                val (running, ended) = calls.partition { it.isActive }
                calls.forEach { it.cancel() }
                running.forEach { assertFailsWith<CancellationException> { it.await() } }
                ended.forEach { it.await().close() }
                ended.size
            }
            // One more at most had begun.
            assertTrue(session.statistics.processed.toInt() <= ended + 1, "${session.statistics.processed} frames, $ended calls ended")
            runBlocking { session.process(still()) }.close()
        }
    }

    @Test
    fun aLateFrameInAStreamHarmsNothing() {
        val events = LinkedBlockingQueue<SessionEvent>()
        HologramSession(options(), RunningMode.LIVE, events::add).use { session ->
            session.submit(still(5))
            assertIs<SessionEvent.Processed>(events.poll(60, TimeUnit.SECONDS))
            assertRefused<PhasefrontException.Timestamp>("5 ns") { session.submit(still(5)) }
            assertNull(session.submit(still(6)))
            assertIs<SessionEvent.Processed>(events.poll(60, TimeUnit.SECONDS))
        }
    }

    @Test
    fun whatAListenerThrowsIsCountedAndTheStreamGoesOn() {
        for (thrown in listOf(IllegalStateException("no thanks"), PhasefrontException.Frame("no thanks"))) {
            val heard = LinkedBlockingQueue<SessionEvent>()
            val session = HologramSession(options(), RunningMode.LIVE) {
                heard.add(it)
                throw thrown
            }
            session.use {
                for (i in 1L..3L) {
                    it.submit(still(i))
                    assertIs<SessionEvent.Processed>(heard.poll(60, TimeUnit.SECONDS))
                }
            }
            assertEquals(3L, session.statistics.listenerFailures)
        }
    }

    @Test
    fun aListenerMayCloseItsSession() {
        val closed = CountDownLatch(1)
        lateinit var session: HologramSession
        session = HologramSession(options(), RunningMode.LIVE) {
            session.close()
            closed.countDown()
        }
        session.submit(still(1))
        assertTrue(closed.await(60, TimeUnit.SECONDS))
        assertRefused<PhasefrontException.Session>("closed") { session.submit(still(2)) }
        session.close()
    }

    @Test
    fun threadsShareASession() = image { session ->
        val want = session.processBlocking(still()).use { it.levels() }
        val wrong = LinkedBlockingQueue<Any>()
        List(4) {
            thread {
                repeat(10) {
                    val got = session.processBlocking(still()).use { it.levels() }
                    if (!got.contentEquals(want)) wrong.add(got)
                }
            }
        }.forEach { it.join() }
        assertTrue(wrong.isEmpty())
    }

    @Test
    fun aClosedSessionSaysSo() {
        val session = HologramSession(options(), RunningMode.IMAGE)
        session.processBlocking(still()).close()
        session.close()
        session.close()
        val calls = listOf({ session.processBlocking(still()) }, session::warmUp, session::reset, session::pause, session::resume)
        for (call in calls) assertRefused<PhasefrontException.Session>("closed; make a new one") { call() }
        assertEquals(1L, session.statistics.processed)
    }

    @Test
    fun aPausedSessionRefusesAndAResetLetsTimeBeginAnew() {
        HologramSession(options(), RunningMode.VIDEO).use { session ->
            session.warmUp()
            session.processBlocking(still(100)).close()
            assertRefused<PhasefrontException.Timestamp>("99 ns") { session.processBlocking(still(99)) }
            session.reset()
            session.processBlocking(still(1)).close()
            session.pause()
            assertRefused<PhasefrontException.Session>("paused") { session.processBlocking(still(2)) }
            session.resume()
            session.processBlocking(still(3)).close()
        }
    }

    @Test
    fun modesAreNotMixed() {
        image { session -> assertRefused<PhasefrontException.Session>("not live") { session.submit(still()) } }
        HologramSession(options(), RunningMode.LIVE) {}.use { session ->
            assertRefused<PhasefrontException.Session>("submitted") { session.processBlocking(still()) }
        }
        assertRefused<PhasefrontException.Session>("listener") { HologramSession(options(), RunningMode.IMAGE) {} }
        image { session -> runBlocking { assertEquals(listOf(), session.events.toList()) } }
    }

    @Test
    fun networksThatAreNoneAreNamed() {
        assertRefused<PhasefrontException.File>("nowhere.onnx") { HologramNetwork.fromFile("/nowhere.onnx") }
        assertRefused<PhasefrontException.Network>("network") { HologramNetwork.fromBytes(direct(0)) }
        assertRefused<PhasefrontException.Network>("allocateDirect") { HologramNetwork.fromBytes(ByteBuffer.allocate(8)) }
        val onnx = File(System.getProperty("phasefront.suite")).resolve("../../models/rgbd-8-int8.onnx").readBytes()
        val positioned = direct(onnx.size + 3).position(3).put(onnx).position(3)
        assertEquals(8, HologramNetwork.fromBytes(positioned).info().layers)
        val file = File.createTempFile("phasefront", ".onnx")
        try {
            file.writeText("not a network")
            assertRefused<PhasefrontException.Network>("network") { HologramNetwork.fromFile(file.path) }
        } finally {
            file.delete()
        }
        val info = network.info()
        assertEquals(8 to 8.0, info.layers to info.pitchUm)
    }

    @Test
    fun theNetworkThatIsBuiltInIsTheDefault() {
        for (offset in listOf(0.0, 3.0, 12.0)) {
            val defaults = sessionOptions(display.copy(offsetMm = offset))
            assertEquals(HologramMethod.Auto(), defaults.qualityLevels[0].method)
            assertTrue(defaults.encoding is Encoding.AntiAlias)
            HologramSession(defaults, RunningMode.IMAGE).use { session -> session.processBlocking(still()).close() }
        }
    }

    @Test
    fun thePairThatIsBuiltInCanBeTaken() {
        val pair = builtInPair()
        val options = sessionOptions(display, pair.hologram).copy(encoding = Encoding.Deep(pair.prefilter))
        HologramSession(options, RunningMode.IMAGE).use { session -> session.processBlocking(still()).close() }
    }

    @Test
    fun stepsAndDarkCanBeSet() {
        fun levels(options: SessionOptions) =
            HologramSession(options, RunningMode.IMAGE).use { session -> session.processBlocking(still()).use { it.levels() } }
        val defaults = sessionOptions(display)
        assertContentEquals(levels(defaults), levels(defaults.copy(darkThreshold = 0.4f, localSteps = 1)))
        assertTrue(!levels(defaults).contentEquals(levels(defaults.copy(localSteps = 0))))
        assertTrue(!levels(defaults).contentEquals(levels(defaults.copy(midpointSteps = 1))))
        val qualityLevel = defaults.qualityLevels[0].copy(midpointSteps = 1)
        assertTrue(!levels(defaults).contentEquals(levels(defaults.copy(qualityLevels = listOf(qualityLevel)))))
        assertRefused<PhasefrontException>("at most 8") { HologramSession(defaults.copy(localSteps = 9), RunningMode.IMAGE) }
        assertRefused<PhasefrontException>("from 0 to 1") { HologramSession(defaults.copy(darkThreshold = 2f), RunningMode.IMAGE) }
    }

    @Test
    fun withoutANetworkTheSweepIsTheDefault() {
        val defaults = sessionOptions(display.copy(pitchUm = 3.74))
        HologramSession(defaults, RunningMode.IMAGE).use { session ->
            session.processBlocking(still()).close()
            assertTrue(session.statistics.backendWhy.startsWith("the plane sweep"))
        }
    }

    @Test
    fun targetsThatCannotBeAreNamed() {
        assertRefused<PhasefrontException.Display>("pitch_um") { sessionOptions(display.copy(pitchUm = -1.0)) }
        assertRefused<PhasefrontException.Setting>("3 levels") { HologramTarget.withLookUpTable(display, ByteArray(3)) }
        assertRefused<PhasefrontException.File>("nowhere.pfc") { HologramTarget.fromFile("/nowhere.pfc") }
        assertRefused<PhasefrontException.Setting>("calibration") { HologramTarget.fromBytes(direct(8)) }
        assertRefused<PhasefrontException.Setting>("allocateDirect") { HologramTarget.fromBytes(ByteBuffer.allocate(8)) }
    }

    @Test
    fun aTargetIsTakenAsItsDisplayIs() {
        val target = HologramTarget.withLookUpTable(display, ByteArray(256) { it.toByte() })
        val options = sessionOptions(target)
        assertEquals(display, options.target.display())
        fun levels(options: SessionOptions) = HologramSession(options, RunningMode.IMAGE).use { it.processBlocking(still()).use { made -> made.levels() } }
        // This table has equal steps.
        assertContentEquals(levels(sessionOptions(display)), levels(options))
    }

    @Test
    fun settingsThatCannotBeMeantAreNamed() {
        fun make(change: SessionOptions.() -> SessionOptions): () -> Any? = { HologramSession(options().change(), RunningMode.IMAGE) }
        assertRefused<PhasefrontException.Setting>("no quality levels", make { copy(qualityLevels = listOf()) })
        assertRefused<PhasefrontException.Setting>("0 threads", make { copy(threads = 0) })
        assertRefused<PhasefrontException.Setting>("target rate", make { copy(targetRateHz = Double.NaN) })
        assertRefused<PhasefrontException.Setting>("no quality level 3", make { copy(quality = Quality.Fixed(3)) })
        val fine = HologramTarget.ofDisplay(display.copy(pitchUm = 3.74))
        assertRefused<PhasefrontException.Network>("pitch") { HologramSession(sessionOptions(fine, network), RunningMode.IMAGE) }
        val tiny = HologramTarget.ofDisplay(HologramDisplay(width = 32, height = 24))
        assertRefused<PhasefrontException.Setting>("the modulator's 32×24", make { copy(target = tiny) })
        assertRefused<PhasefrontException.Display>("line 1") { displayFromToml("width = ") }
    }

    @Test
    fun messagesReachTheLog() {
        val messages = Collections.synchronizedList(mutableListOf<Pair<LogLevel, String>>())
        HologramLog.send(LogLevel.INFO) { level, message -> messages.add(level to message) }
        image {}
        HologramLog.send(LogLevel.INFO, null)
        image {}
        // Other tests may log at the same time, but not in this process.
        assertEquals(1, messages.size)
        assertEquals(LogLevel.INFO, messages[0].first)
        assertContains(messages[0].second, "Image")
    }

    @Test
    fun stagesBeginAndEnd() {
        val stages = Collections.synchronizedList(mutableListOf<Pair<Stage, Boolean>>())
        HologramTrace.send { stage, begins -> stages.add(stage to begins) }
        image { it.processBlocking(still()).close() }
        HologramTrace.send(null)
        image { it.processBlocking(still()).close() }
        val inside = listOf(Stage.COLOUR, Stage.DEPTH, Stage.METHOD, Stage.PROPAGATE, Stage.ENCODE)
        val ended = stages.filterNot { it.second }.map { it.first }
        assertEquals(listOf(Stage.PLAN, Stage.FRAME) + inside, stages.filter { it.second }.map { it.first })
        assertEquals(listOf(Stage.PLAN) + inside + Stage.FRAME, ended)
    }

    @Test
    fun memoryOfTenThousandFramesIsFlat() {
        // Only Linux has this file, and the tests run there.
        val statm = File("/proc/self/statm")
        fun residentMb(): Double {
            System.gc()
            return statm.readText().split(' ')[1].toInt() * 4096 / 1e6
        }
        HologramSession(options().copy(threads = 1), RunningMode.IMAGE).use { session ->
            val frame = still()
            val sum = LongArray(1)
            fun frames(count: Int) = repeat(count) {
                session.processBlocking(frame).use { hologram -> hologram.usePlane(Colour.BLUE) { sum[0] += it.get(0).toLong() } }
            }
            frames(1000)
            val before = residentMb()
            frames(9000)
            val growth = residentMb() - before
            // The results of each frame take 15 KB. All of them would take 138 MB.
            assertTrue(growth < 32, "grown by $growth MB")
            Reference.reachabilityFence(frame)
        }
    }
}
