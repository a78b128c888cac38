using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;

namespace Phasefront
{
    /// <summary>How a colour image lies in memory.</summary>
    public enum ColourFormat : uint
    {
        /// <summary>One plane; bytes red, green, blue, alpha.</summary>
        Rgba = 0,
        /// <summary>One plane; bytes blue, green, red, alpha.</summary>
        Bgra = 1,
        /// <summary>One plane; bytes red, green, blue.</summary>
        Rgb = 2,
        /// <summary>Two planes: luma; and at half the resolution blue and red chroma side by side.</summary>
        Nv12 = 3,
        /// <summary>Three planes: luma, and at half the resolution blue chroma and red chroma.</summary>
        Yuv420 = 4,
    }

    /// <summary>The matrix between luma, chroma and colour.</summary>
    public enum YuvMatrix : uint
    {
        /// <summary>Standard definition, JPEG, most Android cameras.</summary>
        Bt601 = 0,
        /// <summary>High definition.</summary>
        Bt709 = 1,
    }

    /// <summary>How a depth image lies in memory. But for the normalized ones, 0, negative and not finite mean no reading.</summary>
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
    }

    /// <summary>How a confidence map lies in memory.</summary>
    public enum ConfidenceFormat : uint
    {
        /// <summary>0 low, 1 medium, 2 high.</summary>
        LowMediumHigh = 0,
        /// <summary>0 none to 255 full.</summary>
        U8 = 1,
    }

    /// <summary>How far a sensor's picture must be turned clockwise to stand upright.</summary>
    public enum Rotation : uint
    {
        /// <summary>Not at all.</summary>
        Upright = 0,
        /// <summary>A quarter turn.</summary>
        Clockwise90 = 1,
        /// <summary>Half a turn.</summary>
        Half = 2,
        /// <summary>Three quarters.</summary>
        Clockwise270 = 3,
    }

    /// <summary>One plane of an image: bytes of an array, or of native memory that lives as long as the call.</summary>
    public struct Plane
    {
        internal readonly byte[] Bytes;
        internal readonly int Offset;
        internal readonly IntPtr Data;
        internal readonly long Length;
        internal readonly int RowStride;
        internal readonly int PixelStride;

        /// <summary>A plane in an array, from <paramref name="offset"/> to its end.</summary>
        public Plane(byte[] bytes, int rowStride, int pixelStride, int offset = 0)
        {
            if (bytes == null) throw new ArgumentNullException(nameof(bytes));
            if (offset < 0 || offset > bytes.Length) throw new ArgumentOutOfRangeException(nameof(offset));
            (Bytes, Offset, Data, Length, RowStride, PixelStride) =
                (bytes, offset, IntPtr.Zero, bytes.Length - offset, rowStride, pixelStride);
        }

        /// <summary>A plane in native memory, as of a NativeArray or a camera's image.</summary>
        public Plane(IntPtr data, long length, int rowStride, int pixelStride)
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
    public struct Colour
    {
        /// <summary>How it lies in memory.</summary>
        public ColourFormat Format;
        /// <summary>Pixels along x, as the sensor gives them.</summary>
        public int Width;
        /// <summary>Pixels along y.</summary>
        public int Height;
        /// <summary>Only formats of luma and chroma look at it.</summary>
        public YuvMatrix Matrix;
        /// <summary>Whether luma runs over 16 to 235 and chroma over 16 to 240; the same.</summary>
        public bool VideoRange;
        /// <summary>Its planes, in the format's order.</summary>
        public Plane[] Planes;
    }

    /// <summary>A depth image.</summary>
    public struct Depth
    {
        /// <summary>How it lies in memory.</summary>
        public DepthFormat Format;
        /// <summary>Pixels along x, as the sensor gives them.</summary>
        public int Width;
        /// <summary>Pixels along y.</summary>
        public int Height;
        /// <summary>Its plane.</summary>
        public Plane Plane;
    }

    /// <summary>The confidence map of a depth image.</summary>
    public struct Confidence
    {
        /// <summary>How it lies in memory.</summary>
        public ConfidenceFormat Format;
        /// <summary>Pixels along x: as many as the depth has.</summary>
        public int Width;
        /// <summary>Pixels along y: as many as the depth has.</summary>
        public int Height;
        /// <summary>Its plane.</summary>
        public Plane Plane;
    }

    /// <summary>A frame: colour, depth, and how they belong together.</summary>
    public sealed class Frame
    {
        /// <summary>When it was taken, in nanoseconds of any clock that runs forward.</summary>
        public ulong TimestampNs;
        /// <summary>The colour image.</summary>
        public Colour Colour;
        /// <summary>The depth image.</summary>
        public Depth Depth;
        /// <summary>The confidence map of the depth, where there is one.</summary>
        public Confidence? Confidence;
        /// <summary>How all must be turned to stand upright.</summary>
        public Rotation Rotation;
        /// <summary>Whether left and right are exchanged after the turn, as front cameras need.</summary>
        public bool Mirrored;

        /// What `call` gives of this frame as C takes it, its memory held in place meanwhile.
        internal T Pinned<T>(Func<NativeFrame, T> call)
        {
            var pins = new List<GCHandle>();
            try
            {
                return call(Write(pins));
            }
            finally
            {
                foreach (var pin in pins) pin.Free();
            }
        }

        private NativeFrame Write(List<GCHandle> pins)
        {
            var planes = Colour.Planes ?? new Plane[0];
            if (planes.Length > 3) throw new PhasefrontException(Status.Frame, "frame: a colour image has 3 planes at most");
            var native = new NativeFrame
            {
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
            };
            if (Confidence is Confidence map)
            {
                native.Confidence = new NativeDepth
                {
                    Format = (uint)map.Format,
                    Width = checked((uint)map.Width),
                    Height = checked((uint)map.Height),
                    Plane = map.Plane.Pin(pins),
                };
            }
            return native;
        }
    }
}
