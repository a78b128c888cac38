//! Sub-holograms that focus a plane wave, with and without a correction, Eq. 19.
//!
//! # Sub-holograms and the corrected transfer function
//! The paper adds the terms to the sub-hologram φ⁰, which focuses a plane wave at the distance d (Eq. 19), propagates
//! it to its focus, and defines Φ as the Fourier transform of the result. Light that leaves the sub-hologram at (x, y)
//! arrives with the frequency −(x, y)/(λd), so the paper's pupil is the one used here, rotated by π if d > 0.
//!
//! As the aperture grows, Φ approaches exp(i·terms), [`Aberration::phase`](super::zernike::Aberration::phase). This
//! limit is used for every d, including 0, where a sub-hologram has no size. Its magnitude is 1, without the ripples of
//! diffraction at the rim of a sub-hologram. [`sub_hologram`] and [`corrected_transfer_function`] follow the paper. The
//! first serves captures of a focused spot, and tests check the transfer function against the second.

use super::asm::{Padding, Propagator};
use super::reference;
use super::zernike::{Coefficients, terms};
use crate::Size;
use crate::runtime::error::{Error, Result};
use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use std::f64::consts::PI;

/// Returns the radius of a sub-hologram that focuses at `distance_m`, |d|·tan(asin(λ/2p)), in metres.
pub fn sub_hologram_radius_m(distance_m: f64, wavelength_m: f64, pitch_m: f64) -> f64 {
    super::asm::reach_m(distance_m, wavelength_m, pitch_m)
}

/// Computes the corrected sub-hologram φ_d of Eq. 19 in the middle of a plane of `size`. In its
/// circle, the amplitude is 1, and it focuses a plane wave at the signed `distance_m` (positive toward the viewer) with
/// the correction `a`. Outside, it is 0.
///
/// # Errors
/// Returns an error if the distance is 0 or not finite, or if the aperture does not fit into the plane.
pub fn sub_hologram(
    size: Size,
    pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
    a: &Coefficients,
) -> Result<Vec<Complex32>> {
    let Size { width, height } = size;
    let radius_m = sub_hologram_radius_m(distance_m, wavelength_m, pitch_m);
    let pixels = radius_m / pitch_m;
    if !(pixels >= 1.0 && 2.0 * pixels <= height.min(width) as f64) {
        return Err(Error::Setting(format!(
            "a focus at {:.3} mm from the modulator needs a sub-hologram {:.0} pixels wide; the plane is {width}×{height}, and at least 2 are needed",
            distance_m * 1e3,
            2.0 * pixels
        )));
    }
    let centre = |n: usize| ((n - 1) / 2) as f64;
    let mut plane = Vec::with_capacity(height * width);
    for y in 0..height {
        for x in 0..width {
            let (x, y) = (x as f64 - centre(width), y as f64 - centre(height));
            let square = (x * x + y * y) * pitch_m * pitch_m;
            if square > radius_m * radius_m {
                plane.push(Complex32::ZERO);
                continue;
            }
            // The conjugate of the wave from a point at the focus.
            let path = square / (distance_m.abs() + (distance_m * distance_m + square).sqrt());
            let lens = -2.0 * PI / wavelength_m * path * distance_m.signum();
            let side = -distance_m.signum() / pixels;
            let phase = lens + terms(a, side * x, side * y);
            plane.push(Complex32::new(phase.cos() as f32, phase.sin() as f32));
        }
    }
    Ok(plane)
}

/// Computes Φ_d = F(ASM(φ_d, d)) as in the paper, (H, W), by direct sums for small planes.
///
/// Frequencies are in the order of the discrete Fourier transform. Phases are relative to the centre of the
/// sub-hologram. The scale gives the uncorrected function a mean magnitude of 1 over half the pupil.
///
/// # Errors
/// Returns an error if [`sub_hologram`] does.
pub fn corrected_transfer_function(
    size: Size,
    pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
    a: &Coefficients,
) -> Result<Array2<Complex64>> {
    let Size { width, height } = size;
    let spectrum = |a: &Coefficients| -> Result<Array2<Complex64>> {
        let mut plane = sub_hologram(size, pitch_m, wavelength_m, distance_m, a)?;
        let padding = Padding::Reach;
        let plan = Propagator::new(size, pitch_m, wavelength_m, distance_m, padding)?;
        plan.propagate(&mut plane, &mut plan.scratch());
        // The centre moves to the corner, so that Φ does not depend on the position of the sub-hologram.
        let (cy, cx) = ((height - 1) / 2, (width - 1) / 2);
        let spot = Array2::from_shape_fn((height, width), |(y, x)| {
            let v = plane[(y + cy) % height * width + (x + cx) % width];
            Complex64::new(v.re.into(), v.im.into())
        });
        Ok(reference::dft(&spot, -1.0))
    };
    let ideal = spectrum(&[0.0; 5])?;
    let frequency = |k: usize, n: usize| k.min(n - k) as f64 / n as f64;
    let inner = ideal.indexed_iter().filter(|((ky, kx), _)| {
        let (fx, fy) = (frequency(*kx, width), frequency(*ky, height));
        fx * fx + fy * fy < 0.25 * 0.25
    });
    let (sum, count) = inner.fold((Complex64::ZERO, 0), |(sum, n), (_, v)| (sum + v, n + 1));
    // A converging wave also has a constant phase, which is not an aberration.
    Ok(spectrum(a)? / (sum / f64::from(count)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::zernike::Aberration;
    use super::*;

    const PITCH: f64 = 8e-6;
    const GREEN: f64 = 520e-9;

    /// The paper's Φ of a sub-hologram must have the phase of `Aberration::phase`, on both sides of the modulator.
    #[test]
    fn the_sub_hologram_has_the_transfer_function() {
        let n = 128;
        let a = [0.6, -0.8, 0.5, 0.7, -0.4];
        let aberration = Aberration::new([a; 3]).unwrap();
        for distance in [14e-3, -14e-3] {
            let literal =
                corrected_transfer_function(Size { width: n, height: n }, PITCH, GREEN, distance, &a).unwrap();
            let ideal =
                corrected_transfer_function(Size { width: n, height: n }, PITCH, GREEN, distance, &[0.0; 5]).unwrap();
            let (mut square, mut count) = (0.0, 0.0);
            for ((ky, kx), value) in literal.indexed_iter() {
                let signed = |k: usize| (if 2 * k < n { k as f64 } else { k as f64 - n as f64 }) / n as f64;
                let (fx, fy) = (signed(kx), signed(ky));
                if fx.hypot(fy) > 0.4 {
                    continue;
                }
                let expected = aberration.phase(1, fx / PITCH, fy / PITCH, PITCH);
                // The ratio to the uncorrected function cancels the rim and the lens, which are the same in both.
                let apart = (value / ideal[(ky, kx)] * Complex64::from_polar(1.0, -expected)).arg();
                square += apart * apart;
                count += 1.0;
            }
            let rms = (square / count).sqrt();
            assert!(rms < 0.12, "{distance}: {rms} rad");
        }
    }

    #[test]
    fn sub_holograms_that_cannot_be_are_named() {
        for distance in [0.0, f64::NAN, 1.0] {
            let e = sub_hologram(Size { width: 64, height: 64 }, PITCH, GREEN, distance, &[0.0; 5]).unwrap_err();
            assert!(e.to_string().contains("sub-hologram"), "{e}");
        }
    }
}
