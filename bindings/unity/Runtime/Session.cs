using System;
using System.Runtime.InteropServices;
using static Phasefront.PhasefrontException;

namespace Phasefront
{
    /// <summary>The running mode of a session, fixed when it is created.</summary>
    public enum RunningMode : uint
    {
        /// <summary>Each frame is processed independently.</summary>
        Image = 0,
        /// <summary>Frames are processed in order, and depth and brightness are smoothed over time. Timestamps must
        /// increase.</summary>
        Video = 1,
        /// <summary>Frames are submitted without waiting, and the listener receives the results.</summary>
        Live = 2,
    }

    /// <summary>The thermal state that the device's system reports.</summary>
    public enum Thermal : uint
    {
        /// <summary>Not warm: the session has no limits.</summary>
        Nominal = 0,
        /// <summary>Warm: frames may take a little less time.</summary>
        Fair = 1,
        /// <summary>Hot: half the time.</summary>
        Serious = 2,
        /// <summary>Too hot: the lowest quality level.</summary>
        Critical = 3,
    }

    /// <summary>The reason why a frame was dropped without an error.</summary>
    public enum DropReason : uint
    {
        /// <summary>The frame was not dropped.</summary>
        Not = 0,
        /// <summary>A newer frame arrived while the frame waited.</summary>
        Superseded = 1,
        /// <summary>The frame arrived sooner than the target rate requires.</summary>
        AboveTargetRate = 2,
        /// <summary>The session was paused.</summary>
        Paused = 3,
        /// <summary>The session was reset before the frame was done.</summary>
        Reset = 4,
        /// <summary>The session was closed before the frame was done.</summary>
        Closed = 5,
        /// <summary>A reason that this version does not know.</summary>
        Other = 6,
    }

    /// <summary>The reason why a session changed its quality level.</summary>
    public enum QualityReason : uint
    {
        /// <summary>Frames took longer than the target rate allows.</summary>
        TooSlow = 0,
        /// <summary>There was time for a better level.</summary>
        Room = 1,
        /// <summary>The device is hot.</summary>
        Thermal = 2,
        /// <summary>The caller requested the change.</summary>
        Asked = 3,
        /// <summary>The new quality level cannot be planned, so the session keeps the old one.</summary>
        Refused = 4,
        /// <summary>A reason that this version does not know.</summary>
        Other = 5,
    }

    /// <summary>A change of the quality level.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct QualityChange
    {
        /// <summary>The quality level before.</summary>
        public uint FromQualityLevel;
        /// <summary>The quality level now, equal to the level before if the step was refused.</summary>
        public uint ToQualityLevel;
        /// <summary>The reason for the change.</summary>
        public QualityReason Reason;
    }

    /// <summary>The statistics of a session.</summary>
    [StructLayout(LayoutKind.Sequential, CharSet = CharSet.Ansi)]
    public struct Statistics
    {
        internal UIntPtr Size;
        /// <summary>The frames that were submitted to the session.</summary>
        public ulong Submitted;
        /// <summary>The frames that became holograms.</summary>
        public ulong Processed;
        /// <summary>The frames that could not be processed.</summary>
        public ulong Failed;
        /// <summary>The frames that were refused because they were late.</summary>
        public ulong Refused;
        /// <summary>The frames that were dropped.</summary>
        public ulong Dropped;
        /// <summary>The frames that wait or are in progress.</summary>
        public ulong Pending;
        /// <summary>The quality level; 0 is the best.</summary>
        public uint QualityLevel;
        /// <summary>The recent rate in holograms per second.</summary>
        public double RateHz;
        /// <summary>The recent mean times.</summary>
        public FrameTimes Times;
        /// <summary>The device that computes.</summary>
        [MarshalAs(UnmanagedType.ByValTStr, SizeConst = 64)] public string Backend;
        /// <summary>The reason for this backend.</summary>
        [MarshalAs(UnmanagedType.ByValTStr, SizeConst = 256)] public string BackendWhy;
    }

    /// <summary>
    /// Receives the events of a live session, one call after another, on the session's own thread and not on Unity's
    /// main thread. The session processes no frame during a call. It counts the exceptions of the listener.
    /// </summary>
    public interface ISessionListener
    {
        /// <summary>A frame became a hologram. The listener must dispose of it.</summary>
        void OnProcessed(Hologram hologram);
        /// <summary>A frame was dropped.</summary>
        void OnDropped(ulong timestampNs, DropReason reason);
        /// <summary>A frame could not be processed. The session continues.</summary>
        void OnFailed(ulong timestampNs, string message);
        /// <summary>The session processes the frames after this one at another quality level.</summary>
        void OnQualityChanged(ulong timestampNs, QualityChange change);
    }

    /// <summary>A session that turns frames into holograms. Every method may be called from any thread at any
    /// time.</summary>
    public sealed class HologramSession : NativeObject
    {
        // Native code calls these delegates, so they live as long as the process.
        private static readonly Native.OnProcessed Processed = OnProcessed;
        private static readonly Native.OnDropped Dropped = OnDropped;
        private static readonly Native.OnFailed Failed = OnFailed;
        private static readonly Native.OnQualityChanged QualityChanged = OnQualityChanged;
        private static readonly Native.OnClosed Closed = OnClosed;

        private sealed class Hearing
        {
            public ISessionListener Listener;
            public int Failures;
        }

        private readonly Hearing hearing;

        private HologramSession(IntPtr handle, Hearing hearing) : base(handle) => this.hearing = hearing;

        /// <summary>Opens an image or a video session, or with a listener a live session.</summary>
        public static HologramSession Open(SessionOptions options, RunningMode mode, ISessionListener listener = null)
        {
            if (listener == null)
            {
                Check(Native.pf_session_new(options, mode, IntPtr.Zero, out var still));
                return new HologramSession(still, null);
            }
            var hearing = new Hearing { Listener = listener };
            // Native code holds the context until OnClosed, which may run after the session is disposed of.
            var context = GCHandle.Alloc(hearing);
            var native = new NativeListener
            {
                Size = Native.SizeOf<NativeListener>(),
                Context = GCHandle.ToIntPtr(context),
                OnProcessed = Processed,
                OnDropped = Dropped,
                OnFailed = Failed,
                OnQualityChanged = QualityChanged,
                OnClosed = Closed,
            };
            var status = Native.pf_session_new_live(options, mode, ref native, out var session);
            if (status != Status.Ok) context.Free();
            Check(status);
            return new HologramSession(session, hearing);
        }

        /// <summary>Returns the hologram of a frame, in an image or a video session.</summary>
        public Hologram Process(CameraFrame frame)
        {
            return CameraFrame.Pinned(frame, native =>
            {
                Check(Native.pf_session_process(this, ref native, out var hologram));
                return new Hologram(hologram);
            });
        }

        /// <summary>Submits a frame to a live session, which copies it. Returns the reason if the frame was dropped at
        /// once.</summary>
        public DropReason Submit(CameraFrame frame)
        {
            return CameraFrame.Pinned(frame, native =>
            {
                Check(Native.pf_session_submit(this, ref native, out var dropped));
                return dropped;
            });
        }

        /// <summary>Processes an empty frame, so that the first real frame is as fast as the later ones.</summary>
        public void WarmUp() => Check(Native.pf_session_warm_up(this));

        /// <summary>Discards all earlier frames, including one in progress. The next frame may have any
        /// timestamp.</summary>
        public void Reset() => Check(Native.pf_session_reset(this));

        /// <summary>Stops accepting frames until Resume.</summary>
        public void Pause() => Check(Native.pf_session_pause(this));

        /// <summary>Accepts frames again.</summary>
        public void Resume() => Check(Native.pf_session_resume(this));

        /// <summary>Reports how hot the device is.</summary>
        public void SetThermal(Thermal thermal) => Check(Native.pf_session_set_thermal(this, thermal));

        /// <summary>Fixes the quality level; 0 is the best.</summary>
        public void FixQualityLevel(int qualityLevel) => Check(Native.pf_session_fix_quality_level(this, checked((uint)qualityLevel)));

        /// <summary>Lets the session change the quality level automatically.</summary>
        public void StepByItself() => Check(Native.pf_session_step_by_itself(this));

        /// <summary>The session's statistics. Never blocks on a frame.</summary>
        public Statistics Statistics
        {
            get
            {
                var statistics = new Statistics { Size = Native.SizeOf<Statistics>() };
                Check(Native.pf_session_statistics(this, ref statistics));
                return statistics;
            }
        }

        /// <summary>The number of exceptions that the listener threw.</summary>
        public int ListenerFailures => hearing == null ? 0 : System.Threading.Volatile.Read(ref hearing.Failures);

        /// <summary>
        /// Stops accepting frames, waits until the listener has received all events, and frees the session. If a
        /// listener calls it, it does not wait, and the listener receives the other events afterwards.
        /// </summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_session_free(handle);
            return true;
        }

        // No exception may propagate into native code.
        private static void Tell(IntPtr context, Action<ISessionListener> call)
        {
            var hearing = (Hearing)GCHandle.FromIntPtr(context).Target;
            try
            {
                call(hearing.Listener);
            }
            catch (Exception)
            {
                System.Threading.Interlocked.Increment(ref hearing.Failures);
            }
        }

        [MonoPInvokeCallback(typeof(Native.OnProcessed))]
        private static void OnProcessed(IntPtr context, IntPtr hologram)
        {
            var given = new Hologram(hologram);
            Tell(context, listener => listener.OnProcessed(given));
        }

        [MonoPInvokeCallback(typeof(Native.OnDropped))]
        private static void OnDropped(IntPtr context, ulong timestampNs, DropReason reason) =>
            Tell(context, listener => listener.OnDropped(timestampNs, reason));

        [MonoPInvokeCallback(typeof(Native.OnFailed))]
        private static void OnFailed(IntPtr context, ulong timestampNs, IntPtr message)
        {
            var text = Text.Read(message);
            Tell(context, listener => listener.OnFailed(timestampNs, text));
        }

        [MonoPInvokeCallback(typeof(Native.OnQualityChanged))]
        private static void OnQualityChanged(IntPtr context, ulong timestampNs, QualityChange change) =>
            Tell(context, listener => listener.OnQualityChanged(timestampNs, change));

        // OnClosed is the last call with this context.
        [MonoPInvokeCallback(typeof(Native.OnClosed))]
        private static void OnClosed(IntPtr context) => GCHandle.FromIntPtr(context).Free();
    }
}
