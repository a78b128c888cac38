//! Many frames: what an app feeds with camera frames and gets holograms from.
//!
//! An [`ImageSession`] answers each frame by itself. A [`VideoSession`] answers each frame too, and smooths depth and
//! brightness over time. A [`LiveSession`] takes frames without ever waiting, works on one while the newest
//! waits, and tells its listener of every result and every drop. What all three can do is their [`SessionHandle`]'s.
//!
//! Which frame is next is decided in `queue`, a state machine without threads; `live` is its thread; `stages` is what
//! happens to a frame; `engine` is where CPU and GPU meet; `quality` chooses the quality level. One frame by itself,
//! without a camera's formats, is [`phasefront_core::pipeline::Pipeline`]'s.

mod computing;
mod drop_reason;
mod engine;
mod event;
mod handle;
mod hologram;
mod live;
mod live_work;
mod options;
mod owned_frame;
mod process_id;
mod quality;
mod queue;
mod shared;
mod stages;
mod statistics;
mod sync;
mod threads;

pub use drop_reason::DropReason;
#[cfg(feature = "gpu")]
pub use engine::GpuOptions;
pub use event::Event;
pub use handle::SessionHandle;
pub use hologram::Hologram;
pub use options::SessionOptions;
pub use phasefront_core::pipeline::FrameTimes;
#[cfg(feature = "gpu")]
pub use phasefront_gpu::DeviceOptions;
pub use quality::{Backend, Quality, QualityLevel, QualityReason, Thermal};
pub use statistics::{BackendReport, Drops, Statistics};

use handle::Frames;
use live::{Live, guarded, lock};
use live_work::{LiveWork, tell};
use owned_frame::OwnedFrame;
use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::runtime::error::{Error, Result};
use queue::Gate;
use shared::Shared;
use stages::Stages;
use std::fmt::{Debug, Formatter};
use std::ops::Deref;
use std::sync::{Arc, Mutex};

/// Makes a hologram of each frame by itself. Every method may be called from any thread, at any moment. A session
/// belongs to the process that made it: in a fork of it, calls that need its threads are refused.
///
/// Frames are submitted to a [`LiveSession`] only:
///
/// ```compile_fail,E0599
/// use phasefront::input::CameraFrame;
/// use phasefront::session::ImageSession;
///
/// fn hand_over(session: &ImageSession, frame: &CameraFrame<'_>) {
///     session.submit(frame);
/// }
/// ```
#[derive(Debug)]
pub struct ImageSession(Answering);

/// Makes a hologram of each frame of a video; depth and brightness are smoothed over time. Timestamps must
/// rise. Threads and processes as [`ImageSession`] says.
#[derive(Debug)]
pub struct VideoSession(Answering);

/// Takes a camera's frames without waiting, and tells its listener what becomes of them. Timestamps must rise. Threads
/// and processes as [`ImageSession`] says.
///
/// ```no_run
/// use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane};
/// use phasefront::session::{Event, LiveSession};
/// use phasefront::{Display, Method, Network, SessionOptions};
/// use std::sync::Arc;
///
/// # fn camera() -> (u64, Vec<u8>, Vec<u8>) { unimplemented!() }
/// let network = Network::from_onnx(&std::fs::read("rgbd-8-int8.onnx").expect("a network"))?;
/// let method = Method::Network(Arc::new(network));
/// let options = SessionOptions::new(Display::default(), method);
/// let session = LiveSession::new(options, |event| match event {
///     Event::Processed(hologram) => println!("{} bytes", hologram.levels().len()),
///     other => println!("{other:?}"),
/// })?;
/// loop {
///     let (timestamp_ns, colour, depth) = camera();
///     let colour = Plane::new(&colour, 4 * 1920, 4);
///     let colour = ColourImage::new(ColourFormat::Bgra, 1920, 1440, &[colour])?;
///     let depth = DepthImage::new(DepthFormat::MetresF32, 256, 192, Plane::new(&depth, 4 * 256, 4))?;
///     session.submit(&CameraFrame::new(timestamp_ns, colour, depth))?;
/// }
/// # #[allow(unreachable_code)]
/// # Ok::<(), phasefront::Error>(())
/// ```
pub struct LiveSession {
    handle: SessionHandle,
    live: Arc<Live<LiveWork>>,
}

impl ImageSession {
    /// A session for single images.
    ///
    /// # Errors
    /// Options that cannot be meant or planned for, or threads that cannot be started.
    pub fn new(options: SessionOptions) -> Result<Self> {
        Answering::new(options).map(ImageSession)
    }

    /// Makes the hologram of `frame` and waits for it. Calls from several threads are answered one after another.
    ///
    /// # Errors
    /// A frame that is not usable, a session that is paused, closed or forked, or reset or closed while the frame is
    /// computed, a call by a handler of logs or traces while a session computes on its thread, or a panic inside. None
    /// of them harms the frames that follow.
    pub fn process(&self, frame: &CameraFrame<'_>) -> Result<Hologram> {
        self.0.process(frame, false)
    }
}

impl VideoSession {
    /// A session for the frames of a video.
    ///
    /// # Errors
    /// As [`ImageSession::new`].
    pub fn new(options: SessionOptions) -> Result<Self> {
        Answering::new(options).map(VideoSession)
    }

    /// Makes the hologram of `frame` and waits for it. Calls from several threads are answered one after another.
    ///
    /// # Errors
    /// As [`ImageSession::process`]; a frame that is not later than the last.
    pub fn process(&self, frame: &CameraFrame<'_>) -> Result<Hologram> {
        self.0.process(frame, true)
    }

    /// Takes up a video where it was left: does for `frame` what the frames after it need, without making its hologram,
    /// which got `scale` ([`Hologram::scale`]). Frames that follow become what they would have become after
    /// [`Self::process`] of it, but for what remembers more: a method chosen automatically, and steps at the midpoint.
    ///
    /// # Errors
    /// As [`Self::process`]; a scale that no hologram has.
    pub fn replay(&self, frame: &CameraFrame<'_>, scale: f32) -> Result<()> {
        if !(scale.is_finite() && scale > 0.0) {
            return Err(Error::Setting(format!(
                "a scale of {scale} is no hologram's; it must be positive and finite"
            )));
        }
        self.0
            .answer(frame, true, |stages, past| stages.replay(frame, past, scale))
    }
}

impl LiveSession {
    /// A session for a camera's frames, with a thread of its own, on which it calls `listener`.
    ///
    /// # Errors
    /// As [`ImageSession::new`]; WebAssembly, which has no threads.
    pub fn new(options: SessionOptions, mut listener: impl FnMut(Event) + Send + 'static) -> Result<Self> {
        if cfg!(target_family = "wasm") {
            return Err(Error::Session(
                "a live one has a thread of its own, and WebAssembly has none; make a video session, and process frames as \
                 they come"
                    .into(),
            ));
        }
        let period_ns = options.target_rate_hz.map(|rate| (1e9 / rate) as u64);
        let shared = Shared::new(options)?;
        let of = shared.clone();
        let listener = move |report| tell(&of, &mut listener, report);
        let live = Arc::new(Live::start(LiveWork(shared.clone()), period_ns, listener)?);
        let frames = Frames::Live(live.clone());
        let handle = SessionHandle { shared, frames };
        Ok(LiveSession { handle, live })
    }

    /// Hands `frame` to the session, which copies it and returns at once. Gives the reason where the frame was dropped;
    /// the listener hears of it too.
    ///
    /// # Errors
    /// Colour and depth that do not belong together, a late frame, or a session that is closed or forked. None of them
    /// harms the frames that follow.
    pub fn submit(&self, frame: &CameraFrame<'_>) -> Result<Option<DropReason>> {
        self.shared.process.check()?;
        frame.check()?;
        (self.live).submit(frame.timestamp_ns, |spare| OwnedFrame::copy(frame, spare))
    }
}

impl Deref for ImageSession {
    type Target = SessionHandle;

    fn deref(&self) -> &SessionHandle {
        &self.0.handle
    }
}

impl Deref for VideoSession {
    type Target = SessionHandle;

    fn deref(&self) -> &SessionHandle {
        &self.0.handle
    }
}

impl Deref for LiveSession {
    type Target = SessionHandle;

    fn deref(&self) -> &SessionHandle {
        &self.handle
    }
}

impl Debug for LiveSession {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("LiveSession").field(&self.handle).finish()
    }
}

impl Drop for LiveSession {
    fn drop(&mut self) {
        self.close();
    }
}

/// What image and video sessions share: a caller waits for the answer to its frame.
struct Answering {
    handle: SessionHandle,
    gate: Arc<Mutex<Gate>>,
}

impl Answering {
    fn new(options: SessionOptions) -> Result<Self> {
        let shared = Shared::new(options)?;
        let gate = Arc::new(Mutex::new(Gate::new(shared.cancel.clone())));
        let frames = Frames::Answered(gate.clone());
        let handle = SessionHandle { shared, frames };
        Ok(Answering { handle, gate })
    }

    fn process(&self, frame: &CameraFrame<'_>, video: bool) -> Result<Hologram> {
        self.answer(frame, video, |stages, past| {
            let made = self.handle.shared.process(stages, frame, past)?;
            Ok(made.hologram)
        })
    }

    /// Answers one frame by `work`, which hears whether the frames before count.
    fn answer<T>(
        &self,
        frame: &CameraFrame<'_>,
        video: bool,
        work: impl FnOnce(&mut Stages, bool) -> Result<T>,
    ) -> Result<T> {
        self.handle.with_stages(|stages| {
            let fresh = {
                let mut gate = lock(&self.gate);
                gate.admit(frame.timestamp_ns, video)?;
                if gate.paused {
                    gate.counts.dropped.count(DropReason::Paused);
                    return Err(Error::Session("it is paused; resume it first".into()));
                }
                gate.begin()
            };
            // There are stages as long as the gate is open.
            let stages = stages.as_mut().ok_or_else(queue::closed)?;
            if fresh {
                stages.forget();
            }
            let (result, panicked) = guarded(|| {
                frame.check()?;
                work(stages, video && !fresh)
            });
            if panicked {
                stages.recover();
            }
            let Gate { counts, closed, .. } = &mut *lock(&self.gate);
            match (&result, self.handle.shared.cancel.requested(), *closed) {
                (Ok(_), ..) => counts.processed += 1,
                (Err(_), false, _) => counts.failed += 1,
                (Err(_), true, true) => counts.dropped.count(DropReason::Closed),
                (Err(_), true, false) => counts.dropped.count(DropReason::Reset),
            }
            result
        })
    }
}

impl Debug for Answering {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        self.handle.fmt(f)
    }
}

impl Drop for Answering {
    fn drop(&mut self) {
        self.handle.close();
    }
}
