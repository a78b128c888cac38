//! A model of the sharpness of a spot as a function of its residual aberration, and its inversion.
//!
//! The light in the focus is the Fourier transform of the pupil, exp(i·terms) over ρ ≤ 1. Sharpness is ΣI² over (ΣI)².
//! One photograph alone does not determine the sign of an aberration. The photographs of a search differ by known
//! steps, including focus, so a single aberration must explain them all. [`explain`](Pupil::explain) finds it by the
//! Levenberg–Marquardt method, together with the scale of the sharpness, which depends on the camera's pixels and stray
//! light.

use crate::cholesky;
use ndarray::Array2;
use num_complex::Complex32;
use phasefront::Size;
use phasefront_core::optics::fft::{Fft2, Scratch};
use phasefront_core::optics::zernike::{self, Coefficients};
use rayon::prelude::*;

/// The number of samples across the pupil.
const PUPIL: usize = 28;
/// The number of samples across the plane of the transform. It is about twice as large, because I² has twice the
/// bandwidth of the light.
const PLANE: usize = 60;
/// The maximum number of steps of a descent.
const STEPS: usize = 15;
/// The number of terms of an aberration.
const TERMS: usize = 5;

/// One spot: the displayed terms in radians, and its sharpness in any unit.
pub type Spot = (Coefficients, f64);

/// The pupil and its transform.
pub struct Pupil {
    fft: Fft2,
    /// The samples within ρ ≤ 1: the index in the plane, and the value of each term with a coefficient of 1.
    inside: Vec<(usize, [f32; TERMS])>,
    /// The value of ΣI² without aberration.
    sharpest: f64,
}

/// An aberration that explains the measured spots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Explained {
    /// The terms that correct the aberration.
    pub correction: Coefficients,
    /// The RMS residual of the spots' sharpness, relative to their sharpness.
    pub residual: f64,
}

impl Default for Pupil {
    fn default() -> Self {
        Self::new()
    }
}

impl Pupil {
    /// Creates a round pupil.
    pub fn new() -> Self {
        let at = |i: usize| (2 * i + 1) as f64 / PUPIL as f64 - 1.0;
        let places = (0..PUPIL * PUPIL).map(|i| (i, at(i % PUPIL), at(i / PUPIL)));
        let inside = places
            .filter(|(_, x, y)| x * x + y * y <= 1.0)
            .map(|(i, x, y)| {
                let term = |j: usize| {
                    let mut a = [0.0; TERMS];
                    a[j] = 1.0;
                    zernike::terms(&a, x, y) as f32
                };
                (i, std::array::from_fn(term))
            })
            .collect();
        let mut pupil = Pupil {
            fft: Fft2::new(
                Size {
                    width: PUPIL,
                    height: PUPIL,
                },
                Size {
                    width: PLANE,
                    height: PLANE,
                },
            ),
            inside,
            sharpest: 1.0,
        };
        pupil.sharpest = pupil.sharpness(&[0.0; TERMS], &mut pupil.fft.scratch()).0;
        pupil
    }

    /// Returns the sharpness of the spot of a pupil with the terms `left`, which is 1 without any, and its derivative
    /// with respect to each term.
    fn sharpness(&self, left: &Coefficients, scratch: &mut Scratch) -> (f64, Coefficients) {
        let a = left.map(|a| a as f32);
        let mut plane = vec![Complex32::ZERO; PUPIL * PUPIL];
        for (at, terms) in &self.inside {
            let phase: f32 = a.iter().zip(terms).map(|(a, t)| a * t).sum();
            let (sin, cos) = phase.sin_cos();
            plane[*at] = Complex32::new(cos, sin);
        }
        let Scratch { rows, columns, work } = scratch;
        self.fft.rows_forward(&plane, rows, work);
        self.fft.spectrum(rows, columns, |_, _, _| {}, work);
        // ΣI² = Σ|F|⁴. The inverse transform of |F|²F gives its derivative with respect to each sample of the pupil.
        let mut sum = 0.0;
        for value in columns.iter_mut() {
            let light = value.norm_sqr();
            sum += f64::from(light) * f64::from(light);
            *value *= light;
        }
        self.fft.columns_inverse(columns, |_, _| {}, work);
        self.fft.rows_inverse(columns, rows, work);
        let mut slopes = [0.0; TERMS];
        for (at, terms) in &self.inside {
            let back = rows[at / PUPIL * PLANE + at % PUPIL];
            let turned = f64::from((plane[*at] * back.conj()).im);
            (slopes.iter_mut().zip(terms)).for_each(|(s, t)| *s -= 4.0 * f64::from(*t) * turned);
        }
        (sum / self.sharpest, slopes.map(|s| s / self.sharpest))
    }

    /// Returns the correction that explains `spots` best among the local optima found from `starts`. Returns `None` if
    /// no spot has light.
    pub fn explain(&self, spots: &[Spot], starts: &[Coefficients]) -> Option<Explained> {
        if spots.iter().all(|(_, sharp)| *sharp <= 0.0) {
            return None;
        }
        (starts.par_iter())
            .map(|start| self.descend(spots, *start))
            .min_by(|a, b| a.residual.total_cmp(&b.residual))
    }

    /// Returns the residual of each spot for `correction`, at the best scale, and its derivatives with respect to the
    /// terms, including the change of the scale.
    fn residuals(&self, spots: &[Spot], correction: &Coefficients, scratch: &mut Scratch) -> (Vec<f64>, Array2<f64>) {
        let mut models = Vec::with_capacity(spots.len());
        for (shown, _) in spots {
            let left = std::array::from_fn(|j| shown[j] - correction[j]);
            models.push(self.sharpness(&left, scratch));
        }
        let own: f64 = models.iter().map(|(model, _)| model * model).sum();
        let product = models.iter().zip(spots).map(|((m, _), (_, s))| m * s);
        let scale = product.sum::<f64>() / own;
        let left = (models.iter().zip(spots)).map(|((m, _), (_, s))| s - scale * m);
        let mut slopes = Array2::from_shape_fn((spots.len(), TERMS), |(i, j)| scale * models[i].1[j]);
        for mut column in slopes.columns_mut() {
            let along: f64 = column.iter().zip(&models).map(|(c, (m, _))| c * m).sum();
            for (c, (m, _)) in column.iter_mut().zip(&models) {
                *c -= along / own * m;
            }
        }
        (left.collect(), slopes)
    }

    fn descend(&self, spots: &[Spot], start: Coefficients) -> Explained {
        let scratch = &mut self.fft.scratch();
        let square = |left: &[f64]| left.iter().map(|r| r * r).sum::<f64>();
        let mut at = start;
        let (mut left, mut slopes) = self.residuals(spots, &at, scratch);
        let mut cost = square(&left);
        let mut damping = 1e-2;
        for _ in 0..STEPS {
            let mut gram = [[0.0; TERMS]; TERMS];
            let mut right = [0.0; TERMS];
            for (row, left) in slopes.rows().into_iter().zip(&left) {
                for i in 0..TERMS {
                    // The residual decreases with the correction as the model increases.
                    right[i] -= row[i] * left;
                    (gram[i].iter_mut().zip(row)).for_each(|(g, v)| *g += row[i] * v);
                }
            }
            let trace: f64 = (0..TERMS).map(|i| gram[i][i]).sum();
            for (i, row) in gram.iter_mut().enumerate() {
                row[i] += damping * (row[i] + 1e-3 * trace);
            }
            let mut step = right;
            cholesky::solve(&mut gram, &mut step, 1e-12);
            let next: Coefficients = std::array::from_fn(|j| at[j] + step[j].clamp(-1.0, 1.0));
            let (next_left, next_slopes) = self.residuals(spots, &next, scratch);
            let next_cost = square(&next_left);
            if next_cost < cost {
                let gained = cost - next_cost;
                (at, left, slopes, cost) = (next, next_left, next_slopes, next_cost);
                damping *= 0.2;
                if gained < 1e-5 * cost {
                    break;
                }
            } else {
                damping *= 5.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        let all: f64 = spots.iter().map(|(_, sharp)| sharp * sharp).sum();
        Explained {
            correction: at,
            residual: (cost / all).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::optics::spot::{Search, strehl};
    use phasefront_io::dice::Dice;

    fn some(dice: &mut Dice, most: f64) -> Coefficients {
        std::array::from_fn(|_| dice.range(-most, most))
    }

    /// Compares with direct sums in f64.
    #[test]
    fn sharpness_is_that_of_the_transform_and_slopes_are_its_own() {
        let pupil = Pupil::new();
        let mut scratch = pupil.fft.scratch();
        let direct = |a: &Coefficients| {
            let at = |i: usize| (2 * i + 1) as f64 / PUPIL as f64 - 1.0;
            let plane = Array2::from_shape_fn((PLANE, PLANE), |(i, j)| {
                let inside = i < PUPIL && j < PUPIL && at(i).powi(2) + at(j).powi(2) <= 1.0;
                if inside {
                    num_complex::Complex64::from_polar(1.0, zernike::terms(a, at(j), at(i)))
                } else {
                    num_complex::Complex64::ZERO
                }
            });
            let light = phasefront_core::optics::reference::dft(&plane, -1.0);
            light.iter().map(|v| v.norm_sqr().powi(2)).sum::<f64>()
        };
        let most = direct(&[0.0; TERMS]);
        let mut dice = Dice::new(2);
        for _ in 0..3 {
            let a = some(&mut dice, 1.5);
            let (ours, slopes) = pupil.sharpness(&a, &mut scratch);
            let naive = direct(&a) / most;
            assert!((ours - naive).abs() < 1e-5, "{ours} {naive}");
            for (j, slope) in slopes.iter().enumerate() {
                let beside = |d: f64| {
                    let mut a = a;
                    a[j] += d;
                    direct(&a) / most
                };
                let expected = (beside(1e-3) - beside(-1e-3)) / 2e-3;
                assert!((slope - expected).abs() < 1e-4, "{j}: {slope} {expected}");
            }
        }
    }

    /// One round of a search is enough, in any unit of sharpness, with 2 % of noise.
    #[test]
    fn eleven_spots_tell_the_aberration_and_its_sign() {
        let pupil = Pupil::new();
        let mut scratch = pupil.fft.scratch();
        let mut dice = Dice::new(6);
        for _ in 0..6 {
            let wanted = some(&mut dice, 1.2);
            let mut spots = Vec::new();
            for shown in Search::from([0.0; TERMS]).trials() {
                let left = std::array::from_fn(|j| shown[j] - wanted[j]);
                let noise = 1.0 + dice.range(-0.02, 0.02);
                spots.push((shown, 0.03 * noise * pupil.sharpness(&left, &mut scratch).0));
            }
            let mut starts = vec![[0.0; TERMS]];
            starts.extend((0..15).map(|_| some(&mut dice, 1.5)));
            let found = pupil.explain(&spots, &starts).unwrap();
            let left = std::array::from_fn(|j| wanted[j] - found.correction[j]);
            let strehl = strehl(&left);
            assert!(strehl > 0.95, "{wanted:?} {found:?}: {strehl}");
        }
        let dark = [([0.0; TERMS], 0.0)];
        assert_eq!(pupil.explain(&dark, &[[0.0; TERMS]]), None);
    }
}
