//! Short filters fitted to the transfer function of free space.
//!
//! Along one axis a distance s multiplies the frequency f by exp(−i2πsλf²/(1 + √(1 − λ²f²))), without the carrier as in
//! [`crate::optics::asm`]. The product of both axes differs from the true transfer function by a phase of πsλ³f²ₓf²ᵧ/2,
//! which is small for small diffraction angles. A symmetric filter is a polynomial in cos: H(f) = 1 + Σ cⱼ(2cos(2πjfp)
//! − 2). Its gain at f = 0 is 1 for any cⱼ.
//!
//! Because a step's filter is applied repeatedly, the powers of H must be near those of its target T. Levenberg and
//! Marquardt's method minimises Σ over f and several m of w(f)·|(H/T)ᵐ − 1|², for small powers first. w falls like the
//! spectra of images.

use num_complex::Complex64;
use std::f64::consts::PI;

/// The number of frequencies from 0 to the Nyquist frequency at which a step is fitted.
const SAMPLES: usize = 129;
/// The constant in the weight w(f) = 1/((2pf)² + WHITE).
const WHITE: f64 = 0.02;
/// The number of coefficients above which a fit that is applied once uses sums of cosines. With 1000 coefficients, this
/// takes a hundredth of the time.
const WIDE: usize = 128;
/// The largest number of iterations for one set of powers.
const ITERATIONS: usize = 60;

/// The coefficients c₁, c₂ … of a symmetric filter whose gain at frequency 0 is 1.
pub(super) type Coefficients = Vec<Complex64>;

/// Returns the transfer function along one axis over `distance_m`, at the fraction `f` of the Nyquist frequency, 0 to
/// 1.
pub(super) fn transfer(f: f64, distance_m: f64, wavelength_m: f64, pitch_m: f64) -> Complex64 {
    let f = f / (2.0 * pitch_m);
    let cosine = (1.0 - (wavelength_m * f).powi(2)).max(0.0).sqrt();
    let phase = -2.0 * PI * distance_m * wavelength_m * f * f / (1.0 + cosine);
    Complex64::from_polar(1.0, phase)
}

/// Returns the gain of a filter at the fraction `f` of the Nyquist frequency.
pub(super) fn gain(coefficients: &[Complex64], f: f64) -> Complex64 {
    (1..).zip(coefficients).map(|(j, c)| c * basis(j, f)).sum::<Complex64>() + 1.0
}

/// Returns the factor of coefficient j.
fn basis(j: usize, f: f64) -> f64 {
    2.0 * (PI * j as f64 * f).cos() - 2.0
}

/// Returns `samples` frequencies from 0 to 1 and the square roots of their weights. The weights sum to 1.
fn weights(samples: usize) -> Vec<(f64, f64)> {
    let f = |i: usize| i as f64 / (samples - 1) as f64;
    let weight = |f: f64| 1.0 / (f * f + WHITE);
    let total: f64 = (0..samples).map(|i| weight(f(i))).sum();
    (0..samples).map(|i| (f(i), (weight(f(i)) / total).sqrt())).collect()
}

/// Returns the deviation of the `power`th power of a filter from that of its target, √(Σ w(f)·|(H/T)ᵐ − 1|²). 0 is
/// perfect.
pub(super) fn error(coefficients: &[Complex64], target: impl Fn(f64) -> Complex64, power: usize) -> f64 {
    let squares = weights(SAMPLES).into_iter().map(|(f, weight)| {
        let ratio = gain(coefficients, f) * target(f).conj();
        (weight * (ratio.powu(power as u32) - 1.0)).norm_sqr()
    });
    squares.sum::<f64>().sqrt()
}

/// Returns the filter of `radius` coefficients that is nearest to `target` when applied once, by weighted least
/// squares.
pub(super) fn once(radius: usize, target: impl Fn(f64) -> Complex64) -> Coefficients {
    match radius > WIDE {
        true => once_wide(radius, target),
        false => once_narrow(radius, target),
    }
}

/// Computes [`once`] by sums of cosines. The products of two coefficients' bases, summed over all frequencies, are real
/// and depend only on the sum and difference of the coefficients' indices.
fn once_wide(radius: usize, target: impl Fn(f64) -> Complex64) -> Coefficients {
    let samples = SAMPLES.max(4 * radius + 1);
    let weights = weights(samples);
    // cos(πkf) of the kth cosine at the ith frequency, i/(samples − 1).
    let circle: Vec<f64> = (0..2 * (samples - 1))
        .map(|i| (PI * i as f64 / (samples - 1) as f64).cos())
        .collect();
    let cosine = |k: usize, i: usize| circle[k * i % circle.len()];
    let sums: Vec<f64> = (0..=2 * radius)
        .map(|k| (0..samples).map(|i| weights[i].1.powi(2) * cosine(k, i)).sum())
        .collect();
    let residuals: Vec<Complex64> = (weights.iter())
        .map(|(f, weight)| weight.powi(2) * (1.0 - target(*f)))
        .collect();
    let right = (1..=radius).map(|j| {
        let terms = residuals.iter().enumerate();
        -terms.map(|(i, r)| r * (2.0 * cosine(j, i) - 2.0)).sum::<Complex64>()
    });
    let mut matrix = vec![0.0; radius * radius];
    for i in 1..=radius {
        for j in 1..=i {
            let product = (sums[i + j] + sums[i - j]) / 2.0 - sums[i] - sums[j] + sums[0];
            matrix[(i - 1) * radius + j - 1] = 4.0 * product;
        }
        matrix[(i - 1) * radius + i - 1] += 1e-15;
    }
    solve(matrix, right.collect()).unwrap_or(vec![Complex64::ZERO; radius])
}

/// Returns the solution of a real, symmetric system, given by its lower triangle, by Cholesky's method. Returns `None`
/// if there is none.
fn solve(mut l: Vec<f64>, mut x: Vec<Complex64>) -> Option<Vec<Complex64>> {
    let n = x.len();
    for i in 0..n {
        let (above, row) = l.split_at_mut(i * n);
        for j in 0..=i {
            let known: f64 = match j < i {
                true => (above[j * n..][..j].iter().zip(&row[..j])).map(|(a, b)| a * b).sum(),
                false => row[..j].iter().map(|a| a * a).sum(),
            };
            let left = row[j] - known;
            row[j] = match j < i {
                true => left / above[j * n + j],
                false if left > 0.0 && left.is_finite() => left.sqrt(),
                false => return None,
            };
        }
        let known: Complex64 = (row[..i].iter().zip(&x)).map(|(a, x)| x * a).sum();
        x[i] = (x[i] - known) / row[i];
    }
    for i in (0..n).rev() {
        x[i] /= l[i * n + i];
        let solved = x[i];
        for (x, a) in x[..i].iter_mut().zip(&l[i * n..]) {
            *x -= solved * a;
        }
    }
    Some(x)
}

fn once_narrow(radius: usize, target: impl Fn(f64) -> Complex64) -> Coefficients {
    let samples = SAMPLES.max(4 * radius + 1);
    let mut normal = Normal::new(radius);
    let mut row = vec![Complex64::ZERO; radius];
    for (f, weight) in weights(samples) {
        for (j, value) in row.iter_mut().enumerate() {
            *value = (weight * basis(j + 1, f)).into();
        }
        normal.add(&row, weight * (1.0 - target(f)));
    }
    normal.step(1e-12).unwrap_or(vec![Complex64::ZERO; radius])
}

/// Returns the filter of `radius` coefficients whose powers up to `steps` stay nearest to those of `target`, |target| =
/// 1.
pub(super) fn powers(radius: usize, steps: usize, target: impl Fn(f64) -> Complex64) -> Coefficients {
    let samples: Vec<_> = (weights(SAMPLES).into_iter())
        .map(|(f, weight)| Sample {
            weight,
            target: target(f).conj(),
            basis: (1..=radius).map(|j| basis(j, f)).collect(),
        })
        .collect();
    let mut coefficients = once(radius, target);
    let mut power = 2;
    while power < steps {
        refine(&mut coefficients, &samples, &[1, power]);
        power *= 2;
    }
    let mut last = vec![1, steps / 4, steps / 2, steps];
    last.retain(|power| *power > 0);
    last.dedup();
    refine(&mut coefficients, &samples, &last);
    coefficients
}

struct Sample {
    weight: f64,
    /// The conjugate of the target.
    target: Complex64,
    basis: Vec<f64>,
}

impl Sample {
    /// Returns H/T.
    fn ratio(&self, coefficients: &[Complex64]) -> Complex64 {
        let gain: Complex64 = self.basis.iter().zip(coefficients).map(|(b, c)| c * b).sum();
        (gain + 1.0) * self.target
    }
}

fn cost(coefficients: &[Complex64], samples: &[Sample], powers: &[usize]) -> f64 {
    let squares = samples.iter().map(|sample| {
        let ratio = sample.ratio(coefficients);
        let each = powers
            .iter()
            .map(|&m| (sample.weight * (ratio.powu(m as u32) - 1.0)).norm_sqr());
        each.sum::<f64>()
    });
    squares.sum()
}

/// Refines `coefficients` by Levenberg and Marquardt's method, for all `powers` together.
fn refine(coefficients: &mut Coefficients, samples: &[Sample], powers: &[usize]) {
    let radius = coefficients.len();
    let mut least = cost(coefficients, samples, powers);
    let mut damping = 1e-3;
    let mut row = vec![Complex64::ZERO; radius];
    for _ in 0..ITERATIONS {
        let mut normal = Normal::new(radius);
        for sample in samples {
            let ratio = sample.ratio(coefficients);
            for &m in powers {
                let before = ratio.powu(m as u32 - 1);
                let slope = sample.weight * m as f64 * before * sample.target;
                for (value, basis) in row.iter_mut().zip(&sample.basis) {
                    *value = slope * basis;
                }
                normal.add(&row, sample.weight * (before * ratio - 1.0));
            }
        }
        loop {
            let Some(step) = normal.step(damping) else {
                return;
            };
            let tried: Coefficients = coefficients.iter().zip(&step).map(|(c, s)| c + s).collect();
            let reached = cost(&tried, samples, powers);
            if reached < least {
                let gained = least - reached;
                *coefficients = tried;
                least = reached;
                damping /= 5.0;
                if gained < 1e-6 * least {
                    return;
                }
                break;
            }
            damping *= 5.0;
            if damping > 1e6 {
                return;
            }
        }
    }
}

/// The normal equations of a complex least-squares problem: Aᴴ A x = −Aᴴ r.
struct Normal {
    size: usize,
    matrix: Vec<Complex64>,
    right: Vec<Complex64>,
}

impl Normal {
    fn new(size: usize) -> Self {
        Normal {
            size,
            matrix: vec![Complex64::ZERO; size * size],
            right: vec![Complex64::ZERO; size],
        }
    }

    /// Adds one equation: a row of A and its residual.
    fn add(&mut self, row: &[Complex64], residual: Complex64) {
        for (i, a) in row.iter().enumerate() {
            self.right[i] -= a.conj() * residual;
            // The lower triangle. The upper one is its conjugate.
            for (value, b) in self.matrix[i * self.size..].iter_mut().zip(&row[..=i]) {
                *value += a.conj() * b;
            }
        }
    }

    /// Returns the solution with the diagonal increased by the factor 1 + `damping`, by Cholesky's method. Returns
    /// `None` if there is none.
    fn step(&self, damping: f64) -> Option<Vec<Complex64>> {
        let n = self.size;
        let mut l = self.matrix.clone();
        for i in 0..n {
            l[i * n + i] *= 1.0 + damping;
            l[i * n + i] += 1e-15;
        }
        for i in 0..n {
            for j in 0..=i {
                let mut sum = l[i * n + j];
                for k in 0..j {
                    sum -= l[i * n + k] * l[j * n + k].conj();
                }
                if i == j {
                    if !(sum.re > 0.0 && sum.re.is_finite()) {
                        return None;
                    }
                    l[i * n + i] = sum.re.sqrt().into();
                } else {
                    l[i * n + j] = sum / l[j * n + j];
                }
            }
        }
        let mut x = self.right.clone();
        for i in 0..n {
            for k in 0..i {
                let known = x[k];
                x[i] -= l[i * n + k] * known;
            }
            x[i] /= l[i * n + i];
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                let known = x[k];
                x[i] -= l[k * n + i].conj() * known;
            }
            x[i] /= l[i * n + i];
        }
        Some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(distance_m: f64) -> impl Fn(f64) -> Complex64 {
        move |f| transfer(f, distance_m, 638e-9, 8e-6)
    }

    #[test]
    fn a_fitted_step_stays_near_its_target_where_least_squares_alone_drifts() {
        let step = target(6e-3 / 32.0);
        let fitted = powers(4, 32, &step);
        assert!(error(&fitted, &step, 1) < 0.02);
        assert!(error(&fitted, &step, 32) < 0.2);
        assert!(error(&once(4, &step), &step, 32) > error(&fitted, &step, 32));
    }

    #[test]
    fn more_coefficients_never_fit_worse() {
        let step = target(6e-3 / 32.0);
        let mut before = f64::INFINITY;
        for radius in 2..8 {
            let error = error(&powers(radius, 32, &step), &step, 32);
            assert!(error < before, "{radius}: {error} after {before}");
            before = error;
        }
    }

    #[test]
    fn a_wide_filter_is_that_of_the_same_least_squares() {
        for (radius, distance_m) in [(3, 1e-4), (40, 1.7e-3), (130, 6e-3)] {
            let wide = once_wide(radius, target(distance_m));
            for (wide, narrow) in wide.iter().zip(once_narrow(radius, target(distance_m))) {
                assert!((wide - narrow).norm() < 1e-7, "{radius}: {wide} for {narrow}");
            }
        }
    }

    #[test]
    fn no_distance_is_the_identity() {
        for c in powers(4, 10, target(0.0)) {
            assert!(c.norm() < 1e-12);
        }
    }
}
