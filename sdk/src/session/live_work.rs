//! Processes the frames of a live session and converts the results to events.

use super::computing::Computing;
use super::event::Event;
use super::guarded::lock;
use super::live::{Report, Work};
use super::owned_frame::OwnedFrame;
use super::quality::QualityChange;
use super::queue;
use super::shared::Shared;
use super::stages::FrameResult;
use super::threads::block_on;
use phasefront_core::frame::Past;
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::error::Result;
use std::sync::Arc;

/// The work of a live session's thread.
pub(super) struct LiveWork(pub(super) Arc<Shared>);

impl Work for LiveWork {
    type Frame = OwnedFrame;
    type Output = FrameResult;

    fn process(&mut self, frame: &OwnedFrame, past: Option<Past>) -> Result<FrameResult> {
        let _computing = Computing::begin();
        let mut stages = lock(&self.0.stages);
        let stages = stages.as_mut().ok_or_else(queue::closed)?;
        block_on(self.0.process(stages, &frame.frame()?, past))
    }

    fn scale(result: &FrameResult) -> f32 {
        result.hologram.scale
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

/// Passes the events of a report to `listener`.
pub(super) fn tell(shared: &Shared, listener: &mut dyn FnMut(Event), report: Report<FrameResult>) {
    match report {
        Report::Done { timestamp_ns, output } => {
            listener(Event::Processed(output.hologram));
            if let Some(change) = output.change {
                let QualityChange { from, to, reason } = change;
                listener(Event::QualityChanged {
                    timestamp_ns,
                    from,
                    to,
                    reason,
                });
            }
        }
        Report::Dropped { timestamp_ns, reason } => listener(Event::Dropped { timestamp_ns, reason }),
        Report::Failed { timestamp_ns, error } => listener(Event::Failed { timestamp_ns, error }),
        Report::ListenerPanicked => lock(&shared.recent).listener_panics += 1,
        Report::Closed => listener(Event::Closed),
    }
}
