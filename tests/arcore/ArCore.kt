// The part of ARCore that the sample uses, declared by hand for the type checks of `tests/kotlin`, because ARCore is only
// on Google's Maven. It neither runs nor ships: without ARCore no session opens.
package com.google.ar.core

import android.content.Context
import android.media.Image
import com.google.ar.core.exceptions.UnavailableException

class Session(context: Context) {
    init {
        throw UnavailableException()
    }

    val cameraConfig: CameraConfig get() = TODO()

    fun isDepthModeSupported(mode: Config.DepthMode): Boolean = TODO()

    fun configure(config: Config): Unit = TODO()

    fun setCameraTextureName(name: Int): Unit = TODO()

    fun resume(): Unit = TODO()

    fun pause(): Unit = TODO()

    fun update(): Frame = TODO()

    fun close(): Unit = TODO()
}

class CameraConfig {
    val cameraId: String get() = TODO()
}

class Config(session: Session) {
    enum class DepthMode { DISABLED, AUTOMATIC, RAW_DEPTH_ONLY }

    enum class FocusMode { FIXED, AUTO }

    enum class UpdateMode { BLOCKING, LATEST_CAMERA_IMAGE }

    fun setDepthMode(mode: DepthMode): Config = TODO()

    fun setFocusMode(mode: FocusMode): Config = TODO()

    fun setUpdateMode(mode: UpdateMode): Config = TODO()
}

class Frame {
    val timestamp: Long get() = TODO()
    val camera: Camera get() = TODO()

    fun acquireCameraImage(): Image = TODO()

    fun acquireRawDepthImage16Bits(): Image = TODO()

    fun acquireRawDepthConfidenceImage(): Image = TODO()
}

class Camera {
    val imageIntrinsics: CameraIntrinsics get() = TODO()
    val textureIntrinsics: CameraIntrinsics get() = TODO()
}

class CameraIntrinsics {
    val focalLength: FloatArray get() = TODO()
    val principalPoint: FloatArray get() = TODO()
    val imageDimensions: IntArray get() = TODO()
}
