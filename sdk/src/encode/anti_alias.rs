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

    /// The centre tap and those to one side.
    #[cfg(feature = "gpu")]
    pub(crate) fn taps(&self) -> &[f32] {
        &self.taps
    }

    /// Working memory for rows of `width` values, one call at a time: some rows for each thread.
    pub fn scratch(&self, width: usize) -> AntiAliasScratch {
        let half = self.taps.len() - 1;
        let parts = 2 * rayon::current_num_threads();
        AntiAliasScratch {
            rows: vec![Complex32::ZERO; parts * (3 * half + 1) * width],
            parts,
        }
    }

    /// Blurs `plane`, rows of `width` values, in place.
    pub fn filter(&self, plane: &mut [Complex32], width: usize, scratch: &mut AntiAliasScratch) {
        let half = self.taps.len() - 1;
        let height = plane.len() / width;
        let band = height.div_ceil(scratch.parts);
        let own = (3 * half + 1) * width;
        plane
            .par_chunks_mut(band * width)
            .zip(scratch.rows.par_chunks_exact_mut(own))
            .for_each(|(band, own)| {
                let copy = &mut own[..width];
                for row in band.chunks_exact_mut(width) {
                    copy.copy_from_slice(row);
                    self.blur_row(copy, row);
                }
            });
        // Bands are blurred in place side by side, so each first keeps its neighbours' rows as they are now.
        for (part, own) in scratch.rows.chunks_exact_mut(own).enumerate() {
            let (start, end) = (part * band, ((part + 1) * band).min(height));
            if start >= height {
                break;
            }
            let (above, below) = own[..2 * half * width].split_at_mut(half * width);
            for (i, row) in above.chunks_exact_mut(width).enumerate() {
                let y = (start + i).saturating_sub(half);
                row.copy_from_slice(&plane[y * width..][..width]);
            }
            for (i, row) in below.chunks_exact_mut(width).enumerate() {
                let y = (end + i).min(height - 1);
                row.copy_from_slice(&plane[y * width..][..width]);
            }
        }
        plane
            .par_chunks_mut(band * width)
            .zip(scratch.rows.par_chunks_exact_mut(own))
            .for_each(|(band, own)| self.blur_columns(band, width, own));
    }

    /// The blur of `row` along itself into `out`.
    fn blur_row(&self, row: &[Complex32], out: &mut [Complex32]) {
        let last = row.len() - 1;
        for (x, value) in out.iter_mut().enumerate() {
            *value = row[x] * self.taps[0];
            for (i, tap) in self.taps.iter().enumerate().skip(1) {
                *value += (row[x.saturating_sub(i)] + row[(x + i).min(last)]) * *tap;
            }
        }
    }

    /// The blur of a band of rows across them, in place. `own` holds the rows above the band, those below
    /// it, and room: once a row is overwritten, it takes its place among the rows above.
    fn blur_columns(&self, band: &mut [Complex32], width: usize, own: &mut [Complex32]) {
        let half = self.taps.len() - 1;
        let rows = band.len() / width;
        let (above, rest) = own.split_at_mut(half * width);
        let (below, room) = rest.split_at_mut(half * width);
        let current = &mut room[..width];
        for y in 0..rows {
            let (done, ahead) = band.split_at_mut((y + 1) * width);
            let row = &mut done[y * width..];
            current.copy_from_slice(row);
            for value in row.iter_mut() {
                *value *= self.taps[0];
            }
            for (i, tap) in self.taps.iter().enumerate().skip(1) {
                // `above` is a ring: the row i above y is i − 1 places behind the one overwritten last.
                let up = &above[((y + half - i) % half) * width..][..width];
                let down = match y + i < rows {
                    true => &ahead[(i - 1) * width..][..width],
                    false => &below[(y + i - rows) * width..][..width],
                };
                for ((value, up), down) in row.iter_mut().zip(up).zip(down) {
                    *value += (up + down) * *tap;
                }
            }
            if half > 0 {
                above[(y % half) * width..][..width].copy_from_slice(current);
            }
        }
    }
}

/// Working memory of [`AntiAlias::filter`].
pub struct AntiAliasScratch {
    rows: Vec<Complex32>,
    parts: usize,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn agrees_with_the_direct_double_sum_edges_included() {
        for (h, w, sigma, taps) in [
            (5, 7, 0.7, 3),
            (1, 4, 0.7, 3),
            (23, 6, 1.5, 7),
            (3, 2, 2.0, 9),
            (4, 4, 1.0, 1),
        ] {
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .unwrap();
                pool.install(|| check(h, w, sigma, taps));
            }
        }
    }

    fn check(h: usize, w: usize, sigma: f32, taps: usize) {
        let plan = AntiAlias::new(sigma, taps).unwrap();
        let plane: Vec<_> = (0..h * w)
            .map(|i| Complex32::new((i as f32).sin(), (i as f32 * 2.0).cos()))
            .collect();
        let mut out = plane.clone();
        plan.filter(&mut out, w, &mut plan.scratch(w));
        let half = taps as i32 / 2;
        let weight = |i: i32| (-0.5 * (f64::from(i) / f64::from(sigma)).powi(2)).exp();
        let sum: f64 = (-half..=half).map(weight).sum();
        for y in 0..h as i32 {
            for x in 0..w as i32 {
                let mut expected = Complex32::default();
                for dy in -half..=half {
                    for dx in -half..=half {
                        let yy = (y + dy).clamp(0, h as i32 - 1) as usize;
                        let xx = (x + dx).clamp(0, w as i32 - 1) as usize;
                        let k = weight(dx) * weight(dy) / (sum * sum);
                        expected += plane[yy * w + xx] * k as f32;
                    }
                }
                let got = out[y as usize * w + x as usize];
                assert!(
                    (got - expected).norm() < 1e-5,
                    "{h}×{w}, {taps} taps: {x},{y}"
                );
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
