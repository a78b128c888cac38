//! AA-DPM's filter: a small Gaussian blur of the complex field, so that neighbours which the
//! checkerboard pairs are alike (Shi et al., Nature 591, 234, 2021).

use crate::error::{Error, Result};
use num_complex::Complex32;
use rayon::prelude::*;

/// A separable Gaussian of an odd number of taps, its sum 1; edges are repeated.
pub struct AntiAlias {
    /// The centre tap and those to one side.
    taps: Vec<f32>,
}

impl AntiAlias {
    /// # Errors
    /// A `sigma` that is not positive, or a `width` that is even or over 63.
    pub fn new(sigma: f32, width: usize) -> Result<Self> {
        if !(sigma > 0.0 && sigma.is_finite()) {
            return Err(Error::Plan(format!(
                "an anti-alias sigma of {sigma} px cannot blur; it must be above 0"
            )));
        }
        if width.is_multiple_of(2) || width > 63 {
            return Err(Error::Plan(format!(
                "an anti-alias width of {width} px has no centre or is too wide; it must be odd, up to 63"
            )));
        }
        let weight = |i: usize| (-0.5 * (i as f32 / sigma).powi(2)).exp();
        let half = width / 2;
        let sum: f32 = weight(0) + 2.0 * (1..=half).map(weight).sum::<f32>();
        Ok(AntiAlias {
            taps: (0..=half).map(|i| weight(i) / sum).collect(),
        })
    }

    /// Blurs `plane`, rows of `width` values, using `buffer` of the same length.
    pub fn filter(&self, plane: &mut [Complex32], width: usize, buffer: &mut [Complex32]) {
        let height = plane.len() / width;
        buffer
            .par_chunks_exact_mut(width)
            .zip(plane.par_chunks_exact(width))
            .for_each(|(out, row)| {
                for (x, value) in out.iter_mut().enumerate() {
                    *value = row[x] * self.taps[0];
                    for (i, tap) in self.taps.iter().enumerate().skip(1) {
                        let pair = row[x.saturating_sub(i)] + row[(x + i).min(width - 1)];
                        *value += pair * *tap;
                    }
                }
            });
        let rows: &[Complex32] = buffer;
        plane
            .par_chunks_exact_mut(width)
            .enumerate()
            .for_each(|(y, out)| {
                let row = |y: usize| &rows[y * width..][..width];
                for (value, centre) in out.iter_mut().zip(row(y)) {
                    *value = centre * self.taps[0];
                }
                for (i, tap) in self.taps.iter().enumerate().skip(1) {
                    let above = row(y.saturating_sub(i));
                    let below = row((y + i).min(height - 1));
                    for ((value, above), below) in out.iter_mut().zip(above).zip(below) {
                        *value += (above + below) * *tap;
                    }
                }
            });
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn agrees_with_the_direct_double_sum_edges_included() {
        let (h, w) = (5, 7);
        let plan = AntiAlias::new(0.7, 3).unwrap();
        let plane: Vec<_> = (0..h * w)
            .map(|i| Complex32::new((i as f32).sin(), (i as f32 * 2.0).cos()))
            .collect();
        let mut out = plane.clone();
        plan.filter(&mut out, w, &mut vec![Complex32::default(); h * w]);
        let weight = |i: i32| (-0.5 * (f64::from(i) / 0.7).powi(2)).exp();
        let sum: f64 = (-1..=1).map(weight).sum();
        for y in 0..h as i32 {
            for x in 0..w as i32 {
                let mut expected = Complex32::default();
                for dy in -1..=1 {
                    for dx in -1..=1 {
                        let yy = (y + dy).clamp(0, h as i32 - 1) as usize;
                        let xx = (x + dx).clamp(0, w as i32 - 1) as usize;
                        let k = weight(dx) * weight(dy) / (sum * sum);
                        expected += plane[yy * w + xx] * k as f32;
                    }
                }
                let got = out[y as usize * w + x as usize];
                assert!((got - expected).norm() < 1e-5, "{x},{y}");
            }
        }
    }

    #[test]
    fn unusable_parameters_are_refused() {
        assert!(AntiAlias::new(0.0, 3).is_err());
        assert!(AntiAlias::new(f32::NAN, 3).is_err());
        assert!(AntiAlias::new(0.7, 4).is_err());
    }
}
