using System;
using System.Runtime.InteropServices;
using static Phasefront.PhasefrontException;

namespace Phasefront
{
    /// <summary>How a session runs; fixed when it is made.</summary>
    public enum RunningMode : uint
    {
        /// <summary>Each frame is answered by itself.</summary>
        Image = 0,
        /// <summary>Each frame is answered; depth and brightness are smoothed over time. Timestamps must rise.</summary>
        Video = 1,
        /// <summary>Frames are submitted without waiting, and the listener hears what becomes of them.</summary>
        Live = 2,
    }

    /// <summary>How hot the device is, as its system says.</summary>
    public enum Thermal : uint
    {
        /// <summary>Not warm: nothing is limited.</summary>
        Nominal = 0,
        /// <summary>Warm: frames may take a little less time.</summary>
        Fair = 1,
        /// <summary>Hot: half the time.</summary>
        Serious = 2,
        /// <summary>Too hot: the lowest quality level.</summary>
        Critical = 3,
    }

    /// <summary>Why a frame was not made into a hologram, without fault.</summary>
    public enum DropReason : uint
    {
        /// <summary>It was not dropped.</summary>
        Not = 0,
        /// <summary>A newer frame came while it waited.</summary>
        Superseded = 1,
        /// <summary>It came sooner than the target rate asks for.</summary>
        AboveTargetRate = 2,
        /// <summary>The session was paused.</summary>
        Paused = 3,
        /// <summary>The session was reset before it was done.</summary>
        Reset = 4,
        /// <summary>The session was closed before it was done.</summary>
        Closed = 5,
        /// <summary>For a reason that this version does not know.</summary>
        Other = 6,
    }

    /// <summary>Why a session changed its quality.</summary>
    public enum QualityReason : uint
    {
        /// <summary>Frames took longer than the target rate allows.</summary>
        TooSlow = 0,
        /// <summary>There was room for more.</summary>
        Room = 1,
        /// <summary>The device is hot.</summary>
        Thermal = 2,
        /// <summary>The caller said so.</summary>
        Asked = 3,
        /// <summary>The quality level that was to be taken cannot be planned: the session stays where it was.</summary>
        Refused = 4,
        /// <summary>For a reason that this version does not know.</summary>
        Other = 5,
    }

    /// <summary>A change of the quality level.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct QualityChange
    {
        /// <summary>The quality level before.</summary>
        public uint FromQualityLevel;
        /// <summary>The quality level now; the one before where the step was refused.</summary>
        public uint ToQualityLevel;
        /// <summary>Why.</summary>
        public QualityReason Reason;
    }

    /// <summary>What a session has done so far.</summary>
    [StructLayout(LayoutKind.Sequential, CharSet = CharSet.Ansi)]
    public struct Statistics
    {
        /// <summary>Frames that were given to the session.</summary>
        public ulong Submitted;
        /// <summary>Frames that became holograms.</summary>
        public ulong Processed;
        /// <summary>Frames that could not be processed.</summary>
        public ulong Failed;
        /// <summary>Frames that came late.</summary>
        public ulong Refused;
        /// <summary>Frames that were dropped.</summary>
        public ulong Dropped;
        /// <summary>Frames that wait or are in flight.</summary>
        public ulong Pending;
        /// <summary>The quality level, 0 the best.</summary>
        public uint QualityLevel;
        /// <summary>Holograms a second, of late.</summary>
        public double RateHz;
        /// <summary>Mean times, of late.</summary>
        public FrameTimes Times;
        /// <summary>What computes.</summary>
        [MarshalAs(UnmanagedType.ByValTStr, SizeConst = 64)] public string Backend;
        /// <summary>Why that.</summary>
        [MarshalAs(UnmanagedType.ByValTStr, SizeConst = 256)] public string BackendWhy;
    }

    /// <summary>
    /// Hears what becomes of the frames of a live session: one call after another, on the session's own thread, not
    /// Unity's main one. While it is busy no frame is processed. What it throws is counted.
    /// </summary>
    public interface IListener
    {
        /// <summary>A frame became a hologram, which is the listener's to dispose of.</summary>
        void OnProcessed(Hologram hologram);
        /// <summary>A frame was dropped.</summary>
        void OnDropped(ulong timestampNs, DropReason reason);
        /// <summary>A frame could not be processed. The session goes on.</summary>
        void OnFailed(ulong timestampNs, string message);
        /// <summary>The frames after this one are made at another quality level.</summary>
        void OnQualityChanged(ulong timestampNs, QualityChange change);
    }

    /// <summary>A session: frames in, holograms out. Every call may come from any thread, at any moment.</summary>
    public sealed class Session : NativeObject
    {
        // What native code calls lives as long as the process.
        private static readonly Native.OnProcessed Processed = OnProcessed;
        private static readonly Native.OnDropped Dropped = OnDropped;
        private static readonly Native.OnFailed Failed = OnFailed;
        private static readonly Native.OnQualityChanged QualityChanged = OnQualityChanged;
        private static readonly Native.OnClosed Closed = OnClosed;

        private sealed class Hearing
        {
            public IListener Listener;
            public int Failures;
        }

        private readonly Hearing hearing;

        private Session(IntPtr handle, Hearing hearing) : base(handle) => this.hearing = hearing;

        /// <summary>An image or a video session, or with a listener a live one.</summary>
        public static Session Open(SessionOptions options, RunningMode mode, IListener listener = null)
        {
            if (listener == null)
            {
                Check(Native.pf_session_new(options, mode, IntPtr.Zero, out var still));
                return new Session(still, null);
            }
            var hearing = new Hearing { Listener = listener };
            // Native code holds it until OnClosed, which may come after this session's end.
            var context = GCHandle.Alloc(hearing);
            var native = new NativeListener
            {
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
            return new Session(session, hearing);
        }

        /// <summary>The hologram of a frame, in an image or a video session.</summary>
        public Hologram Process(Frame frame)
        {
            return frame.Pinned(native =>
            {
                Check(Native.pf_session_process(this, ref native, out var hologram));
                return new Hologram(hologram);
            });
        }

        /// <summary>Hands a frame to a live session, which copies it; whether it was dropped at once, and why.</summary>
        public DropReason Submit(Frame frame)
        {
            return frame.Pinned(native =>
            {
                Check(Native.pf_session_submit(this, ref native, out var dropped));
                return dropped;
            });
        }

        /// <summary>Runs an empty frame through the stages, so that the first real one is as fast as the others.</summary>
        public void WarmUp() => Check(Native.pf_session_warm_up(this));

        /// <summary>Forgets all frames so far, one in the making too; the next, of any timestamp, is the first again.</summary>
        public void Reset() => Check(Native.pf_session_reset(this));

        /// <summary>Takes no frames until Resume.</summary>
        public void Pause() => Check(Native.pf_session_pause(this));

        /// <summary>Takes frames again.</summary>
        public void Resume() => Check(Native.pf_session_resume(this));

        /// <summary>Says how hot the device is.</summary>
        public void SetThermal(Thermal thermal) => Check(Native.pf_session_set_thermal(this, thermal));

        /// <summary>Stays at this quality level, 0 the best.</summary>
        public void FixQualityLevel(int qualityLevel) => Check(Native.pf_session_fix_quality_level(this, checked((uint)qualityLevel)));

        /// <summary>Changes the quality level by itself.</summary>
        public void StepByItself() => Check(Native.pf_session_step_by_itself(this));

        /// <summary>What the session has done so far. Never waits for a frame.</summary>
        public Statistics Statistics
        {
            get
            {
                Check(Native.pf_session_statistics(this, out var statistics));
                return statistics;
            }
        }

        /// <summary>How often the listener threw.</summary>
        public int ListenerFailures => hearing == null ? 0 : System.Threading.Volatile.Read(ref hearing.Failures);

        /// <summary>
        /// Takes no more frames, waits until the listener has heard everything, and ends. Called by a listener it does
        /// not wait: the listener hears the rest afterwards.
        /// </summary>
        protected override bool ReleaseHandle()
        {
            Native.pf_session_free(handle);
            return true;
        }

        // No exception may go back into native code.
        private static void Tell(IntPtr context, Action<IListener> call)
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

        // The last call with this context.
        [MonoPInvokeCallback(typeof(Native.OnClosed))]
        private static void OnClosed(IntPtr context) => GCHandle.FromIntPtr(context).Free();
    }
}
