//! A second implementation of the paper's equations in f64, independent of the library. The tests of every crate
//! include this file (`#[path]`) and compare the library's optics with it.
//!
//! It is not optimised and does not call the library.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

use ndarray::{Array2, Array3, s};
use phasefront_core::Size;
use rustfft::FftPlannerScalar;
use rustfft::num_complex::{Complex32, Complex64};
use std::f64::consts::PI;

/// Returns the Fourier transform F, or F⁻¹ with its factor 1/(H·W).
pub fn fft2(plane: &Array2<Complex64>, inverse: bool) -> Array2<Complex64> {
    let (h, w) = plane.dim();
    let mut planner = FftPlannerScalar::<f64>::new();
    let mut plan = |n| {
        if inverse {
            planner.plan_fft_inverse(n)
        } else {
            planner.plan_fft_forward(n)
        }
    };
    let (along_x, along_y) = (plan(w), plan(h));
    let mut out = plane.clone();
    for mut row in out.rows_mut() {
        let mut line = row.to_vec();
        along_x.process(&mut line);
        row.assign(&Array2::from_shape_vec((1, w), line).unwrap().row(0));
    }
    for mut column in out.columns_mut() {
        let mut line = column.to_vec();
        along_y.process(&mut line);
        column.assign(&Array2::from_shape_vec((1, h), line).unwrap().row(0));
    }
    if inverse { out / (h * w) as f64 } else { out }
}

/// Computes Eq. 2 on a periodic plane, with the carrier: F⁻¹(F(u)·exp(i2πs√(λ⁻² − µ² − ν²))).
pub fn asm_periodic(u: &Array2<Complex64>, pitch: f64, lambda: f64, s: f64) -> Array2<Complex64> {
    let (h, w) = u.dim();
    let bin = |k: usize, n: usize| (if 2 * k < n { k as f64 } else { k as f64 - n as f64 }) / n as f64;
    let mut spectrum = fft2(u, false);
    for ((ky, kx), value) in spectrum.indexed_iter_mut() {
        let (mu, nu) = (bin(kx, w) / pitch, bin(ky, h) / pitch);
        let under = lambda.powi(-2) - mu * mu - nu * nu;
        *value *= if under >= 0.0 {
            Complex64::from_polar(1.0, 2.0 * PI * s * under.sqrt())
        } else {
            Complex64::ZERO
        };
    }
    fft2(&spectrum, true)
}

/// Computes Eq. 2 as a linear convolution, in a plane padded with zeros to `padded` and then cropped.
pub fn asm(u: &Array2<Complex64>, pitch: f64, lambda: f64, distance: f64, padded: Size) -> Array2<Complex64> {
    let (h, w) = u.dim();
    let mut plane = Array2::zeros(padded.shape());
    plane.slice_mut(s![..h, ..w]).assign(u);
    asm_periodic(&plane, pitch, lambda, distance)
        .slice(s![..h, ..w])
        .to_owned()
}

/// Computes Eq. 1–4 for one colour at z = 0. `layers` are (amplitude, depth), front first; a depth of NaN means no hit.
pub fn sm_lbm(
    layers: &[(Array2<f64>, Array2<f64>)],
    planes: usize,
    volume: f64,
    pitch: f64,
    lambda: f64,
    padded: Size,
) -> Array2<Complex64> {
    let (h, w) = layers[0].0.dim();
    let step = volume / planes as f64;
    let z = |k: usize| volume / 2.0 - volume * (k as f64 + 0.5) / planes as f64;
    let mut field: Array2<Complex64> = Array2::zeros(padded.shape());
    for k in (0..planes).rev() {
        if k + 1 < planes {
            field = asm_periodic(&field, pitch, lambda, step);
        }
        for y in 0..h {
            for x in 0..w {
                let hit = layers.iter().find(|(_, depth)| {
                    let d = depth[(y, x)];
                    !d.is_nan() && ((d * planes as f64) as usize).min(planes - 1) == k
                });
                if let Some((amplitude, _)) = hit {
                    field[(y, x)] = Complex64::from_polar(amplitude[(y, x)], 2.0 * PI * z(k) / lambda);
                }
            }
        }
    }
    asm_periodic(&field, pitch, lambda, -z(0))
        .slice(s![..h, ..w])
        .to_owned()
}

/// Computes Eq. 7: the phases of φ ± acos(A/scale), + where x + y is even, in [0, 2π).
pub fn double_phase(field: &Array3<Complex64>, scale: f64) -> Array3<f64> {
    Array3::from_shape_fn(field.dim(), |(c, y, x)| {
        let value = field[(c, y, x)];
        let half = (value.norm() / scale).min(1.0).acos();
        let phase = value.arg() + if (x + y) % 2 == 0 { half } else { -half };
        phase.rem_euclid(2.0 * PI)
    })
}

/// Returns the relative error |a − b| / |b|, with norms over all values.
pub fn relative_error(a: &Array2<Complex64>, b: &Array2<Complex64>) -> f64 {
    let difference: f64 = a.iter().zip(b).map(|(a, b)| (a - b).norm_sqr()).sum();
    let energy: f64 = b.iter().map(|b| b.norm_sqr()).sum();
    (difference / energy).sqrt()
}

/// Converts a plane of the library to f64.
pub fn widen(plane: &[Complex32], Size { width: w, height: h }: Size) -> Array2<Complex64> {
    let values = plane.iter().map(|v| Complex64::new(v.re.into(), v.im.into())).collect();
    Array2::from_shape_vec((h, w), values).unwrap()
}

/// Returns a plane with detail at every scale and no symmetry. It is the same for the same `seed`.
pub fn test_plane(Size { width: w, height: h }: Size, seed: u32) -> Vec<Complex32> {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12345);
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    (0..h * w)
        .map(|i| {
            let (y, x) = ((i / w) as f32, (i % w) as f32);
            let smooth = 0.5 + 0.3 * (x * 0.11 + y * 0.05).sin() + 0.1 * (y * 0.4).cos();
            Complex32::from_polar(smooth + 0.2 * random(), 0.5 * (x * 0.07).sin() + 0.3 * random())
        })
        .collect()
}
