//! Which amplitude full light stands for, and how bright a field is without its brightest points. How a scale moves
//! from frame to frame is a session's.

use crate::runtime::error::{Error, Result};
use num_complex::Complex32;

/// How the scale of a frame is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Brightness {
    /// The amplitude that all but one of a thousand stay under, in a session smoothed over a second. What is brighter
    /// is clipped.
    #[default]
    Smoothed,
    /// This one, always. What is brighter is clipped.
    Fixed(f32),
    /// Each frame's own largest amplitude: nothing is clipped, and video flickers.
    FrameMax,
}

impl Brightness {
    /// # Errors
    /// A fixed scale that is not positive.
    #[doc(hidden)]
    pub fn check(self) -> Result<()> {
        match self {
            Brightness::Fixed(scale) if !(scale > 0.0 && scale.is_finite()) => Err(Error::Setting(format!(
                "a scale of {scale} cannot stand for full light; it must be above 0"
            ))),
            _ => Ok(()),
        }
    }

    /// The scale of `field`, which a smoothed one comes to from `past`; None for the field's largest amplitude.
    #[doc(hidden)]
    pub fn scale(self, field: &[Complex32], past: Option<Past>, percentile: &mut Percentile) -> Option<f32> {
        match self {
            Brightness::FrameMax => None,
            Brightness::Fixed(scale) => Some(scale),
            Brightness::Smoothed => Some(percentile.scale(field, past)),
        }
    }
}

/// Where a smoothed scale comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Past {
    /// The scale of the frame before.
    pub scale: f32,
    /// The share of the way from there to the frame's own percentile that it goes, 0 to 1.
    pub share: f32,
}

/// The share of amplitudes that are clipped.
pub const CLIPPED: f64 = 1e-3;
/// Of so many values one is looked at. Odd, so that both colours of a checkerboard are.
pub const STEP: usize = 17;
/// Bins of the histogram, over amplitudes up to [`MOST`].
pub const BINS: usize = 2048;
/// What is brighter counts as this.
pub const MOST: f32 = 4.0;
/// A picture darker than this is shown as dark, not made bright.
pub const LEAST: f32 = 0.05;

/// Values of a field of `len` that are looked at, and how many of them may be clipped.
pub fn looked_at(len: usize) -> (usize, u32) {
    let count = len.div_ceil(STEP);
    (count, (count as f64 * CLIPPED) as u32)
}

/// The amplitude that all but [`CLIPPED`] of a field stay under, to a bin, and [`LEAST`] at least.
#[derive(Debug)]
pub struct Percentile {
    histogram: Vec<u32>,
}

impl Default for Percentile {
    fn default() -> Self {
        Percentile {
            histogram: vec![0; BINS],
        }
    }
}

impl Percentile {
    /// That of `field`, moved to from `past`, where there is one. Allocates nothing.
    pub fn scale(&mut self, field: &[Complex32], past: Option<Past>) -> f32 {
        self.histogram.fill(0);
        for value in field.iter().step_by(STEP) {
            let bin = value.norm() * (BINS as f32 / MOST);
            self.histogram[(bin as usize).min(BINS - 1)] += 1;
        }
        let (_, mut over) = looked_at(field.len());
        let last = (self.histogram.iter().rposition(|n| {
            let is = *n > over;
            over = over.saturating_sub(*n);
            is
        }))
        .unwrap_or(0);
        let now = ((last + 1) as f32 * (MOST / BINS as f32)).max(LEAST);
        past.map_or(now, |past| past.scale + past.share * (now - past.scale))
    }
}
