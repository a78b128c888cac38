//! The definition of the angular spectrum method as direct sums in f64. Tests compare [`super::asm`] with it.

use crate::Size;
use ndarray::Array2;
use num_complex::Complex64;
use std::f64::consts::PI;

/// Computes ASM(`field`, `distance_m`) in a plane padded with zeros to `padded` (H', W') and crops it, following Eq. 2
/// with the carrier exp(i2πs/λ). It uses two passes of direct Fourier sums: O(H'W'(H'+W')).
pub fn propagate(
    field: &Array2<Complex64>,
    pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
    padded: Size,
) -> Array2<Complex64> {
    let (h, w) = field.dim();
    let mut plane = Array2::zeros(padded.shape());
    plane.slice_mut(ndarray::s![..h, ..w]).assign(field);
    let mut spectrum = dft(&plane, -1.0);
    for ((ky, kx), value) in spectrum.indexed_iter_mut() {
        let mu = frequency(kx, padded.width) / pitch_m;
        let nu = frequency(ky, padded.height) / pitch_m;
        let square = wavelength_m.powi(-2) - mu * mu - nu * nu;
        *value *= if square < 0.0 {
            Complex64::ZERO
        } else {
            Complex64::from_polar(1.0, 2.0 * PI * distance_m * square.sqrt())
        };
    }
    let out = dft(&spectrum, 1.0) / (padded.height * padded.width) as f64;
    out.slice(ndarray::s![..h, ..w]).to_owned()
}

/// Returns the frequency of bin `k` of `n`, in cycles per sample, within [−½, ½).
fn frequency(k: usize, n: usize) -> f64 {
    let k = k as f64;
    (if 2.0 * k < n as f64 { k } else { k - n as f64 }) / n as f64
}

/// Computes the unnormalized 2D discrete Fourier sum with exponent `sign`·i2πkx/n.
pub fn dft(plane: &Array2<Complex64>, sign: f64) -> Array2<Complex64> {
    let matrix = |n: usize| {
        Array2::from_shape_fn((n, n), |(k, x)| {
            Complex64::from_polar(1.0, sign * 2.0 * PI * ((k * x) % n) as f64 / n as f64)
        })
    };
    let (h, w) = plane.dim();
    matrix(h).dot(plane).dot(&matrix(w))
}
