package org.phasefront

import java.nio.ByteBuffer

/**
 * Reads a network from the bytes of an ONNX file: [onnx], a direct buffer, from its position to its limit.
 *
 * @throws PhasefrontException.Network if it is not a hologram network. The message names the problem and the remedy.
 */
public fun HologramNetwork.Companion.fromBytes(onnx: ByteBuffer): HologramNetwork = fromMemory(
    onnx.direct { PhasefrontException.Network("network: it is $it; a direct one is needed, from ByteBuffer.allocateDirect") },
)

/**
 * Reads a depth network from the bytes of an ONNX file that holds its own weights: [onnx], a direct buffer, from its
 * position to its limit. It takes colours of the scale [colours], and gives inverse depth, or distance.
 *
 * @throws PhasefrontException.Network if the library does not read it. The message names the problem.
 */
public fun DepthNetwork.Companion.fromBytes(
    onnx: ByteBuffer,
    colours: ColourScale = ColourScale.IMAGENET,
    givesDistance: Boolean = false,
): DepthNetwork = fromMemory(
    onnx.direct { PhasefrontException.Network("depth network: it is $it; a direct one is needed, from ByteBuffer.allocateDirect") },
    colours,
    givesDistance,
)

/**
 * Reads a calibrated display from the bytes of a file that `phasefront calibrate pack` wrote: [file], a direct buffer,
 * from its position to its limit.
 *
 * @throws PhasefrontException.Setting if it is not such a file. The message names the problem.
 */
public fun HologramTarget.Companion.fromBytes(file: ByteBuffer): HologramTarget = fromMemory(
    file.direct { PhasefrontException.Setting("calibration file: it is $it; a direct one is needed, from ByteBuffer.allocateDirect") },
)

/** Returns the third-party notices of the library as Markdown. An app must show them with its own notices. */
public fun thirdPartyNotices(): String = checkNotNull(HologramSession::class.java.getResourceAsStream("THIRD-PARTY.md")) {
    "the notices are not in this package; take it as it is published"
}.use { it.readBytes().decodeToString() }
