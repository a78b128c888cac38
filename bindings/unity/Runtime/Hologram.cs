using System;
using System.Runtime.InteropServices;
using static Phasefront.PhasefrontException;

namespace Phasefront
{
    /// <summary>How long each stage of a frame took, milliseconds.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct FrameTimes
    {
        /// <summary>Colour to amplitudes of the display's resolution.</summary>
        public double ColourMs;
        /// <summary>Depth to normalized depth of the display's resolution.</summary>
        public double DepthMs;
        /// <summary>The midpoint hologram.</summary>
        public double MethodMs;
        /// <summary>From the midpoint to the modulator.</summary>
        public double PropagateMs;
        /// <summary>From the field to levels.</summary>
        public double EncodeMs;
        /// <summary>All together.</summary>
        public double TotalMs;
    }

    /// <summary>What is known of a hologram.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct HologramInfo
    {
        /// <summary>The frame's timestamp.</summary>
        public ulong TimestampNs;
        /// <summary>Pixels along x.</summary>
        public uint Width;
        /// <summary>Pixels along y.</summary>
        public uint Height;
        /// <summary>How many colours its levels have: 3, or 1 for a display of one laser.</summary>
        public uint Colours;
        /// <summary>The quality level that it was made at, 0 the best.</summary>
        public uint QualityLevel;
        /// <summary>The amplitude that full light stands for.</summary>
        public float Scale;
        /// <summary>Metres at the near end of the volume; NaN for normalized depth.</summary>
        public float NearM;
        /// <summary>Metres at the far end of the volume; NaN for normalized depth.</summary>
        public float FarM;
        /// <summary>The share of the depth sensor's pixels that had a usable reading.</summary>
        public float ValidDepth;
        /// <summary>How long each stage took.</summary>
        public FrameTimes Times;
    }

    /// <summary>How the levels of the colours lie in images for a modulator's driver.</summary>
    public enum Layout : uint
    {
        /// <summary>One image, bytes red, green, blue.</summary>
        Rgb = 0,
        /// <summary>One image, bytes red, green, blue, alpha 255.</summary>
        Rgba = 1,
        /// <summary>One image, bytes blue, green, red, alpha 255.</summary>
        Bgra = 2,
        /// <summary>An image for each colour, one after another; a byte a pixel.</summary>
        Grey = 3,
    }

    /// <summary>An image, row by row without gaps.</summary>
    public sealed class Image
    {
        /// <summary>Its bytes.</summary>
        public byte[] Bytes { get; }
        /// <summary>Pixels along x.</summary>
        public int Width { get; }
        /// <summary>Pixels along y.</summary>
        public int Height { get; }
        /// <summary>Bytes of a pixel.</summary>
        public int PixelBytes { get; }

        // Takes what C gave, and ends it.
        internal Image(IntPtr image)
        {
            try
            {
                Check(Native.pf_image_info(image, out var info));
                Bytes = new byte[checked((int)info.Length)];
                Marshal.Copy(info.Data, Bytes, 0, Bytes.Length);
                (Width, Height, PixelBytes) = ((int)info.Width, (int)info.Height, (int)info.PixelBytes);
            }
            finally
            {
                Native.pf_image_free(image);
            }
        }
    }

    /// <summary>Numbers at each pixel of each colour of a hologram: amplitudes, or a field.</summary>
    public sealed class Planes
    {
        /// <summary>Planes row by row without gaps, one colour after another.</summary>
        public float[] Values { get; }
        /// <summary>Pixels along x.</summary>
        public int Width { get; }
        /// <summary>Pixels along y.</summary>
        public int Height { get; }
        /// <summary>How many planes there are: 3, or 1 of a display of one laser.</summary>
        public int Colours { get; }
        /// <summary>Numbers of a pixel: 1, an amplitude, or 2, a real and an imaginary part.</summary>
        public int Numbers { get; }

        // Takes what C gave, and ends it.
        internal Planes(IntPtr planes)
        {
            try
            {
                Check(Native.pf_planes_info(planes, out var info));
                Values = new float[checked((int)info.Length)];
                Marshal.Copy(info.Data, Values, 0, Values.Length);
                (Width, Height) = ((int)info.Width, (int)info.Height);
                (Colours, Numbers) = ((int)info.Colours, (int)info.Numbers);
            }
            finally
            {
                Native.pf_planes_free(planes);
            }
        }
    }

    /// <summary>The hologram of one frame: modulator levels of its colours. Dispose gives its memory back to its session.</summary>
    public sealed class Hologram : NativeObject
    {
        internal Hologram(IntPtr handle) : base(handle) { }

        /// <summary>What is known of it.</summary>
        public HologramInfo Info
        {
            get
            {
                Check(Native.pf_hologram_info(this, out var info));
                return info;
            }
        }

        /// <summary>The levels of one colour, row by row without gaps: 0 red, 1 green, 2 blue, or 0 of one laser.</summary>
        public byte[] Levels(int colour)
        {
            Check(Native.pf_hologram_levels(this, checked((uint)colour), out var levels, out var length));
            var bytes = new byte[checked((int)length)];
            Marshal.Copy(levels, bytes, 0, bytes.Length);
            GC.KeepAlive(this);
            return bytes;
        }

        /// <summary>z of what is seen at (x, y), each 0 to 1 from the upper left corner, mm: where to focus.</summary>
        public double ZAt(double x, double y)
        {
            Check(Native.pf_hologram_z_at(this, x, y, out var zMm));
            return zMm;
        }

        /// <summary>What an eye focused at z sees: red, green, blue, 255.</summary>
        public Image Preview(double zMm, int width, int height)
        {
            Check(Native.pf_hologram_preview(this, zMm, checked((uint)width), checked((uint)height), out var image));
            return new Image(image);
        }

        /// <summary>What an eye focused at z sees of the whole hologram: amplitudes, of which 1 is white. Not for every
        /// frame.</summary>
        public Planes Refocus(double zMm)
        {
            Check(Native.pf_hologram_refocus(this, zMm, out var planes));
            return new Planes(planes);
        }

        /// <summary>The complex field that the levels make behind the aperture at z, 0 the midpoint, without the
        /// carrier. Not for every frame.</summary>
        public Planes Field(double zMm = 0)
        {
            Check(Native.pf_hologram_field(this, zMm, out var planes));
            return new Planes(planes);
        }

        /// <summary>Image <paramref name="number"/> of those that the modulator's driver takes.</summary>
        public Image Output(Layout layout, int number = 0, bool flipX = false, bool flipY = false, int shiftX = 0, int shiftY = 0)
        {
            var placement = new NativePlacement
            {
                Layout = (uint)layout,
                FlipX = flipX,
                FlipY = flipY,
                ShiftX = shiftX,
                ShiftY = shiftY,
            };
            Check(Native.pf_hologram_output(this, ref placement, checked((uint)number), out var image));
            return new Image(image);
        }

        /// <summary>Ends it.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_hologram_free(handle);
            return true;
        }
    }
}
