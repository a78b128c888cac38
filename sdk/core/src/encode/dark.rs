//! The dark: where the amplitude is low the phase of a field is noise, and double phase shows it under full light, as
//! coloured speckle. So the field is drawn to the real axis there, on a straight line:
//!
//!   u' = w·u + (1 − w)·|u|,  w = min(1, |u| / (dark · scale)).
//!
//! Its mean phase being removed before, the real axis is the phase that the bright parts have.

use num_complex::Complex32;

/// How a row is drawn to the real axis. 0 leaves it as it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dark {
    /// 1 over the amplitude from which on nothing is changed.
    per_amplitude: f32,
}

impl Dark {
    /// For amplitudes below the share `dark` of `scale`. None where nothing is to be done.
    pub(super) fn new(dark: f32, scale: f32) -> Option<Self> {
        (dark > 0.0 && scale > 0.0).then(|| Dark {
            per_amplitude: 1.0 / (dark * scale),
        })
    }

    /// `row` drawn to the real axis, into `to`.
    #[inline(always)]
    pub(super) fn draw(self, row: &[Complex32], to: &mut [Complex32]) {
        for (u, to) in row.iter().zip(to) {
            let amplitude = (u.re * u.re + u.im * u.im).sqrt();
            let weight = (amplitude * self.per_amplitude).min(1.0);
            to.re = weight * u.re + (1.0 - weight) * amplitude;
            to.im = weight * u.im;
        }
    }
}
