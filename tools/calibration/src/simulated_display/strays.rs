//! Light beside the picture's: the zero order, a conjugate image and a ghost image.

use num_complex::{Complex32, Complex64};
use std::f64::consts::TAU;

/// Light beside the picture's, for each colour as its amplitude relative to what the panel modulates; none by default.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Strays {
    /// The zero order: light that the panel does not modulate.
    pub undiffracted: Vec<Complex64>,
    /// Light that the panel modulates with the opposite phase, which makes the conjugate image.
    pub conjugate: Vec<Complex64>,
    /// The light of a ghost image.
    pub ghost: Vec<Complex64>,
    /// How far the ghost image lies to the right and down, in pixels of the modulator.
    pub ghost_shift_px: [f64; 2],
    /// The longer way of the ghost image's light, in metres.
    pub ghost_path_m: f64,
}

impl Strays {
    fn of(amplitudes: &[Complex64], colour: usize) -> Complex64 {
        amplitudes.get(colour).copied().unwrap_or_default()
    }

    /// Returns what the panel shows of a pixel's phase.
    pub(super) fn modulated(&self, colour: usize, phase: f64) -> Complex64 {
        let modulated = Complex64::from_polar(1.0, phase);
        modulated + Self::of(&self.undiffracted, colour) + Self::of(&self.conjugate, colour) * modulated.conj()
    }

    /// Returns the factor of the ghost image at a frequency, in cycles per pixel.
    pub(super) fn ghost(&self, colour: usize, fx: f64, fy: f64, pitch_m: f64, wavelength_m: f64) -> Complex32 {
        let [x, y] = self.ghost_shift_px;
        let sine2 = (fx * fx + fy * fy) * (wavelength_m / pitch_m).powi(2);
        let path = self.ghost_path_m * ((1.0 - sine2).max(0.0).sqrt() - 1.0) / wavelength_m;
        let factor = 1.0 + Self::of(&self.ghost, colour) * Complex64::from_polar(1.0, TAU * (path - fx * x - fy * y));
        Complex32::new(factor.re as f32, factor.im as f32)
    }
}
