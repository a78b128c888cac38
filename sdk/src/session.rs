//! Sessions, which take camera frames from an app and return holograms.
//!
//! An [`ImageSession`] processes each frame independently. A [`VideoSession`] also returns a hologram for each frame,
//! and smooths depth and brightness over time. A [`LiveSession`] takes frames without waiting: it processes one frame
//! while the newest waits, and reports every result and every drop to its listener. All three have the controls of a
//! [`SessionHandle`], a clone of which controls a session from anywhere.
//!
//! The state machine in `queue` decides which frame is next, without threads; `live` is its thread; `stages` processes
//! a frame; `engine` chooses between CPU and GPU; `quality` chooses the quality level.
//! [`phasefront_core::pipeline::Pipeline`] processes a single frame without a camera's formats.

mod answering;
mod colour_stage;
mod computing;
#[cfg(feature = "tract")]
mod depth_estimates;
#[cfg(not(feature = "tract"))]
#[path = "session/no_depth_estimates.rs"]
mod depth_estimates;
mod drop_reason;
mod engine;
mod event;
mod focus;
mod guarded;
mod handle;
mod history;
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

pub use answering::AnsweringSession;
pub use drop_reason::DropReason;
pub use event::Event;
pub use focus::Focus;
pub use handle::SessionHandle;
pub use hologram::Hologram;
#[cfg(feature = "gpu")]
pub use options::GpuOptions;
pub use options::SessionOptions;
pub use phasefront_core::pipeline::FrameTimes;
#[cfg(feature = "gpu")]
pub use phasefront_gpu::DeviceOptions;
pub use quality::{Backend, Quality, QualityLevel, QualityReason, Thermal};
pub use statistics::{BackendReport, Drops, Statistics};

use depth_estimates::DepthEstimates;
use handle::{Frames, controls};
use live::Live;
use live_work::{LiveWork, tell};
use owned_frame::OwnedFrame;
use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::runtime::error::{Error, Result};
use shared::Shared;
use std::fmt::{Debug, Formatter};
use std::sync::Arc;
use threads::block_on;

/// Makes a hologram of each frame independently. Every method may be called from any thread at any time. A session
/// belongs to the process that made it: in a forked process, calls that need its threads fail.
///
/// Only a [`LiveSession`] has `submit`:
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
pub struct ImageSession(AnsweringSession);

/// Makes a hologram of each frame of a video and smooths depth and brightness over time. Timestamps must increase. The
/// rules of [`ImageSession`] for threads and processes apply.
#[derive(Debug)]
pub struct VideoSession(AnsweringSession);

/// Takes a camera's frames without waiting, and reports the outcome of each to its listener. Timestamps must increase.
/// The rules of [`ImageSession`] for threads and processes apply.
///
/// ```no_run
/// use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane};
/// use phasefront::session::{Event, LiveSession};
/// use phasefront::{Display, Method, Network, SessionOptions, Size};
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
///     let size = Size { width: 1920, height: 1440 };
///     let colour = ColourImage::new(ColourFormat::Bgra, size, &[Plane::new(&colour, 4 * 1920, 4)])?;
///     let size = Size { width: 256, height: 192 };
///     let depth = DepthImage::new(DepthFormat::MetresF32, size, Plane::new(&depth, 4 * 256, 4))?;
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
    /// Creates a session for single images.
    ///
    /// # Errors
    /// Returns an error if the options are invalid or cannot be planned for, or if threads cannot be started.
    pub fn new(options: SessionOptions) -> Result<Self> {
        block_on(AnsweringSession::new(options, false)).map(ImageSession)
    }

    /// Creates a session as [`Self::new`] does, in a browser, whose GPU answers only while nothing blocks.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`Self::new`].
    #[cfg(target_arch = "wasm32")]
    pub async fn new_async(options: SessionOptions) -> Result<Self> {
        AnsweringSession::new(options, false).await.map(ImageSession)
    }

    /// Makes the hologram of `frame` as [`Self::process`] does, in a browser. One frame is computed at a time. With
    /// `stay`, its levels stay on the GPU, if there is one: see [`Hologram::on_gpu`].
    ///
    /// # Errors
    /// Returns an error in the same cases as [`Self::process`], and while the session computes another frame.
    #[cfg(target_arch = "wasm32")]
    pub async fn process_async(&self, frame: &CameraFrame<'_>, stay: bool) -> Result<Hologram> {
        self.0.process_async(frame, stay).await
    }

    /// Makes the hologram of `frame` and waits for it. Calls from several threads run one after another.
    ///
    /// # Errors
    /// Returns an error if the frame is not usable, if the session is paused, closed or forked, if it is reset or
    /// closed while it computes the frame, if a log or trace handler makes the call while a session computes on its
    /// thread, or if the computation panics. The frames that follow are not affected.
    pub fn process(&self, frame: &CameraFrame<'_>) -> Result<Hologram> {
        self.0.process(frame)
    }
}

impl VideoSession {
    /// Creates a session for the frames of a video.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`ImageSession::new`].
    pub fn new(options: SessionOptions) -> Result<Self> {
        block_on(AnsweringSession::new(options, true)).map(VideoSession)
    }

    /// Creates a session as [`Self::new`] does, in a browser, whose GPU answers only while nothing blocks.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`Self::new`].
    #[cfg(target_arch = "wasm32")]
    pub async fn new_async(options: SessionOptions) -> Result<Self> {
        AnsweringSession::new(options, true).await.map(VideoSession)
    }

    /// Makes the hologram of `frame` as [`Self::process`] does, in a browser, as [`ImageSession::process_async`] does.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`Self::process`], and while the session computes another frame.
    #[cfg(target_arch = "wasm32")]
    pub async fn process_async(&self, frame: &CameraFrame<'_>, stay: bool) -> Result<Hologram> {
        self.0.process_async(frame, stay).await
    }

    /// Makes the hologram of `frame` and waits for it. Calls from several threads run one after another.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`ImageSession::process`], and if the frame is not later than the last.
    pub fn process(&self, frame: &CameraFrame<'_>) -> Result<Hologram> {
        self.0.process(frame)
    }

    /// Resumes a video: updates the state of the session with `frame`, without making its hologram, whose
    /// [`Hologram::scale`] was `scale`. The frames that follow give the same result as after [`Self::process`] of
    /// `frame`, except with steps at the midpoint, or where what stands still keeps its wave: they keep more state.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`Self::process`], and if the scale is not positive and finite.
    pub fn replay(&self, frame: &CameraFrame<'_>, scale: f32) -> Result<()> {
        if !(scale.is_finite() && scale > 0.0) {
            return Err(Error::Setting(format!(
                "a scale of {scale} is no hologram's; it must be positive and finite"
            )));
        }
        self.0.replay(frame, scale)
    }
}

impl LiveSession {
    /// Creates a session for a camera's frames, with its own thread, on which it calls `listener`.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`ImageSession::new`], and on WebAssembly, which has no threads.
    pub fn new(options: SessionOptions, mut listener: impl FnMut(Event) + Send + 'static) -> Result<Self> {
        if cfg!(target_family = "wasm") {
            return Err(Error::Session(
                "a live one has a thread of its own, and WebAssembly has none; make a video session, and process frames as \
                 they come"
                    .into(),
            ));
        }
        let period_ns = options.target_rate_hz.map(|rate| (1e9 / rate) as u64);
        let estimates = DepthEstimates::on_own_thread(&options)?;
        let shared = block_on(Shared::new(options, estimates))?;
        let of = shared.clone();
        let listener = move |report| tell(&of, &mut listener, report);
        let live = Arc::new(Live::start(LiveWork(shared.clone()), period_ns, listener)?);
        let frames = Frames::Live(live.clone());
        let handle = SessionHandle { shared, frames };
        Ok(LiveSession { handle, live })
    }

    /// Hands `frame` to the session, which copies it and returns at once. Returns the reason if the frame was dropped;
    /// the listener is also told.
    ///
    /// # Errors
    /// Returns an error if colour and depth do not match, if the frame is late, or if the session is closed or forked.
    /// The frames that follow are not affected.
    pub fn submit(&self, frame: &CameraFrame<'_>) -> Result<Option<DropReason>> {
        self.handle.shared.process.check()?;
        frame.check()?;
        (self.live).submit(frame.timestamp_ns, |spare| OwnedFrame::copy(frame, spare))
    }
}

controls!(ImageSession, 0);
controls!(VideoSession, 0);
controls!(LiveSession);
controls!(AnsweringSession);

impl From<ImageSession> for AnsweringSession {
    fn from(session: ImageSession) -> Self {
        session.0
    }
}

impl From<VideoSession> for AnsweringSession {
    fn from(session: VideoSession) -> Self {
        session.0
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
