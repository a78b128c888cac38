//! The amplitude that maps to full light, and the brightness of a field without its brightest points. A session
//! controls how the scale changes from frame to frame.

use crate::Bounds;
use crate::frame::Past;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use std::ops::Range;
use std::time::Duration;

/// The rule that chooses the scale of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Brightness {
    /// The 99.9th percentile of the amplitudes, smoothed over a second in a session. Brighter values are clipped.
    #[default]
    Smoothed,
    /// A constant scale. Brighter values are clipped.
    Fixed(f32),
    /// The largest amplitude of each frame. Nothing is clipped, but video flickers.
    FrameMax,
}

impl Brightness {
    /// Checks a fixed scale.
    ///
    /// # Errors
    /// Returns an error if it is not positive.
    pub(crate) fn check(self) -> Result<()> {
        match self {
            Brightness::Fixed(scale) if !(scale > 0.0 && scale.is_finite()) => Err(Error::Setting(format!(
                "a scale of {scale} cannot stand for full light; it must be above 0"
            ))),
            _ => Ok(()),
        }
    }

    /// Returns the scale of `field`, or `None` for the field's largest amplitude. A smoothed scale starts from `past`.
    pub(crate) fn scale(self, field: &[Complex32], past: Option<Past>, percentile: &mut Percentile) -> Option<f32> {
        match self {
            Brightness::FrameMax => None,
            Brightness::Fixed(scale) => Some(scale),
            Brightness::Smoothed => Some(percentile.scale(field, past)),
        }
    }
}

/// The time in which a smoothed scale covers 63 % of the distance to its target.
const TIME_CONSTANT: Duration = Duration::from_secs(1);

/// Returns the share, 0 to 1, by which a smoothed scale moves from that of the `past` toward the frame's own
/// percentile.
pub fn share(past: Past) -> f32 {
    1.0 - (-past.elapsed.as_secs_f32() / TIME_CONSTANT.as_secs_f32()).exp()
}

/// Returns the scale that moves from that of the `past` toward the frame's own percentile.
pub(crate) fn smoothed(past: Past, now: f32) -> f32 {
    past.scale + share(past) * (now - past.scale)
}

/// The largest share by which a held scale may differ from the frame's own percentile.
const HELD: f32 = 0.02;

/// Works like the smoothed scale, but stays at that of the `past` if it is near enough, so that what stands still keeps
/// its levels.
pub(crate) fn held(past: Past, now: f32) -> f32 {
    match (past.scale - now).abs() <= HELD * now {
        true => past.scale,
        false => smoothed(past, now),
    }
}

/// The share of amplitudes that are clipped.
pub const CLIPPED: f64 = 1e-3;
/// The sampling step in values. It is odd so that both colours of a checkerboard are sampled.
pub const STEP: usize = 17;
/// The number of bins in the histogram of amplitudes up to [`MOST`].
pub const BINS: usize = 2048;
/// The largest amplitude of the histogram. Brighter values are counted in the last bin.
pub const MOST: f32 = 4.0;
/// The smallest scale. Darker images stay dark instead of being brightened.
pub const LEAST: f32 = 0.05;

/// Returns the number of sampled values in a field of `len` and how many of them may be clipped.
pub fn looked_at(len: usize) -> (usize, u32) {
    let count = len.div_ceil(STEP);
    (count, (count as f64 * CLIPPED) as u32)
}

/// A histogram that finds the amplitude that all but [`CLIPPED`] of a field's values stay below, to the nearest bin and
/// at least [`LEAST`].
#[derive(Debug)]
pub struct Percentile {
    /// The histograms of [`PARTS`] parts of the field, (PARTS, BINS).
    histograms: Vec<u32>,
    /// Their sum.
    all: Vec<u32>,
}

/// The number of parts of a field that are counted apart.
const PARTS: usize = 48;

impl Default for Percentile {
    fn default() -> Self {
        Percentile {
            histograms: vec![0; PARTS * BINS],
            all: vec![0; BINS],
        }
    }
}

impl Percentile {
    /// Returns the percentile of `field`. If `past` is given, the result moves from the previous scale toward it.
    /// Allocates nothing.
    pub fn scale(&mut self, field: &[Complex32], past: Option<Past>) -> f32 {
        let now = self.of(field.len(), |at| field[at], |_| true);
        past.map_or(now, |past| smoothed(past, now))
    }

    /// Returns the percentile of `len` values. Counts only ranges of values again of which `differs` says that they may
    /// differ from those of the last call.
    pub(crate) fn of(
        &mut self,
        len: usize,
        value: impl Fn(usize) -> Complex32 + Sync,
        differs: impl Fn(Range<usize>) -> bool + Sync,
    ) -> f32 {
        let (count, mut over) = looked_at(len);
        let part = (count.div_ceil(PARTS) * STEP).max(1);
        let values = |i: usize| (i * part).min(len)..((i + 1) * part).min(len);
        let histograms = self.histograms.par_chunks_exact_mut(BINS).enumerate();
        histograms
            .filter(|(i, _)| differs(values(*i)))
            .for_each(|(i, histogram)| {
                histogram.fill(0);
                for at in values(i).step_by(STEP) {
                    let bin = value(at).norm_sqr().sqrt() * (BINS as f32 / MOST);
                    histogram[(bin as usize).min(BINS - 1)] += 1;
                }
            });
        let histogram = &mut self.all;
        histogram.fill(0);
        for part in self.histograms.chunks_exact(BINS) {
            histogram.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        let last = (histogram.iter().rposition(|n| {
            let is = *n > over;
            over = over.saturating_sub(*n);
            is
        }))
        .unwrap_or(0);
        ((last + 1) as f32 * (MOST / BINS as f32)).at_least(LEAST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    fn scale(field: &[Complex32], past: Option<Past>) -> f32 {
        let scale = Brightness::Smoothed.scale(field, past, &mut Percentile::default());
        scale.unwrap_or(f32::NAN)
    }

    #[test]
    fn a_few_bright_pixels_do_not_count() {
        for (spikes, expected) in [(0, 0.8), (2, 0.8), (3, 3.0)] {
            let scale = scale(&field(0.8, spikes), None);
            assert!((scale - expected).abs() < 0.01, "{spikes}: {scale}");
        }
        assert!((scale(&field(9.0, 0), None) - MOST).abs() < 0.01);
        assert!((scale(&field(0.0, 0), None) - LEAST).abs() < 0.01);
    }

    #[test]
    fn what_does_not_differ_keeps_its_count() {
        let mut percentile = Percentile::default();
        let mut now = field(0.4, 0);
        percentile.of(now.len(), |at| now[at], |_| true);
        let bright = 20_000..20_900;
        now[bright.clone()].fill(Complex32::ONE);
        let differs = |values: Range<usize>| values.start < bright.end && bright.start < values.end;
        let kept = percentile.of(now.len(), |at| now[at], differs);
        let anew = Percentile::default().of(now.len(), |at| now[at], |_| true);
        assert_eq!(kept, anew);
        assert!(kept > 0.9, "{kept}");
        now[..5000].fill(Complex32::new(3.0, 0.0));
        assert_eq!(percentile.of(now.len(), |at| now[at], |_| false), anew);
    }

    #[test]
    fn a_held_scale_stays_near_the_percentile_and_follows_it_when_it_is_far() {
        let past = |scale| Past {
            scale,
            elapsed: Duration::from_millis(33),
        };
        for scale in [0.5, 0.495, 0.509] {
            assert_eq!(held(past(scale), 0.5), scale);
        }
        let mut scale = 0.4;
        for _ in 0..200 {
            scale = held(past(scale), 0.5);
        }
        assert!((0.49..0.4904).contains(&scale), "{scale}");
    }

    #[test]
    fn the_scale_moves_slowly_in_time_and_not_at_all_where_fixed() {
        let after = |scale, ms| {
            Some(Past {
                scale,
                elapsed: Duration::from_millis(ms),
            })
        };
        let start = scale(&field(0.5, 0), None);
        let next = scale(&field(1.0, 0), after(start, 33));
        assert!(next > start && next < start * 1.05);
        let later = scale(&field(1.0, 0), after(next, 10_000));
        assert!((later - 1.0).abs() < 0.01);
        let fixed = Brightness::Fixed(0.7).scale(&field(1.0, 0), None, &mut Percentile::default());
        assert_eq!(fixed, Some(0.7));
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(Brightness::Fixed(bad).check().is_err());
        }
    }
}
