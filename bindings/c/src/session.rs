//! Sessions: frames in, holograms out.

use crate::frame::PfFrame;
use crate::hologram::{PfFrameTimes, PfHologram};
use crate::options::PfOptions;
use crate::pointer::{free, give, object, pick, read};
use crate::status::{PfStatus, Result, c_text, call};
use phasefront_ffi::{
    DropReason, ListenerError, Quality, QualityChange, QualityReason, RawHologram, RawSession, RunningMode,
    SessionListener, Statistics, Thermal,
};
use std::ffi::{c_char, c_void};
use std::sync::Arc;

/// How a session runs; fixed when it is made.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfRunningMode {
    /// Each frame is answered by itself.
    Image = 0,
    /// Each frame is answered; depth and brightness are smoothed over time. Timestamps must rise.
    Video = 1,
    /// Frames are submitted without waiting, and the listener hears what becomes of them. Timestamps must rise.
    Live = 2,
}

const RUNNING_MODES: [RunningMode; 3] = [RunningMode::Image, RunningMode::Video, RunningMode::Live];

/// How hot the device is, as its system says.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfThermal {
    /// Not warm: nothing is limited.
    Nominal = 0,
    /// Warm: frames may take a little less time.
    Fair = 1,
    /// Hot: half the time.
    Serious = 2,
    /// Too hot: the lowest quality level.
    Critical = 3,
}

const THERMALS: [Thermal; 4] = [Thermal::Nominal, Thermal::Fair, Thermal::Serious, Thermal::Critical];

/// Why a frame was not made into a hologram, without fault.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfDropReason {
    /// It was not dropped.
    Not = 0,
    /// A newer frame came while it waited.
    Superseded = 1,
    /// It came sooner than the target rate asks for.
    AboveTargetRate = 2,
    /// The session was paused.
    Paused = 3,
    /// The session was reset before it was done.
    Reset = 4,
    /// The session was closed before it was done.
    Closed = 5,
    /// For a reason that this version does not know.
    Other = 6,
}

impl From<DropReason> for PfDropReason {
    fn from(reason: DropReason) -> Self {
        match reason {
            DropReason::Superseded => PfDropReason::Superseded,
            DropReason::AboveTargetRate => PfDropReason::AboveTargetRate,
            DropReason::Paused => PfDropReason::Paused,
            DropReason::Reset => PfDropReason::Reset,
            DropReason::Closed => PfDropReason::Closed,
            DropReason::Unread | DropReason::Other => PfDropReason::Other,
        }
    }
}

/// Why a session changed its quality.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfQualityReason {
    /// Frames took longer than the target rate allows.
    TooSlow = 0,
    /// There was room for more.
    Room = 1,
    /// The device is hot.
    Thermal = 2,
    /// The caller said so.
    Asked = 3,
    /// The quality level that was to be taken cannot be planned: the session stays where it was, and does not try it
    /// again.
    Refused = 4,
    /// For a reason that this version does not know.
    Other = 5,
}

/// A change of the quality level.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfQualityChange {
    /// The quality level before.
    pub from_quality_level: u32,
    /// The quality level now; the one before where the step was refused.
    pub to_quality_level: u32,
    /// Why.
    pub reason: PfQualityReason,
}

impl From<QualityChange> for PfQualityChange {
    fn from(change: QualityChange) -> Self {
        PfQualityChange {
            from_quality_level: change.from_quality_level,
            to_quality_level: change.to_quality_level,
            reason: match change.reason {
                QualityReason::TooSlow => PfQualityReason::TooSlow,
                QualityReason::Room => PfQualityReason::Room,
                QualityReason::Thermal => PfQualityReason::Thermal,
                QualityReason::Asked => PfQualityReason::Asked,
                QualityReason::Refused => PfQualityReason::Refused,
                QualityReason::Other => PfQualityReason::Other,
            },
        }
    }
}

/// Hears what becomes of the frames of a live session: one call after another, on the session's own thread, in the
/// order in which things happened. While it is busy no frame is processed. A call that is NULL is not made. No
/// exception may leave a call.
///
/// `context` must live until on_closed was called; that call may free it. Where pf_session_new fails, no call is made,
/// and the context is the caller's.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PfListener {
    /// Given to each call.
    pub context: *mut c_void,
    /// A frame became a hologram, which is the listener's until pf_hologram_free.
    pub on_processed: Option<unsafe extern "C" fn(context: *mut c_void, hologram: *mut PfHologram)>,
    /// A frame was dropped.
    pub on_dropped: Option<unsafe extern "C" fn(context: *mut c_void, timestamp_ns: u64, reason: PfDropReason)>,
    /// A frame could not be processed. The session goes on. The message ends with the call.
    pub on_failed: Option<unsafe extern "C" fn(context: *mut c_void, timestamp_ns: u64, message: *const c_char)>,
    /// The frames after this one are made at another quality level.
    pub on_quality_changed:
        Option<unsafe extern "C" fn(context: *mut c_void, timestamp_ns: u64, change: PfQualityChange)>,
    /// The session has ended. This is the last call, made exactly once: before pf_session_free returns, or after it
    /// where that does not wait.
    pub on_closed: Option<unsafe extern "C" fn(context: *mut c_void)>,
}

struct Listener(PfListener);

// SAFETY: whoever makes a live session says that its context may be used on the session's thread.
unsafe impl Send for Listener {}
// SAFETY: calls come one after another.
unsafe impl Sync for Listener {}

impl SessionListener for Listener {
    fn on_processed(&self, hologram: Arc<RawHologram>) -> std::result::Result<(), ListenerError> {
        if let Some(tell) = self.0.on_processed {
            // SAFETY: the listener's own call, with its context.
            unsafe { tell(self.0.context, object(PfHologram(hologram))) };
        }
        Ok(())
    }

    fn on_dropped(&self, timestamp_ns: u64, reason: DropReason) -> std::result::Result<(), ListenerError> {
        if let Some(tell) = self.0.on_dropped {
            // SAFETY: as above.
            unsafe { tell(self.0.context, timestamp_ns, reason.into()) };
        }
        Ok(())
    }

    fn on_failed(&self, timestamp_ns: u64, message: String) -> std::result::Result<(), ListenerError> {
        if let Some(tell) = self.0.on_failed {
            let message = c_text(&message);
            // SAFETY: as above; the message lives until the call returns.
            unsafe { tell(self.0.context, timestamp_ns, message.as_ptr()) };
        }
        Ok(())
    }

    fn on_quality_changed(&self, timestamp_ns: u64, change: QualityChange) -> std::result::Result<(), ListenerError> {
        if let Some(tell) = self.0.on_quality_changed {
            // SAFETY: as above.
            unsafe { tell(self.0.context, timestamp_ns, change.into()) };
        }
        Ok(())
    }

    fn on_closed(&self) -> std::result::Result<(), ListenerError> {
        if let Some(tell) = self.0.on_closed {
            // SAFETY: as above; the context is not used after it.
            unsafe { tell(self.0.context) };
        }
        Ok(())
    }
}

/// What a session has done so far. Submitted frames are processed, failed, refused, dropped or pending.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfStatistics {
    /// Frames that were given to the session.
    pub submitted: u64,
    /// Frames that became holograms.
    pub processed: u64,
    /// Frames that could not be processed.
    pub failed: u64,
    /// Frames that came late.
    pub refused: u64,
    /// Frames that were dropped.
    pub dropped: u64,
    /// Frames that wait or are in flight.
    pub pending: u64,
    /// The quality level, 0 the best.
    pub quality_level: u32,
    /// Holograms a second, of late.
    pub rate_hz: f64,
    /// Mean times, of late.
    pub times: PfFrameTimes,
    /// What computes, as text; cut where it is longer.
    pub backend: [c_char; 64],
    /// Why that.
    pub backend_why: [c_char; 256],
}

impl From<Statistics> for PfStatistics {
    fn from(statistics: Statistics) -> Self {
        PfStatistics {
            submitted: statistics.submitted,
            processed: statistics.processed,
            failed: statistics.failed,
            refused: statistics.refused,
            dropped: statistics.dropped.total,
            pending: statistics.pending,
            quality_level: statistics.quality_level,
            rate_hz: statistics.rate_hz,
            times: statistics.times.into(),
            backend: cut(&statistics.backend),
            backend_why: cut(&statistics.backend_why),
        }
    }
}

/// `text` with a zero behind it, cut between two characters where it is too long.
fn cut<const N: usize>(text: &str) -> [c_char; N] {
    let mut to = [0; N];
    let end = text.floor_char_boundary(N - 1);
    for (to, byte) in to.iter_mut().zip(text[..end].bytes()) {
        *to = byte as c_char;
    }
    to
}

/// A session. Every call may come from any thread, at any moment, but for pf_session_free, which is the last.
pub struct PfSession(Arc<RawSession>);

impl Drop for PfSession {
    fn drop(&mut self) {
        // It only fails by a fault of ours, which nobody is left to hear of.
        let _ = self.0.shut_down();
    }
}

/// # Safety
/// `session` is NULL or valid.
unsafe fn with(session: *const PfSession, how: impl FnOnce(&RawSession) -> Result<()>) -> PfStatus {
    // SAFETY: the caller's promise.
    call(|| how(&unsafe { read(session, "session") }?.0))
}

/// A session that runs in `mode`, a PfRunningMode. A live one needs a `listener`, which is copied; for the others it is
/// NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_new(
    options: *const PfOptions,
    mode: u32,
    listener: *const PfListener,
    session: *mut *mut PfSession,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(session, "session", || {
            let options = read(options, "options")?.0.clone();
            let mode = pick(&RUNNING_MODES, mode, "mode")?;
            let listener = listener
                .as_ref()
                .map(|listener| Arc::new(Listener(*listener)) as Arc<_>);
            Ok(object(PfSession(RawSession::new(options, mode, listener)?)))
        })
    })
}

/// Takes no more frames, waits until the listener has heard everything, and ends the session. Called by a listener, of
/// this session or another, or by a log handler while a session computes, it does not wait: on_closed says when the
/// listener has heard everything. Its holograms live on. It is the last call with this session, and never made during
/// another one with it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_free(session: *mut PfSession) {
    // SAFETY: the rules of this border.
    unsafe { free(session) };
}

/// The hologram of a frame, in an image or a video session.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_process(
    session: *const PfSession,
    frame: *const PfFrame,
    hologram: *mut *mut PfHologram,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(hologram, "hologram", || {
            let taken = read(frame, "frame")?.take()?;
            let [luma_or_colour, chroma, chroma_v] = taken.colour;
            let hologram = read(session, "session")?.0.process(
                luma_or_colour,
                chroma,
                chroma_v,
                taken.depth,
                taken.confidence,
                taken.info,
            )?;
            Ok(object(PfHologram(hologram)))
        })
    })
}

/// Hands a frame to a live session, which copies it and goes on by itself. `dropped` says whether it was dropped at
/// once, and why; the listener hears of it too.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_submit(
    session: *const PfSession,
    frame: *const PfFrame,
    dropped: *mut PfDropReason,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(dropped, "dropped", || {
            let taken = read(frame, "frame")?.take()?;
            let [luma_or_colour, chroma, chroma_v] = taken.colour;
            let reason = read(session, "session")?.0.submit(
                luma_or_colour,
                chroma,
                chroma_v,
                taken.depth,
                taken.confidence,
                taken.info,
            )?;
            Ok(reason.map_or(PfDropReason::Not, PfDropReason::from))
        })
    })
}

/// Runs an empty frame through the stages, so that the first real one is as fast as the others. Waits for it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_warm_up(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, RawSession::warm_up) }
}

/// Forgets all frames so far, one in the making too; the next, of any timestamp, is the first again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_reset(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, RawSession::reset) }
}

/// Takes no frames until pf_session_resume.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_pause(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, RawSession::pause) }
}

/// Takes frames again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_resume(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, RawSession::resume) }
}

/// Says how hot the device is: a PfThermal.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_set_thermal(session: *const PfSession, thermal: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        with(session, |session| {
            session.set_thermal(pick(&THERMALS, thermal, "thermal")?)
        })
    }
}

/// Stays at this quality level, 0 the best.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_fix_quality_level(session: *const PfSession, quality_level: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, |session| session.set_quality(Quality::Fixed { quality_level })) }
}

/// Changes the quality level by itself: down where frames take longer than the target rate allows or the device is hot,
/// up where there is room.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_step_by_itself(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, |session| session.set_quality(Quality::Adaptive)) }
}

/// What the session has done so far. Never waits for a frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_statistics(session: *const PfSession, statistics: *mut PfStatistics) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(statistics, "statistics", || {
            Ok(read(session, "session")?.0.statistics()?.into())
        })
    })
}
