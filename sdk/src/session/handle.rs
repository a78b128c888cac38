//! Controls of a session that all three kinds share.

use super::computing::{self, Computing};
#[cfg(doc)]
use super::engine::GpuOptions;
use super::live::{Live, guarded, lock};
use super::live_work::LiveWork;
use super::quality::{Quality, Thermal};
use super::queue::{self, Gate, Queue};
use super::shared::Shared;
use super::stages::Stages;
use super::statistics::Statistics;
use phasefront_core::runtime::error::Result;
use std::fmt::{Debug, Formatter};
use std::sync::{Arc, Mutex};

/// Controls a session: every kind of session dereferences to it. A clone controls the same session from any thread, a
/// listener's too. It does not keep the session open: a session closes when it is dropped, whatever handles there are.
#[derive(Clone)]
pub struct SessionHandle {
    pub(super) shared: Arc<Shared>,
    pub(super) frames: Frames,
}

/// What lets frames into a session.
#[derive(Clone)]
pub(super) enum Frames {
    /// Each is answered while its caller waits.
    Answered(Arc<Mutex<Gate>>),
    /// A thread takes them from a queue.
    Live(Arc<Live<LiveWork>>),
}

impl SessionHandle {
    /// Lets `work` have the stages, once nobody else has them.
    pub(super) fn with_stages<T>(&self, work: impl FnOnce(&mut Option<Stages>) -> Result<T>) -> Result<T> {
        self.shared.process.check()?;
        computing::check()?;
        let result = {
            let _computing = Computing::begin();
            work(&mut lock(&self.shared.stages))
        };
        // A handler of logs that closed the session meanwhile did not wait.
        if let Frames::Answered(gate) = &self.frames
            && lock(gate).closed
        {
            self.shared.end();
        }
        result
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
    /// GPU and a network on tract end it first. The `process` that waits for it then gives an error.
    pub fn reset(&self) {
        match &self.frames {
            Frames::Answered(gate) => lock(gate).reset(),
            Frames::Live(live) => live.change(Queue::reset),
        }
    }

    /// Takes no frames until [`Self::resume`]. A live session drops what waits, ends what is in flight, and drops what
    /// is submitted; the others refuse to process.
    pub fn pause(&self) {
        match &self.frames {
            Frames::Answered(gate) => lock(gate).paused = true,
            Frames::Live(live) => live.change(Queue::pause),
        }
    }

    /// Takes frames again.
    pub fn resume(&self) {
        match &self.frames {
            Frames::Answered(gate) => lock(gate).paused = false,
            Frames::Live(live) => live.change(|queue| {
                queue.resume();
                None
            }),
        }
    }

    /// Takes no more frames and gives the memory back; the statistics stay. A frame that is being computed is given up,
    /// as by [`Self::reset`]. A live session drops what waits or is in flight; when this returns, its listener has
    /// heard everything, [`Event::Closed`](super::Event::Closed) last, and will not be called again. Called by a
    /// listener, of this session or another, or by a handler of logs while a session computes, it does not wait for
    /// that. Results that were handed out stay valid. Dropping a session closes it.
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

    /// Says how hot the device is; an adaptive session follows it from the next frame on.
    pub fn set_thermal(&self, thermal: Thermal) {
        lock(&self.shared.control).thermal = thermal;
    }

    /// Allows or forbids changes of the quality level, from the next frame on.
    ///
    /// # Errors
    /// A quality level that the session does not have.
    pub fn set_quality(&self, quality: Quality) -> Result<()> {
        let mut control = lock(&self.shared.control);
        quality.check(control.quality_levels)?;
        control.quality = quality;
        Ok(())
    }

    /// The GPU that frames are computed on, if it is one; waits for a frame that is being processed, and gives none to
    /// a handler of logs while a session computes. Its [`phasefront_gpu::Device::programs`], kept for [`GpuOptions`] of
    /// the next start, save compiling.
    #[cfg(feature = "gpu")]
    #[doc(hidden)]
    pub fn gpu(&self) -> Option<Arc<phasefront_gpu::Device>> {
        let gpu = self.with_stages(|stages| Ok(stages.as_ref().and_then(Stages::gpu)));
        gpu.ok().flatten()
    }

    /// What the session has done so far. Never waits for a frame.
    pub fn statistics(&self) -> Statistics {
        let counts = match &self.frames {
            Frames::Answered(gate) => lock(gate).counts,
            Frames::Live(live) => live.look(|queue| queue.gate.counts),
        };
        lock(&self.shared.recent).statistics(counts)
    }
}

impl Debug for SessionHandle {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SessionHandle")
            .field("statistics", &self.statistics())
            .finish_non_exhaustive()
    }
}
