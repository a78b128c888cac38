//! The controls that all three kinds of session share.

use super::computing::{self, Computing};
use super::guarded::{guarded, lock};
use super::live::Live;
use super::live_work::LiveWork;
#[cfg(doc)]
use super::options::GpuOptions;
use super::quality::{Quality, Thermal};
use super::queue::{self, Gate, Queue};
use super::shared::Shared;
use super::stages::Stages;
use super::statistics::Statistics;
use super::threads::block_on;
#[cfg(target_arch = "wasm32")]
use phasefront_core::runtime::error::Error;
use phasefront_core::runtime::error::Result;
use std::fmt::{Debug, Formatter};
use std::sync::{Arc, Mutex, MutexGuard};

/// Controls a session of any kind from any thread, including a listener's: a clone of `handle()` of the session. It
/// does not keep the session open: a session closes when it is dropped, even if handles remain.
#[derive(Clone)]
pub struct SessionHandle {
    pub(super) shared: Arc<Shared>,
    pub(super) frames: Frames,
}

/// The way in which frames enter a session.
#[derive(Clone)]
pub(super) enum Frames {
    /// The caller waits for the result of each frame.
    Answered(Arc<Mutex<Gate>>),
    /// A thread takes frames from a queue.
    Live(Arc<Live<LiveWork>>),
}

impl SessionHandle {
    /// Returns exclusive access to the stages.
    ///
    /// # Errors
    /// Returns an error in a forked process, or if this thread computes for a session.
    pub(super) fn enter(&self) -> Result<Entered<'_>> {
        self.shared.process.check()?;
        computing::check()?;
        let computing = Computing::begin();
        Ok(Entered {
            handle: self,
            held: Some((lock(&self.shared.stages), computing)),
        })
    }

    /// Takes the stages, so that no lock is held while the caller waits and the session counts as busy.
    #[cfg(target_arch = "wasm32")]
    pub(super) fn take_stages(&self) -> Result<Stages> {
        let stages = lock(&self.shared.stages).take();
        stages
            .ok_or_else(|| Error::Session("it is closed, or it computes another frame; wait for that one first".into()))
    }

    /// Gives back what [`Self::take_stages`] took.
    #[cfg(target_arch = "wasm32")]
    pub(super) fn give_back(&self, stages: Stages) {
        *lock(&self.shared.stages) = Some(stages);
        self.end_if_closed();
    }

    /// Ends a session that was closed while it computed.
    fn end_if_closed(&self) {
        if let Frames::Answered(gate) = &self.frames
            && lock(gate).closed
        {
            self.shared.end();
        }
    }

    /// Runs an empty frame through the stages and waits for it, so that the first real frame is as fast as the others.
    ///
    /// # Errors
    /// Returns an error if the session is closed, if a log handler makes the call while a session computes, or if the
    /// computation panics.
    pub fn warm_up(&self) -> Result<()> {
        let mut entered = self.enter()?;
        let stages = entered.stages()?;
        let (result, panicked) = guarded(|| block_on(stages.warm_up()));
        if panicked {
            stages.recover();
        }
        result
    }

    /// Forgets all previous frames: drops the frames that wait or are in flight, and treats the next frame, with any
    /// timestamp, as the first. A frame that is being computed is cancelled: on the CPU within a row, tile or plane of
    /// its work; a GPU or a network on tract finishes it first. The `process` call that waits for it then returns an
    /// error.
    pub fn reset(&self) {
        match &self.frames {
            Frames::Answered(gate) => lock(gate).reset(),
            Frames::Live(live) => live.change(Queue::reset),
        }
    }

    /// Stops taking frames until [`Self::resume`]. A live session drops the waiting frame, finishes the frame in
    /// flight, and drops frames that are submitted; the other sessions refuse to process.
    pub fn pause(&self) {
        match &self.frames {
            Frames::Answered(gate) => lock(gate).paused = true,
            Frames::Live(live) => live.change(Queue::pause),
        }
    }

    /// Resumes taking frames.
    pub fn resume(&self) {
        match &self.frames {
            Frames::Answered(gate) => lock(gate).paused = false,
            Frames::Live(live) => live.change(|queue| {
                queue.resume();
                None
            }),
        }
    }

    /// Stops taking frames and frees the memory; the statistics remain. A frame that is being computed is cancelled as
    /// by [`Self::reset`]. A live session drops the frames that wait or are in flight. When this function returns, the
    /// listener has received all events, [`Event::Closed`](super::Event::Closed) last, and will not be called again. It
    /// does not wait for that if it is called by a listener, of this session or another, or by a log handler while a
    /// session computes. Results that were handed out stay valid. Dropping a session closes it.
    pub fn close(&self) {
        match &self.frames {
            Frames::Answered(gate) => {
                lock(gate).close();
                if self.shared.process.is_current() {
                    self.shared.end();
                }
            }
            Frames::Live(live) => live.close(),
        }
    }

    /// Sets the thermal state of the device, which an adaptive session follows from the next frame on.
    pub fn set_thermal(&self, thermal: Thermal) {
        lock(&self.shared.control).thermal = thermal;
    }

    /// Allows or forbids changes of the quality level from the next frame on.
    ///
    /// # Errors
    /// Returns an error if the session does not have the quality level.
    pub fn set_quality(&self, quality: Quality) -> Result<()> {
        let mut control = lock(&self.shared.control);
        quality.check(control.quality_levels)?;
        control.quality = quality;
        Ok(())
    }

    /// Returns the GPU that computes the frames, if there is one. Waits for a frame that is being processed; returns
    /// `None` to a log handler that calls it while a session computes. Its [`phasefront_gpu::Device::programs`] can be
    /// stored and passed to [`GpuOptions`] at the next start, to save compiling.
    #[cfg(feature = "gpu")]
    #[doc(hidden)]
    pub fn gpu(&self) -> Option<Arc<phasefront_gpu::Device>> {
        self.enter().ok()?.stages().ok()?.gpu()
    }

    /// Returns the statistics so far. Never waits for a frame.
    pub fn statistics(&self) -> Statistics {
        let counts = match &self.frames {
            Frames::Answered(gate) => lock(gate).counts,
            Frames::Live(live) => live.look(|queue| queue.gate.counts),
        };
        lock(&self.shared.recent).statistics(counts)
    }
}

/// Gives a kind of session the controls of its handle, which is a field of the session or of its field 0.
macro_rules! controls {
    ($session:ident $(, $field:tt)?) => {
        impl $session {
            /// Returns the handle of this session. Its clones control the session from other threads and from
            /// listeners.
            pub fn handle(&self) -> &SessionHandle {
                &self$(.$field)?.handle
            }

            /// Runs an empty frame through the stages and waits for it, so that the first real frame is as fast as the
            /// others.
            ///
            /// # Errors
            /// Returns an error in the cases of [`SessionHandle::warm_up`].
            pub fn warm_up(&self) -> Result<()> {
                self.handle().warm_up()
            }

            /// Forgets all previous frames, as [`SessionHandle::reset`] does.
            pub fn reset(&self) {
                self.handle().reset();
            }

            /// Stops taking frames until [`Self::resume`], as [`SessionHandle::pause`] does.
            pub fn pause(&self) {
                self.handle().pause();
            }

            /// Resumes taking frames.
            pub fn resume(&self) {
                self.handle().resume();
            }

            /// Stops taking frames and frees the memory, as [`SessionHandle::close`] does.
            pub fn close(&self) {
                self.handle().close();
            }

            /// Sets the thermal state of the device, which an adaptive session follows from the next frame on.
            pub fn set_thermal(&self, thermal: Thermal) {
                self.handle().set_thermal(thermal);
            }

            /// Allows or forbids changes of the quality level from the next frame on.
            ///
            /// # Errors
            /// Returns an error if the session does not have the quality level.
            pub fn set_quality(&self, quality: Quality) -> Result<()> {
                self.handle().set_quality(quality)
            }

            /// Returns the GPU that computes the frames, as [`SessionHandle::gpu`] does.
            #[cfg(feature = "gpu")]
            #[doc(hidden)]
            pub fn gpu(&self) -> Option<Arc<phasefront_gpu::Device>> {
                self.handle().gpu()
            }

            /// Returns the statistics so far. Never waits for a frame.
            pub fn statistics(&self) -> Statistics {
                self.handle().statistics()
            }
        }
    };
}
pub(super) use controls;

/// Exclusive access to the stages of a session, on a thread that counts as computing.
pub(super) struct Entered<'a> {
    handle: &'a SessionHandle,
    /// `None` only while it is dropped.
    held: Option<(MutexGuard<'a, Option<Stages>>, Computing)>,
}

impl Entered<'_> {
    /// # Errors
    /// Returns an error if the session is closed.
    pub(super) fn stages(&mut self) -> Result<&mut Stages> {
        let held = self.held.as_mut().and_then(|(stages, _)| (**stages).as_mut());
        held.ok_or_else(queue::closed)
    }
}

impl Drop for Entered<'_> {
    fn drop(&mut self) {
        self.held = None;
        // A log handler that closed the session in the meantime did not wait.
        self.handle.end_if_closed();
    }
}

impl Debug for SessionHandle {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SessionHandle")
            .field("statistics", &self.statistics())
            .finish_non_exhaustive()
    }
}
