package org.phasefront.sample

import android.annotation.SuppressLint
import android.content.Context
import android.graphics.ImageFormat
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
import kotlin.math.abs
import org.phasefront.CameraFrame
import org.phasefront.Orientation
import org.phasefront.sensorOrientation
import org.phasefront.toColourImage
import org.phasefront.toDepthImage

/**
 * A source of colour and DEPTH16 from one camera by Camera2. Few phones have this kind of camera; [find] looks for it.
 * On other phones, [ArCoreSource] gives depth.
 */
class CameraSource private constructor(
    private val manager: CameraManager,
    private val id: String,
    private val orientation: Orientation,
) : FrameSource {
    private val thread = HandlerThread("camera").apply { start() }
    private val handler = Handler(thread.looper)
    private var device: CameraDevice? = null
    private var session: CameraCaptureSession? = null
    private val readers = mutableListOf<ImageReader>()
    private var colour: Image? = null
    private var depth: Image? = null

    @SuppressLint("MissingPermission") // The activity asks for it first.
    override fun start(onFrame: (CameraFrame) -> Unit, onError: (String) -> Unit) {
        val sizes = manager.getCameraCharacteristics(id).get(CameraCharacteristics.SCALER_STREAM_CONFIGURATION_MAP)
        val depthSize = sizes?.getOutputSizes(ImageFormat.DEPTH16)?.maxByOrNull { it.width * it.height }
        // Colour with the depth's field of view: among sizes of its aspect ratio, the one nearest to 1080 lines.
        val colourSize = sizes?.getOutputSizes(ImageFormat.YUV_420_888)
            ?.filter { depthSize != null && abs(it.width * depthSize.height - it.height * depthSize.width) <= it.width }
            ?.minByOrNull { abs(it.height - 1080) }
        if (depthSize == null || colourSize == null) return onError("camera $id has no depth that goes with its colour")

        val colours = ImageReader.newInstance(colourSize.width, colourSize.height, ImageFormat.YUV_420_888, 3)
        val depths = ImageReader.newInstance(depthSize.width, depthSize.height, ImageFormat.DEPTH16, 3)
        readers += listOf(colours, depths)
        colours.setOnImageAvailableListener({ reader ->
            reader.acquireLatestImage()?.let {
                colour?.close()
                colour = it
                pair(onFrame)
            }
        }, handler)
        depths.setOnImageAvailableListener({ reader ->
            reader.acquireLatestImage()?.let {
                depth?.close()
                depth = it
                pair(onFrame)
            }
        }, handler)

        manager.openCamera(
            id,
            object : CameraDevice.StateCallback() {
                override fun onOpened(camera: CameraDevice) {
                    device = camera
                    capture(camera, onError)
                }

                override fun onDisconnected(camera: CameraDevice) {
                    camera.close()
                    onError("the camera is used by another app")
                }

                override fun onError(camera: CameraDevice, error: Int) {
                    camera.close()
                    onError("the camera failed with error $error")
                }
            },
            handler,
        )
    }

    @Suppress("DEPRECATION") // The newer call needs API 28.
    private fun capture(camera: CameraDevice, onError: (String) -> Unit) {
        camera.createCaptureSession(
            readers.map { it.surface },
            object : CameraCaptureSession.StateCallback() {
                override fun onConfigured(configured: CameraCaptureSession) {
                    session = configured
                    val request = camera.createCaptureRequest(CameraDevice.TEMPLATE_PREVIEW)
                    readers.forEach { request.addTarget(it.surface) }
                    request.set(CaptureRequest.CONTROL_MODE, CameraMetadata.CONTROL_MODE_AUTO)
                    configured.setRepeatingRequest(request.build(), null, handler)
                }

                override fun onConfigureFailed(configured: CameraCaptureSession) = onError("the camera takes no pair of colour and depth")
            },
            handler,
        )
    }

    /** Pairs colour and depth that were captured within half a frame of each other. */
    private fun pair(onFrame: (CameraFrame) -> Unit) {
        val colour = colour ?: return
        val depth = depth ?: return
        if (abs(colour.timestamp - depth.timestamp) > 17_000_000) return
        try {
            onFrame(CameraFrame(colour.timestamp, colour.toColourImage(), depth.toDepthImage(), orientation))
        } finally {
            colour.close()
            depth.close()
            this.colour = null
            this.depth = null
        }
    }

    override fun close() {
        handler.post {
            session?.close()
            device?.close()
            colour?.close()
            depth?.close()
            readers.forEach { it.close() }
            thread.quitSafely()
        }
    }

    companion object {
        /** Returns the first back camera with DEPTH16, or null. */
        fun find(context: Context, displayDegrees: Int): CameraSource? {
            val manager = context.getSystemService(CameraManager::class.java)
            for (id in manager.cameraIdList) {
                val about = manager.getCameraCharacteristics(id)
                val depth = about.get(CameraCharacteristics.SCALER_STREAM_CONFIGURATION_MAP)?.getOutputSizes(ImageFormat.DEPTH16)
                val back = about.get(CameraCharacteristics.LENS_FACING) == CameraMetadata.LENS_FACING_BACK
                if (!back || depth.isNullOrEmpty()) continue
                val sensorDegrees = about.get(CameraCharacteristics.SENSOR_ORIENTATION) ?: 0
                return CameraSource(manager, id, sensorOrientation(sensorDegrees, displayDegrees, isFront = false))
            }
            return null
        }
    }
}
