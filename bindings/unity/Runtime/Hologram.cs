using System;
using System.Runtime.InteropServices;
using static Phasefront.PhasefrontException;

namespace Phasefront
{
    /// <summary>The time of each stage of a frame, in milliseconds.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct FrameTimes
    {
        /// <summary>Converting colour to amplitudes at the display's resolution.</summary>
        public double ColourMs;
        /// <summary>Converting depth to normalized depth at the display's resolution.</summary>
        public double DepthMs;
        /// <summary>Computing the midpoint hologram.</summary>
        public double MethodMs;
        /// <summary>Propagating from the midpoint to the modulator.</summary>
        public double PropagateMs;
        /// <summary>Encoding the field as levels.</summary>
        public double EncodeMs;
        /// <summary>The whole frame.</summary>
        public double TotalMs;
    }

    /// <summary>The metadata of a hologram.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct HologramInfo
    {
        /// <summary>The frame's timestamp.</summary>
        public ulong TimestampNs;
        /// <summary>The width in pixels.</summary>
        public uint Width;
        /// <summary>The height in pixels.</summary>
        public uint Height;
        /// <summary>The number of colours: 3, or 1 for a display with a single laser.</summary>
        public uint Colours;
        /// <summary>The quality level of the hologram; 0 is the best.</summary>
        public uint QualityLevel;
        /// <summary>The amplitude that full light represents.</summary>
        public float Scale;
        /// <summary>The depth in metres at the near end of the volume, or NaN for normalized depth.</summary>
        public float NearM;
        /// <summary>The depth in metres at the far end of the volume, or NaN for normalized depth.</summary>
        public float FarM;
        /// <summary>The fraction of the depth sensor's pixels with a usable reading.</summary>
        public float ValidDepth;
        /// <summary>The time of each stage.</summary>
        public FrameTimes Times;
    }

    /// <summary>The layout of the colours' levels in images for a modulator's driver.</summary>
    public enum ModulatorLayout : uint
    {
        /// <summary>One image, bytes red, green, blue.</summary>
        Rgb = 0,
        /// <summary>One image, bytes red, green, blue, alpha 255.</summary>
        Rgba = 1,
        /// <summary>One image, bytes blue, green, red, alpha 255.</summary>
        Bgra = 2,
        /// <summary>One image per colour, one byte per pixel.</summary>
        Grey = 3,
    }

    /// <summary>An image whose rows have no gaps.</summary>
    public sealed class PixelImage
    {
        /// <summary>The bytes of the image.</summary>
        public byte[] Bytes { get; }
        /// <summary>The width in pixels.</summary>
        public int Width { get; }
        /// <summary>The height in pixels.</summary>
        public int Height { get; }
        /// <summary>The number of bytes per pixel.</summary>
        public int PixelBytes { get; }

        // Copies an image of the C interface and frees it.
        internal PixelImage(IntPtr image)
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

    /// <summary>The amplitudes or the complex field of a hologram, for each pixel and colour.</summary>
    public sealed class Planes
    {
        /// <summary>The values row by row without gaps, one colour after another.</summary>
        public float[] Values { get; }
        /// <summary>The width in pixels.</summary>
        public int Width { get; }
        /// <summary>The height in pixels.</summary>
        public int Height { get; }
        /// <summary>The number of planes: 3, or 1 for a display with a single laser.</summary>
        public int Colours { get; }
        /// <summary>The numbers per pixel: 1 for an amplitude, 2 for a real and an imaginary part.</summary>
        public int Numbers { get; }

        // Copies planes of the C interface and frees them.
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

    /// <summary>The hologram of one frame: the modulator levels of its colours. Dispose returns its memory to the
    /// session.</summary>
    public sealed class Hologram : NativeObject
    {
        internal Hologram(IntPtr handle) : base(handle) { }

        /// <summary>The metadata of the hologram.</summary>
        public HologramInfo Info
        {
            get
            {
                Check(Native.pf_hologram_info(this, out var info));
                return info;
            }
        }

        /// <summary>Returns the levels of one colour, row by row without gaps: 0 is red or the single laser, 1 green, 2
        /// blue.</summary>
        public byte[] Levels(int colour)
        {
            Check(Native.pf_hologram_levels(this, checked((uint)colour), out var levels, out var length));
            var bytes = new byte[checked((int)length)];
            Marshal.Copy(levels, bytes, 0, bytes.Length);
            GC.KeepAlive(this);
            return bytes;
        }

        /// <summary>Returns the z in mm of the scene point at (x, y), each 0 to 1 from the upper left corner.</summary>
        public double ZAt(double x, double y)
        {
            Check(Native.pf_hologram_z_at(this, x, y, out var zMm));
            return zMm;
        }

        /// <summary>Returns the displayed image for an eye focused at z: red, green, blue, 255.</summary>
        public PixelImage Preview(double zMm, int width, int height)
        {
            Check(Native.pf_hologram_preview(this, zMm, checked((uint)width), checked((uint)height), out var image));
            return new PixelImage(image);
        }

        /// <summary>Returns the displayed image of the whole hologram for an eye focused at z, as amplitudes; 1 is
        /// white. Too slow for every frame.</summary>
        public Planes Refocus(double zMm)
        {
            Check(Native.pf_hologram_refocus(this, zMm, out var planes));
            return new Planes(planes);
        }

        /// <summary>Returns the complex field of the levels behind the aperture at z (0 is the midpoint), without the
        /// carrier. Too slow for every frame.</summary>
        public Planes Field(double zMm = 0)
        {
            Check(Native.pf_hologram_field(this, zMm, out var planes));
            return new Planes(planes);
        }

        /// <summary>Returns image <paramref name="number"/> of the images for the modulator's driver.</summary>
        public PixelImage Output(ModulatorLayout layout, int number = 0, bool flipX = false, bool flipY = false, int shiftX = 0, int shiftY = 0)
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
            return new PixelImage(image);
        }

        /// <summary>Frees the hologram.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_hologram_free(handle);
            return true;
        }
    }
}
