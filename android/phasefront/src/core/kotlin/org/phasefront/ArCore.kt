package org.phasefront

/** The numbers of ARCore's `CameraIntrinsics`, in pixels of an image of [width]×[height]. */
public class ArIntrinsics(
    private val focalLength: FloatArray,
    private val principalPoint: FloatArray,
    private val width: Int,
    private val height: Int,
) {
    /** Creates it from `focalLength`, `principalPoint` and `imageDimensions` of ARCore's `CameraIntrinsics`. */
    public constructor(focalLength: FloatArray, principalPoint: FloatArray, imageDimensions: IntArray) :
        this(focalLength, principalPoint, imageDimensions[0], imageDimensions[1])

    /**
     * Returns the intrinsics of an image of [toWidth]×[toHeight] pixels with the same field of view. ARCore measures from
     * the corner of the first pixel, Phasefront from its middle.
     */
    internal fun scaled(toWidth: Int, toHeight: Int): Intrinsics {
        val x = toWidth.toDouble() / width
        val y = toHeight.toDouble() / height
        return Intrinsics(focalLength[0] * x, focalLength[1] * y, principalPoint[0] * x - 0.5, principalPoint[1] * y - 0.5)
    }
}

/**
 * Returns the cameras of a frame of ARCore, for [CameraFrame.cameras], so that edges of depth lie on those of colour. The
 * image of `acquireCameraImage` has the intrinsics [image] (`Camera.imageIntrinsics`). Depth has the field of view of
 * the texture of the camera, which is often another: [texture] is `Camera.textureIntrinsics`.
 */
public fun arCameras(image: ArIntrinsics, colour: ColourImage, texture: ArIntrinsics, depth: DepthImage): Cameras =
    Cameras(image.scaled(colour.width, colour.height), texture.scaled(depth.width, depth.height), pose = null)
