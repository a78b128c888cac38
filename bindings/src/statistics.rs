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
    pub superseded: i64,
    /// Frames that arrived sooner than the target rate allows.
    pub above_target_rate: i64,
    /// Frames that arrived while the session was paused.
    pub paused: i64,
    /// Frames that were not finished when the session was reset.
    pub reset: i64,
    /// Frames that were not finished when the session was closed.
    pub closed: i64,
    /// The sum of all reasons.
    pub total: i64,
}

/// The statistics of a session at one moment. Each submitted frame is either processed, failed, refused, dropped or
/// pending.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct Statistics {
    /// Frames that were submitted.
    pub submitted: i64,
    /// Frames that became holograms.
    pub processed: i64,
    /// Frames that could not be processed.
    pub failed: i64,
    /// Frames that were refused because they were late or the session was closed.
    pub refused: i64,
    /// Frames that were dropped.
    pub dropped: Drops,
    /// Frames that wait or are being processed.
    pub pending: i64,
    /// Holograms per second over the last 30.
    pub rate_hz: f64,
    /// The mean times of the stages over the last 30 holograms.
    pub times: FrameTimes,
    /// The backend that computes the frames.
    pub backend: String,
    /// The reason for using this backend.
    pub backend_why: String,
    /// The quality level; 0 is the best.
    pub quality_level: usize,
    /// The number of errors that the listener threw.
    pub listener_failures: i64,
}

impl Statistics {
    pub(crate) fn new(core: session::Statistics, listener_failures: u64) -> Self {
        let dropped = core.dropped;
        Statistics {
            submitted: core.submitted as i64,
            processed: core.processed as i64,
            failed: core.failed as i64,
            refused: core.refused as i64,
            dropped: Drops {
                superseded: dropped.superseded as i64,
                above_target_rate: dropped.above_target_rate as i64,
                paused: dropped.paused as i64,
                reset: dropped.reset as i64,
                closed: dropped.closed as i64,
                total: dropped.total() as i64,
            },
            pending: core.pending as i64,
            rate_hz: core.rate_hz,
            times: core.times.into(),
            backend: core.backend.name,
            backend_why: core.backend.why,
            quality_level: core.quality_level,
            listener_failures: (core.listener_panics + listener_failures) as i64,
        }
    }
}
