//! The range of metres between the near and the far end of the volume. It changes smoothly from frame to frame.

use crate::runtime::error::{Error, Result};
use std::time::Duration;

/// The method that determines near and far.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum DepthRange {
    /// The 1st and 99th percentile of the readings, smoothed over half a second in video.
    #[default]
    Percentiles,
    /// Fixed distances.
    Fixed {
        /// The distance at the near end of the volume, in metres.
        near_m: f32,
        /// The distance at the far end of the volume, in metres.
        far_m: f32,
    },
}

impl DepthRange {
    /// Checks the range.
    ///
    /// # Errors
    /// Returns an error if fixed distances are not a valid range.
    pub(crate) fn check(self) -> Result<()> {
        match self {
            DepthRange::Fixed { near_m, far_m } if !(near_m >= 0.0 && near_m < far_m && far_m.is_finite()) => {
                Err(Error::Setting(format!(
                    "near {near_m} m and far {far_m} m are no range; near must lie before far"
                )))
            }
            _ => Ok(()),
        }
    }
}

/// The time in which near and far move 63 % of the way to their new values.
const TIME_CONSTANT: Duration = Duration::from_millis(500);

/// Tracks near and far over a sequence of frames.
#[derive(Debug, Clone)]
pub struct RangeTracker {
    range: DepthRange,
    current: Option<(f32, f32)>,
    sorted: Vec<f32>,
}

impl RangeTracker {
    /// Creates a tracker without a history.
    pub fn new(range: DepthRange) -> Self {
        RangeTracker {
            range,
            current: None,
            sorted: Vec::new(),
        }
    }

    /// Clears the history.
    pub fn reset(&mut self) {
        self.current = None;
    }

    /// Returns near and far in metres for a frame with these readings, NaN for none, that follows the previous one
    /// after `elapsed`. Near equals far if all distances are equal.
    ///
    /// # Errors
    /// Returns an error if there is no reading.
    pub fn next(&mut self, metres: &[f32], elapsed: Duration) -> Result<(f32, f32)> {
        if let DepthRange::Fixed { near_m, far_m } = self.range {
            return Ok((near_m, far_m));
        }
        self.sorted.clear();
        self.sorted.extend(metres.iter().filter(|m| !m.is_nan()));
        let Some(last) = self.sorted.len().checked_sub(1) else {
            return Err(Error::Frame(
                "depth has no reading at all; at least one pixel must be valid".into(),
            ));
        };
        let mut percentile = |share: f64| {
            let i = (share * last as f64).round() as usize;
            *self.sorted.select_nth_unstable_by(i, f32::total_cmp).1
        };
        let now = (percentile(0.01), percentile(0.99));
        let next = match self.current {
            None => now,
            Some(before) => {
                let share = 1.0 - (-elapsed.as_secs_f32() / TIME_CONSTANT.as_secs_f32()).exp();
                let toward = |from: f32, to: f32| from + share * (to - from);
                (toward(before.0, now.0), toward(before.1, now.1))
            }
        };
        self.current = Some(next);
        Ok(next)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const FRAME: Duration = Duration::from_millis(33);

    #[test]
    fn near_and_far_are_percentiles_that_move_smoothly() {
        let metres = |from: f32| -> Vec<f32> {
            let ramp = (0..1001).map(|i| from + i as f32 / 1000.0);
            ramp.chain([f32::NAN, 1000.0]).collect()
        };
        let mut tracker = RangeTracker::new(DepthRange::Percentiles);
        let (near, far) = tracker.next(&metres(1.0), FRAME).unwrap();
        assert!((near - 1.01).abs() < 2e-3 && (far - 1.99).abs() < 2e-3);
        let mut last = near;
        for _ in 0..60 {
            let (near, _) = tracker.next(&metres(2.0), FRAME).unwrap();
            assert!(near > last && near - last < 0.07);
            last = near;
        }
        assert!((last - 2.01).abs() < 0.03);
        tracker.reset();
        assert!((tracker.next(&metres(1.0), FRAME).unwrap().0 - 1.01).abs() < 2e-3);
        assert!(tracker.next(&[f32::NAN], FRAME).is_err());
    }

    #[test]
    fn a_fixed_range_stays() {
        let fixed = DepthRange::Fixed {
            near_m: 0.5,
            far_m: 3.0,
        };
        assert!(fixed.check().is_ok());
        assert_eq!(RangeTracker::new(fixed).next(&[9.0], FRAME).unwrap(), (0.5, 3.0));
        for (near_m, far_m) in [(1.0, 1.0), (2.0, 1.0), (f32::NAN, 1.0), (0.0, f32::INFINITY)] {
            assert!(DepthRange::Fixed { near_m, far_m }.check().is_err());
        }
    }
}
