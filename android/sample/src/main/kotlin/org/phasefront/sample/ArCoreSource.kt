package org.phasefront.sample

import android.app.Activity
import android.content.Context
import android.hardware.camera2.CameraAccessException
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraManager
import com.google.ar.core.ArCoreApk
import com.google.ar.core.CameraIntrinsics
import com.google.ar.core.Config
import com.google.ar.core.Frame
import com.google.ar.core.Session
import com.google.ar.core.TrackingFailureReason
import com.google.ar.core.exceptions.CameraNotAvailableException
import com.google.ar.core.exceptions.DeadlineExceededException
import com.google.ar.core.exceptions.FatalException
import com.google.ar.core.exceptions.NotTrackingException
import com.google.ar.core.exceptions.NotYetAvailableException
import com.google.ar.core.exceptions.ResourceExhaustedException
import com.google.ar.core.exceptions.UnavailableApkTooOldException
import com.google.ar.core.exceptions.UnavailableDeviceNotCompatibleException
import com.google.ar.core.exceptions.UnavailableException
import com.google.ar.core.exceptions.UnavailableUserDeclinedInstallationException
import java.util.concurrent.CountDownLatch
import java.util.concurrent.TimeUnit
import kotlin.concurrent.thread
import org.phasefront.ArIntrinsics
import org.phasefront.CameraFrame
import org.phasefront.arCameras
import org.phasefront.sensorOrientation
import org.phasefront.toColourImage
import org.phasefront.toDepthImage

/**
 * A source of colour and raw depth with its confidence by ARCore, which computes depth on phones without a depth camera.
 * Check [ArCore.prepare] first. [displayDegrees] is the display's rotation.
 */
class ArCoreSource(private val context: Context, private val displayDegrees: () -> Int) : FrameSource {
    private val closed = CountDownLatch(1)
    private var worker: Thread? = null
    private val isOpen: Boolean get() = closed.count > 0

    override fun start(listener: FrameSource.Listener) {
        worker = thread(name = "ARCore") {
            try {
                val session = session()
                try {
                    CameraTexture().use { Frames(session, listener).run(it.name) }
                } finally {
                    session.close()
                }
            } catch (refused: UnavailableException) {
                listener.onFailed(ArCore.reason(refused))
            } catch (_: SecurityException) {
                listener.onFailed("the app may not use the camera")
            } catch (lost: CameraAccessException) {
                listener.onFailed("the camera does not answer (${lost.message})")
            } catch (broken: RuntimeException) {
                // ARCore's own exceptions are unchecked, and none of them may end the app.
                listener.onFailed("ARCore failed (${broken.message ?: broken.javaClass.simpleName})")
            }
        }
    }

    /** Opens a session with raw depth. */
    private fun session(): Session {
        val session = Session(context)
        if (!session.isDepthModeSupported(Config.DepthMode.RAW_DEPTH_ONLY)) {
            session.close()
            throw UnavailableDeviceNotCompatibleException()
        }
        val config = Config(session).setDepthMode(Config.DepthMode.RAW_DEPTH_ONLY).setFocusMode(Config.FocusMode.AUTO)
            .setUpdateMode(Config.UpdateMode.BLOCKING)
        session.configure(config)
        return session
    }

    /** The frames of a session. */
    private inner class Frames(private val session: Session, private val listener: FrameSource.Listener) {
        private val sensorDegrees = context.getSystemService(CameraManager::class.java)
            .getCameraCharacteristics(session.cameraConfig.cameraId).get(CameraCharacteristics.SENSOR_ORIENTATION) ?: 0

        /** Takes frames until the source is closed. Where another app takes the camera, tries again each second. */
        fun run(texture: Int) {
            session.setCameraTextureName(texture)
            while (isOpen) {
                try {
                    session.resume()
                    try {
                        take()
                    } finally {
                        session.pause()
                    }
                } catch (_: CameraNotAvailableException) {
                    listener.onInterrupted("another app uses the camera")
                    closed.await(1, TimeUnit.SECONDS)
                }
            }
        }

        /** Each update waits for the next image of the camera. */
        private fun take() {
            var last = 0L
            while (isOpen) {
                val frame = session.update()
                if (frame.timestamp == last) continue
                last = frame.timestamp
                try {
                    take(frame)
                } catch (_: NotTrackingException) {
                    listener.onInterrupted(ArCore.advice(frame.camera.trackingFailureReason))
                } catch (_: NotYetAvailableException) {
                    // Depth needs a few images from different places first.
                    listener.onInterrupted(ArCore.advice(TrackingFailureReason.NONE))
                } catch (_: ResourceExhaustedException) {
                    // Images are still in use. The next frame will do.
                } catch (_: DeadlineExceededException) {
                    // The frame is too old. The next one will do.
                }
            }
        }

        private fun take(frame: Frame) {
            frame.acquireCameraImage().use { image ->
                frame.acquireRawDepthImage16Bits().use { raw ->
                    frame.acquireRawDepthConfidenceImage().use { confidence ->
                        val colour = image.toColourImage()
                        val depth = raw.toDepthImage(confidence)
                        val camera = frame.camera
                        val cameras = arCameras(camera.imageIntrinsics.numbers(), colour, camera.textureIntrinsics.numbers(), depth)
                        val orientation = sensorOrientation(sensorDegrees, displayDegrees(), isFront = false)
                        listener.onFrame(CameraFrame(frame.timestamp, colour, depth, orientation, cameras), "Camera with depth by ARCore")
                    }
                }
            }
        }
    }

    private fun CameraIntrinsics.numbers() = ArIntrinsics(focalLength, principalPoint, imageDimensions)

    override fun close() {
        closed.countDown()
        worker?.join()
    }
}

/** Whether ARCore can be used. */
sealed interface ArCore {
    data object Ready : ArCore

    /** ARCore asks its server whether it knows the phone. Ask again soon. */
    data object Checking : ArCore

    /** The user is asked to install ARCore or its update. The activity is paused; ask again when it is resumed. */
    data object Installing : ArCore

    data class Missing(val why: String) : ArCore

    companion object {
        /**
         * Returns whether ARCore can be used. Where it can be installed and [mayAsk], asks the user. The call belongs in
         * the activity's `onResume`.
         */
        fun prepare(activity: Activity, mayAsk: Boolean): ArCore {
            val availability = ArCoreApk.getInstance().checkAvailability(activity.applicationContext)
            if (availability.isTransient) return Checking
            if (!availability.isSupported) return Missing("ARCore does not know this phone")
            return try {
                when (ArCoreApk.getInstance().requestInstall(activity, mayAsk)) {
                    ArCoreApk.InstallStatus.INSTALLED -> Ready
                    ArCoreApk.InstallStatus.INSTALL_REQUESTED -> Installing
                }
            } catch (refused: UnavailableException) {
                Missing(reason(refused))
            } catch (broken: FatalException) {
                Missing("ARCore failed (${broken.message})")
            }
        }

        /** Says in words of a user why there is no session. */
        fun reason(of: UnavailableException): String = when (of) {
            is UnavailableUserDeclinedInstallationException -> "Google Play Services for AR is not installed"
            is UnavailableApkTooOldException -> "Google Play Services for AR is too old; update it in the Play Store"
            is UnavailableDeviceNotCompatibleException -> "ARCore gives no depth on this phone"
            else -> "ARCore cannot be used (${of.javaClass.simpleName})"
        }

        /** Says what a user can do when ARCore does not know where the phone is. */
        fun advice(why: TrackingFailureReason): String = when (why) {
            TrackingFailureReason.INSUFFICIENT_LIGHT -> "it is too dark, or the lens is covered"
            TrackingFailureReason.EXCESSIVE_MOTION -> "move the phone more slowly"
            TrackingFailureReason.INSUFFICIENT_FEATURES -> "point the phone at something with more detail"
            TrackingFailureReason.CAMERA_UNAVAILABLE -> "another app uses the camera"
            TrackingFailureReason.BAD_STATE -> "ARCore has lost its way; try again"
            TrackingFailureReason.NONE -> "move the phone slowly to and fro, so that ARCore sees depth"
        }
    }
}
