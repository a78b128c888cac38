//! The dark threshold. Where the amplitude is low, the phase of a field is noise, and double phase displays it at full
//! light as coloured speckle. Below the threshold the field moves to the real axis along a straight line:
//!
//!   u' = w·u + (1 − w)·|u|,  w = min(1, |u| / (threshold · scale)).
//!
//! The mean phase is removed beforehand, so the real axis is the phase of the bright parts.

use crate::Bounds;
use num_complex::Complex32;

/// Moves the dark values of rows to the real axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct DarkThreshold {
    /// The reciprocal of the amplitude above which values stay unchanged.
    per_amplitude: f32,
}

impl DarkThreshold {
    /// Creates the step for amplitudes below the share `threshold` of `scale`. Returns `None` if it would change
    /// nothing.
    pub(super) fn new(threshold: f32, scale: f32) -> Option<Self> {
        (threshold > 0.0 && scale > 0.0).then(|| DarkThreshold {
            per_amplitude: 1.0 / (threshold * scale),
        })
    }

    /// Writes `row` with its dark values moved to the real axis into `to`.
    #[inline(always)]
    pub(super) fn draw(self, row: &[Complex32], to: &mut [Complex32]) {
        for (u, to) in row.iter().zip(to) {
            let amplitude = (u.re * u.re + u.im * u.im).sqrt();
            let weight = (amplitude * self.per_amplitude).at_most(1.0);
            to.re = weight * u.re + (1.0 - weight) * amplitude;
            to.im = weight * u.im;
        }
    }
}
