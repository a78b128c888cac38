//! Many frames: what an app feeds with camera frames and gets holograms from.
//!
//! A [`Session`] is made for one of three running modes. An image session answers each frame by itself; a video session
//! answers each frame too, and steadies depth and brightness from one to the next; a live session takes frames without
//! ever waiting, works on one while the newest waits, and tells its listener of every result and every drop.
//!
//! Which frame is next is decided in `queue`, a state machine without threads; `live` is its thread; `stages` is what
//! happens to a frame; `engine` is where CPU and GPU meet; `quality` is the ladder. One frame by itself, without a
//! camera's formats, is [`crate::Pipeline`]'s.

mod brightness;
mod computing;
mod engine;
mod event;
mod hologram;
mod home;
mod live;
mod on_cpu;
#[cfg(feature = "gpu")]
mod on_gpu;
mod owned_frame;
mod quality;
mod queue;
mod stages;
mod statistics;
mod sync;
mod threads;

use crate::depth::stream::DepthOptions;
pub use event::{DropReason, Event};
pub use hologram::Hologram;
#[cfg(feature = "gpu")]
pub use on_gpu::GpuOptions;
pub use quality::{Backend, Quality, QualityChange, QualityReason, Rung, Thermal};
pub use statistics::{BackendReport, Drops, FrameTimes, Statistics};

use crate::cancel::Cancel;
use crate::clock::Instant;
use crate::depth::camera::CameraFrame;
use crate::encode::EncoderOptions;
use crate::error::{Error, Result};
use crate::method::Method;
use crate::target::Target;
use computing::Computing;
use home::Home;
use live::{Live, Report, Work, guarded, lock};
use owned_frame::OwnedFrame;
use queue::{Gate, Queue};
use stages::{Made, Stages};
use statistics::Recent;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

/// What a session makes, and how. [`SessionOptions::new`] has what is usual; change what is not.
#[derive(Clone)]
#[non_exhaustive]
pub struct SessionOptions {
    /// What holograms are for.
    pub target: Target,
    /// Quality levels, the best first, [`MOST_QUALITY_LEVELS`] at most.
    pub ladder: Vec<Rung>,
    /// Whether the session may step on the ladder by itself.
    pub quality: Quality,
    /// Frames a second that are aimed at: a live session drops frames that come sooner, and an adaptive one steps down
    /// where it cannot hold it. None takes frames as they come and never steps.
    pub target_rate_hz: Option<f64>,
    /// How fields become levels.
    pub encoder: EncoderOptions,
    /// What becomes of depth.
    pub depth: DepthOptions,
    /// Where frames are computed, unless their rung says it.
    pub backend: Backend,
    /// Which GPU, and how.
    #[cfg(feature = "gpu")]
    pub gpu: GpuOptions,
    /// Threads to compute with, [`MOST_THREADS`] at most; None for as many as the device has, and no more than that.
    pub threads: Option<NonZeroUsize>,
    /// Most pixels of a rung and of the modulator: what a session allocates is a multiple of them.
    pub most_pixels: usize,
}

/// Most threads of a session's pool. A live session has one more.
pub const MOST_THREADS: usize = 256;

/// Most quality levels of a session: each is planned once when the session is made.
pub const MOST_QUALITY_LEVELS: usize = 16;

/// [`SessionOptions::most_pixels`] unless it is set: 8192×4096, which holds 8K UHD.
pub const MOST_PIXELS: usize = 1 << 25;

impl SessionOptions {
    /// Holograms of the modulator's resolution by `method`: AA-DPM, steady brightness, near and far by percentiles, no
    /// target rate.
    pub fn new(target: impl Into<Target>, method: Method) -> Self {
        let target = target.into();
        let (height, width) = target.modulator();
        SessionOptions {
            ladder: vec![Rung {
                method,
                height,
                width,
                backend: None,
                encoder: None,
            }],
            quality: Quality::Adaptive,
            target_rate_hz: None,
            encoder: EncoderOptions::default(),
            depth: DepthOptions::default(),
            backend: Backend::Cpu,
            #[cfg(feature = "gpu")]
            gpu: GpuOptions::default(),
            threads: None,
            most_pixels: MOST_PIXELS,
            target,
        }
    }

    fn check(&self) -> Result<()> {
        quality::check(&self.ladder, self.quality, self.target.modulator())?;
        // Rungs are no larger than the modulator.
        let (height, width) = self.target.modulator();
        if height.saturating_mul(width) > self.most_pixels {
            return Err(Error::Plan(format!(
                "a session for {width}×{height} pixels; most_pixels allows {}: set it higher where the memory is there",
                self.most_pixels
            )));
        }
        if let Some(threads) = self.threads
            && threads.get() > MOST_THREADS
        {
            return Err(Error::Plan(format!(
                "{threads} threads are too many; 1 to {MOST_THREADS} are right, or none for as many as the device has"
            )));
        }
        if let Some(rate) = self.target_rate_hz
            && !(rate.is_finite() && (0.01..=1000.0).contains(&rate))
        {
            return Err(Error::Plan(format!(
                "a target rate of {rate} frames a second cannot be aimed at; it must lie in 0.01..=1000"
            )));
        }
        self.target.check()?;
        self.encoder.check()?;
        self.depth.check()
    }
}

/// How a session runs; fixed when it is made.
pub enum RunningMode {
    /// [`Session::process`] answers each frame by itself.
    Image,
    /// [`Session::process`] answers each frame; depth and brightness are steadied from one to the next. Timestamps
    /// must rise.
    Video,
    /// [`Session::submit`] takes frames without waiting, and the listener hears what becomes of them. Timestamps must
    /// rise.
    Live(Box<dyn FnMut(Event) + Send>),
}

/// What became of a submitted frame at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Submission {
    /// It waits to be processed.
    Queued,
    /// It was dropped; the listener hears of it too.
    Dropped(DropReason),
}

/// What the caller may change while a session runs.
#[derive(Debug, Clone, Copy)]
struct Control {
    /// Rungs of the ladder.
    rungs: usize,
    quality: Quality,
    thermal: Thermal,
}

/// What callers and the session's thread share.
struct Shared {
    home: Home,
    /// None when the session has ended: its memory went back.
    stages: Mutex<Option<Stages>>,
    control: Mutex<Control>,
    recent: Mutex<Recent>,
    cancel: Cancel,
}

enum Mode {
    Image(Mutex<Gate>),
    Video(Mutex<Gate>),
    Live(Live<LiveWork>),
}

/// Frames in, holograms out. Every method may be called from any thread, at any moment. A session belongs to the
/// process that made it: in a fork of it, calls that need its threads are refused.
///
/// ```no_run
/// use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane};
/// use phasefront::session::{Event, RunningMode};
/// use phasefront::{Display, Method, Network, Session, SessionOptions};
/// use std::sync::Arc;
///
/// # fn camera() -> (u64, Vec<u8>, Vec<u8>) { unimplemented!() }
/// let network = Network::from_onnx(&std::fs::read("rgbd-8-int8.onnx").expect("a network"))?;
/// let method = Method::Network(Arc::new(network));
/// let options = SessionOptions::new(Display::default(), method);
/// let session = Session::new(options, RunningMode::Live(Box::new(|event| match event {
///     Event::Hologram(hologram) => println!("{} bytes", hologram.levels().len()),
///     other => println!("{other:?}"),
/// })))?;
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
pub struct Session {
    shared: Arc<Shared>,
    mode: Mode,
}

/// The work of a live session's thread.
struct LiveWork(Arc<Shared>);

impl Work for LiveWork {
    type Frame = OwnedFrame;
    type Output = Made;

    fn process(&mut self, frame: &OwnedFrame, fresh: bool) -> Result<Made> {
        let _computing = Computing::begin();
        let mut stages = lock(&self.0.stages);
        let stages = stages.as_mut().ok_or_else(queue::closed)?;
        if fresh {
            stages.forget();
        }
        self.0.process(stages, &frame.frame()?, !fresh)
    }

    fn recover(&mut self) {
        self.0.recover();
    }

    fn cancel(&self) -> Cancel {
        self.0.cancel.clone()
    }
}

impl Drop for LiveWork {
    fn drop(&mut self) {
        self.0.end();
    }
}

impl Shared {
    fn process(&self, stages: &mut Stages, frame: &CameraFrame<'_>, past: bool) -> Result<Made> {
        let Control { quality, thermal, .. } = *lock(&self.control);
        let made = stages.process(frame, past, thermal, quality)?;
        let mut recent = lock(&self.recent);
        recent.push(Instant::now(), made.hologram.times());
        recent.rung = stages.rung();
        if let Some(backend) = stages.new_report() {
            recent.backend = backend;
        }
        Ok(made)
    }

    fn recover(&self) {
        let _computing = Computing::begin();
        if let Some(stages) = &mut *lock(&self.stages) {
            stages.recover();
        }
    }

    /// Gives back all memory but the statistics'; waits for a frame that is being processed, but not on a thread that
    /// computes: whoever processes it does this when the frame is done.
    fn end(&self) {
        let stages = if computing::here() {
            match self.stages.try_lock() {
                Ok(mut stages) => stages.take(),
                Err(TryLockError::Poisoned(stages)) => PoisonError::into_inner(stages).take(),
                Err(TryLockError::WouldBlock) => None,
            }
        } else {
            lock(&self.stages).take()
        };
        // Not under the lock: what is logged meanwhile may come back here.
        drop(stages);
    }
}

impl Session {
    /// A session that runs in `mode`.
    ///
    /// # Errors
    /// Options that cannot be meant or planned for, or threads that cannot be started.
    pub fn new(options: SessionOptions, mode: RunningMode) -> Result<Self> {
        options.check()?;
        let control = Control {
            rungs: options.ladder.len(),
            quality: options.quality,
            thermal: Thermal::Nominal,
        };
        let period_ns = options.target_rate_hz.map(|rate| (1e9 / rate) as u64);
        let cancel = Cancel::default();
        let mut stages = Stages::new(options, cancel.clone())?;
        let recent = Recent::new(stages.new_report().unwrap_or_default(), stages.rung());
        let shared = Arc::new(Shared {
            home: Home::here(),
            stages: Mutex::new(Some(stages)),
            control: Mutex::new(control),
            recent: Mutex::new(recent),
            cancel: cancel.clone(),
        });
        let mode = match mode {
            RunningMode::Image => Mode::Image(Mutex::new(Gate::new(cancel))),
            RunningMode::Video => Mode::Video(Mutex::new(Gate::new(cancel))),
            RunningMode::Live(_) if cfg!(target_family = "wasm") => {
                return Err(Error::Session(
                    "a live one has a thread of its own, and WebAssembly has none; make a video session, and process frames \
                     as they come"
                        .into(),
                ));
            }
            RunningMode::Live(mut listener) => {
                let of = shared.clone();
                let listener = move |report| tell(&of, &mut listener, report);
                Mode::Live(Live::start(LiveWork(shared.clone()), period_ns, listener)?)
            }
        };
        Ok(Session { shared, mode })
    }

    /// Makes the hologram of `frame`, in an image or a video session, and waits for it. Calls from several threads are
    /// answered one after another.
    ///
    /// # Errors
    /// A frame that is not usable, a late one in a video session, a session that is live, paused or closed, or reset or
    /// closed while the frame is computed, a call by a handler of logs or traces while a session computes on its
    /// thread, or a panic inside. None of them harms the frames that follow.
    pub fn process(&self, frame: &CameraFrame<'_>) -> Result<Hologram> {
        let (gate, video) = match &self.mode {
            Mode::Image(gate) => (gate, false),
            Mode::Video(gate) => (gate, true),
            Mode::Live(_) => {
                return Err(Error::Session(
                    "it is live, so frames are submitted; process is for image and video sessions".into(),
                ));
            }
        };
        self.answer(gate, frame, video, |stages, past| {
            let made = self.shared.process(stages, frame, past)?;
            Ok(made.hologram)
        })
    }

    /// Takes up a video where it was left: does for `frame` what the frames after it need, without making its hologram,
    /// which got `scale` ([`Hologram::scale`]). Frames that follow become what they would have become after
    /// [`Self::process`] of it, but for what remembers more: a method chosen by sharpness, and steps at the midpoint.
    ///
    /// # Errors
    /// As [`Self::process`]; a session that is not for video, or a scale that no hologram has.
    pub fn replay(&self, frame: &CameraFrame<'_>, scale: f32) -> Result<()> {
        let Mode::Video(gate) = &self.mode else {
            return Err(Error::Session("only a video session can be taken up again".into()));
        };
        if !(scale.is_finite() && scale > 0.0) {
            return Err(Error::Plan(format!(
                "a scale of {scale} is no hologram's; it must be positive and finite"
            )));
        }
        self.answer(gate, frame, true, |stages, past| stages.replay(frame, past, scale))
    }

    /// Answers one frame of an image or a video session by `work`, which hears whether the frames before count.
    fn answer<T>(
        &self,
        gate: &Mutex<Gate>,
        frame: &CameraFrame<'_>,
        video: bool,
        work: impl FnOnce(&mut Stages, bool) -> Result<T>,
    ) -> Result<T> {
        self.with_stages(|stages| {
            let fresh = {
                let mut gate = lock(gate);
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
            let Gate { counts, closed, .. } = &mut *lock(gate);
            match (&result, self.shared.cancel.requested(), *closed) {
                (Ok(_), ..) => counts.processed += 1,
                (Err(_), false, _) => counts.failed += 1,
                (Err(_), true, true) => counts.dropped.count(DropReason::Closed),
                (Err(_), true, false) => counts.dropped.count(DropReason::Reset),
            }
            result
        })
    }

    /// Lets `work` have the stages, once nobody else has them.
    fn with_stages<T>(&self, work: impl FnOnce(&mut Option<Stages>) -> Result<T>) -> Result<T> {
        self.shared.home.check()?;
        computing::check()?;
        let result = {
            let _computing = Computing::begin();
            work(&mut lock(&self.shared.stages))
        };
        // A handler of logs that closed the session meanwhile did not wait.
        if let Mode::Image(gate) | Mode::Video(gate) = &self.mode
            && lock(gate).closed
        {
            self.shared.end();
        }
        result
    }

    /// Hands `frame` to a live session, which copies it and goes on by itself. Never waits for a frame to be processed.
    ///
    /// # Errors
    /// Colour and depth that do not belong together, a late frame, or a session that is not live or is closed. None of
    /// them harms the frames that follow.
    pub fn submit(&self, frame: &CameraFrame<'_>) -> Result<Submission> {
        let Mode::Live(live) = &self.mode else {
            return Err(Error::Session(
                "it is not live; process frames, or make a live session".into(),
            ));
        };
        self.shared.home.check()?;
        frame.check()?;
        let dropped = live.submit(frame.timestamp_ns, |spare| OwnedFrame::copy(frame, spare))?;
        Ok(dropped.map_or(Submission::Queued, Submission::Dropped))
    }

    /// Runs an empty frame through the stages, so that the first real one is as fast as the others. Waits for it.
    ///
    /// # Errors
    /// A session that is closed, a call by a handler of logs while a session computes, or a panic inside.
    pub fn warm_up(&self) -> Result<()> {
        self.with_stages(|stages| {
            let stages = stages.as_mut().ok_or_else(queue::closed)?;
            let (result, panicked) = guarded(|| stages.warm_up());
            if panicked {
                stages.recover();
            }
            result
        })
    }

    /// Forgets all frames so far: what waits or is in flight is dropped, and the next frame, of any timestamp, is the
    /// first again. A frame that is being computed is given up, on the CPU within a row, tile or plane of its work; a
    /// GPU and a network on tract end it first. [`Self::process`] then gives an error.
    pub fn reset(&self) {
        match &self.mode {
            Mode::Image(gate) | Mode::Video(gate) => lock(gate).reset(),
            Mode::Live(live) => live.change(Queue::reset),
        }
    }

    /// Takes no frames until [`Self::resume`]. A live session drops what waits, ends what is in flight, and drops what
    /// is submitted; the others refuse to process.
    pub fn pause(&self) {
        match &self.mode {
            Mode::Image(gate) | Mode::Video(gate) => lock(gate).paused = true,
            Mode::Live(live) => live.change(Queue::pause),
        }
    }

    /// Takes frames again.
    pub fn resume(&self) {
        match &self.mode {
            Mode::Image(gate) | Mode::Video(gate) => lock(gate).paused = false,
            Mode::Live(live) => live.change(|queue| {
                queue.resume();
                None
            }),
        }
    }

    /// Takes no more frames and gives the memory back; the statistics stay. A frame that is being computed is given up,
    /// as by [`Self::reset`]. A live session drops what waits or is in flight; when this returns, its listener has
    /// heard everything, [`Event::Closed`] last, and will not be called again. Called by a listener, of this session or
    /// another, or by a handler of logs while a session computes, it does not wait for that. Results that were handed
    /// out stay valid. Dropping a session closes it.
    pub fn close(&self) {
        match &self.mode {
            Mode::Image(gate) | Mode::Video(gate) => {
                lock(gate).close();
                if self.shared.home.is_here() {
                    self.shared.end();
                }
            }
            Mode::Live(live) => live.close(),
        }
    }

    /// Says how hot the device is; an adaptive session heeds it from the next frame on.
    pub fn set_thermal(&self, thermal: Thermal) {
        lock(&self.shared.control).thermal = thermal;
    }

    /// Allows or forbids steps on the ladder, from the next frame on.
    ///
    /// # Errors
    /// A rung that is not on the ladder.
    pub fn set_quality(&self, quality: Quality) -> Result<()> {
        let mut control = lock(&self.shared.control);
        quality.check(control.rungs)?;
        control.quality = quality;
        Ok(())
    }

    /// The GPU that frames are computed on, if it is one; waits for a frame that is being processed, and gives none to
    /// a handler of logs while a session computes. Its [`crate::gpu::Device::programs`], kept for [`GpuOptions`] of the
    /// next start, save compiling.
    #[cfg(feature = "gpu")]
    pub fn gpu(&self) -> Option<Arc<crate::gpu::Device>> {
        let gpu = self.with_stages(|stages| Ok(stages.as_ref().and_then(Stages::gpu)));
        gpu.ok().flatten()
    }

    /// What the session has done so far. Never waits for a frame.
    pub fn statistics(&self) -> Statistics {
        let counts = match &self.mode {
            Mode::Image(gate) | Mode::Video(gate) => lock(gate).counts,
            Mode::Live(live) => live.look(|queue| queue.gate.counts),
        };
        lock(&self.shared.recent).statistics(counts)
    }
}

/// A report as the listener's events.
fn tell(shared: &Shared, listener: &mut dyn FnMut(Event), report: Report<Made>) {
    match report {
        Report::Done { timestamp_ns, output } => {
            listener(Event::Hologram(output.hologram));
            if let Some(change) = output.change {
                listener(Event::QualityChanged { timestamp_ns, change });
            }
        }
        Report::Dropped { timestamp_ns, reason } => listener(Event::Dropped { timestamp_ns, reason }),
        Report::Failed { timestamp_ns, error } => listener(Event::Failed { timestamp_ns, error }),
        Report::ListenerPanicked => lock(&shared.recent).listener_panics += 1,
        Report::Closed => listener(Event::Closed),
    }
}
