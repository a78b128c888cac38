using System;
using static Phasefront.PhasefrontException;

namespace Phasefront
{
    /// <summary>What makes holograms.</summary>
    public enum Method : uint
    {
        /// <summary>The network that is built in, or the plane sweep where it was not trained for the display.</summary>
        Default = 0,
        /// <summary>A trained network.</summary>
        Trained = 1,
        /// <summary>The plane sweep, for any display: slower, and nothing needs to be trained.</summary>
        Sweep = 2,
        /// <summary>For each frame what suits its depth: the sweep where it is clean, the network where it is noisy.</summary>
        Auto = 3,
    }

    /// <summary>Where frames are computed.</summary>
    public enum Backend : uint
    {
        /// <summary>On the CPU.</summary>
        Cpu = 0,
        /// <summary>On the GPU, where the library was built for it and there is one; else on the CPU.</summary>
        Gpu = 1,
    }

    /// <summary>
    /// What a session makes, and how. A new one has the defaults for its target; set what differs. Of one thread at a
    /// time.
    /// </summary>
    public sealed class SessionOptions : NativeObject
    {
        private SessionOptions(IntPtr handle) : base(handle) { }

        /// <summary>The default options for <paramref name="target"/>.</summary>
        public static SessionOptions For(Target target, Method method = Method.Default, Network network = null)
        {
            return With(network, native =>
            {
                Check(Native.pf_options_new(target, (uint)method, native, out var options));
                return new SessionOptions(options);
            });
        }

        // The network may not end while C reads it.
        private static T With<T>(Network network, Func<IntPtr, T> call)
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
        /// Adds a quality level, below those that are there: a method, a resolution, and how often the displayed image
        /// is corrected; below 0 as often as in the session.
        /// </summary>
        public void PushQualityLevel(Method method, Network network, int width, int height, int localSteps = -1, int midpointSteps = -1)
        {
            With(network, native =>
            {
                var qualityLevel = new NativeQualityLevel
                {
                    Method = (uint)method,
                    Network = native,
                    Width = (uint)width,
                    Height = (uint)height,
                    LocalSteps = localSteps,
                    MidpointSteps = midpointSteps,
                };
                Check(Native.pf_options_push_quality_level(this, ref qualityLevel));
                return true;
            });
        }

        /// <summary>Frames a second that are aimed at; 0 takes every frame and never changes the quality level.</summary>
        public double TargetRateHz { set => Check(Native.pf_options_set_target_rate_hz(this, value)); }

        /// <summary>Encodes by double phase on the field as it is.</summary>
        public void DoublePhase() => Check(Native.pf_options_set_double_phase(this));

        /// <summary>Encodes behind a small Gaussian blur (AA-DPM).</summary>
        public void AntiAlias(float sigma = 0.7f, int width = 3) =>
            Check(Native.pf_options_set_anti_alias(this, sigma, (uint)width));

        /// <summary>Encodes with high diagonal frequencies cut (BL-DPM).</summary>
        public void BandLimit(float k = 1) => Check(Native.pf_options_set_band_limit(this, k));

        /// <summary>Encodes behind a pre-filter network (DDPM), trained together with the hologram network.</summary>
        public void Deep(Network prefilter) => Check(Native.pf_options_set_deep(this, prefilter));

        /// <summary>Full light stands near the frame's largest amplitude, moving smoothly. The default.</summary>
        public void SmoothedBrightness() => Check(Native.pf_options_set_brightness_smoothed(this));

        /// <summary>Full light stands for this amplitude; what is brighter is clipped.</summary>
        public void FixedBrightness(float scale) => Check(Native.pf_options_set_brightness_fixed(this, scale));

        /// <summary>Full light stands for the frame's largest amplitude.</summary>
        public void FrameMaxBrightness() => Check(Native.pf_options_set_brightness_frame_max(this));

        /// <summary>Where the amplitude is below this share of full light, phases are drawn to 0.</summary>
        public float DarkThreshold { set => Check(Native.pf_options_set_dark_threshold(this, value)); }

        /// <summary>Steps of correction, 0 to 8.</summary>
        public int LocalSteps { set => Check(Native.pf_options_set_local_steps(this, checked((uint)value))); }

        /// <summary>Steps of correction at the midpoint, 0 to 100: 3 for stills, 1 for video.</summary>
        public int MidpointSteps { set => Check(Native.pf_options_set_midpoint_steps(this, checked((uint)value))); }

        /// <summary>Shows these metres at the ends of the volume.</summary>
        public void DepthRange(float nearM, float farM) => Check(Native.pf_options_set_depth_range(this, nearM, farM));

        /// <summary>Readings less sure than this, in 0 to 1, are none.</summary>
        public float LeastConfidence { set => Check(Native.pf_options_set_least_confidence(this, value)); }

        /// <summary>Threads to compute with, 1 to 256.</summary>
        public int Threads { set => Check(Native.pf_options_set_threads(this, checked((uint)value))); }

        /// <summary>Most pixels of a quality level and of the modulator.</summary>
        public long MostPixels { set => Check(Native.pf_options_set_most_pixels(this, checked((ulong)value))); }

        /// <summary>Where frames are computed.</summary>
        public Backend Backend { set => Check(Native.pf_options_set_backend(this, value)); }

        /// <summary>Ends it.</summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_options_free(handle);
            return true;
        }
    }
}
