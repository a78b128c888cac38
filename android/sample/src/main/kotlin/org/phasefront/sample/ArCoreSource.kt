package org.phasefront.sample

import android.content.Context
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraManager
import android.opengl.EGL14
import android.opengl.EGLConfig
import android.opengl.GLES20
import com.google.ar.core.CameraIntrinsics
import com.google.ar.core.Config
import com.google.ar.core.Frame
import com.google.ar.core.Session
import com.google.ar.core.exceptions.CameraNotAvailableException
import com.google.ar.core.exceptions.NotYetAvailableException
import com.google.ar.core.exceptions.UnavailableException
import kotlin.concurrent.thread
import org.phasefront.ArIntrinsics
import org.phasefront.CameraFrame
import org.phasefront.Orientation
import org.phasefront.arCameras
import org.phasefront.sensorOrientation
import org.phasefront.toColourImage
import org.phasefront.toDepthImage

/** A source of colour and raw depth with its confidence by ARCore, which computes depth on phones without a depth camera. */
class ArCoreSource private constructor(private val session: Session, private val orientation: Orientation) : FrameSource {
    @Volatile private var running = false

    override fun start(onFrame: (CameraFrame) -> Unit, onError: (String) -> Unit) {
        running = true
        thread(name = "ARCore") {
            try {
                onTexture { frames(onFrame) }
            } catch (_: CameraNotAvailableException) {
                onError("the camera is used by another app")
            } finally {
                session.close()
            }
        }
    }

    /** Each update waits for the next image of the camera. */
    private fun frames(onFrame: (CameraFrame) -> Unit) {
        session.resume()
        var last = 0L
        while (running) {
            val frame = session.update()
            if (frame.timestamp <= last) continue
            last = frame.timestamp
            try {
                take(frame, onFrame)
            } catch (_: NotYetAvailableException) {
                // Depth needs a few moving images first.
            }
        }
        session.pause()
    }

    private fun take(frame: Frame, onFrame: (CameraFrame) -> Unit) {
        frame.acquireCameraImage().use { image ->
            frame.acquireRawDepthImage16Bits().use { raw ->
                frame.acquireRawDepthConfidenceImage().use { confidence ->
                    val colour = image.toColourImage()
                    val depth = raw.toDepthImage(confidence)
                    val camera = frame.camera
                    val cameras = arCameras(camera.imageIntrinsics.numbers(), colour, camera.textureIntrinsics.numbers(), depth)
                    onFrame(CameraFrame(frame.timestamp, colour, depth, orientation, cameras))
                }
            }
        }
    }

    private fun CameraIntrinsics.numbers() = ArIntrinsics(focalLength, principalPoint, imageDimensions)

    /** Runs [work] with a texture that nobody sees: ARCore draws the camera's image into one. */
    private fun onTexture(work: () -> Unit) {
        val display = EGL14.eglGetDisplay(EGL14.EGL_DEFAULT_DISPLAY)
        EGL14.eglInitialize(display, null, 0, null, 0)
        val configs = arrayOfNulls<EGLConfig>(1)
        val needed = intArrayOf(EGL14.EGL_RENDERABLE_TYPE, EGL14.EGL_OPENGL_ES2_BIT, EGL14.EGL_SURFACE_TYPE, EGL14.EGL_PBUFFER_BIT, EGL14.EGL_NONE)
        EGL14.eglChooseConfig(display, needed, 0, configs, 0, 1, IntArray(1), 0)
        val version = intArrayOf(EGL14.EGL_CONTEXT_CLIENT_VERSION, 2, EGL14.EGL_NONE)
        val context = EGL14.eglCreateContext(display, configs[0], EGL14.EGL_NO_CONTEXT, version, 0)
        val size = intArrayOf(EGL14.EGL_WIDTH, 1, EGL14.EGL_HEIGHT, 1, EGL14.EGL_NONE)
        val surface = EGL14.eglCreatePbufferSurface(display, configs[0], size, 0)
        EGL14.eglMakeCurrent(display, surface, surface, context)
        try {
            val texture = IntArray(1)
            GLES20.glGenTextures(1, texture, 0)
            session.setCameraTextureName(texture[0])
            work()
        } finally {
            EGL14.eglMakeCurrent(display, EGL14.EGL_NO_SURFACE, EGL14.EGL_NO_SURFACE, EGL14.EGL_NO_CONTEXT)
            EGL14.eglDestroySurface(display, surface)
            EGL14.eglDestroyContext(display, context)
        }
    }

    override fun close() {
        running = false
    }

    companion object {
        /** Returns a source if ARCore is installed and gives depth on this phone, or null. */
        fun find(context: Context, displayDegrees: Int): ArCoreSource? {
            val session = try {
                Session(context)
            } catch (_: UnavailableException) {
                return null
            }
            if (!session.isDepthModeSupported(Config.DepthMode.RAW_DEPTH_ONLY)) {
                session.close()
                return null
            }
            val config = Config(session).setDepthMode(Config.DepthMode.RAW_DEPTH_ONLY).setFocusMode(Config.FocusMode.AUTO)
                .setUpdateMode(Config.UpdateMode.BLOCKING)
            session.configure(config)
            val about = context.getSystemService(CameraManager::class.java).getCameraCharacteristics(session.cameraConfig.cameraId)
            val sensorDegrees = about.get(CameraCharacteristics.SENSOR_ORIENTATION) ?: 0
            return ArCoreSource(session, sensorOrientation(sensorDegrees, displayDegrees, isFront = false))
        }
    }
}
