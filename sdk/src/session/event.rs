//! What a live session tells its listener.

use super::hologram::Hologram;
use super::quality::QualityChange;
use phasefront_core::runtime::error::Error;

/// Why a frame was not made into a hologram, without fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DropReason {
    /// A newer frame came while it waited.
    Superseded,
    /// It came sooner than the target rate asks for.
    AboveTargetRate,
    /// The session was paused.
    Paused,
    /// The session was reset before it was done.
    Reset,
    /// The session was closed before it was done.
    Closed,
}

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
        /// From which quality level to which, and why.
        change: QualityChange,
    },
    /// The session is closed and its memory is given back. This is the last event, told exactly once, also where
    /// [`super::SessionHandle::close`] does not wait for it.
    Closed,
}
