using System;
using static Phasefront.PhasefrontException;

namespace Phasefront
{
    /// <summary>The method that computes holograms.</summary>
    public enum HologramMethod : uint
    {
        /// <summary>The network for frames whose depth has soft edges, and the plane sweep for all others. Without a
        /// network, the built-in one, or the plane sweep alone if that network was not trained for the display. This is
        /// the default.</summary>
        Auto = 0,
        /// <summary>A trained network.</summary>
        Trained = 1,
        /// <summary>The plane sweep, which works for any display without training.</summary>
        Sweep = 2,
    }

    /// <summary>The device that computes frames.</summary>
    public enum Backend : uint
    {
        /// <summary>The CPU.</summary>
        Cpu = 0,
        /// <summary>The GPU, if the library was built for it and finds one, else the CPU.</summary>
        Gpu = 1,
    }

    /// <summary>
    /// The options of a session. A new object has the defaults for its target. Only one thread may use it at a time.
    /// </summary>
    public sealed class SessionOptions : NativeObject
    {
        private SessionOptions(IntPtr handle) : base(handle) { }

        /// <summary>Returns the default options for <paramref name="target"/>.</summary>
        public static SessionOptions For(HologramTarget target, HologramMethod method = HologramMethod.Auto, HologramNetwork network = null)
        {
            return With(network, native =>
            {
                Check(Native.pf_options_new(target, (uint)method, native, out var options));
                return new SessionOptions(options);
            });
        }

        // Keeps the network alive while C reads it.
        private static T With<T>(HologramNetwork network, Func<IntPtr, T> call)
        {
            if (network == null) return call(IntPtr.Zero);
            var held = false;
            try
            {
                network.DangerousAddRef(ref held);
                return call(network.DangerousGetHandle());
            }
            finally
            {
                if (held) network.DangerousRelease();
            }
        }

        /// <summary>Removes all quality levels; push at least one afterwards.</summary>
        public void ClearQualityLevels() => Check(Native.pf_options_clear_quality_levels(this));

        /// <summary>
        /// Adds a quality level below the existing ones: a method, a resolution and the steps that correct the
        /// displayed image. A negative number of steps means the session's number. </summary>
        public void PushQualityLevel(HologramMethod method, HologramNetwork network, int width, int height, int localSteps = -1, int midpointSteps = -1, int focusSteps = -1)
        {
            With(network, native =>
            {
                var qualityLevel = new NativeQualityLevel
                {
                    Size = Native.SizeOf<NativeQualityLevel>(),
                    Method = (uint)method,
                    Network = native,
                    Width = (uint)width,
                    Height = (uint)height,
                    LocalSteps = localSteps,
                    MidpointSteps = midpointSteps,
                    FocusSteps = focusSteps,
                };
                Check(Native.pf_options_push_quality_level(this, ref qualityLevel));
                return true;
            });
        }

        /// <summary>The target rate in frames per second. With 0 the session takes every frame and never changes the
        /// quality level.</summary>
        public double TargetRateHz { set => Check(Native.pf_options_set_target_rate_hz(this, value)); }

        /// <summary>Encodes the unfiltered field by double phase.</summary>
        public void DoublePhase() => Check(Native.pf_options_set_double_phase(this));

        /// <summary>Encodes the field after a small Gaussian blur (AA-DPM).</summary>
        public void AntiAlias(float sigma = 0.7f, int width = 3) =>
            Check(Native.pf_options_set_anti_alias(this, sigma, (uint)width));

        /// <summary>Encodes the field without its high diagonal frequencies (BL-DPM).</summary>
        public void BandLimit(float k = 1) => Check(Native.pf_options_set_band_limit(this, k));

        /// <summary>Encodes the field after a pre-filter network (DDPM) that was trained together with the hologram
        /// network.</summary>
        public void Deep(HologramNetwork prefilter) => Check(Native.pf_options_set_deep(this, prefilter));

        /// <summary>The network that estimates the depth of frames without depth. A live session runs it on its own
        /// thread, at the network's own rate; other sessions run it for each frame.</summary>
        public DepthNetwork DepthNetwork { set => Check(Native.pf_options_set_depth_network(this, value)); }

        /// <summary>Makes full light follow the frame's largest amplitude smoothly. This is the default.</summary>
        public void SmoothedBrightness() => Check(Native.pf_options_set_brightness_smoothed(this));

        /// <summary>Makes full light represent this amplitude. Larger amplitudes are clipped.</summary>
        public void FixedBrightness(float scale) => Check(Native.pf_options_set_brightness_fixed(this, scale));

        /// <summary>Makes full light represent the frame's largest amplitude.</summary>
        public void FrameMaxBrightness() => Check(Native.pf_options_set_brightness_frame_max(this));

        /// <summary>The fraction of full light below which phases are drawn to 0.</summary>
        public float DarkThreshold { set => Check(Native.pf_options_set_dark_threshold(this, value)); }

        /// <summary>The number of correction steps, 0 to 8.</summary>
        public int LocalSteps { set => Check(Native.pf_options_set_local_steps(this, checked((uint)value))); }

        /// <summary>The number of correction steps at the midpoint, 0 to 100: 3 for stills, 1 for video.</summary>
        public int MidpointSteps { set => Check(Native.pf_options_set_midpoint_steps(this, checked((uint)value))); }

        /// <summary>Makes what is out of focus soft, as in the world. The steps follow the method, 0 to 1000: 30 bring most of
        /// the gain in stills. Without steps, as live frames need it, the method Auto without a network takes the built-in
        /// network for natural focus. The default is coherent focus: halos and rings, as a laser shows them.</summary>
        public void NaturalFocus(int steps = 0) => Check(Native.pf_options_set_natural_focus(this, checked((uint)steps)));

        /// <summary>Maps these depths in metres to the ends of the volume.</summary>
        public void DepthRange(float nearM, float farM) => Check(Native.pf_options_set_depth_range(this, nearM, farM));

        /// <summary>The confidence, 0 to 1, below which depth readings are ignored.</summary>
        public float LeastConfidence { set => Check(Native.pf_options_set_least_confidence(this, value)); }

        /// <summary>Whether what stands still in a video keeps its wave on the CPU: a frame computes only the parts where
        /// colour or depth have changed by more than a camera's noise.</summary>
        public bool KeepStanding { set => Check(Native.pf_options_set_keep_standing(this, value)); }

        /// <summary>The number of threads, 1 to 256.</summary>
        public int Threads { set => Check(Native.pf_options_set_threads(this, checked((uint)value))); }

        /// <summary>The maximum number of pixels of a quality level and of the modulator.</summary>
        public long MostPixels { set => Check(Native.pf_options_set_most_pixels(this, checked((ulong)value))); }

        /// <summary>The device that computes frames.</summary>
        public Backend Backend { set => Check(Native.pf_options_set_backend(this, value)); }

        /// <summary>Frees the options.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_options_free(handle);
            return true;
        }
    }
}
