//! Which amplitude full light stands for, from frame to frame.
//!
//! The brightness of a hologram goes with 1/scale. Were the scale each frame's largest amplitude, a single pixel of noise
//! would make the whole picture flicker.

use crate::encode::Scale;
use crate::error::{Error, Result};
use num_complex::Complex32;
use std::time::Duration;

/// How the scale of a frame is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Brightness {
    /// The amplitude that all but one of a thousand stay under, smoothed over a second. What is brighter is clipped.
    #[default]
    Steady,
    /// This one, always. What is brighter is clipped.
    Fixed(f32),
    /// Each frame's own largest amplitude: nothing is clipped, and video flickers.
    FrameMax,
}

impl Brightness {
    /// # Errors
    /// A fixed scale that is not positive.
    pub fn check(self) -> Result<()> {
        match self {
            Brightness::Fixed(scale) if !(scale > 0.0 && scale.is_finite()) => Err(Error::Plan(
                format!("a scale of {scale} cannot stand for full light; it must be above 0"),
            )),
            _ => Ok(()),
        }
    }
}

/// Time in which the scale goes 63 % of the way to where it should be.
const TIME_CONSTANT: Duration = Duration::from_secs(1);
/// The share of amplitudes that are clipped.
const CLIPPED: f64 = 1e-3;
/// Of so many values one is looked at. Odd, so that both colours of a checkerboard are.
const STEP: usize = 17;
/// Bins of the histogram, over amplitudes up to [`MOST`].
const BINS: usize = 2048;
/// What is brighter counts as this.
const MOST: f32 = 4.0;
/// A picture darker than this is shown as dark, not made bright.
const LEAST: f32 = 0.05;

/// The scale of a sequence of frames.
#[derive(Debug)]
pub(super) struct BrightnessTracker {
    brightness: Brightness,
    current: Option<f32>,
    histogram: Vec<u32>,
}

impl BrightnessTracker {
    pub(super) fn new(brightness: Brightness) -> Self {
        BrightnessTracker {
            brightness,
            current: None,
            histogram: vec![0; BINS],
        }
    }

    /// The scale for `field`, which follows the last one after `elapsed`, None where it has no past.
    pub(super) fn next(&mut self, field: &[Complex32], elapsed: Option<Duration>) -> Scale {
        match self.brightness {
            Brightness::FrameMax => Scale::Max,
            Brightness::Fixed(scale) => Scale::Fixed(scale),
            Brightness::Steady => {
                let now = self.percentile(field).max(LEAST);
                let next = match (self.current, elapsed) {
                    (Some(before), Some(elapsed)) => {
                        let share =
                            1.0 - (-elapsed.as_secs_f32() / TIME_CONSTANT.as_secs_f32()).exp();
                        before + share * (now - before)
                    }
                    _ => now,
                };
                self.current = Some(next);
                Scale::Fixed(next)
            }
        }
    }

    /// The amplitude that all but [`CLIPPED`] of `field` stay under, to a bin.
    fn percentile(&mut self, field: &[Complex32]) -> f32 {
        self.histogram.fill(0);
        let looked_at = field.iter().step_by(STEP);
        let count = looked_at.len();
        for value in looked_at {
            let bin = value.norm() * (BINS as f32 / MOST);
            self.histogram[(bin as usize).min(BINS - 1)] += 1;
        }
        let mut over = (count as f64 * CLIPPED) as u32;
        let last = (self.histogram.iter().rposition(|n| {
            let is = *n > over;
            over = over.saturating_sub(*n);
            is
        }))
        .unwrap_or(0);
        (last + 1) as f32 * (MOST / BINS as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(level: f32, spikes: usize) -> Vec<Complex32> {
        (0..34_000)
            .map(|i| match i / STEP < spikes && i % STEP == 0 {
                true => Complex32::new(0.0, -3.0),
                false => Complex32::from_polar(level * (i % 100) as f32 / 99.0, i as f32),
            })
            .collect()
    }

    fn scale(tracker: &mut BrightnessTracker, field: &[Complex32], elapsed: Option<u64>) -> f32 {
        match tracker.next(field, elapsed.map(Duration::from_millis)) {
            Scale::Fixed(scale) => scale,
            Scale::Max => f32::NAN,
        }
    }

    #[test]
    fn a_few_bright_pixels_do_not_count() {
        let mut tracker = BrightnessTracker::new(Brightness::Steady);
        for (spikes, expected) in [(0, 0.8), (2, 0.8), (3, 3.0)] {
            let scale = scale(&mut tracker, &field(0.8, spikes), None);
            assert!((scale - expected).abs() < 0.01, "{spikes}: {scale}");
        }
        assert!((scale(&mut tracker, &field(9.0, 0), None) - MOST).abs() < 0.01);
        assert!((scale(&mut tracker, &field(0.0, 0), None) - LEAST).abs() < 0.01);
    }

    #[test]
    fn the_scale_moves_slowly_in_time_and_not_at_all_where_fixed() {
        let mut tracker = BrightnessTracker::new(Brightness::Steady);
        let start = scale(&mut tracker, &field(0.5, 0), None);
        let next = scale(&mut tracker, &field(1.0, 0), Some(33));
        assert!(next > start && next < start * 1.05);
        let later = scale(&mut tracker, &field(1.0, 0), Some(10_000));
        assert!((later - 1.0).abs() < 0.01);
        let mut fixed = BrightnessTracker::new(Brightness::Fixed(0.7));
        assert_eq!(scale(&mut fixed, &field(1.0, 0), Some(33)), 0.7);
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(Brightness::Fixed(bad).check().is_err());
        }
    }
}
