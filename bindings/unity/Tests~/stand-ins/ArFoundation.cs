// The part of AR Foundation that the sample uses, declared by hand, so that bindings/c/test checks its types without Unity. Nothing
// here runs or ships. Source: https://docs.unity3d.com/Packages/com.unity.xr.arfoundation@5.0/api/
using System;

namespace UnityEngine
{
    public enum ScreenOrientation { Portrait = 1, PortraitUpsideDown, LandscapeLeft, LandscapeRight, AutoRotation }
    public static class Screen { public static ScreenOrientation orientation { get { throw new NotSupportedException(); } } }
}

namespace Unity.Collections
{
    public struct NativeArray<T> where T : struct { public int Length { get { throw new NotSupportedException(); } } }
}

namespace Unity.Collections.LowLevel.Unsafe
{
    public static class NativeArrayUnsafeUtility
    {
        public static unsafe void* GetUnsafeReadOnlyPtr<T>(this NativeArray<T> array) where T : struct { throw new NotSupportedException(); }
    }
}

namespace UnityEngine.XR.ARSubsystems
{
    public enum EnvironmentDepthMode { Disabled, Fastest, Medium, Best }

    // A struct that must be disposed explicitly: "Failing to do so will leak resources and could prevent future camera image
    // access", UnityEngine.XR.ARSubsystems.XRCpuImage.html
    public struct XRCpuImage : IDisposable
    {
        public enum Format { Unknown, AndroidYuv420_888, IosYpCbCr420_8BiPlanarFullRange, OneComponent8, DepthFloat32, DepthUint16 }
        public struct Plane
        {
            public int rowStride { get { throw new NotSupportedException(); } }
            public int pixelStride { get { throw new NotSupportedException(); } }
            public Unity.Collections.NativeArray<byte> data { get { throw new NotSupportedException(); } }
        }
        public Format format { get { throw new NotSupportedException(); } }
        public int width { get { throw new NotSupportedException(); } }
        public int height { get { throw new NotSupportedException(); } }
        public int planeCount { get { throw new NotSupportedException(); } }
        public double timestamp { get { throw new NotSupportedException(); } }
        public Plane GetPlane(int planeIndex) { throw new NotSupportedException(); }
        public void Dispose() { throw new NotSupportedException(); }
    }
}

namespace UnityEngine.XR.ARFoundation
{
    using UnityEngine.XR.ARSubsystems;

    public struct ARCameraFrameEventArgs { }
    public sealed class ARCameraManager : MonoBehaviour
    {
        public event Action<ARCameraFrameEventArgs> frameReceived { add { throw new NotSupportedException(); } remove { throw new NotSupportedException(); } }
        public bool TryAcquireLatestCpuImage(out XRCpuImage cpuImage) { throw new NotSupportedException(); }
    }
    public sealed class AROcclusionManager : MonoBehaviour
    {
        public EnvironmentDepthMode requestedEnvironmentDepthMode { get; set; }
        public bool TryAcquireEnvironmentDepthCpuImage(out XRCpuImage cpuImage) { throw new NotSupportedException(); }
    }
}
