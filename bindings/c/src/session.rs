//! Sessions, which turn frames into holograms.

use crate::frame::PfFrame;
use crate::hologram::{PfFrameTimes, PfHologram};
use crate::options::PfOptions;
use crate::pointer::{Extensible, free, give, give_sized, object, pick, read, read_sized};
use crate::status::{PfStatus, Result, c_text, call};
use phasefront_ffi::{
    DropReason, ListenerError, Quality, QualityChange, QualityReason, RawHologram, RawSession, RunningMode,
    SessionListener, Statistics, Thermal,
};
use std::ffi::{c_char, c_void};
use std::sync::Arc;

/// The running mode of a session. It is fixed when the session is created.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfRunningMode {
    /// The session answers each frame independently of all others.
    Image = 0,
    /// The session answers each frame, and smooths depth and brightness over time. Timestamps must increase.
    Video = 1,
    /// The app submits frames without waiting, and the listener receives the outcome of each. Timestamps must increase.
    Live = 2,
}

const RUNNING_MODES: [RunningMode; 3] = [RunningMode::Image, RunningMode::Video, RunningMode::Live];

/// The thermal state of the device as reported by its system.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfThermal {
    /// The device is not warm; nothing is limited.
    Nominal = 0,
    /// The device is warm; frames may take a little less time.
    Fair = 1,
    /// The device is hot; frames may take half the time.
    Serious = 2,
    /// The device is too hot; the session uses the lowest quality level.
    Critical = 3,
}

const THERMALS: [Thermal; 4] = [Thermal::Nominal, Thermal::Fair, Thermal::Serious, Thermal::Critical];

/// The reason why a session dropped a frame without an error.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfDropReason {
    /// The frame was not dropped.
    Not = 0,
    /// A newer frame arrived while this one waited.
    Superseded = 1,
    /// The frame arrived sooner than the target rate allows.
    AboveTargetRate = 2,
    /// The session was paused.
    Paused = 3,
    /// The session was reset before the frame was finished.
    Reset = 4,
    /// The session was closed before the frame was finished.
    Closed = 5,
    /// A reason that this version does not know.
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

/// The reason why a session changed its quality level.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfQualityReason {
    /// Frames took longer than the target rate allows.
    TooSlow = 0,
    /// There was time left.
    Room = 1,
    /// The device is hot.
    Thermal = 2,
    /// The app asked for it.
    Asked = 3,
    /// The next quality level cannot be planned. The session keeps the previous one and does not try the next one
    /// again.
    Refused = 4,
    /// A reason that this version does not know.
    Other = 5,
}

/// A change of the quality level.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfQualityChange {
    /// The previous quality level.
    pub from_quality_level: u32,
    /// The new quality level; the previous one if the reason is PF_QUALITY_REASON_REFUSED.
    pub to_quality_level: u32,
    /// The reason.
    pub reason: PfQualityReason,
}

impl From<QualityChange> for PfQualityChange {
    fn from(change: QualityChange) -> Self {
        PfQualityChange {
            from_quality_level: change.from_quality_level as u32,
            to_quality_level: change.to_quality_level as u32,
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

/// A receiver of the events of a live session. Calls arrive one after another, on the session's own thread, in the
/// order of the events. No frame is processed while the listener is busy. A function that is NULL is not called.
/// Functions must not throw exceptions.
///
/// `context` must live until on_closed is called, which may free it. If pf_session_new fails, no function is called and
/// the context still belongs to the caller.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PfListener {
    /// The size of this struct, sizeof(PfListener). Set it before the call.
    pub size: usize,
    /// The first argument of each function.
    pub context: *mut c_void,
    /// Reports that a frame became a hologram. The listener must free it with pf_hologram_free.
    pub on_processed: Option<unsafe extern "C" fn(context: *mut c_void, hologram: *mut PfHologram)>,
    /// Reports that a frame was dropped.
    pub on_dropped: Option<unsafe extern "C" fn(context: *mut c_void, timestamp_ns: u64, reason: PfDropReason)>,
    /// Reports that a frame could not be processed. The session continues. The message is valid during the call.
    pub on_failed: Option<unsafe extern "C" fn(context: *mut c_void, timestamp_ns: u64, message: *const c_char)>,
    /// Reports that the session uses another quality level after the frame of `timestamp_ns`.
    pub on_quality_changed:
        Option<unsafe extern "C" fn(context: *mut c_void, timestamp_ns: u64, change: PfQualityChange)>,
    /// Reports that the session is closed. This is the last call. It is made exactly once, before pf_session_free
    /// returns, or after it if pf_session_free does not wait.
    pub on_closed: Option<unsafe extern "C" fn(context: *mut c_void)>,
}

// SAFETY: its first field is its size.
unsafe impl Extensible for PfListener {
    const NAME: &'static str = "PfListener";
}

struct Listener(PfListener);

// SAFETY: the caller of pf_session_new promises that the context may be used on the session's thread.
unsafe impl Send for Listener {}
// SAFETY: calls arrive one after another.
unsafe impl Sync for Listener {}

impl SessionListener for Listener {
    fn on_processed(&self, hologram: Arc<RawHologram>) -> std::result::Result<(), ListenerError> {
        if let Some(tell) = self.0.on_processed {
            // SAFETY: the listener's own call, with its context.
            unsafe { tell(self.0.context, object(PfHologram(hologram))) };
        }
        Ok(())
    }

    fn on_dropped(&self, timestamp_ns: i64, reason: DropReason) -> std::result::Result<(), ListenerError> {
        if let Some(tell) = self.0.on_dropped {
            // SAFETY: as above.
            unsafe { tell(self.0.context, timestamp_ns as u64, reason.into()) };
        }
        Ok(())
    }

    fn on_failed(&self, timestamp_ns: i64, message: String) -> std::result::Result<(), ListenerError> {
        if let Some(tell) = self.0.on_failed {
            let message = c_text(&message);
            // SAFETY: as above; the message lives until the call returns.
            unsafe { tell(self.0.context, timestamp_ns as u64, message.as_ptr()) };
        }
        Ok(())
    }

    fn on_quality_changed(&self, timestamp_ns: i64, change: QualityChange) -> std::result::Result<(), ListenerError> {
        if let Some(tell) = self.0.on_quality_changed {
            // SAFETY: as above.
            unsafe { tell(self.0.context, timestamp_ns as u64, change.into()) };
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

/// The statistics of a session at one moment. Each submitted frame is either processed, failed, refused, dropped or
/// pending.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfStatistics {
    /// The size of this struct, sizeof(PfStatistics). Set it before the call.
    pub size: usize,
    /// Frames that were submitted.
    pub submitted: u64,
    /// Frames that became holograms.
    pub processed: u64,
    /// Frames that could not be processed.
    pub failed: u64,
    /// Frames that were refused because they were late or the session was closed.
    pub refused: u64,
    /// Frames that were dropped.
    pub dropped: u64,
    /// Frames that wait or are being processed.
    pub pending: u64,
    /// The quality level; 0 is the best.
    pub quality_level: u32,
    /// Holograms per second over the last 30.
    pub rate_hz: f64,
    /// The mean times of the stages over the last 30 holograms.
    pub times: PfFrameTimes,
    /// The name of the backend that computes the frames, cut if it is longer.
    pub backend: [c_char; 64],
    /// The reason for using this backend, cut if it is longer.
    pub backend_why: [c_char; 256],
}

// SAFETY: its first field is its size.
unsafe impl Extensible for PfStatistics {
    const NAME: &'static str = "PfStatistics";
}

impl From<Statistics> for PfStatistics {
    fn from(statistics: Statistics) -> Self {
        PfStatistics {
            size: size_of::<PfStatistics>(),
            submitted: statistics.submitted as u64,
            processed: statistics.processed as u64,
            failed: statistics.failed as u64,
            refused: statistics.refused as u64,
            dropped: statistics.dropped.total as u64,
            pending: statistics.pending as u64,
            quality_level: statistics.quality_level as u32,
            rate_hz: statistics.rate_hz,
            times: statistics.times.into(),
            backend: cut(&statistics.backend),
            backend_why: cut(&statistics.backend_why),
        }
    }
}

/// Returns `text` with a zero at its end, cut between two characters if it is too long.
fn cut<const N: usize>(text: &str) -> [c_char; N] {
    let mut to = [0; N];
    let end = text.floor_char_boundary(N - 1);
    for (to, byte) in to.iter_mut().zip(text[..end].bytes()) {
        *to = byte as c_char;
    }
    to
}

/// A session. All functions except pf_session_free can be called from any thread at any time.
pub struct PfSession(Arc<RawSession>);

impl Drop for PfSession {
    fn drop(&mut self) {
        self.0.shut_down();
    }
}

/// # Safety
/// `session` is NULL or valid.
unsafe fn with(session: *const PfSession, how: impl FnOnce(&RawSession) -> Result<()>) -> PfStatus {
    // SAFETY: the caller's promise.
    call(|| how(&unsafe { read(session, "session") }?.0))
}

/// Creates a session that runs in `mode`, a PfRunningMode. A live session needs a `listener`, which is copied; for
/// other sessions it is NULL.
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
            let listener = if listener.is_null() {
                None
            } else {
                Some(Arc::new(Listener(*read_sized(listener, "listener")?)) as Arc<_>)
            };
            Ok(object(PfSession(RawSession::new(options, mode, listener)?)))
        })
    })
}

/// Closes and frees a session: it accepts no more frames and waits until the listener has received all events. A call
/// from a listener of any session, or from a log handler while a session computes, does not wait; on_closed then
/// reports that the listener has received all events. The session's holograms stay valid. This must be the last call
/// with the session, and no other call with it may be in progress.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_free(session: *mut PfSession) {
    // SAFETY: the rules of this border.
    unsafe { free(session) };
}

/// Creates the hologram of a frame, in an image or a video session.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_process(
    session: *const PfSession,
    frame: *const PfFrame,
    hologram: *mut *mut PfHologram,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(hologram, "hologram", || {
            let taken = read_sized(frame, "frame")?.take()?;
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

/// Submits a frame to a live session, which copies it, without waiting for its hologram. `dropped` receives the reason
/// if the frame is dropped at once, which the listener receives too.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_submit(
    session: *const PfSession,
    frame: *const PfFrame,
    dropped: *mut PfDropReason,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(dropped, "dropped", || {
            let taken = read_sized(frame, "frame")?.take()?;
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

/// Runs an empty frame through the stages and waits for it, so that the first real frame is as fast as later ones.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_warm_up(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, RawSession::warm_up) }
}

/// Forgets all previous frames, including one that is being processed. The next frame may have any timestamp.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_reset(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, RawSession::reset) }
}

/// Accepts no frames until pf_session_resume.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_pause(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, RawSession::pause) }
}

/// Accepts frames again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_resume(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, RawSession::resume) }
}

/// Sets the thermal state of the device, a PfThermal.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_set_thermal(session: *const PfSession, thermal: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        with(session, |session| {
            session.set_thermal(pick(&THERMALS, thermal, "thermal")?)
        })
    }
}

/// Keeps the session at a quality level; 0 is the best.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_fix_quality_level(session: *const PfSession, quality_level: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        with(session, |session| {
            session.set_quality(Quality::Fixed {
                quality_level: quality_level as usize,
            })
        })
    }
}

/// Lets the session change its quality level: it lowers the level if frames take longer than the target rate allows or
/// the device is hot, and raises it if there is time left.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_step_by_itself(session: *const PfSession) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { with(session, |session| session.set_quality(Quality::Adaptive)) }
}

/// Returns the statistics of a session. Never waits for a frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_session_statistics(session: *const PfSession, statistics: *mut PfStatistics) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give_sized(statistics, "statistics", || {
            Ok(read(session, "session")?.0.statistics().into())
        })
    })
}
