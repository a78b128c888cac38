//! What a live session tells its listener.

use super::drop_reason::DropReason;
use super::hologram::Hologram;
use super::quality::QualityReason;
use phasefront_core::runtime::error::Error;

/// One thing that happened in a live session. Events come one after another, on the session's own thread, in the
/// order in which things happened. While the listener is busy no frame is processed.
#[derive(Debug)]
#[non_exhaustive]
pub enum Event {
    /// A frame became a hologram.
    Processed(Hologram),
    /// A frame was dropped.
    Dropped {
        /// Its timestamp.
        timestamp_ns: u64,
        /// Why.
        reason: DropReason,
    },
    /// A frame could not be processed. The session goes on.
    Failed {
        /// Its timestamp.
        timestamp_ns: u64,
        /// What is wrong with it.
        error: Error,
    },
    /// The frames after this one are made at another quality level.
    QualityChanged {
        /// The timestamp of the frame.
        timestamp_ns: u64,
        /// The quality level before.
        from: usize,
        /// The quality level now; the one before where the step was [`QualityReason::Refused`].
        to: usize,
        /// Why.
        reason: QualityReason,
    },
    /// The session is closed and its memory is given back. This is the last event, told exactly once, also where
    /// [`super::SessionHandle::close`] does not wait for it.
    Closed,
}
