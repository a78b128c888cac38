//! Tracks the amplitude that full light represents, from frame to frame.
//!
//! The brightness of a hologram varies with 1/scale. If the scale were the largest amplitude of each frame, a single
//! noisy pixel would make the whole picture flicker.

use phasefront_core::encode::brightness::Past;
use std::time::Duration;

/// The time in which the scale covers 63 % of the distance to its target.
const TIME_CONSTANT: Duration = Duration::from_secs(1);

/// The scale of a sequence of frames.
#[derive(Debug, Default)]
pub(in crate::session) struct BrightnessTracker {
    current: Option<f32>,
}

impl BrightnessTracker {
    /// Returns the past for the scale of a frame that follows the last one after `elapsed`.
    pub(in crate::session) fn past(&self, elapsed: Option<Duration>) -> Option<Past> {
        let (scale, elapsed) = self.current.zip(elapsed)?;
        let share = 1.0 - (-elapsed.as_secs_f32() / TIME_CONSTANT.as_secs_f32()).exp();
        Some(Past { scale, share })
    }

    /// Records the scale of a frame.
    pub(in crate::session) fn set_scale(&mut self, scale: f32) {
        self.current = Some(scale);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;
    use phasefront_core::encode::brightness::{Brightness, LEAST, MOST, Percentile, STEP};

    fn field(level: f32, spikes: usize) -> Vec<Complex32> {
        (0..34_000)
            .map(|i| {
                if i / STEP < spikes && i % STEP == 0 {
                    Complex32::new(0.0, -3.0)
                } else {
                    Complex32::from_polar(level * (i % 100) as f32 / 99.0, i as f32)
                }
            })
            .collect()
    }

    fn scale(tracker: &mut BrightnessTracker, field: &[Complex32], elapsed: Option<u64>) -> f32 {
        let past = tracker.past(elapsed.map(Duration::from_millis));
        let scale = Brightness::Smoothed.scale(field, past, &mut Percentile::default());
        tracker.set_scale(scale.unwrap_or(f32::NAN));
        scale.unwrap_or(f32::NAN)
    }

    #[test]
    fn a_few_bright_pixels_do_not_count() {
        let mut tracker = BrightnessTracker::default();
        for (spikes, expected) in [(0, 0.8), (2, 0.8), (3, 3.0)] {
            let scale = scale(&mut tracker, &field(0.8, spikes), None);
            assert!((scale - expected).abs() < 0.01, "{spikes}: {scale}");
        }
        assert!((scale(&mut tracker, &field(9.0, 0), None) - MOST).abs() < 0.01);
        assert!((scale(&mut tracker, &field(0.0, 0), None) - LEAST).abs() < 0.01);
    }

    #[test]
    fn the_scale_moves_slowly_in_time_and_not_at_all_where_fixed() {
        let mut tracker = BrightnessTracker::default();
        let start = scale(&mut tracker, &field(0.5, 0), None);
        let next = scale(&mut tracker, &field(1.0, 0), Some(33));
        assert!(next > start && next < start * 1.05);
        let later = scale(&mut tracker, &field(1.0, 0), Some(10_000));
        assert!((later - 1.0).abs() < 0.01);
        let fixed = Brightness::Fixed(0.7).scale(&field(1.0, 0), None, &mut Percentile::default());
        assert_eq!(fixed, Some(0.7));
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(Brightness::Fixed(bad).check().is_err());
        }
    }
}
