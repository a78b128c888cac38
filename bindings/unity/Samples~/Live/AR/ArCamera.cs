// Submits the camera's image and depth of AR Foundation to a HologramView: LiDAR of ARKit, depth from motion of ARCore. Add it
// to an AR scene, beside the camera's ARCameraManager and AROcclusionManager. Nothing is copied but by the session.
using Phasefront;
using Unity.Collections;
using Unity.Collections.LowLevel.Unsafe;
using UnityEngine;
using UnityEngine.XR.ARFoundation;
using UnityEngine.XR.ARSubsystems;

public sealed class ArCamera : MonoBehaviour
{
    [SerializeField] private ARCameraManager cameras;
    [SerializeField] private AROcclusionManager occlusion;
    [SerializeField] private HologramView view;

    private double last;

    private void OnEnable()
    {
        occlusion.requestedEnvironmentDepthMode = EnvironmentDepthMode.Best;
        cameras.frameReceived += Take;
    }

    private void OnDisable() => cameras.frameReceived -= Take;

    private void Take(ARCameraFrameEventArgs frame)
    {
        // Both are false until the session tracks, and the phones' systems have few images: each must be disposed.
        if (!cameras.TryAcquireLatestCpuImage(out var colour)) return;
        using (colour)
        {
            if (colour.timestamp <= last || !occlusion.TryAcquireEnvironmentDepthCpuImage(out var depth)) return;
            using (depth)
            {
                last = colour.timestamp;
                view.Submit(new CameraFrame
                {
                    TimestampNs = (ulong)(colour.timestamp * 1e9),
                    Colour = Colour(colour),
                    Depth = Depth(depth),
                    Rotation = Upright(Screen.orientation),
                });
            }
        }
    }

    private static ColourImage Colour(XRCpuImage image)
    {
        var planes = new ImagePlane[image.planeCount];
        for (var i = 0; i < planes.Length; i++) planes[i] = Plane(image.GetPlane(i));
        return new ColourImage { Format = Format(image.format), Width = image.width, Height = image.height, Planes = planes };
    }

    private static ColourFormat Format(XRCpuImage.Format format)
    {
        switch (format)
        {
            case XRCpuImage.Format.AndroidYuv420_888: return ColourFormat.Yuv420;
            case XRCpuImage.Format.IosYpCbCr420_8BiPlanarFullRange: return ColourFormat.Nv12;
            default: throw new System.NotSupportedException($"colour is {format}; the formats of ARCore and ARKit are needed");
        }
    }

    private static DepthImage Depth(XRCpuImage image) => new DepthImage
    {
        Format = image.format == XRCpuImage.Format.DepthUint16 ? DepthFormat.MillimetresU16 : DepthFormat.MetresF32,
        Width = image.width,
        Height = image.height,
        Plane = Plane(image.GetPlane(0)),
    };

    private static unsafe ImagePlane Plane(XRCpuImage.Plane plane) =>
        new ImagePlane((System.IntPtr)plane.data.GetUnsafeReadOnlyPtr(), plane.data.Length, plane.rowStride, plane.pixelStride);

    // Images come as the sensor sees: landscape, with the phone's top on the left.
    private static Rotation Upright(ScreenOrientation screen)
    {
        switch (screen)
        {
            case ScreenOrientation.Portrait: return Rotation.Clockwise90;
            case ScreenOrientation.PortraitUpsideDown: return Rotation.Clockwise270;
            case ScreenOrientation.LandscapeRight: return Rotation.Half;
            default: return Rotation.Upright;
        }
    }
}
