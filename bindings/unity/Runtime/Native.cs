// Declares the C interface for C#. bindings/c/include/phasefront.h documents each call.
using System;
using System.Runtime.InteropServices;

namespace Phasefront
{
    [StructLayout(LayoutKind.Sequential)]
    internal struct NativePlane
    {
        public IntPtr Data;
        public UIntPtr Length;
        public uint RowStride;
        public uint PixelStride;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct NativeColour
    {
        public uint Format;
        public uint Width;
        public uint Height;
        public uint Matrix;
        [MarshalAs(UnmanagedType.U1)] public bool VideoRange;
        public NativePlane Plane0;
        public NativePlane Plane1;
        public NativePlane Plane2;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct NativeDepth
    {
        public uint Format;
        public uint Width;
        public uint Height;
        public NativePlane Plane;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct NativeFrame
    {
        public UIntPtr Size;
        public ulong TimestampNs;
        public NativeColour Colour;
        public NativeDepth Depth;
        public NativeDepth Confidence;
        public uint Rotation;
        [MarshalAs(UnmanagedType.U1)] public bool Mirrored;
        public IntPtr Cameras;
        public uint RgbEncoding;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct NativeQualityLevel
    {
        public UIntPtr Size;
        public uint Method;
        public IntPtr Network;
        public uint Width;
        public uint Height;
        public int LocalSteps;
        public int MidpointSteps;
        public int FocusSteps;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct NativePlanes
    {
        public IntPtr Data;
        public UIntPtr Length;
        public uint Width;
        public uint Height;
        public uint Colours;
        public uint Numbers;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct NativeMemory
    {
        public IntPtr Data;
        public UIntPtr Length;
        public uint RowStride;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct NativePlacement
    {
        public uint Layout;
        [MarshalAs(UnmanagedType.U1)] public bool FlipX;
        [MarshalAs(UnmanagedType.U1)] public bool FlipY;
        public int ShiftX;
        public int ShiftY;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct NativeListener
    {
        public UIntPtr Size;
        public IntPtr Context;
        public Native.OnProcessed OnProcessed;
        public Native.OnDropped OnDropped;
        public Native.OnFailed OnFailed;
        public Native.OnQualityChanged OnQualityChanged;
        public Native.OnClosed OnClosed;
    }

    // IL2CPP looks for an attribute of this name on methods that native code calls.
    [AttributeUsage(AttributeTargets.Method)]
    internal sealed class MonoPInvokeCallbackAttribute : Attribute
    {
        public MonoPInvokeCallbackAttribute(Type type) { }
    }

    internal static class Native
    {
#if UNITY_IOS && !UNITY_EDITOR
        private const string Library = "__Internal";
#else
        private const string Library = "phasefront_c";
#endif
        private const CallingConvention C = CallingConvention.Cdecl;

        // What the library expects in the first field of structs that later versions may extend.
        public static UIntPtr SizeOf<T>() => (UIntPtr)(ulong)Marshal.SizeOf<T>();

        [UnmanagedFunctionPointer(C)] public delegate void OnProcessed(IntPtr context, IntPtr hologram);
        [UnmanagedFunctionPointer(C)] public delegate void OnDropped(IntPtr context, ulong timestampNs, DropReason reason);
        [UnmanagedFunctionPointer(C)] public delegate void OnFailed(IntPtr context, ulong timestampNs, IntPtr message);
        [UnmanagedFunctionPointer(C)] public delegate void OnQualityChanged(IntPtr context, ulong timestampNs, QualityChange change);
        [UnmanagedFunctionPointer(C)] public delegate void OnClosed(IntPtr context);

        [DllImport(Library, CallingConvention = C)] public static extern IntPtr pf_version();
        [DllImport(Library, CallingConvention = C)] public static extern IntPtr pf_third_party_notices();
        [DllImport(Library, CallingConvention = C)] public static extern IntPtr pf_last_error();

        [DllImport(Library, CallingConvention = C)] public static extern Status pf_target_from_toml(byte[] toml, out IntPtr target);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_target_with_look_up_table(byte[] toml, byte[] levels, UIntPtr count, out IntPtr target);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_target_from_bytes(byte[] file, UIntPtr length, out IntPtr target);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_target_size(HologramTarget target, out uint width, out uint height);
        [DllImport(Library, CallingConvention = C)] public static extern void pf_target_free(IntPtr target);

        [DllImport(Library, CallingConvention = C)] public static extern Status pf_network_built_in(byte[] name, out IntPtr network);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_network_from_bytes(byte[] onnx, UIntPtr length, out IntPtr network);
        [DllImport(Library, CallingConvention = C)] public static extern void pf_network_free(IntPtr network);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_depth_network_from_bytes(byte[] onnx, UIntPtr length, uint colours, [MarshalAs(UnmanagedType.I1)] bool givesDistance, out IntPtr network);
        [DllImport(Library, CallingConvention = C)] public static extern void pf_depth_network_free(IntPtr network);

        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_new(HologramTarget target, uint method, IntPtr network, out IntPtr options);
        [DllImport(Library, CallingConvention = C)] public static extern void pf_options_free(IntPtr options);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_clear_quality_levels(SessionOptions options);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_push_quality_level(SessionOptions options, ref NativeQualityLevel qualityLevel);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_target_rate_hz(SessionOptions options, double rateHz);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_double_phase(SessionOptions options);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_anti_alias(SessionOptions options, float sigma, uint width);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_band_limit(SessionOptions options, float k);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_deep(SessionOptions options, HologramNetwork prefilter);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_depth_network(SessionOptions options, DepthNetwork network);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_brightness_smoothed(SessionOptions options);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_brightness_fixed(SessionOptions options, float scale);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_brightness_frame_max(SessionOptions options);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_dark_threshold(SessionOptions options, float threshold);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_local_steps(SessionOptions options, uint steps);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_midpoint_steps(SessionOptions options, uint steps);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_natural_focus(SessionOptions options, uint steps);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_depth_range(SessionOptions options, float nearM, float farM);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_least_confidence(SessionOptions options, float confidence);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_keep_standing(SessionOptions options, [MarshalAs(UnmanagedType.I1)] bool keep);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_threads(SessionOptions options, uint threads);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_most_pixels(SessionOptions options, ulong pixels);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_options_set_backend(SessionOptions options, Backend backend);

        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_new(SessionOptions options, RunningMode mode, IntPtr listener, out IntPtr session);
        [DllImport(Library, CallingConvention = C, EntryPoint = "pf_session_new")] public static extern Status pf_session_new_live(SessionOptions options, RunningMode mode, ref NativeListener listener, out IntPtr session);
        [DllImport(Library, CallingConvention = C)] public static extern void pf_session_free(IntPtr session);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_process(HologramSession session, ref NativeFrame frame, out IntPtr hologram);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_submit(HologramSession session, ref NativeFrame frame, out DropReason dropped);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_warm_up(HologramSession session);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_reset(HologramSession session);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_pause(HologramSession session);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_resume(HologramSession session);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_set_thermal(HologramSession session, Thermal thermal);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_fix_quality_level(HologramSession session, uint qualityLevel);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_step_by_itself(HologramSession session);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_session_statistics(HologramSession session, ref Statistics statistics);

        [DllImport(Library, CallingConvention = C)] public static extern Status pf_hologram_info(Hologram hologram, ref HologramInfo info);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_hologram_levels(Hologram hologram, uint colour, out IntPtr levels, out UIntPtr length);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_hologram_z_at(Hologram hologram, double x, double y, out double zMm);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_hologram_write_preview(Hologram hologram, double zMm, uint width, uint height, uint layout, NativeMemory memory);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_hologram_refocus(Hologram hologram, double zMm, out IntPtr planes);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_hologram_field(Hologram hologram, double zMm, out IntPtr planes);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_planes_info(IntPtr planes, out NativePlanes info);
        [DllImport(Library, CallingConvention = C)] public static extern void pf_planes_free(IntPtr planes);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_hologram_output_size(Hologram hologram, uint layout, out OutputSize size);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_hologram_write_output(Hologram hologram, ref NativePlacement placement, uint number, NativeMemory memory);
        [DllImport(Library, CallingConvention = C)] public static extern void pf_hologram_free(IntPtr hologram);

        [DllImport(Library, CallingConvention = C)] public static extern Status pf_modulator_named(byte[] name, out IntPtr modulator);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_modulator_from_toml(byte[] toml, out IntPtr modulator);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_modulator_target(Modulator modulator, out IntPtr target);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_modulator_output_size(Modulator modulator, out OutputSize size);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_modulator_write_output(Modulator modulator, Hologram hologram, uint number, NativeMemory memory);
        [DllImport(Library, CallingConvention = C)] public static extern Status pf_modulator_write_pixels(Modulator modulator, Hologram hologram, uint number, uint layout, NativeMemory memory);
        [DllImport(Library, CallingConvention = C)] public static extern void pf_modulator_free(IntPtr modulator);
    }
}
