// The part of ARCore that the sample uses, written by hand, because ARCore is only on Google's Maven. It keeps what ARCore's
// reference promises: which call throws what in which state. Each promise names its page below
// https://developers.google.com/ar/reference/java/com/google/ar/core. Nothing here ships.
package com.google.ar.core

import android.Manifest
import android.app.Activity
import android.content.Context
import android.content.pm.PackageManager
import android.media.Image
import android.opengl.EGL14
import com.google.ar.core.exceptions.CameraNotAvailableException
import com.google.ar.core.exceptions.DeadlineExceededException
import com.google.ar.core.exceptions.MissingGlContextException
import com.google.ar.core.exceptions.NotTrackingException
import com.google.ar.core.exceptions.NotYetAvailableException
import com.google.ar.core.exceptions.ResourceExhaustedException
import com.google.ar.core.exceptions.SessionPausedException
import com.google.ar.core.exceptions.TextureNotSetException
import com.google.ar.core.exceptions.UnavailableApkTooOldException
import com.google.ar.core.exceptions.UnavailableArcoreNotInstalledException
import com.google.ar.core.exceptions.UnavailableDeviceNotCompatibleException
import com.google.ar.core.exceptions.UnavailableUserDeclinedInstallationException

class ArCoreApk private constructor() {
    /** ArCoreApk.Availability */
    enum class Availability(val isTransient: Boolean = false, val isSupported: Boolean = false) {
        UNKNOWN_CHECKING(isTransient = true),
        UNKNOWN_ERROR,
        UNKNOWN_TIMED_OUT,
        UNSUPPORTED_DEVICE_NOT_CAPABLE,
        SUPPORTED_NOT_INSTALLED(isSupported = true),
        SUPPORTED_APK_TOO_OLD(isSupported = true),
        SUPPORTED_INSTALLED(isSupported = true),
    }

    enum class InstallStatus { INSTALLED, INSTALL_REQUESTED }

    /** ArCoreApk#checkAvailability: returns at once, and UNKNOWN_CHECKING while it asks a server. */
    fun checkAvailability(context: Context): Availability = Phone.availability.also {
        if (it.isTransient) Phone.availability = Phone.afterChecking
    }

    /**
     * ArCoreApk#requestInstall: returns INSTALLED if ARCore is there and new enough. Otherwise, asks the user if
     * [userRequestedInstall], pauses the activity and returns INSTALL_REQUESTED; throws if the user has declined.
     */
    fun requestInstall(activity: Activity, userRequestedInstall: Boolean): InstallStatus = when {
        Phone.availability == Availability.SUPPORTED_INSTALLED -> InstallStatus.INSTALLED
        !Phone.availability.isSupported -> throw UnavailableDeviceNotCompatibleException()
        userRequestedInstall -> InstallStatus.INSTALL_REQUESTED.also { Phone.installations++ }
        else -> throw UnavailableUserDeclinedInstallationException()
    }

    companion object {
        private val instance = ArCoreApk()

        @JvmStatic
        fun getInstance(): ArCoreApk = instance
    }
}

/**
 * Session(Context): throws if ARCore is missing or old, and SecurityException without the permission of the camera.
 */
class Session(private val context: Context) {
    private var config = Config(this)
    private var texture = 0
    private var isResumed = false
    internal var latest: Frame? = null

    init {
        when (Phone.availability) {
            ArCoreApk.Availability.SUPPORTED_INSTALLED -> Unit
            ArCoreApk.Availability.SUPPORTED_APK_TOO_OLD -> throw UnavailableApkTooOldException()
            ArCoreApk.Availability.SUPPORTED_NOT_INSTALLED -> throw UnavailableArcoreNotInstalledException()
            else -> throw UnavailableDeviceNotCompatibleException()
        }
        checkPermission()
        Phone.openSessions++
    }

    private fun checkPermission() {
        if (context.checkSelfPermission(Manifest.permission.CAMERA) != PackageManager.PERMISSION_GRANTED) {
            throw SecurityException("ARCore requires camera permission")
        }
    }

    val cameraConfig: CameraConfig get() = CameraConfig()

    internal val hasDepth: Boolean get() = config.depthMode != Config.DepthMode.DISABLED

    fun isDepthModeSupported(mode: Config.DepthMode): Boolean = Phone.hasDepth || mode == Config.DepthMode.DISABLED

    fun configure(config: Config) {
        this.config = config
    }

    fun setCameraTextureName(name: Int) {
        texture = name
    }

    /** Session#resume: CameraNotAvailableException if the camera cannot be opened, SecurityException without permission. */
    fun resume() {
        checkPermission()
        if (Phone.isCameraTaken) throw CameraNotAvailableException()
        isResumed = true
        Phone.runningSessions++
    }

    fun pause() {
        if (isResumed) Phone.runningSessions--
        isResumed = false
    }

    /**
     * Session#update: needs a resumed session, a texture and a context of OpenGL; CameraNotAvailableException if the camera
     * is lost meanwhile. Blocks until there is a new image (Config.UpdateMode.BLOCKING).
     */
    fun update(): Frame {
        if (!isResumed) throw SessionPausedException()
        if (texture == 0) throw TextureNotSetException()
        if (EGL14.eglGetCurrentContext() == EGL14.EGL_NO_CONTEXT) throw MissingGlContextException()
        if (Phone.isCameraTaken) throw CameraNotAvailableException()
        Thread.sleep(Phone.FRAME_MS)
        return Frame(this, ++Phone.images).also { latest = it }
    }

    /** Session#close: frees much native memory, which nothing else frees. */
    fun close() {
        check(!isResumed) { "the session is closed while it runs" }
        Phone.openSessions--
    }
}

class CameraConfig {
    val cameraId: String get() = "0"
}

class Config(@Suppress("unused") private val session: Session) {
    enum class DepthMode { DISABLED, AUTOMATIC, RAW_DEPTH_ONLY }

    enum class FocusMode { FIXED, AUTO }

    enum class UpdateMode { BLOCKING, LATEST_CAMERA_IMAGE }

    internal var depthMode = DepthMode.DISABLED

    fun setDepthMode(mode: DepthMode): Config = apply { depthMode = mode }

    fun setFocusMode(@Suppress("unused") mode: FocusMode): Config = this

    fun setUpdateMode(@Suppress("unused") mode: UpdateMode): Config = this
}

class Frame internal constructor(private val session: Session, private val number: Long) {
    val timestamp: Long get() = number * 33_000_000
    val camera: Camera get() = Camera()

    /**
     * Frame#acquireCameraImage: NotYetAvailableException before the first image, DeadlineExceededException if this is not
     * the current frame, ResourceExhaustedException if too many images are open.
     */
    fun acquireCameraImage(): Image = acquire(0) { StandInImage.camera() }

    /**
     * Frame#acquireRawDepthImage16Bits: IllegalStateException without a depth mode, NotTrackingException while the camera
     * is not tracking, NotYetAvailableException before the first depth, and what acquireCameraImage throws.
     */
    fun acquireRawDepthImage16Bits(): Image = depth { StandInImage.depth() }

    /** Frame#acquireRawDepthConfidenceImage throws as acquireRawDepthImage16Bits does. */
    fun acquireRawDepthConfidenceImage(): Image = depth { StandInImage.confidence() }

    private fun depth(image: () -> Image): Image {
        check(session.hasDepth) { "no depth mode is configured" }
        if (Phone.lost != null) throw NotTrackingException()
        return acquire(Phone.IMAGES_BEFORE_DEPTH, image)
    }

    private fun acquire(before: Int, image: () -> Image): Image {
        if (number <= before) throw NotYetAvailableException()
        if (this !== session.latest || Phone.isLate) throw DeadlineExceededException()
        if (StandInImage.open.get() >= Phone.MOST_IMAGES) throw ResourceExhaustedException()
        return image()
    }
}

enum class TrackingState { TRACKING, PAUSED, STOPPED }

enum class TrackingFailureReason { NONE, BAD_STATE, INSUFFICIENT_LIGHT, EXCESSIVE_MOTION, INSUFFICIENT_FEATURES, CAMERA_UNAVAILABLE }

/** Camera#getTrackingFailureReason is NONE while the camera tracks, and while the session starts. */
class Camera {
    val trackingState: TrackingState get() = if (Phone.lost == null) TrackingState.TRACKING else TrackingState.PAUSED
    val trackingFailureReason: TrackingFailureReason get() = Phone.lost ?: TrackingFailureReason.NONE
    val imageIntrinsics: CameraIntrinsics get() = CameraIntrinsics()
    val textureIntrinsics: CameraIntrinsics get() = CameraIntrinsics()
}

class CameraIntrinsics {
    val focalLength: FloatArray get() = floatArrayOf(60f, 60f)
    val principalPoint: FloatArray get() = floatArrayOf(32f, 24f)
    val imageDimensions: IntArray get() = intArrayOf(64, 48)
}
