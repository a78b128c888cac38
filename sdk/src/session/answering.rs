//! Image and video sessions: a caller waits for the result of its frame.

use super::depth_estimates::DepthEstimates;
use super::drop_reason::DropReason;
use super::guarded::{guarded, lock};
use super::handle::{Frames, SessionHandle};
use super::hologram::Hologram;
use super::options::SessionOptions;
use super::queue::Gate;
use super::shared::Shared;
use super::threads::block_on;
use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::frame::Past;
use phasefront_core::runtime::error::{Error, Result};
use std::fmt::{Debug, Formatter};
use std::sync::{Arc, Mutex};

/// An image or a video session, for code that learns only at run time which of the two it needs:
///
/// ```
/// use phasefront::session::AnsweringSession;
/// use phasefront::{ImageSession, SessionOptions, VideoSession};
///
/// fn open(options: SessionOptions, is_video: bool) -> phasefront::Result<AnsweringSession> {
///     if is_video {
///         VideoSession::new(options).map(AnsweringSession::from)
///     } else {
///         ImageSession::new(options).map(AnsweringSession::from)
///     }
/// }
/// ```
pub struct AnsweringSession {
    pub(super) handle: SessionHandle,
    gate: Arc<Mutex<Gate>>,
}

impl AnsweringSession {
    /// Creates a session, whose frames follow one another if they come `in_order`.
    pub(super) async fn new(mut options: SessionOptions, in_order: bool) -> Result<Self> {
        // Nothing stands still from one picture to another.
        options.keep_standing &= in_order;
        let estimates = DepthEstimates::for_each_frame(&options);
        let shared = Shared::new(options, estimates).await?;
        let gate = Arc::new(Mutex::new(Gate::new(in_order, shared.cancel.clone())));
        let frames = Frames::Answered(gate.clone());
        let handle = SessionHandle { shared, frames };
        Ok(AnsweringSession { handle, gate })
    }

    /// Makes the hologram of `frame` and waits for it. Calls from several threads run one after another.
    ///
    /// # Errors
    /// Returns an error in the cases of [`ImageSession::process`](super::ImageSession::process) or
    /// [`VideoSession::process`](super::VideoSession::process).
    pub fn process(&self, frame: &CameraFrame<'_>) -> Result<Hologram> {
        let mut entered = self.handle.enter()?;
        let past = self.admit(frame)?;
        // The stages exist as long as the gate is open.
        let stages = entered.stages()?;
        let (made, panicked) = guarded(|| {
            frame.check()?;
            block_on(self.handle.shared.process(stages, frame, past))
        });
        if panicked {
            stages.recover();
        }
        self.settle(frame, made.as_ref().ok().map(|made| made.hologram.scale), panicked);
        Ok(made?.hologram)
    }

    /// Updates the state as [`Self::process`] does, for a frame whose hologram is known to have `scale`.
    pub(super) fn replay(&self, frame: &CameraFrame<'_>, scale: f32) -> Result<()> {
        let mut entered = self.handle.enter()?;
        let past = self.admit(frame)?;
        let stages = entered.stages()?;
        let (replayed, panicked) = guarded(|| {
            frame.check()?;
            block_on(stages.replay(frame, past))
        });
        if panicked {
            stages.recover();
        }
        self.settle(frame, replayed.is_ok().then_some(scale), panicked);
        replayed
    }

    /// Makes the hologram of `frame` in a browser, whose GPU answers only while nothing blocks. One frame is computed
    /// at a time. With `stay`, its levels stay on the GPU, if there is one: see [`Hologram::on_gpu`].
    ///
    /// # Errors
    /// Returns an error in the same cases as [`Self::process`], and while the session computes another frame.
    #[cfg(target_arch = "wasm32")]
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables))] // Only levels on a GPU stay there.
    pub async fn process_async(&self, frame: &CameraFrame<'_>, stay: bool) -> Result<Hologram> {
        let mut stages = self.handle.take_stages()?;
        #[cfg(feature = "gpu")]
        stages.stay_on_gpu(stay);
        let made = match self.admit(frame) {
            Ok(past) => {
                let made = match frame.check() {
                    Ok(()) => self.handle.shared.process(&mut stages, frame, past).await,
                    Err(why) => Err(why),
                };
                self.settle(frame, made.as_ref().ok().map(|made| made.hologram.scale), false);
                made
            }
            Err(why) => Err(why),
        };
        self.handle.give_back(stages);
        Ok(made?.hologram)
    }

    /// Lets a frame in and returns its past.
    fn admit(&self, frame: &CameraFrame<'_>) -> Result<Option<Past>> {
        let mut gate = lock(&self.gate);
        gate.admit(frame.timestamp_ns)?;
        if gate.paused {
            gate.counts.dropped.count(DropReason::Paused);
            return Err(Error::Session("it is paused; resume it first".into()));
        }
        Ok(gate.begin(frame.timestamp_ns))
    }

    /// Counts a frame that was let in, whose hologram has `scale`; `None` if it failed. A panic leaves no past.
    fn settle(&self, frame: &CameraFrame<'_>, scale: Option<f32>, panicked: bool) {
        let given_up = self.handle.shared.cancel.requested();
        let Gate {
            counts,
            closed,
            history,
            ..
        } = &mut *lock(&self.gate);
        match scale {
            Some(_) => counts.processed += 1,
            None if !given_up => counts.failed += 1,
            None if *closed => counts.dropped.count(DropReason::Closed),
            None => counts.dropped.count(DropReason::Reset),
        }
        match scale.filter(|_| !given_up) {
            Some(scale) => history.add(frame.timestamp_ns, scale),
            None if panicked => history.forget(),
            None => {}
        }
    }
}

impl Debug for AnsweringSession {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        self.handle.fmt(f)
    }
}

impl Drop for AnsweringSession {
    fn drop(&mut self) {
        self.handle.close();
    }
}
