//! Statistics of a session: counts of frames and their times.

use super::drop_reason::DropReason;
use phasefront_core::pipeline::FrameTimes;
use phasefront_core::runtime::clock::Instant;
use std::collections::VecDeque;
use std::time::Duration;

/// The number of results over which rates and times are averaged.
const RECENT: usize = 30;

/// The number of dropped frames for each reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Drops {
    /// Frames dropped for [`DropReason::Superseded`].
    pub superseded: u64,
    /// Frames dropped for [`DropReason::AboveTargetRate`].
    pub above_target_rate: u64,
    /// Frames dropped for [`DropReason::Paused`].
    pub paused: u64,
    /// Frames dropped for [`DropReason::Reset`].
    pub reset: u64,
    /// Frames dropped for [`DropReason::Closed`].
    pub closed: u64,
}

impl Drops {
    /// Returns the number of dropped frames for all reasons.
    pub fn total(&self) -> u64 {
        self.superseded + self.above_target_rate + self.paused + self.reset + self.closed
    }

    pub(super) fn count(&mut self, reason: DropReason) {
        *match reason {
            DropReason::Superseded => &mut self.superseded,
            DropReason::AboveTargetRate => &mut self.above_target_rate,
            DropReason::Paused => &mut self.paused,
            DropReason::Reset => &mut self.reset,
            DropReason::Closed => &mut self.closed,
        } += 1;
    }
}

/// The number of frames for each outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Counts {
    pub(super) submitted: u64,
    pub(super) processed: u64,
    pub(super) failed: u64,
    pub(super) refused: u64,
    pub(super) dropped: Drops,
}

impl Counts {
    /// Returns the number of submitted frames without an outcome yet.
    pub(super) fn pending(&self) -> u64 {
        self.submitted - self.processed - self.failed - self.refused - self.dropped.total()
    }
}

/// The backend that computes the frames.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct BackendReport {
    /// The name: an instruction set, "tract", or a GPU's name.
    pub name: String,
    /// The reason for using this backend.
    pub why: String,
}

/// The statistics of a session at one moment. Every submitted frame is counted exactly once more: `submitted` =
/// `processed` + `failed` + `refused` + `dropped` + `pending`.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
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
    /// Holograms per second over the last 30; 0 before the second hologram.
    pub rate_hz: f64,
    /// The mean times of the stages over the last 30 holograms.
    pub times: FrameTimes,
    /// The backend that computes the frames.
    pub backend: BackendReport,
    /// The quality level; 0 is the best.
    pub quality_level: usize,
    /// The number of panics of the listener.
    pub listener_panics: u64,
}

/// The times of recent frames.
#[derive(Debug, Default)]
pub(super) struct Recent {
    frames: VecDeque<(Instant, FrameTimes)>,
    pub(super) backend: BackendReport,
    pub(super) quality_level: usize,
    pub(super) listener_panics: u64,
}

impl Recent {
    pub(super) fn new(backend: BackendReport, quality_level: usize) -> Self {
        Recent {
            backend,
            quality_level,
            ..Recent::default()
        }
    }

    pub(super) fn push(&mut self, done: Instant, times: FrameTimes) {
        if self.frames.len() == RECENT {
            self.frames.pop_front();
        }
        self.frames.push_back((done, times));
    }

    pub(super) fn statistics(&self, counts: Counts) -> Statistics {
        let count = self.frames.len() as u32;
        let mean = |stage: fn(&FrameTimes) -> Duration| {
            let sum: Duration = self.frames.iter().map(|(_, times)| stage(times)).sum();
            sum / count.max(1)
        };
        let rate_hz = match (self.frames.front(), self.frames.back()) {
            (Some(first), Some(last)) if count > 1 && last.0 > first.0 => {
                f64::from(count - 1) / (last.0 - first.0).as_secs_f64()
            }
            _ => 0.0,
        };
        Statistics {
            submitted: counts.submitted,
            processed: counts.processed,
            failed: counts.failed,
            refused: counts.refused,
            dropped: counts.dropped,
            pending: counts.pending(),
            rate_hz,
            times: FrameTimes {
                colour: mean(|t| t.colour),
                depth: mean(|t| t.depth),
                method: mean(|t| t.method),
                propagate: mean(|t| t.propagate),
                encode: mean(|t| t.encode),
            },
            backend: self.backend.clone(),
            quality_level: self.quality_level,
            listener_panics: self.listener_panics,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_and_times_are_of_recent_frames() {
        let mut recent = Recent::default();
        let start = Instant::now();
        assert_eq!(recent.statistics(Counts::default()).rate_hz, 0.0);
        for frame in 0..100 {
            let times = FrameTimes {
                method: Duration::from_millis(if frame < 70 { 1000 } else { 10 }),
                ..FrameTimes::default()
            };
            recent.push(start + Duration::from_millis(20 * frame), times);
        }
        let statistics = recent.statistics(Counts::default());
        assert!((statistics.rate_hz - 50.0).abs() < 1e-9);
        assert_eq!(statistics.times.method, Duration::from_millis(10));
        assert_eq!(statistics.times.total(), Duration::from_millis(10));
    }
}
