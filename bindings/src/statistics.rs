//! What a session has done so far.

use phasefront::session;
use std::time::Duration;

/// How long each stage of a frame took, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, uniffi::Record)]
pub struct FrameTimes {
    /// Colour to amplitudes of the display's resolution.
    pub colour_ms: f64,
    /// Depth to normalized depth of the display's resolution.
    pub depth_ms: f64,
    /// The midpoint hologram.
    pub method_ms: f64,
    /// From the midpoint to the modulator.
    pub propagate_ms: f64,
    /// From the field to levels.
    pub encode_ms: f64,
    /// All together.
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

/// Dropped frames by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Record)]
pub struct Drops {
    /// A newer frame came while they waited.
    pub superseded: u64,
    /// They came sooner than the target rate asks for.
    pub above_target_rate: u64,
    /// The session was paused.
    pub paused: u64,
    /// The session was reset before they were done.
    pub reset: u64,
    /// The session was closed before they were done.
    pub closed: u64,
    /// All together.
    pub total: u64,
}

/// What a session has done so far. Submitted frames are processed, failed, refused, dropped or pending.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct Statistics {
    /// Frames that were given to the session.
    pub submitted: u64,
    /// Frames that became holograms.
    pub processed: u64,
    /// Frames that could not be processed.
    pub failed: u64,
    /// Frames that came late.
    pub refused: u64,
    /// Frames that were dropped.
    pub dropped: Drops,
    /// Frames that wait or are in flight.
    pub pending: u64,
    /// Holograms a second, of late.
    pub rate_hz: f64,
    /// Mean times, of late.
    pub times: FrameTimes,
    /// What runs the network.
    pub backend: String,
    /// Why that.
    pub backend_why: String,
    /// The quality level, 0 the best.
    pub quality_level: u32,
    /// How often the listener threw.
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
