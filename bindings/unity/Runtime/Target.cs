using System;
using System.Runtime.InteropServices;
using static Phasefront.PhasefrontException;

namespace Phasefront
{
    /// <summary>An object of the native library; it ends with Dispose, or when nobody holds it.</summary>
    public abstract class NativeObject : SafeHandle
    {
        internal NativeObject(IntPtr handle) : base(IntPtr.Zero, true) { SetHandle(handle); }

        /// <summary>Whether it is none.</summary>
        public override bool IsInvalid => handle == IntPtr.Zero;
    }

    /// <summary>
    /// What holograms are made for: a display and, where it is calibrated, what its modulator answers to a phase, its
    /// lasers' light, what corrects its optics. Immutable; one serves many sessions.
    /// </summary>
    public sealed class Target : NativeObject
    {
        private Target(IntPtr handle) : base(handle) { }

        /// <summary>A display in TOML, as "width = 1920\npitch_um = 8.0"; what is left out has the default value.</summary>
        public static Target FromToml(string toml)
        {
            Check(Native.pf_target_from_toml(Text.Write(toml), out var target));
            return new Target(target);
        }

        /// <summary>
        /// A display whose modulator was calibrated as a whole: of 256 levels the one at i shows the phase 2πi/256.
        /// </summary>
        public static Target WithLookUpTable(string toml, byte[] levels)
        {
            Check(Native.pf_target_with_look_up_table(Text.Write(toml), levels, (UIntPtr)levels.Length, out var target));
            return new Target(target);
        }

        /// <summary>The bytes of a calibration's file, as `phasefront calibrate pack` writes it.</summary>
        public static Target FromBytes(byte[] file)
        {
            Check(Native.pf_target_from_bytes(file, (UIntPtr)file.Length, out var target));
            return new Target(target);
        }

        /// <summary>Width and height of its modulator, pixels.</summary>
        public (int Width, int Height) Size
        {
            get
            {
                Check(Native.pf_target_size(this, out var width, out var height));
                return ((int)width, (int)height);
            }
        }

        /// <summary>Ends it.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_target_free(handle);
            return true;
        }
    }

    /// <summary>A hologram network or a pre-filter. Immutable; one serves many sessions.</summary>
    public sealed class Network : NativeObject
    {
        private Network(IntPtr handle) : base(handle) { }

        /// <summary>A network in int8 that is bundled.</summary>
        public static Network BuiltIn(string name = "rgbd-8")
        {
            Check(Native.pf_network_built_in(Text.Write(name), out var network));
            return new Network(network);
        }

        /// <summary>The bytes of an ONNX file.</summary>
        public static Network FromBytes(byte[] onnx)
        {
            Check(Native.pf_network_from_bytes(onnx, (UIntPtr)onnx.Length, out var network));
            return new Network(network);
        }

        /// <summary>Ends it.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_network_free(handle);
            return true;
        }
    }
}
