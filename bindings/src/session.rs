//! Sessions, which turn frames into holograms.

use crate::error::{ListenerError, PhasefrontError, guard};
use crate::frame::{FrameInfo, FrameMemory};
use crate::hologram::RawHologram;
use crate::options::{Quality, RunningMode, SessionOptions};
use crate::statistics::Statistics;
use phasefront::session::{self, AnsweringSession, Event, SessionHandle, Thermal};
use phasefront::{ImageSession, LiveSession, VideoSession};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The reason why a session dropped a frame without an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum DropReason {
    /// A newer frame arrived while this one waited.
    Superseded,
    /// The frame arrived sooner than the target rate allows.
    AboveTargetRate,
    /// The session was paused.
    Paused,
    /// The session was reset before the frame was finished.
    Reset,
    /// The session was closed before the frame was finished.
    Closed,
    /// The frame became a hologram, but newer ones arrived before the app took it from the stream of events. Only the
    /// streams of the packages report this reason.
    Unread,
    /// A reason that this version of the bindings does not know.
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

/// The reason why a session changed its quality level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum QualityReason {
    /// Frames took longer than the target rate allows.
    TooSlow,
    /// There was time left.
    Room,
    /// The device is hot.
    Thermal,
    /// The app asked for it.
    Asked,
    /// The next quality level cannot be planned. The session keeps the previous one and does not try the next one
    /// again.
    Refused,
    /// A reason that this version of the bindings does not know.
    Other,
}

/// A change of the quality level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Record)]
pub struct QualityChange {
    /// The previous quality level.
    pub from_quality_level: usize,
    /// The new quality level; the previous one if the reason is `Refused`.
    pub to_quality_level: usize,
    /// The reason.
    pub reason: QualityReason,
}

/// A receiver of the events of a live session. Calls arrive one after another, on the session's own thread, in the
/// order of the events. No frame is processed while the listener is busy. Errors that it throws are counted and logged.
#[uniffi::export(foreign)]
pub trait SessionListener: Send + Sync {
    /// Reports that a frame became a hologram.
    fn on_processed(&self, hologram: Arc<RawHologram>) -> Result<(), ListenerError>;

    /// Reports that a frame was dropped.
    fn on_dropped(&self, timestamp_ns: i64, reason: DropReason) -> Result<(), ListenerError>;

    /// Reports that a frame could not be processed. The session continues.
    fn on_failed(&self, timestamp_ns: i64, message: String) -> Result<(), ListenerError>;

    /// Reports that the session uses another quality level after the frame of `timestamp_ns`.
    fn on_quality_changed(&self, timestamp_ns: i64, change: QualityChange) -> Result<(), ListenerError>;

    /// Reports that the session is closed and its memory is freed. This is the last call. It is made exactly once, even
    /// if shutting down does not wait for it.
    fn on_closed(&self) -> Result<(), ListenerError>;
}

/// A session. All its methods can be called from any thread at any time.
#[derive(uniffi::Object)]
pub struct RawSession {
    /// Controls the session in any running mode.
    handle: SessionHandle,
    entrance: Entrance,
    closed: AtomicBool,
    listener_failures: Arc<AtomicU64>,
}

#[uniffi::export]
impl RawSession {
    /// Creates a session that runs in `mode`. A live session needs a `listener`.
    ///
    /// # Errors
    /// Returns an error if the options are invalid or cannot be planned, if a live session has no listener or another
    /// session has one, or if threads cannot be started.
    #[uniffi::constructor]
    pub fn new(
        options: SessionOptions,
        mode: RunningMode,
        listener: Option<Arc<dyn SessionListener>>,
    ) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let listener_failures = Arc::new(AtomicU64::new(0));
            let options = session::SessionOptions::try_from(&options)?;
            let entrance = match (mode, listener) {
                (RunningMode::Image, None) => Entrance::Process(ImageSession::new(options)?.into()),
                (RunningMode::Video, None) => Entrance::Process(VideoSession::new(options)?.into()),
                (RunningMode::Live, Some(listener)) => {
                    let failures = listener_failures.clone();
                    let session = LiveSession::new(options, move |event| {
                        if let Err(error) = tell(&*listener, event) {
                            failures.fetch_add(1, Ordering::Relaxed);
                            log::warn!("{error}");
                        }
                    })?;
                    Entrance::Submit(session)
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
            let handle = match &entrance {
                Entrance::Process(session) => session.handle().clone(),
                Entrance::Submit(session) => session.handle().clone(),
            };
            let backend = handle.statistics().backend;
            log::info!("a session in mode {mode:?} on {}: {}", backend.name, backend.why);
            Ok(Arc::new(RawSession {
                handle,
                entrance,
                closed: AtomicBool::new(false),
                listener_failures,
            }))
        })
    }

    /// Returns the hologram of a frame, in an image or a video session. `luma_or_colour` is the first plane of the
    /// colour image; `chroma` and `chroma_v` are the others. Memory that the frame does not have is empty.
    ///
    /// # Errors
    /// Returns an error if the frame is unusable or late, or if the session is live, paused or closed. Later frames are
    /// not affected.
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
            self.check_open()?;
            let Entrance::Process(session) = &self.entrance else {
                return Err(PhasefrontError::Session(
                    "session: it is live, so frames are submitted; process is for image and video sessions".into(),
                ));
            };
            Ok(RawHologram::new(session.process(&frame)?))
        })
    }

    /// Submits a frame to a live session, which copies it, without waiting for its hologram. Returns the reason if the
    /// frame is dropped at once, which the listener receives too. The planes are those of [`Self::process`].
    ///
    /// # Errors
    /// Returns an error if the frame is unusable or late, or if the session is not live or is closed. Later frames are
    /// not affected.
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
            self.check_open()?;
            let Entrance::Submit(session) = &self.entrance else {
                return Err(PhasefrontError::Session(
                    "session: it is not live; process frames, or make a live session".into(),
                ));
            };
            Ok(session.submit(&frame)?.map(DropReason::from))
        })
    }

    /// Runs an empty frame through the stages and waits for it, so that the first real frame is as fast as later ones.
    pub fn warm_up(&self) -> Result<(), PhasefrontError> {
        guard(|| Ok(self.controls()?.warm_up()?))
    }

    /// Forgets all previous frames, including one that is being processed. The next frame may have any timestamp.
    pub fn reset(&self) -> Result<(), PhasefrontError> {
        guard(|| {
            self.controls()?.reset();
            Ok(())
        })
    }

    /// Accepts no frames until [`Self::resume`].
    pub fn pause(&self) -> Result<(), PhasefrontError> {
        guard(|| {
            self.controls()?.pause();
            Ok(())
        })
    }

    /// Accepts frames again.
    pub fn resume(&self) -> Result<(), PhasefrontError> {
        guard(|| {
            self.controls()?.resume();
            Ok(())
        })
    }

    /// Sets the thermal state of the device.
    pub fn set_thermal(&self, thermal: Thermal) -> Result<(), PhasefrontError> {
        guard(|| {
            self.controls()?.set_thermal(thermal);
            Ok(())
        })
    }

    /// Allows or forbids changes of the quality level.
    ///
    /// # Errors
    /// Returns an error if the session does not have the quality level.
    pub fn set_quality(&self, quality: Quality) -> Result<(), PhasefrontError> {
        guard(|| Ok(self.controls()?.set_quality(quality.into())?))
    }

    /// Returns the statistics of the session, also after it was closed. Never waits for a frame.
    pub fn statistics(&self) -> Statistics {
        let failures = self.listener_failures.load(Ordering::Relaxed);
        Statistics::new(self.handle.statistics(), failures)
    }

    /// Closes the session: it accepts no more frames and frees its memory. When this returns, the listener has received
    /// all events, `on_closed` last, and is not called again. A call from a listener of any session, or from a log
    /// listener while a session computes, does not wait for that. Closing twice does nothing.
    pub fn shut_down(&self) {
        self.closed.store(true, Ordering::Relaxed);
        self.handle.close();
    }
}

impl RawSession {
    fn controls(&self) -> Result<&SessionHandle, PhasefrontError> {
        self.check_open()?;
        Ok(&self.handle)
    }

    fn check_open(&self) -> Result<(), PhasefrontError> {
        if self.closed.load(Ordering::Relaxed) {
            return Err(PhasefrontError::Session("session: it is closed; make a new one".into()));
        }
        Ok(())
    }
}

/// The call by which frames enter a session.
enum Entrance {
    /// In an image or a video session.
    Process(AnsweringSession),
    /// In a live session.
    Submit(LiveSession),
}

/// Reports `event` to `listener`.
fn tell(listener: &dyn SessionListener, event: Event) -> Result<(), ListenerError> {
    match event {
        Event::Processed(hologram) => listener.on_processed(RawHologram::new(hologram)),
        Event::Dropped { timestamp_ns, reason } => listener.on_dropped(timestamp_ns as i64, reason.into()),
        Event::Failed { timestamp_ns, error } => {
            log::warn!("the frame of {timestamp_ns} ns failed: {error}");
            listener.on_failed(timestamp_ns as i64, error.to_string())
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
                from_quality_level: from,
                to_quality_level: to,
                reason,
            };
            listener.on_quality_changed(timestamp_ns as i64, change)
        }
        Event::Closed => listener.on_closed(),
        other => {
            log::debug!("an event that these bindings do not know: {other:?}");
            Ok(())
        }
    }
}
