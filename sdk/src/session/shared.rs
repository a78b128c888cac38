//! The state that a session's callers and its thread share.

use super::computing::{self, Computing};
use super::depth_estimates::DepthEstimates;
use super::guarded::lock;
use super::options::SessionOptions;
use super::process_id::ProcessId;
use super::quality::{Quality, Thermal};
use super::stages::{FrameResult, Stages};
use super::statistics::Recent;
use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::frame::Past;
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::clock::Instant;
use phasefront_core::runtime::error::Result;
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

/// The state that a session's callers and its thread share.
pub(super) struct Shared {
    pub(super) process: ProcessId,
    /// The stages; `None` after the session has ended and freed its memory.
    pub(super) stages: Mutex<Option<Stages>>,
    pub(super) control: Mutex<Control>,
    pub(super) recent: Mutex<Recent>,
    pub(super) cancel: Cancel,
}

/// The settings that a caller may change while a session runs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Control {
    /// The number of quality levels.
    pub(super) quality_levels: usize,
    pub(super) quality: Quality,
    pub(super) thermal: Thermal,
}

impl Shared {
    /// # Errors
    /// Returns an error if the options are invalid or cannot be planned for, or if threads cannot be started.
    pub(super) async fn new(options: SessionOptions, estimates: Option<DepthEstimates>) -> Result<Arc<Self>> {
        options.check()?;
        let control = Control {
            quality_levels: options.quality_levels.len(),
            quality: options.quality,
            thermal: Thermal::Nominal,
        };
        let cancel = Cancel::default();
        let mut stages = Stages::new(options, estimates, cancel.clone()).await?;
        let recent = Recent::new(stages.new_report().unwrap_or_default(), stages.quality_level());
        Ok(Arc::new(Shared {
            process: ProcessId::current(),
            stages: Mutex::new(Some(stages)),
            control: Mutex::new(control),
            recent: Mutex::new(recent),
            cancel,
        }))
    }

    pub(super) async fn process(
        &self,
        stages: &mut Stages,
        frame: &CameraFrame<'_>,
        past: Option<Past>,
    ) -> Result<FrameResult> {
        let Control { quality, thermal, .. } = *lock(&self.control);
        let made = stages.process(frame, past, thermal, quality).await?;
        let mut recent = lock(&self.recent);
        recent.push(Instant::now(), made.hologram.times());
        recent.quality_level = stages.quality_level();
        if let Some(backend) = stages.new_report() {
            recent.backend = backend;
        }
        Ok(made)
    }

    pub(super) fn recover(&self) {
        let _computing = Computing::begin();
        if let Some(stages) = &mut *lock(&self.stages) {
            stages.recover();
        }
    }

    /// Frees all memory except the statistics. Waits for a frame that is being processed, but not on a thread that
    /// computes: the thread that processes the frame calls this when the frame is done.
    pub(super) fn end(&self) {
        let stages = if computing::here() {
            match self.stages.try_lock() {
                Ok(mut stages) => stages.take(),
                Err(TryLockError::Poisoned(stages)) => PoisonError::into_inner(stages).take(),
                Err(TryLockError::WouldBlock) => None,
            }
        } else {
            lock(&self.stages).take()
        };
        // Drop outside the lock: log handlers may call this session again.
        drop(stages);
    }
}
