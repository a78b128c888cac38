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
        internal UIntPtr Size;
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
        /// <summary>The meaning of the frame's colours. Views are in sRGB unless these are amplitudes, as which views
        /// show them.</summary>
        public RgbEncoding Encoding;
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
        /// <summary>One image of 32-bit little-endian words: red in the lowest 10 bits, then green, then blue, alpha
        /// 3.</summary>
        Rgb10 = 4,
        /// <summary>One image per colour, one 16-bit little-endian word per pixel.</summary>
        Grey16 = 5,
    }

    /// <summary>The images that a modulator's input takes of a hologram.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct OutputSize
    {
        /// <summary>The width of an image in pixels.</summary>
        public uint Width;
        /// <summary>The height of an image in pixels.</summary>
        public uint Height;
        /// <summary>The number of bytes per pixel.</summary>
        public uint PixelBytes;
        /// <summary>The number of images: one, or one for each colour.</summary>
        public uint Images;
    }

    /// <summary>The memory that an image is written into: an array, or native memory, for example of a NativeArray, that
    /// stays valid during the call. Rows are the row stride apart, in bytes.</summary>
    public struct ImageMemory
    {
        private readonly byte[] bytes;
        private NativeMemory memory;

        /// <summary>Creates memory of an array.</summary>
        public ImageMemory(byte[] bytes, int rowStride)
        {
            this.bytes = bytes ?? throw new ArgumentNullException(nameof(bytes));
            memory = new NativeMemory { Length = (UIntPtr)(ulong)bytes.Length, RowStride = checked((uint)rowStride) };
        }

        /// <summary>Creates memory of <paramref name="length"/> bytes at an address.</summary>
        public ImageMemory(IntPtr data, long length, int rowStride)
        {
            bytes = null;
            memory = new NativeMemory { Data = data, Length = (UIntPtr)checked((ulong)length), RowStride = checked((uint)rowStride) };
        }

        // Calls `call` with the memory, which stays in its place meanwhile.
        internal void Lend(Func<NativeMemory, Status> call)
        {
            if (bytes == null)
            {
                Check(call(memory));
                return;
            }
            var pin = GCHandle.Alloc(bytes, GCHandleType.Pinned);
            try
            {
                memory.Data = pin.AddrOfPinnedObject();
                Check(call(memory));
            }
            finally
            {
                pin.Free();
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
                var info = new HologramInfo { Size = Native.SizeOf<HologramInfo>() };
                Check(Native.pf_hologram_info(this, ref info));
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

        /// <summary>Writes the displayed image in sRGB for an eye focused at z: pixels of Rgb, Rgba or Bgra.
        /// Allocates no image.</summary>
        public void WritePreview(double zMm, int width, int height, ModulatorLayout layout, ImageMemory to) =>
            to.Lend(memory => Native.pf_hologram_write_preview(this, zMm, checked((uint)width), checked((uint)height), (uint)layout, memory));

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

        /// <summary>Returns the size of the images of a layout for the modulator.</summary>
        public OutputSize OutputSize(ModulatorLayout layout)
        {
            Check(Native.pf_hologram_output_size(this, (uint)layout, out var size));
            return size;
        }

        /// <summary>Writes image <paramref name="number"/> of the images for the modulator's driver. Allocates no
        /// image.</summary>
        public void WriteOutput(
            ModulatorLayout layout, ImageMemory to, int number = 0, bool flipX = false, bool flipY = false, int shiftX = 0, int shiftY = 0)
        {
            var placement = new NativePlacement
            {
                Layout = (uint)layout,
                FlipX = flipX,
                FlipY = flipY,
                ShiftX = shiftX,
                ShiftY = shiftY,
            };
            to.Lend(memory => Native.pf_hologram_write_output(this, ref placement, checked((uint)number), memory));
        }

        /// <summary>Frees the hologram.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_hologram_free(handle);
            return true;
        }
    }

    /// <summary>A modulator: its display, the phases of its levels, and the images that its input takes.</summary>
    public sealed class Modulator : NativeObject
    {
        private Modulator(IntPtr handle) : base(handle) { }

        /// <summary>Returns a modulator that the command `phasefront devices` lists, for example
        /// holoeye-pluto.</summary>
        public static Modulator Named(string name)
        {
            Check(Native.pf_modulator_named(Text.Write(name), out var modulator));
            return new Modulator(modulator);
        }

        /// <summary>Reads the text of a modulator's file, with keys such as packing and levels_turns.</summary>
        public static Modulator FromToml(string toml)
        {
            Check(Native.pf_modulator_from_toml(Text.Write(toml), out var modulator));
            return new Modulator(modulator);
        }

        /// <summary>Returns the target of holograms for the modulator.</summary>
        public HologramTarget Target()
        {
            Check(Native.pf_modulator_target(this, out var target));
            return new HologramTarget(target);
        }

        /// <summary>The size of the images that its input takes.</summary>
        public OutputSize OutputSize
        {
            get
            {
                Check(Native.pf_modulator_output_size(this, out var size));
                return size;
            }
        }

        /// <summary>Writes image <paramref name="number"/> of the images that its input takes of a hologram.</summary>
        public void WriteOutput(Hologram hologram, ImageMemory to, int number = 0) =>
            to.Lend(memory => Native.pf_modulator_write_output(this, hologram, checked((uint)number), memory));

        /// <summary>Writes the same image in the pixels of a screen or texture that drives the modulator, Rgba or Bgra. The
        /// red, green and blue of a grey image are its level; images of 16 bits are refused.</summary>
        public void WritePixels(Hologram hologram, ModulatorLayout layout, ImageMemory to, int number = 0) =>
            to.Lend(memory => Native.pf_modulator_write_pixels(this, hologram, checked((uint)number), (uint)layout, memory));

        /// <summary>Frees the modulator.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_modulator_free(handle);
            return true;
        }
    }
}
