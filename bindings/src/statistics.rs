//! The statistics of a session.

use phasefront::session;
use std::time::Duration;

/// The time that each stage of a frame took, in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, uniffi::Record)]
pub struct FrameTimes {
    /// Rotating, converting and resizing the colour image.
    pub colour_ms: f64,
    /// Reading, aligning, temporally smoothing and refining the depth.
    pub depth_ms: f64,
    /// Computing the midpoint hologram from the frame.
    pub method_ms: f64,
    /// Propagating from the midpoint to the modulator.
    pub propagate_ms: f64,
    /// Encoding the field into levels.
    pub encode_ms: f64,
    /// The sum of all stages.
    pub total_ms: f64,
}

impl From<session::FrameTimes> for FrameTimes {
    fn from(times: session::FrameTimes) -> Self {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        FrameTimes {
            colour_ms: ms(times.colour),
            depth_ms: ms(times.depth),
            method_ms: ms(times.method),
            propagate_ms: ms(times.propagate),
            encode_ms: ms(times.encode),
            total_ms: ms(times.total()),
        }
    }
}

/// The number of dropped frames for each reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Record)]
pub struct Drops {
    /// Frames that waited when a newer frame arrived.
    pub superseded: u64,
    /// Frames that arrived sooner than the target rate allows.
    pub above_target_rate: u64,
    /// Frames that arrived while the session was paused.
    pub paused: u64,
    /// Frames that were not finished when the session was reset.
    pub reset: u64,
    /// Frames that were not finished when the session was closed.
    pub closed: u64,
    /// The sum of all reasons.
    pub total: u64,
}

/// The statistics of a session at one moment. Each submitted frame is either processed, failed, refused, dropped or
/// pending.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct Statistics {
    /// Frames that were submitted.
    pub submitted: u64,
    /// Frames that became holograms.
    pub processed: u64,
    /// Frames that could not be processed.
    pub failed: u64,
    /// Frames that were refused because they were late or the session was closed.
    pub refused: u64,
    /// Frames that were dropped.
    pub dropped: Drops,
    /// Frames that wait or are being processed.
    pub pending: u64,
    /// Holograms per second over the last 30.
    pub rate_hz: f64,
    /// The mean times of the stages over the last 30 holograms.
    pub times: FrameTimes,
    /// The backend that computes the frames.
    pub backend: String,
    /// The reason for using this backend.
    pub backend_why: String,
    /// The quality level; 0 is the best.
    pub quality_level: u32,
    /// The number of errors that the listener threw.
    pub listener_failures: u64,
}

impl Statistics {
    pub(crate) fn new(core: session::Statistics, listener_failures: u64) -> Self {
        let total = core.dropped.total();
        let session::Drops {
            superseded,
            above_target_rate,
            paused,
            reset,
            closed,
        } = core.dropped;
        Statistics {
            submitted: core.submitted,
            processed: core.processed,
            failed: core.failed,
            refused: core.refused,
            dropped: Drops {
                superseded,
                above_target_rate,
                paused,
                reset,
                closed,
                total,
            },
            pending: core.pending,
            rate_hz: core.rate_hz,
            times: core.times.into(),
            backend: core.backend.name,
            backend_why: core.backend.why,
            quality_level: core.quality_level as u32,
            listener_failures: core.listener_panics + listener_failures,
        }
    }
}
