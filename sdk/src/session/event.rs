//! Events that a live session reports to its listener.

use super::drop_reason::DropReason;
use super::hologram::Hologram;
use super::quality::QualityReason;
use phasefront_core::runtime::error::Error;

/// Something that happened in a live session. Events arrive one after another, in the order in which they happened, on
/// the session's own thread. No frame is processed while the listener is busy.
#[derive(Debug)]
#[non_exhaustive]
#[allow(clippy::large_enum_variant, reason = "almost all events are holograms")]
pub enum Event {
    /// A frame became a hologram.
    Processed(Hologram),
    /// A frame was dropped.
    Dropped {
        /// The timestamp of the frame.
        timestamp_ns: u64,
        /// The reason.
        reason: DropReason,
    },
    /// A frame could not be processed. The session continues.
    Failed {
        /// The timestamp of the frame.
        timestamp_ns: u64,
        /// The error.
        error: Error,
    },
    /// The session uses another quality level from the next frame on.
    QualityChanged {
        /// The timestamp of the last frame before the change.
        timestamp_ns: u64,
        /// The previous quality level.
        from: usize,
        /// The new quality level; the previous one if the reason is [`QualityReason::Refused`].
        to: usize,
        /// The reason.
        reason: QualityReason,
    },
    /// The session is closed and its memory is freed. This is the last event, reported exactly once, even if
    /// [`super::SessionHandle::close`] does not wait for it.
    Closed,
}
