using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;

namespace Phasefront
{
    /// <summary>The memory layout of a colour image.</summary>
    public enum ColourFormat : uint
    {
        /// <summary>One plane; bytes red, green, blue, alpha.</summary>
        Rgba = 0,
        /// <summary>One plane; bytes blue, green, red, alpha.</summary>
        Bgra = 1,
        /// <summary>One plane; bytes red, green, blue.</summary>
        Rgb = 2,
        /// <summary>Two planes: luma, and interleaved blue and red chroma at half the resolution.</summary>
        Nv12 = 3,
        /// <summary>Three planes: luma, and blue chroma and red chroma at half the resolution.</summary>
        Yuv420 = 4,
    }

    /// <summary>The matrix that converts luma and chroma to colour.</summary>
    public enum YuvMatrix : uint
    {
        /// <summary>Standard definition, JPEG, most Android cameras.</summary>
        Bt601 = 0,
        /// <summary>High definition.</summary>
        Bt709 = 1,
        /// <summary>Films of high dynamic range, with non-constant luminance.</summary>
        Bt2020 = 2,
    }

    /// <summary>The meaning of a picture's red, green and blue.</summary>
    public enum RgbEncoding : uint
    {
        /// <summary>sRGB, and BT.709 video, which screens show alike.</summary>
        Srgb = 0,
        /// <summary>Display P3, as phones take photographs and videos.</summary>
        DisplayP3 = 1,
        /// <summary>BT.2020 of standard dynamic range, with the curve of sRGB.</summary>
        Bt2020 = 2,
        /// <summary>BT.2020 with hybrid log-gamma.</summary>
        Bt2020Hlg = 3,
        /// <summary>BT.2020 with perceptual quantization.</summary>
        Bt2020Pq = 4,
        /// <summary>Amplitudes of the lasers, as in the paper and its data sets.</summary>
        Amplitude = 5,
    }

    /// <summary>The memory layout of a depth image. Except in normalized and relative formats, 0, negative numbers,
    /// NaN, numbers of 10⁹ or more, the largest code of an integer format and the largest finite 16-bit float mean no
    /// reading.</summary>
    public enum DepthFormat : uint
    {
        /// <summary>Metres, 32-bit floats.</summary>
        MetresF32 = 0,
        /// <summary>Metres, 16-bit floats.</summary>
        MetresF16 = 1,
        /// <summary>Inverse metres, 32-bit floats.</summary>
        DisparityF32 = 2,
        /// <summary>Inverse metres, 16-bit floats.</summary>
        DisparityF16 = 3,
        /// <summary>Millimetres, all 16 bits.</summary>
        MillimetresU16 = 4,
        /// <summary>Android's DEPTH16: millimetres in the lower 13 bits, a confidence in the upper 3.</summary>
        AndroidDepth16 = 5,
        /// <summary>0 nearest to 255 farthest; every pixel is a reading.</summary>
        NormalizedU8 = 6,
        /// <summary>0 nearest to 65535 farthest; every pixel is a reading.</summary>
        NormalizedU16 = 7,
        /// <summary>Relative inverse depth as 32-bit floats, as networks estimate it: larger where nearer, on any scale.</summary>
        RelativeF32 = 8,
        /// <summary>Relative inverse depth as 16-bit floats.</summary>
        RelativeF16 = 9,
    }

    /// <summary>The memory layout of a confidence map.</summary>
    public enum ConfidenceFormat : uint
    {
        /// <summary>0 low, 1 medium, 2 high.</summary>
        LowMediumHigh = 0,
        /// <summary>0 none to 255 full.</summary>
        U8 = 1,
    }

    /// <summary>The clockwise rotation that brings a sensor's image upright.</summary>
    public enum Rotation : uint
    {
        /// <summary>No rotation.</summary>
        Upright = 0,
        /// <summary>A quarter turn clockwise.</summary>
        Clockwise90 = 1,
        /// <summary>Half a turn.</summary>
        Half = 2,
        /// <summary>Three quarter turns clockwise.</summary>
        Clockwise270 = 3,
    }

    /// <summary>One plane of an image, in an array or in native memory that stays valid during the call.</summary>
    public struct ImagePlane
    {
        internal readonly byte[] Bytes;
        internal readonly int Offset;
        internal readonly IntPtr Data;
        internal readonly long Length;
        internal readonly int RowStride;
        internal readonly int PixelStride;

        /// <summary>Creates a plane in an array, from <paramref name="offset"/> to its end.</summary>
        public ImagePlane(byte[] bytes, int rowStride, int pixelStride, int offset = 0)
        {
            if (bytes == null) throw new ArgumentNullException(nameof(bytes));
            if (offset < 0 || offset > bytes.Length) throw new ArgumentOutOfRangeException(nameof(offset));
            (Bytes, Offset, Data, Length, RowStride, PixelStride) =
                (bytes, offset, IntPtr.Zero, bytes.Length - offset, rowStride, pixelStride);
        }

        /// <summary>Creates a plane in native memory, for example of a NativeArray or a camera image.</summary>
        public ImagePlane(IntPtr data, long length, int rowStride, int pixelStride)
        {
            (Bytes, Offset, Data, Length, RowStride, PixelStride) = (null, 0, data, length, rowStride, pixelStride);
        }

        internal NativePlane Pin(List<GCHandle> pins)
        {
            var data = Data;
            if (Bytes != null)
            {
                var pin = GCHandle.Alloc(Bytes, GCHandleType.Pinned);
                pins.Add(pin);
                data = pin.AddrOfPinnedObject() + Offset;
            }
            return new NativePlane
            {
                Data = data,
                Length = (UIntPtr)(ulong)Length,
                RowStride = checked((uint)RowStride),
                PixelStride = checked((uint)PixelStride),
            };
        }
    }

    /// <summary>A colour image.</summary>
    public struct ColourImage
    {
        /// <summary>The memory layout.</summary>
        public ColourFormat Format;
        /// <summary>The width in pixels, in the sensor's orientation.</summary>
        public int Width;
        /// <summary>The height in pixels.</summary>
        public int Height;
        /// <summary>The matrix of luma and chroma. RGB formats ignore it.</summary>
        public YuvMatrix Matrix;
        /// <summary>Whether luma spans 16 to 235 and chroma 16 to 240. RGB formats ignore it.</summary>
        public bool VideoRange;
        /// <summary>The planes, in the order of the format.</summary>
        public ImagePlane[] Planes;
        /// <summary>The meaning of red, green and blue.</summary>
        public RgbEncoding Encoding;
    }

    /// <summary>A depth image.</summary>
    public struct DepthImage
    {
        /// <summary>The memory layout.</summary>
        public DepthFormat Format;
        /// <summary>The width in pixels, in the sensor's orientation.</summary>
        public int Width;
        /// <summary>The height in pixels.</summary>
        public int Height;
        /// <summary>The plane.</summary>
        public ImagePlane Plane;
    }

    /// <summary>The confidence map of a depth image.</summary>
    public struct ConfidenceMap
    {
        /// <summary>The memory layout.</summary>
        public ConfidenceFormat Format;
        /// <summary>The width in pixels, equal to that of the depth image.</summary>
        public int Width;
        /// <summary>The height in pixels, equal to that of the depth image.</summary>
        public int Height;
        /// <summary>The plane.</summary>
        public ImagePlane Plane;
    }

    /// <summary>The pinhole model of a camera, in pixels of its image before the image is turned upright. The middle of
    /// the first pixel is (0, 0).</summary>
    public struct Intrinsics
    {
        /// <summary>The focal length along x.</summary>
        public double Fx;
        /// <summary>The focal length along y.</summary>
        public double Fy;
        /// <summary>The x of the principal point.</summary>
        public double Cx;
        /// <summary>The y of the principal point.</summary>
        public double Cy;
    }

    /// <summary>The intrinsics and the relative pose of the depth camera and the colour camera. A point p of the depth
    /// camera (x right, y down, z forward) is at R·p + t of the colour camera.</summary>
    public struct Cameras
    {
        /// <summary>The intrinsics of the colour camera.</summary>
        public Intrinsics Colour;
        /// <summary>The intrinsics of the depth camera.</summary>
        public Intrinsics Depth;
        /// <summary>R, nine numbers row by row, or null for cameras with the same orientation.</summary>
        public double[] Rotation;
        /// <summary>t, three numbers in metres, or null for cameras at the same place.</summary>
        public double[] TranslationM;
    }

    /// <summary>A frame: a colour image, a depth image and their orientation.</summary>
    public sealed class CameraFrame
    {
        /// <summary>The capture time in nanoseconds of any monotonic clock.</summary>
        public ulong TimestampNs;
        /// <summary>The colour image.</summary>
        public ColourImage Colour;
        /// <summary>The depth image. Leave it out if the session's depth network estimates it.</summary>
        public DepthImage Depth;
        /// <summary>The confidence map of the depth, or null.</summary>
        public ConfidenceMap? Confidence;
        /// <summary>The rotation that brings all images upright.</summary>
        public Rotation Rotation;
        /// <summary>Whether the images are mirrored left to right after the rotation, as for front cameras.</summary>
        public bool Mirrored;
        /// <summary>The cameras, or null if depth and colour have the same field of view.</summary>
        public Cameras? Cameras;

        /// Calls `call` with `frame` in the form of the C interface, and pins its memory during the call.
        internal static T Pinned<T>(CameraFrame frame, Func<NativeFrame, T> call)
        {
            if (frame == null) throw new PhasefrontException(Status.Frame, "frame: it is null; a CameraFrame with a colour image is right");
            var pins = new List<GCHandle>();
            try
            {
                return call(frame.Write(pins));
            }
            finally
            {
                foreach (var pin in pins) pin.Free();
            }
        }

        private NativeFrame Write(List<GCHandle> pins)
        {
            var planes = Colour.Planes ?? new ImagePlane[0];
            if (planes.Length > 3) throw new PhasefrontException(Status.Frame, "frame: a colour image has 3 planes at most");
            var native = new NativeFrame
            {
                Size = Native.SizeOf<NativeFrame>(),
                TimestampNs = TimestampNs,
                Colour = new NativeColour
                {
                    Format = (uint)Colour.Format,
                    Width = checked((uint)Colour.Width),
                    Height = checked((uint)Colour.Height),
                    Matrix = (uint)Colour.Matrix,
                    VideoRange = Colour.VideoRange,
                    Plane0 = planes.Length > 0 ? planes[0].Pin(pins) : default,
                    Plane1 = planes.Length > 1 ? planes[1].Pin(pins) : default,
                    Plane2 = planes.Length > 2 ? planes[2].Pin(pins) : default,
                },
                Depth = new NativeDepth
                {
                    Format = (uint)Depth.Format,
                    Width = checked((uint)Depth.Width),
                    Height = checked((uint)Depth.Height),
                    Plane = Depth.Plane.Pin(pins),
                },
                Rotation = (uint)Rotation,
                Mirrored = Mirrored,
                RgbEncoding = (uint)Colour.Encoding,
            };
            if (Confidence is ConfidenceMap map)
            {
                native.Confidence = new NativeDepth
                {
                    Format = (uint)map.Format,
                    Width = checked((uint)map.Width),
                    Height = checked((uint)map.Height),
                    Plane = map.Plane.Pin(pins),
                };
            }
            if (Cameras is Cameras cameras)
            {
                var pin = GCHandle.Alloc(Numbers(cameras), GCHandleType.Pinned);
                pins.Add(pin);
                native.Cameras = pin.AddrOfPinnedObject();
            }
            return native;
        }

        /// The numbers of a PfCameras.
        private static double[] Numbers(Cameras cameras)
        {
            var rotation = cameras.Rotation ?? new double[] { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
            var translation = cameras.TranslationM ?? new double[3];
            if (rotation.Length != 9 || translation.Length != 3)
                throw new PhasefrontException(Status.Frame, "frame: a rotation has 9 numbers and a translation 3");
            var numbers = new List<double>(20);
            foreach (var camera in new[] { cameras.Colour, cameras.Depth })
                numbers.AddRange(new[] { camera.Fx, camera.Fy, camera.Cx, camera.Cy });
            numbers.AddRange(rotation);
            numbers.AddRange(translation);
            return numbers.ToArray();
        }
    }
}
