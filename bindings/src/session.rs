//! Sessions: frames in, holograms out.

use crate::error::{ListenerError, PhasefrontError, guard};
use crate::frame::{FrameInfo, FrameMemory};
use crate::hologram::RawHologram;
use crate::options::{Quality, RunningMode, SessionOptions, Thermal};
use crate::statistics::Statistics;
use phasefront::session::{self, Event, SessionHandle};
use phasefront::{ImageSession, LiveSession, VideoSession};
use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Why a frame was not made into a hologram, without fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum DropReason {
    /// A newer frame came while it waited.
    Superseded,
    /// It came sooner than the target rate asks for.
    AboveTargetRate,
    /// The session was paused.
    Paused,
    /// The session was reset before it was done.
    Reset,
    /// The session was closed before it was done.
    Closed,
    /// It became a hologram, but newer ones came before the app took it from its stream of events. Only the packages'
    /// streams say so.
    Unread,
    /// For a reason that this version of the bindings does not know.
    Other,
}

impl From<session::DropReason> for DropReason {
    fn from(reason: session::DropReason) -> Self {
        match reason {
            session::DropReason::Superseded => DropReason::Superseded,
            session::DropReason::AboveTargetRate => DropReason::AboveTargetRate,
            session::DropReason::Paused => DropReason::Paused,
            session::DropReason::Reset => DropReason::Reset,
            session::DropReason::Closed => DropReason::Closed,
            _ => DropReason::Other,
        }
    }
}

/// Why a session changed its quality.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum QualityReason {
    /// Frames took longer than the target rate allows.
    TooSlow,
    /// There was room for more.
    Room,
    /// The device is hot.
    Thermal,
    /// The caller said so.
    Asked,
    /// The quality level that was to be taken cannot be planned: the session stays where it was, and does not try it
    /// again.
    Refused,
    /// For a reason that this version of the bindings does not know.
    Other,
}

/// A change of the quality level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Record)]
pub struct QualityChange {
    /// The quality level before.
    pub from_quality_level: u32,
    /// The quality level now; the one before where the step was refused.
    pub to_quality_level: u32,
    /// Why.
    pub reason: QualityReason,
}

/// Hears what becomes of the frames of a live session: one call after another, on the session's own thread, in the
/// order in which things happened. While it is busy no frame is processed. What it throws is counted and logged.
#[uniffi::export(foreign)]
pub trait SessionListener: Send + Sync {
    /// A frame became a hologram.
    fn on_processed(&self, hologram: Arc<RawHologram>) -> Result<(), ListenerError>;

    /// A frame was dropped.
    fn on_dropped(&self, timestamp_ns: u64, reason: DropReason) -> Result<(), ListenerError>;

    /// A frame could not be processed. The session goes on.
    fn on_failed(&self, timestamp_ns: u64, message: String) -> Result<(), ListenerError>;

    /// The frames after this one are made at another quality level.
    fn on_quality_changed(&self, timestamp_ns: u64, change: QualityChange) -> Result<(), ListenerError>;

    /// The session is closed and its memory is given back. This is the last call, made exactly once, also where
    /// shutting down does not wait for it.
    fn on_closed(&self) -> Result<(), ListenerError>;
}

/// A session. Every call may come from any thread, at any moment.
#[derive(uniffi::Object)]
pub struct RawSession {
    core: Core,
    closed: AtomicBool,
    listener_failures: Arc<AtomicU64>,
}

#[uniffi::export]
impl RawSession {
    /// A session that runs in `mode`; live, it needs a `listener`.
    ///
    /// # Errors
    /// Options that cannot be meant or planned for, a live session without a listener, another with one, or threads
    /// that cannot be started.
    #[uniffi::constructor]
    pub fn new(
        options: SessionOptions,
        mode: RunningMode,
        listener: Option<Arc<dyn SessionListener>>,
    ) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let listener_failures = Arc::new(AtomicU64::new(0));
            let options = session::SessionOptions::try_from(&options)?;
            let core = match (mode, listener) {
                (RunningMode::Image, None) => Core::Image(ImageSession::new(options)?),
                (RunningMode::Video, None) => Core::Video(VideoSession::new(options)?),
                (RunningMode::Live, Some(listener)) => {
                    let failures = listener_failures.clone();
                    let session = LiveSession::new(options, move |event| {
                        if let Err(error) = tell(&*listener, event) {
                            failures.fetch_add(1, Ordering::Relaxed);
                            log::warn!("{error}");
                        }
                    })?;
                    Core::Live(session)
                }
                (RunningMode::Live, None) => {
                    return Err(PhasefrontError::Session(
                        "session: a live one needs a listener, which hears its results".into(),
                    ));
                }
                (_, Some(_)) => {
                    return Err(PhasefrontError::Session(
                        "session: only a live one has a listener; process gives the results of the others".into(),
                    ));
                }
            };
            let backend = core.statistics().backend;
            log::info!("a session in mode {mode:?} on {}: {}", backend.name, backend.why);
            Ok(Arc::new(RawSession {
                core,
                closed: AtomicBool::new(false),
                listener_failures,
            }))
        })
    }

    /// The hologram of a frame, in an image or a video session. `luma_or_colour` is the first plane of its colour,
    /// `chroma` and `chroma_v` the others; what the frame has not, is empty.
    ///
    /// # Errors
    /// A frame that is not usable or late, or a session that is live, paused or closed. None of them harms the frames
    /// that follow.
    pub fn process(
        &self,
        luma_or_colour: &[u8],
        chroma: &[u8],
        chroma_v: &[u8],
        depth: &[u8],
        confidence: &[u8],
        info: FrameInfo,
    ) -> Result<Arc<RawHologram>, PhasefrontError> {
        guard(|| {
            let frame = info.frame(FrameMemory {
                colour: [luma_or_colour, chroma, chroma_v],
                depth,
                confidence,
            })?;
            let hologram = match self.session()? {
                Core::Image(session) => session.process(&frame),
                Core::Video(session) => session.process(&frame),
                Core::Live(_) => {
                    return Err(PhasefrontError::Session(
                        "session: it is live, so frames are submitted; process is for image and video sessions".into(),
                    ));
                }
            };
            Ok(RawHologram::new(hologram?))
        })
    }

    /// Hands a frame to a live session, which copies it and goes on by itself. Gives why the frame was dropped, if it
    /// was at once; the listener hears of it too. Planes as [`Self::process`] takes them.
    ///
    /// # Errors
    /// A frame that is not usable or late, or a session that is not live or is closed. None of them harms the frames
    /// that follow.
    pub fn submit(
        &self,
        luma_or_colour: &[u8],
        chroma: &[u8],
        chroma_v: &[u8],
        depth: &[u8],
        confidence: &[u8],
        info: FrameInfo,
    ) -> Result<Option<DropReason>, PhasefrontError> {
        guard(|| {
            let frame = info.frame(FrameMemory {
                colour: [luma_or_colour, chroma, chroma_v],
                depth,
                confidence,
            })?;
            let Core::Live(session) = self.session()? else {
                return Err(PhasefrontError::Session(
                    "session: it is not live; process frames, or make a live session".into(),
                ));
            };
            Ok(session.submit(&frame)?.map(DropReason::from))
        })
    }

    /// Runs an empty frame through the stages, so that the first real one is as fast as the others. Waits for it.
    pub fn warm_up(&self) -> Result<(), PhasefrontError> {
        guard(|| Ok(self.session()?.warm_up()?))
    }

    /// Forgets all frames so far, one in the making too; the next, of any timestamp, is the first again.
    pub fn reset(&self) -> Result<(), PhasefrontError> {
        guard(|| {
            self.session()?.reset();
            Ok(())
        })
    }

    /// Takes no frames until [`Self::resume`].
    pub fn pause(&self) -> Result<(), PhasefrontError> {
        guard(|| {
            self.session()?.pause();
            Ok(())
        })
    }

    /// Takes frames again.
    pub fn resume(&self) -> Result<(), PhasefrontError> {
        guard(|| {
            self.session()?.resume();
            Ok(())
        })
    }

    /// Says how hot the device is.
    pub fn set_thermal(&self, thermal: Thermal) -> Result<(), PhasefrontError> {
        guard(|| {
            self.session()?.set_thermal(thermal.into());
            Ok(())
        })
    }

    /// Allows or forbids changes of the quality level.
    ///
    /// # Errors
    /// A quality level that the session does not have.
    pub fn set_quality(&self, quality: Quality) -> Result<(), PhasefrontError> {
        guard(|| Ok(self.session()?.set_quality(quality.into())?))
    }

    /// What the session has done so far; of a closed one, what it did. Never waits for a frame.
    pub fn statistics(&self) -> Result<Statistics, PhasefrontError> {
        guard(|| {
            let failures = self.listener_failures.load(Ordering::Relaxed);
            Ok(Statistics::new(self.core.statistics(), failures))
        })
    }

    /// Takes no more frames and gives the memory back. When it returns, the listener has heard everything, `on_closed`
    /// last, and will not be called again; called by a listener, of this session or another, or by a log handler while
    /// a session computes, it does not wait for that. Closing twice does nothing.
    pub fn shut_down(&self) -> Result<(), PhasefrontError> {
        guard(|| {
            self.closed.store(true, Ordering::Relaxed);
            self.core.close();
            Ok(())
        })
    }
}

impl RawSession {
    fn session(&self) -> Result<&Core, PhasefrontError> {
        if self.closed.load(Ordering::Relaxed) {
            return Err(PhasefrontError::Session("session: it is closed; make a new one".into()));
        }
        Ok(&self.core)
    }
}

/// A session of any running mode: the languages have one type for all three.
enum Core {
    Image(ImageSession),
    Video(VideoSession),
    Live(LiveSession),
}

impl Deref for Core {
    type Target = SessionHandle;

    fn deref(&self) -> &SessionHandle {
        match self {
            Core::Image(session) => session,
            Core::Video(session) => session,
            Core::Live(session) => session,
        }
    }
}

/// Tells `listener` of `event`.
fn tell(listener: &dyn SessionListener, event: Event) -> Result<(), ListenerError> {
    match event {
        Event::Processed(hologram) => listener.on_processed(RawHologram::new(hologram)),
        Event::Dropped { timestamp_ns, reason } => listener.on_dropped(timestamp_ns, reason.into()),
        Event::Failed { timestamp_ns, error } => {
            log::warn!("the frame of {timestamp_ns} ns failed: {error}");
            listener.on_failed(timestamp_ns, error.to_string())
        }
        Event::QualityChanged {
            timestamp_ns,
            from,
            to,
            reason,
        } => {
            let reason = match reason {
                session::QualityReason::TooSlow => QualityReason::TooSlow,
                session::QualityReason::Room => QualityReason::Room,
                session::QualityReason::Thermal => QualityReason::Thermal,
                session::QualityReason::Asked => QualityReason::Asked,
                session::QualityReason::Refused => QualityReason::Refused,
                _ => QualityReason::Other,
            };
            log::info!("from quality level {from} to {to}: {reason:?}");
            let change = QualityChange {
                from_quality_level: from as u32,
                to_quality_level: to as u32,
                reason,
            };
            listener.on_quality_changed(timestamp_ns, change)
        }
        Event::Closed => listener.on_closed(),
        other => {
            log::debug!("an event that these bindings do not know: {other:?}");
            Ok(())
        }
    }
}
