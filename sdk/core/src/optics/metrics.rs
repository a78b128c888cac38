//! PSNR and SSIM of amplitudes, as in the paper: with a peak of 1, for each colour and overall.

use crate::runtime::error::{Error, Result};
use ndarray::{Array2, ArrayView2, ArrayView3, Axis, Zip};
use serde::Serialize;

/// The standard deviation of SSIM's window, in pixels (Wang et al., IEEE TIP 13, 600, 2004).
const SSIM_SIGMA: f64 = 1.5;
/// The half width of SSIM's window, which has 11×11 pixels.
const SSIM_HALF: usize = 5;

/// The similarity of two stacks of amplitudes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The PSNR of each colour, in dB.
    pub psnr: Vec<f64>,
    /// The PSNR over all values of all colours, in dB.
    pub psnr_overall: f64,
    /// The SSIM of each colour.
    pub ssim: Vec<f64>,
    /// The mean SSIM of the colours.
    pub ssim_overall: f64,
}

/// Compares `a` with `b`, both (C, H, W).
///
/// # Errors
/// Returns an error if the shapes differ.
pub fn compare(a: ArrayView3<'_, f32>, b: ArrayView3<'_, f32>) -> Result<Comparison> {
    let ((ca, ha, wa), (cb, hb, wb)) = (a.dim(), b.dim());
    if (ha, wa) != (hb, wb) {
        return Err(Error::Setting(format!(
            "one is {wa}×{ha}, the other {wb}×{hb}; only images of one size can be compared"
        )));
    }
    if ca != cb {
        return Err(Error::Setting(format!(
            "one has {ca} colours, the other {cb}; only images of the same colours can be compared"
        )));
    }
    let colours = || a.axis_iter(Axis(0)).zip(b.axis_iter(Axis(0)));
    let squares: Vec<f64> = colours().map(|(a, b)| mean_square(a, b)).collect();
    let ssims: Vec<f64> = colours().map(|(a, b)| ssim(a, b)).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    Ok(Comparison {
        psnr: squares.iter().copied().map(decibels).collect(),
        psnr_overall: decibels(mean(&squares)),
        ssim_overall: mean(&ssims),
        ssim: ssims,
    })
}

/// Returns the peak signal-to-noise ratio for a peak of 1 and this mean squared difference.
fn decibels(mean_square: f64) -> f64 {
    -10.0 * mean_square.log10()
}

fn mean_square(a: ArrayView2<'_, f32>, b: ArrayView2<'_, f32>) -> f64 {
    let sum: f64 = (a.iter().zip(b))
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2))
        .sum();
    sum / a.len() as f64
}

/// Computes the mean structural similarity of two planes over all positions where the 11×11 Gaussian window (σ 1.5)
/// fits. In a smaller plane the window shrinks to fit.
pub fn ssim(a: ArrayView2<'_, f32>, b: ArrayView2<'_, f32>) -> f64 {
    let (height, width) = a.dim();
    let half = SSIM_HALF.min((height.min(width) - 1) / 2);
    let blur = |value: &dyn Fn(f64, f64) -> f64| {
        let joined = Zip::from(a).and(b).map_collect(|a, b| value((*a).into(), (*b).into()));
        window(&joined, half)
    };
    let (mean_a, mean_b) = (blur(&|a, _| a), blur(&|_, b| b));
    let (aa, bb, ab) = (blur(&|a, _| a * a), blur(&|_, b| b * b), blur(&|a, b| a * b));
    let (c1, c2) = (0.01f64.powi(2), 0.03f64.powi(2));
    let similarity = Zip::from(&mean_a)
        .and(&mean_b)
        .and(&aa)
        .and(&bb)
        .and(&ab)
        .map_collect(|ma, mb, aa, bb, ab| {
            let (va, vb, cov) = (aa - ma * ma, bb - mb * mb, ab - ma * mb);
            ((2.0 * ma * mb + c1) * (2.0 * cov + c2)) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
        });
    similarity.sum() / similarity.len() as f64
}

/// Computes the mean under the Gaussian window at all positions where it fits: (H − 2·half, W − 2·half).
fn window(plane: &Array2<f64>, half: usize) -> Array2<f64> {
    let weight = |i: usize| (-0.5 * ((i as f64 - half as f64) / SSIM_SIGMA).powi(2)).exp();
    let sum: f64 = (0..=2 * half).map(weight).sum();
    let taps: Vec<f64> = (0..=2 * half).map(|i| weight(i) / sum).collect();
    let along = |plane: &Array2<f64>, axis: Axis| {
        let length = plane.len_of(axis) - 2 * half;
        let shifted = |i: usize| plane.slice_axis(axis, (i..i + length).into());
        let mut out = shifted(0).to_owned() * taps[0];
        for (i, tap) in taps.iter().enumerate().skip(1) {
            out.scaled_add(*tap, &shifted(i));
        }
        out
    };
    along(&along(plane, Axis(0)), Axis(1))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::Array3;

    /// Computes SSIM by its definition, as a double sum over each window.
    fn naive_ssim(a: &Array2<f32>, b: &Array2<f32>) -> f64 {
        let (h, w) = a.dim();
        let g = |i: usize, j: usize| (-((i as f64 - 5.0).powi(2) + (j as f64 - 5.0).powi(2)) / (2.0 * 1.5 * 1.5)).exp();
        let total: f64 = (0..121).map(|k| g(k / 11, k % 11)).sum();
        let mut sum = 0.0;
        for y in 0..h - 10 {
            for x in 0..w - 10 {
                let mean = |f: &dyn Fn(f64, f64) -> f64| {
                    (0..121)
                        .map(|k| {
                            let at = (y + k / 11, x + k % 11);
                            g(k / 11, k % 11) / total * f(a[at].into(), b[at].into())
                        })
                        .sum::<f64>()
                };
                let (ma, mb) = (mean(&|a, _| a), mean(&|_, b| b));
                let va = mean(&|a, _| (a - ma).powi(2));
                let vb = mean(&|_, b| (b - mb).powi(2));
                let cov = mean(&|a, b| (a - ma) * (b - mb));
                sum += (2.0 * ma * mb + 1e-4) * (2.0 * cov + 9e-4) / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4));
            }
        }
        sum / ((h - 10) * (w - 10)) as f64
    }

    fn planes() -> (Array2<f32>, Array2<f32>) {
        let a = Array2::from_shape_fn((17, 14), |(y, x)| ((y * 3 + x * 5) % 11) as f32 / 11.0);
        let b = a.mapv(|v| v * 0.8 + 0.05) + &Array2::from_shape_fn((17, 14), |(y, x)| ((y * x) % 7) as f32 / 100.0);
        (a, b)
    }

    #[test]
    fn ssim_agrees_with_its_definition() {
        let (a, b) = planes();
        assert!((ssim(a.view(), b.view()) - naive_ssim(&a, &b)).abs() < 1e-9);
        assert!((ssim(a.view(), a.view()) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn small_planes_have_a_similarity_too() {
        let a = Array2::from_elem((1, 3), 0.5);
        assert!((ssim(a.view(), a.view()) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn psnr_of_a_known_difference() {
        let a = Array3::from_elem((3, 4, 4), 0.5);
        let mut b = a.clone();
        b.index_axis_mut(Axis(0), 1).fill(0.6);
        let c = compare(a.view(), b.view()).unwrap();
        assert!((c.psnr[1] - 20.0).abs() < 1e-5 && c.psnr[0] == f64::INFINITY);
        assert!((c.psnr_overall - (20.0 + 10.0 * 3f64.log10())).abs() < 1e-5);
        assert!(compare(a.view(), Array3::zeros((3, 4, 5)).view()).is_err());
    }
}
