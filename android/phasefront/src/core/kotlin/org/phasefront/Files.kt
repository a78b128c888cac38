package org.phasefront

import java.nio.ByteBuffer

/**
 * Reads a network from an ONNX file's bytes: those of [onnx], a direct buffer, from its position to its limit.
 *
 * @throws PhasefrontException.Network for what is not a hologram network, with what is not so and what would be right.
 */
public fun Network.Companion.fromBytes(onnx: ByteBuffer): Network = fromMemory(
    onnx.direct { PhasefrontException.Network("network: it is $it; a direct one is needed, from ByteBuffer.allocateDirect") },
)

/**
 * Reads a calibrated display from the bytes of a file of `phasefront calibrate pack`: those of [file], a direct buffer, from
 * its position to its limit.
 *
 * @throws PhasefrontException.Setting for what is not such a file, with what is not so.
 */
public fun Target.Companion.fromBytes(file: ByteBuffer): Target = fromMemory(
    file.direct { PhasefrontException.Setting("calibration file: it is $it; a direct one is needed, from ByteBuffer.allocateDirect") },
)

/** The notices of what the library carries of others, Markdown: an app shows them where it shows its own. */
public fun thirdPartyNotices(): String = checkNotNull(Session::class.java.getResourceAsStream("THIRD-PARTY.md")) {
    "the notices are not in this package; take it as it is published"
}.use { it.readBytes().decodeToString() }
