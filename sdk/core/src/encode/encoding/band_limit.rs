//! The filter of BL-DPM (Sui et al., Opt. Express 29, 2597, 2021). It removes the frequencies that the checkerboard
//! would fold onto the image and keeps |tan(πfx)·tan(πfy)| ≤ k, with f in cycles per pixel.

use crate::Size;
use crate::optics::fft::{ConvolveScratch, Fft2};
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use std::f64::consts::PI;

/// A plan for one shape and bound.
pub struct BandLimit {
    fft: Fft2,
    k: f64,
}

/// Returns whether the frequency (`fx`, `fy`), in cycles per pixel, is within the bound `k`.
pub fn passes(fx: f64, fy: f64, k: f64) -> bool {
    // tan(π/2) is 1.6e16 in f64, so an axis at Nyquist passes if the other tangent is tan(0) = 0.
    ((PI * fx).tan() * (PI * fy).tan()).abs() <= k
}

impl BandLimit {
    /// Plans the filter for one size and the bound `k`.
    ///
    /// # Errors
    /// Returns an error if `k` is not positive.
    pub fn new(size: Size, k: f32) -> Result<Self> {
        if k.is_nan() || k <= 0.0 {
            return Err(Error::Setting(format!(
                "a band limit of {k} keeps only the axes; it must be above 0"
            )));
        }
        Ok(BandLimit {
            fft: Fft2::new(size, size),
            k: k.into(),
        })
    }

    /// Returns working memory for one call at a time.
    pub fn scratch(&self) -> ConvolveScratch {
        self.fft.convolve_scratch()
    }

    /// Returns the largest |ky| that is kept in column `kx` of the spectrum.
    fn bound(&self, kx: usize) -> f64 {
        let Size { width, height } = self.fft.padded_size();
        let tan_x = (PI * kx.min(width - kx) as f64 / width as f64).tan();
        // tan grows with the frequency, so the kept rows are those up to one angle.
        (self.k / tan_x).atan() * height as f64 / PI
    }

    /// Returns whether the spectrum's column `kx` and row `ky`, each at most half the size, is kept.
    pub fn keeps(&self, kx: usize, ky: usize) -> bool {
        ky as f64 <= self.bound(kx)
    }

    /// Filters `plane`, (H, W), with periodic boundaries.
    pub fn filter(&self, plane: &mut [Complex32], scratch: &mut ConvolveScratch) {
        let Size { width, height } = self.fft.padded_size();
        let scale = 1.0 / (height * width) as f32;
        self.fft.convolve(
            plane,
            |kx, column| {
                let bound = self.bound(kx);
                for (ky, value) in column.iter_mut().enumerate() {
                    let ky = ky.min(height - ky) as f64;
                    *value *= if ky <= bound { scale } else { 0.0 };
                }
            },
            scratch,
        );
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn keeps_just_the_frequencies_under_the_bound() {
        let (h, w) = (12, 9);
        let plan = BandLimit::new(Size { width: w, height: h }, 1.0).unwrap();
        let mut scratch = plan.scratch();
        for ky in 0..h {
            for kx in 0..w {
                let wave = |x: usize, y: usize| {
                    let turns = (kx * x) as f64 / w as f64 + (ky * y) as f64 / h as f64;
                    Complex32::from_polar(1.0, (2.0 * PI * turns.fract()) as f32)
                };
                let mut plane: Vec<_> = (0..h * w).map(|i| wave(i % w, i / w)).collect();
                plan.filter(&mut plane, &mut scratch);
                let signed = |k: usize, n: usize| {
                    if 2 * k <= n {
                        k as f64 / n as f64
                    } else {
                        (k as f64 - n as f64) / n as f64
                    }
                };
                let tangents = (PI * signed(kx, w)).tan() * (PI * signed(ky, h)).tan();
                if (tangents.abs() - 1.0).abs() < 1e-9 {
                    continue; // Exactly on the bound, either result is valid.
                }
                let energy: f32 = plane.iter().map(Complex32::norm_sqr).sum::<f32>();
                let kept = energy / (h * w) as f32 > 0.5;
                assert_eq!(kept, passes(signed(kx, w), signed(ky, h), 1.0), "{kx},{ky}");
            }
        }
    }
}
