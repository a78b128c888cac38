//! The amplitude that maps to full light, and the brightness of a field without its brightest points. A session
//! controls how the scale changes from frame to frame.

use crate::runtime::error::{Error, Result};
use num_complex::Complex32;

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
    #[doc(hidden)]
    pub fn check(self) -> Result<()> {
        match self {
            Brightness::Fixed(scale) if !(scale > 0.0 && scale.is_finite()) => Err(Error::Setting(format!(
                "a scale of {scale} cannot stand for full light; it must be above 0"
            ))),
            _ => Ok(()),
        }
    }

    /// Returns the scale of `field`, or `None` for the field's largest amplitude. A smoothed scale starts from `past`.
    #[doc(hidden)]
    pub fn scale(self, field: &[Complex32], past: Option<Past>, percentile: &mut Percentile) -> Option<f32> {
        match self {
            Brightness::FrameMax => None,
            Brightness::Fixed(scale) => Some(scale),
            Brightness::Smoothed => Some(percentile.scale(field, past)),
        }
    }
}

/// The starting point of a smoothed scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Past {
    /// The scale of the previous frame.
    pub scale: f32,
    /// The share, 0 to 1, by which the scale moves from the previous one toward the frame's own percentile.
    pub share: f32,
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
    /// Returns the percentile of `field`. If `past` is given, the result moves from the previous scale toward it.
    /// Allocates nothing.
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
