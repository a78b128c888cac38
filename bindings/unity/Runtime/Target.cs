using System;
using System.Runtime.InteropServices;
using static Phasefront.PhasefrontException;

namespace Phasefront
{
    /// <summary>An object of the native library. Dispose or the garbage collector frees it.</summary>
    public abstract class NativeObject : SafeHandle
    {
        internal NativeObject(IntPtr handle) : base(IntPtr.Zero, true) { SetHandle(handle); }

        /// <summary>Whether the object has no handle.</summary>
        public override bool IsInvalid => handle == IntPtr.Zero;
    }

    /// <summary>
    /// The display that holograms are made for and, if it is calibrated, the response of its modulator, the light of
    /// its lasers and the correction of its optics. Immutable. Many sessions can share it. </summary>
    public sealed class HologramTarget : NativeObject
    {
        internal HologramTarget(IntPtr handle) : base(handle) { }

        /// <summary>Reads a display in TOML, such as "width = 1920\npitch_um = 8.0". Missing keys have default
        /// values.</summary>
        public static HologramTarget FromToml(string toml)
        {
            Check(Native.pf_target_from_toml(Text.Write(toml), out var target));
            return new HologramTarget(target);
        }

        /// <summary>
        /// Creates a display whose modulator was calibrated as a whole: the i-th of 256 levels has the phase 2πi/256.
        /// </summary>
        public static HologramTarget WithLookUpTable(string toml, byte[] levels)
        {
            Check(Native.pf_target_with_look_up_table(Text.Write(toml), levels, (UIntPtr)levels.Length, out var target));
            return new HologramTarget(target);
        }

        /// <summary>Reads a target from the bytes of a calibration file that `phasefront calibrate pack`
        /// wrote.</summary>
        public static HologramTarget FromBytes(byte[] file)
        {
            Check(Native.pf_target_from_bytes(file, (UIntPtr)file.Length, out var target));
            return new HologramTarget(target);
        }

        /// <summary>The width and height of the modulator in pixels.</summary>
        public (int Width, int Height) Size
        {
            get
            {
                Check(Native.pf_target_size(this, out var width, out var height));
                return ((int)width, (int)height);
            }
        }

        /// <summary>Frees the target.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_target_free(handle);
            return true;
        }
    }

    /// <summary>A hologram network or a pre-filter. Immutable. Many sessions can share it.</summary>
    public sealed class HologramNetwork : NativeObject
    {
        private HologramNetwork(IntPtr handle) : base(handle) { }

        /// <summary>Returns a bundled int8 network.</summary>
        public static HologramNetwork BuiltIn(string name = "rgbd-8")
        {
            Check(Native.pf_network_built_in(Text.Write(name), out var network));
            return new HologramNetwork(network);
        }

        /// <summary>Reads a network from the bytes of an ONNX file.</summary>
        public static HologramNetwork FromBytes(byte[] onnx)
        {
            Check(Native.pf_network_from_bytes(onnx, (UIntPtr)onnx.Length, out var network));
            return new HologramNetwork(network);
        }

        /// <summary>Frees the network.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_network_free(handle);
            return true;
        }
    }

    /// <summary>The scaling that a depth network expects for colour values from 0 to 1.</summary>
    public enum ColourScale : uint
    {
        /// <summary>Normalized by the mean and the spread of ImageNet: MiDaS, DPT, Depth Anything.</summary>
        Imagenet = 0,
        /// <summary>From 0 to 1.</summary>
        Unit = 1,
        /// <summary>From -1 to 1.</summary>
        Signed = 2,
    }

    /// <summary>A network that estimates relative inverse depth from colour alone. Immutable. Many sessions can share
    /// it.</summary>
    public sealed class DepthNetwork : NativeObject
    {
        private DepthNetwork(IntPtr handle) : base(handle) { }

        /// <summary>Reads the bytes of an ONNX file that holds its own weights. It takes one picture, (1, 3, H, W) or
        /// (1, H, W, 3), and gives one plane: inverse depth, or distance.</summary>
        public static DepthNetwork FromBytes(byte[] onnx, ColourScale colours = ColourScale.Imagenet, bool givesDistance = false)
        {
            Check(Native.pf_depth_network_from_bytes(onnx, (UIntPtr)onnx.Length, (uint)colours, givesDistance, out var network));
            return new DepthNetwork(network);
        }

        /// <summary>Frees the network.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_depth_network_free(handle);
            return true;
        }
    }
}
