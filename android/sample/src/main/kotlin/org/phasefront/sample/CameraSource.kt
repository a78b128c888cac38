package org.phasefront.sample

import android.annotation.SuppressLint
import android.content.Context
import android.graphics.ImageFormat
import android.hardware.camera2.CameraAccessException
import android.hardware.camera2.CameraCaptureSession
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraDevice
import android.hardware.camera2.CameraManager
import android.hardware.camera2.CameraMetadata
import android.hardware.camera2.CaptureRequest
import android.media.Image
import android.media.ImageReader
import android.os.Handler
import android.os.HandlerThread
import android.util.Size
import kotlin.math.abs
import org.phasefront.CameraFrame
import org.phasefront.sensorOrientation
import org.phasefront.toColourImage
import org.phasefront.toDepthImage

/**
 * A source of colour and DEPTH16 from one camera by Camera2. Few phones have this kind of camera; [find] looks for it.
 * On other phones, [ArCoreSource] gives depth.
 */
class CameraSource private constructor(
    private val manager: CameraManager,
    private val camera: DepthCamera,
    private val displayDegrees: () -> Int,
) : FrameSource {
    private val thread = HandlerThread("camera")
    private lateinit var handler: Handler
    private lateinit var listener: FrameSource.Listener
    private lateinit var colours: ImageReader
    private lateinit var depths: ImageReader

    // Only the thread uses what follows.
    private var device: CameraDevice? = null
    private var isClosed = false
    private var colour: Image? = null
    private var depth: Image? = null

    /** Opens the camera again after another app has returned it. */
    private val availability = object : CameraManager.AvailabilityCallback() {
        override fun onCameraAvailable(id: String) {
            if (id == camera.id && device == null && !isClosed) open()
        }
    }

    override fun start(listener: FrameSource.Listener) {
        this.listener = listener
        thread.start()
        handler = Handler(thread.looper)
        colours = reader(camera.colour, ImageFormat.YUV_420_888) {
            colour?.close()
            colour = it
        }
        depths = reader(camera.depth, ImageFormat.DEPTH16) {
            depth?.close()
            depth = it
        }
        handler.post {
            open()
            // Tells at once which cameras are free.
            manager.registerAvailabilityCallback(availability, handler)
        }
    }

    private fun reader(size: Size, format: Int, take: (Image) -> Unit): ImageReader =
        ImageReader.newInstance(size.width, size.height, format, 3).apply {
            setOnImageAvailableListener({ reader ->
                reader.acquireLatestImage()?.let {
                    take(it)
                    pair()
                }
            }, handler)
        }

    @SuppressLint("MissingPermission") // The activity asks for it first.
    private fun open() = guarded {
        manager.openCamera(
            camera.id,
            object : CameraDevice.StateCallback() {
                override fun onOpened(opened: CameraDevice) {
                    if (isClosed || device != null) return opened.close()
                    device = opened
                    guarded { capture(opened) }
                }

                override fun onDisconnected(lost: CameraDevice) = lose(lost) { listener.onInterrupted(IN_USE) }

                override fun onError(lost: CameraDevice, error: Int) = lose(lost) {
                    when (error) {
                        ERROR_CAMERA_IN_USE, ERROR_MAX_CAMERAS_IN_USE -> listener.onInterrupted(IN_USE)
                        ERROR_CAMERA_DISABLED -> listener.onFailed("the phone's owner has switched its cameras off")
                        else -> listener.onFailed("the camera failed (error $error); try again, or restart the phone")
                    }
                }
            },
            handler,
        )
    }

    private fun lose(lost: CameraDevice, tell: () -> Unit) {
        lost.close()
        device = null
        if (!isClosed) tell()
    }

    /** Calls the camera, which may have gone at any time. */
    private fun guarded(call: () -> Unit) {
        try {
            call()
        } catch (refused: CameraAccessException) {
            when (refused.reason) {
                CameraAccessException.CAMERA_IN_USE, CameraAccessException.MAX_CAMERAS_IN_USE, CameraAccessException.CAMERA_DISCONNECTED ->
                    listener.onInterrupted(IN_USE)
                CameraAccessException.CAMERA_DISABLED -> listener.onFailed("the phone's owner has switched its cameras off")
                else -> listener.onFailed("the camera failed (${refused.message}); try again, or restart the phone")
            }
        } catch (_: SecurityException) {
            listener.onFailed("the app may not use the camera")
        } catch (_: IllegalStateException) {
            // The camera was closed meanwhile, and its callback has told.
        }
    }

    @Suppress("DEPRECATION") // The newer call needs API 28.
    private fun capture(camera: CameraDevice) {
        camera.createCaptureSession(
            listOf(colours.surface, depths.surface),
            object : CameraCaptureSession.StateCallback() {
                override fun onConfigured(session: CameraCaptureSession) = guarded {
                    val request = camera.createCaptureRequest(CameraDevice.TEMPLATE_PREVIEW)
                    for (reader in listOf(colours, depths)) request.addTarget(reader.surface)
                    request.set(CaptureRequest.CONTROL_MODE, CameraMetadata.CONTROL_MODE_AUTO)
                    session.setRepeatingRequest(request.build(), null, handler)
                }

                override fun onConfigureFailed(session: CameraCaptureSession) =
                    listener.onFailed("the camera gives no colour and depth together")
            },
            handler,
        )
    }

    /** Pairs colour and depth that were captured within half a frame of each other. */
    private fun pair() {
        val colour = colour ?: return
        val depth = depth ?: return
        if (abs(colour.timestamp - depth.timestamp) > 17_000_000) return
        try {
            val orientation = sensorOrientation(camera.sensorDegrees, displayDegrees(), isFront = false)
            listener.onFrame(CameraFrame(colour.timestamp, colour.toColourImage(), depth.toDepthImage(), orientation), "Depth camera")
        } finally {
            colour.close()
            depth.close()
            this.colour = null
            this.depth = null
        }
    }

    override fun close() {
        handler.post {
            isClosed = true
            manager.unregisterAvailabilityCallback(availability)
            device?.close()
            for (image in listOf(colour, depth)) image?.close()
            for (reader in listOf(colours, depths)) reader.close()
        }
        thread.quitSafely()
        thread.join()
    }

    companion object {
        private const val IN_USE = "another app uses the camera"

        /** Returns the first back camera that gives colour and DEPTH16 together, or null. */
        fun find(context: Context, displayDegrees: () -> Int): CameraSource? {
            val manager = context.getSystemService(CameraManager::class.java)
            val camera = try {
                manager.cameraIdList.firstNotNullOfOrNull { DepthCamera.of(it, manager.getCameraCharacteristics(it)) }
            } catch (_: CameraAccessException) {
                null
            }
            return camera?.let { CameraSource(manager, it, displayDegrees) }
        }
    }
}

/** A camera with the sizes of its colour and its DEPTH16. */
class DepthCamera private constructor(val id: String, val colour: Size, val depth: Size, val sensorDegrees: Int) {
    companion object {
        /** Returns null for a front camera, and for one that has no DEPTH16 or no colour of the same field of view. */
        fun of(id: String, about: CameraCharacteristics): DepthCamera? {
            if (about.get(CameraCharacteristics.LENS_FACING) != CameraMetadata.LENS_FACING_BACK) return null
            val sizes = about.get(CameraCharacteristics.SCALER_STREAM_CONFIGURATION_MAP) ?: return null
            val depth = sizes.getOutputSizes(ImageFormat.DEPTH16)?.maxByOrNull { it.width * it.height } ?: return null
            // Among sizes of the depth's aspect ratio, the one nearest to 1080 lines.
            val colour = sizes.getOutputSizes(ImageFormat.YUV_420_888).orEmpty()
                .filter { abs(it.width * depth.height - it.height * depth.width) <= it.width }
                .minByOrNull { abs(it.height - 1080) } ?: return null
            return DepthCamera(id, colour, depth, about.get(CameraCharacteristics.SENSOR_ORIENTATION) ?: 0)
        }
    }
}
