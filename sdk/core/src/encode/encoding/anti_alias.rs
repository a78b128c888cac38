//! The filter of AA-DPM: a small Gaussian blur of the complex field that makes the neighbours in a checkerboard pair
//! similar (Shi et al., Nature 591, 234, 2021).

use crate::parallel::{self, prelude::*};
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use phasefront_kernels::wide;

/// A separable Gaussian with an odd number of taps and sum 1. Edge values are repeated.
pub struct AntiAlias {
    /// The centre tap and the taps to one side.
    taps: Vec<f32>,
}

impl AntiAlias {
    /// Creates a Gaussian of standard deviation `sigma` in pixels with `width` taps.
    ///
    /// # Errors
    /// Returns an error if `sigma` is not positive, or if `width` is even or above 63.
    pub fn new(sigma: f32, width: usize) -> Result<Self> {
        if !(sigma > 0.0 && sigma.is_finite()) {
            return Err(Error::Setting(format!(
                "an anti-alias sigma of {sigma} px cannot blur; it must be above 0"
            )));
        }
        if width.is_multiple_of(2) || width > 63 {
            return Err(Error::Setting(format!(
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

    /// Returns the centre tap and the taps to one side.
    pub fn taps(&self) -> &[f32] {
        &self.taps
    }

    /// Returns working memory for rows of `width` values and one call at a time. Each part of a plane gets some rows.
    pub fn scratch(&self, width: usize) -> AntiAliasScratch {
        // The rows blurred along themselves, in a ring and behind a part's end, and one row blurred both ways.
        let rows = 3 * (self.taps.len() - 1) + 2;
        AntiAliasScratch {
            rows: vec![Complex32::ZERO; 2 * parallel::current_num_threads() * rows * width],
            part: rows * width,
        }
    }

    /// Returns the number of taps to one side of the centre.
    pub(in crate::encode) fn half(&self) -> usize {
        self.taps.len() - 1
    }

    /// Blurs `plane`, (H, W), in place. Allocates nothing.
    pub fn in_place(&self, plane: &mut [Complex32], width: usize, scratch: &mut AntiAliasScratch) {
        let height = plane.len() / width;
        let half = self.taps.len() - 1;
        let count = 2 * half + 1;
        let AntiAliasScratch { rows, part } = scratch;
        let band = height.div_ceil(rows.len() / *part);
        // Blurs the rows that parts read from their neighbours before any part writes.
        let before = &*plane;
        rows.par_chunks_exact_mut(*part)
            .zip(before.par_chunks(band * width))
            .enumerate()
            .for_each(|(part, (own, plane))| {
                let first = part * band;
                let end = first + plane.len() / width;
                let (ring, after) = own.split_at_mut(count * width);
                let row = |y: usize| &before[y * width..][..width];
                wide!({
                    for y in first.saturating_sub(half)..first {
                        self.blur_row(row(y), &mut ring[y % count * width..][..width]);
                    }
                    let behind = end..(end + half).min(height);
                    for (y, after) in behind.zip(after.chunks_exact_mut(width)) {
                        self.blur_row(row(y), after);
                    }
                });
            });
        plane
            .par_chunks_mut(band * width)
            .zip(rows.par_chunks_exact_mut(*part))
            .enumerate()
            .for_each(|(part, (plane, own))| {
                let first = part * band;
                let end = first + plane.len() / width;
                let (ring, rest) = own.split_at_mut(count * width);
                let (after, blurred) = rest.split_at_mut(half * width);
                let mut next = first;
                for y in first..end {
                    wide!({
                        while next <= (y + half).min(height - 1) {
                            let ring = &mut ring[next % count * width..][..width];
                            match next.checked_sub(end) {
                                None => self.blur_row(&plane[(next - first) * width..][..width], ring),
                                Some(i) => ring.copy_from_slice(&after[i * width..][..width]),
                            }
                            next += 1;
                        }
                        self.blur_down(ring, y, height, blurred);
                    });
                    plane[(y - first) * width..][..width].copy_from_slice(blurred);
                }
            });
    }

    /// Blurs row `y` of `height` along the columns, from a ring of rows that are already blurred along themselves.
    #[inline(always)]
    pub(in crate::encode) fn blur_down(&self, ring: &[Complex32], y: usize, height: usize, blurred: &mut [Complex32]) {
        let width = blurred.len();
        let count = ring.len() / width;
        let row = |y: usize| values(&ring[y % count * width..][..width]);
        // Loads the tap once, because after a store to the row the compiler would load it again in each iteration.
        let tap = self.taps[0];
        for (to, from) in values_mut(blurred).iter_mut().zip(row(y)) {
            *to = from * tap;
        }
        for (i, &tap) in self.taps.iter().enumerate().skip(1) {
            let (up, down) = (row(y.saturating_sub(i)), row((y + i).min(height - 1)));
            let sums = values_mut(blurred).iter_mut();
            for ((to, up), down) in sums.zip(up).zip(down) {
                *to += (up + down) * tap;
            }
        }
    }

    /// Blurs `plane`, (H, W), value by value. This is the bit-exact oracle for the faster versions.
    pub fn filter(&self, plane: &mut [Complex32], width: usize) {
        let height = plane.len() / width;
        // Returns the sum of the values `i` places before and after position `at`, on an axis of `count` values that
        // are `step` apart.
        let pair = |from: &[Complex32], at: usize, i: usize, count: usize, step: usize| {
            let place = at / step % count;
            let (before, after) = (place.saturating_sub(i), (place + i).min(count - 1));
            from[at - (place - before) * step] + from[at + (after - place) * step]
        };
        for (count, step) in [(width, 1), (height, width)] {
            let from = plane.to_vec();
            for (at, to) in plane.iter_mut().enumerate() {
                *to = from[at] * self.taps[0];
                for (i, tap) in self.taps.iter().enumerate().skip(1) {
                    *to += pair(&from, at, i, count, step) * *tap;
                }
            }
        }
    }

    /// Blurs `row` along itself into `out`.
    #[inline(always)]
    pub(in crate::encode) fn blur_row(&self, row: &[Complex32], out: &mut [Complex32]) {
        let (last, half) = (row.len() - 1, self.taps.len() - 1);
        let inner = half..row.len().saturating_sub(half).max(half);
        for x in (0..half.min(row.len())).chain(inner.end..row.len()) {
            out[x] = row[x] * self.taps[0];
            for (i, tap) in self.taps.iter().enumerate().skip(1) {
                out[x] += (row[x.saturating_sub(i)] + row[(x + i).min(last)]) * *tap;
            }
        }
        if inner.is_empty() {
            return;
        }
        let part = |from: usize| values(&row[from..][..inner.len()]);
        let out = values_mut(&mut out[inner.clone()]);
        let tap = self.taps[0];
        for (to, from) in out.iter_mut().zip(part(half)) {
            *to = from * tap;
        }
        for (i, &tap) in self.taps.iter().enumerate().skip(1) {
            let sums = out.iter_mut().zip(part(half - i)).zip(part(half + i));
            for ((to, left), right) in sums {
                *to += (left + right) * tap;
            }
        }
    }
}

/// Returns real and imaginary parts alternately.
#[inline(always)]
fn values(row: &[Complex32]) -> &[f32] {
    bytemuck::cast_slice(row)
}

#[inline(always)]
fn values_mut(row: &mut [Complex32]) -> &mut [f32] {
    bytemuck::cast_slice_mut(row)
}

/// The working memory of [`AntiAlias::in_place`].
pub struct AntiAliasScratch {
    rows: Vec<Complex32>,
    /// The number of values of a part.
    part: usize,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Size;

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
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| check(Size { width: w, height: h }, sigma, taps));
            }
        }
    }

    fn check(size: Size, sigma: f32, taps: usize) {
        let Size { width: w, height: h } = size;
        let plan = AntiAlias::new(sigma, taps).unwrap();
        let plane: Vec<_> = (0..h * w)
            .map(|i| Complex32::new((i as f32).sin(), (i as f32 * 2.0).cos()))
            .collect();
        let mut naive = plane.clone();
        plan.filter(&mut naive, w);
        let mut in_place = plane.clone();
        plan.in_place(&mut in_place, w, &mut plan.scratch(w));
        assert_eq!(in_place, naive);
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
                let got = naive[y as usize * w + x as usize];
                assert!((got - expected).norm() < 1e-5, "{h}×{w}, {taps} taps: {x},{y}");
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
