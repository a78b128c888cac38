//! What the times of a session's frames come to: `video` and `bench --session` report it.

use phasefront::session::FrameTimes;
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::Duration;

/// The time of the first frame, and the median and the 95th percentile of each stage of all frames, in milliseconds.
/// The stages have the names of [`FrameTimes::stages`]; `total` is the whole frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameStatistics {
    /// The number of frames.
    pub frames: usize,
    /// The time of the first frame.
    pub first_ms: f64,
    /// The medians.
    pub median_ms: BTreeMap<&'static str, f64>,
    /// The 95th percentiles.
    pub p95_ms: BTreeMap<&'static str, f64>,
}

impl FrameStatistics {
    /// Returns the statistics of `times`, or `None` if there are none.
    pub fn of(times: &[FrameTimes]) -> Option<Self> {
        let first = times.first()?;
        let percentile = |share: f64| {
            let of = |stage: &dyn Fn(&FrameTimes) -> Duration| {
                let mut stages: Vec<_> = times.iter().map(stage).collect();
                stages.sort_unstable();
                rounded_ms(stages[((stages.len() - 1) as f64 * share).round() as usize])
            };
            let names = first.stages().map(|(name, _)| name);
            let stages = (names.into_iter().enumerate()).map(|(i, name)| (name, of(&|times| times.stages()[i].1)));
            stages.chain([("total", of(&FrameTimes::total))]).collect()
        };
        Some(FrameStatistics {
            frames: times.len(),
            first_ms: rounded_ms(first.total()),
            median_ms: percentile(0.5),
            p95_ms: percentile(0.95),
        })
    }
}

/// Returns a time in milliseconds with two decimals.
pub fn rounded_ms(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e5).round() / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_times_of_frames_that_ran() {
        let times = |method_ms: u64| FrameTimes {
            colour: Duration::from_millis(1),
            method: Duration::from_millis(method_ms),
            ..FrameTimes::default()
        };
        assert_eq!(FrameStatistics::of(&[]), None);
        let of = |times: &[FrameTimes]| FrameStatistics::of(times).expect("frames");
        let one = of(&[times(7)]);
        assert_eq!((one.frames, one.first_ms), (1, 8.0));
        assert_eq!((one.median_ms["method"], one.p95_ms["total"]), (7.0, 8.0));
        let many: Vec<_> = (0..=100).rev().map(times).collect();
        let many = of(&many);
        assert_eq!((many.frames, many.first_ms), (101, 101.0));
        assert_eq!((many.median_ms["method"], many.p95_ms["method"]), (50.0, 95.0));
        assert_eq!((many.median_ms["total"], many.p95_ms["colour"]), (51.0, 1.0));
    }
}
