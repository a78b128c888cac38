//! The angular spectrum method, Eq. 2 of the paper, which computes the field at a distance s from a plane.
//!
//! ASM(u, s) = F⁻¹(F(u) · exp(+i2πs·√(λ⁻² − µ² − ν²))), with s positive toward the viewer. The evanescent part is zero.
//! The convolution is linear: the frame is padded with zeros, and the result is cropped.
//!
//! The exponent leaves out the carrier exp(i2πs/λ) by using √(λ⁻² − f²) − λ⁻¹ = −λf²/(1 + √(1 − λ²f²)), f² = µ² + ν².
//! At 20 mm and 450 nm the carrier is 2.8·10⁵ rad, and an f32 phase that includes it is only accurate to 0.03 rad.
//! Without it, only the part that bends the wave remains, which is computed in f64. Points with the initial phase 2πz/λ
//! in Eq. 1 have the initial phase zero here; the two conventions agree at z = 0.

use super::aperture::Opening;
use super::aperture::passes;
use super::fft::{ConvolveScratch, Fft2, fast_size};
use super::zernike::Aberration;
use crate::Size;
use crate::runtime::error::{Error, Result};
use num_complex::{Complex32, Complex64};
use phasefront_kernels::wide;
use std::f64::consts::PI;
use std::sync::Arc;

/// The largest number of values in a padded plane: 1 GiB of complex numbers.
pub const MAX_PADDED_VALUES: usize = 1 << 27;

/// The amount of zero padding of a frame before its transform.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Padding {
    /// Padding by the reach of light diffracted at the pitch over the distance, see [`reach_m`].
    Reach,
    /// Padding to twice the size at any distance. Tests compare [`Padding::Reach`] with it.
    ///
    /// At distances whose kernel does not fit, the band limit of Matsushima and Shimobaba (Opt. Express 17, 19662,
    /// 2009) keeps the kernel from wrapping around.
    Double,
    /// No padding. The plane is periodic.
    Circular,
}

/// Returns the distance in metres, |s|·tan(asin(λ/2p)), that light of `wavelength_m` diffracted by pixels of `pitch_m`
/// can travel sideways over `distance_m`.
pub fn reach_m(distance_m: f64, wavelength_m: f64, pitch_m: f64) -> f64 {
    distance_m.abs() * (wavelength_m / (2.0 * pitch_m)).asin().tan()
}

/// Returns the carrier exp(i2πs/λ) that the fields here leave out. Its phase is reduced in f64.
pub fn carrier(distance_m: f64, wavelength_m: f64) -> Complex32 {
    let turns = (distance_m / wavelength_m).fract();
    let phase = Complex64::from_polar(1.0, 2.0 * PI * turns);
    Complex32::new(phase.re as f32, phase.im as f32)
}

/// Returns the padded size in which a frame of `size` propagates by up to `distance_m`.
///
/// # Errors
/// Returns an error if the frame is empty, the distance is not finite, or the padded plane would exceed
/// [`MAX_PADDED_VALUES`].
pub fn padded_size(size: Size, pitch_m: f64, wavelength_m: f64, distance_m: f64, padding: Padding) -> Result<Size> {
    let Size { width, height } = size;
    if height == 0 || width == 0 {
        return Err(Error::Setting(format!(
            "a plane of {width}×{height} is empty; each side must be at least 1"
        )));
    }
    if !distance_m.is_finite() {
        return Err(Error::Setting(format!(
            "a distance of {distance_m} m cannot be propagated; it must be finite"
        )));
    }
    let padded = |n: usize| -> f64 {
        match padding {
            Padding::Reach => n as f64 + (reach_m(distance_m, wavelength_m, pitch_m) / pitch_m).ceil(),
            Padding::Double => 2.0 * n as f64,
            Padding::Circular => n as f64,
        }
    };
    let (h, w) = (padded(height), padded(width));
    if h * w > MAX_PADDED_VALUES as f64 {
        return Err(Error::Setting(format!(
            "a distance of {:.3} mm needs a padded plane of {w:.0}×{h:.0}, over the {} Mi values that fit; \
             a shorter distance or a smaller frame is needed",
            distance_m * 1e3,
            MAX_PADDED_VALUES >> 20,
        )));
    }
    Ok(match padding {
        Padding::Circular => size,
        _ => Size {
            width: fast_size(w as usize),
            height: fast_size(h as usize),
        },
    })
}

/// The transfer function of one distance on a padded plane. If it is even in both frequencies, as in free space, only
/// one quadrant is stored.
pub struct Transfer {
    /// The factors, (W'/2 + 1, H'/2 + 1) if even, else (W', H'). They include 1/(H'·W') for the unnormalized
    /// transforms.
    factors: Vec<Complex32>,
    even: bool,
    padded_height: usize,
    padded_width: usize,
}

/// Returns the exponent of free space at the frequency (`mu`, `nu`), in cycles per metre, without the carrier, in
/// radians, or `None` if the wave is evanescent.
fn free_space(mu: f64, nu: f64, wavelength_m: f64, distance_m: f64) -> Option<f64> {
    let f2 = mu * mu + nu * nu;
    let cosine2 = 1.0 - wavelength_m * wavelength_m * f2;
    (cosine2 >= 0.0).then(|| -2.0 * PI * distance_m * wavelength_m * f2 / (1.0 + cosine2.sqrt()))
}

impl Transfer {
    /// Computes H(µ, ν) of `distance_m` on a padded plane (H', W'). It is zero if `keep` returns false for |µ|, |ν|, in
    /// cycles per metre, or if the wave is evanescent.
    pub fn new(
        Size {
            width: padded_width,
            height: padded_height,
        }: Size,
        pitch_m: f64,
        wavelength_m: f64,
        distance_m: f64,
        keep: impl Fn(f64, f64) -> bool,
    ) -> Self {
        let (rows, columns) = (padded_height / 2 + 1, padded_width / 2 + 1);
        let scale = 1.0 / (padded_height * padded_width) as f64;
        let mut factors = Vec::with_capacity(rows * columns);
        for kx in 0..columns {
            let mu = kx as f64 / (padded_width as f64 * pitch_m);
            for ky in 0..rows {
                let nu = ky as f64 / (padded_height as f64 * pitch_m);
                factors.push(match free_space(mu, nu, wavelength_m, distance_m) {
                    Some(phase) if keep(mu, nu) => polar(scale, phase),
                    _ => Complex32::ZERO,
                });
            }
        }
        Transfer {
            factors,
            even: true,
            padded_height,
            padded_width,
        }
    }

    /// Computes H(µ, ν)·exp(i·`phase`(µ, ν)) of `distance_m` on a padded plane (H', W'), with signed µ and ν: free
    /// space and a correction in the pupil. Takes four times the memory of [`Self::new`].
    pub fn corrected(
        Size {
            width: padded_width,
            height: padded_height,
        }: Size,
        pitch_m: f64,
        wavelength_m: f64,
        distance_m: f64,
        phase: impl Fn(f64, f64) -> f64,
    ) -> Self {
        let scale = 1.0 / (padded_height * padded_width) as f64;
        let frequency = |k: usize, n: usize| {
            let k = if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
            k / (n as f64 * pitch_m)
        };
        let mut factors = Vec::with_capacity(padded_height * padded_width);
        for kx in 0..padded_width {
            let mu = frequency(kx, padded_width);
            for ky in 0..padded_height {
                let nu = frequency(ky, padded_height);
                factors.push(match free_space(mu, nu, wavelength_m, distance_m) {
                    Some(free) => polar(scale, free + phase(mu, nu)),
                    None => Complex32::ZERO,
                });
            }
        }
        Transfer {
            factors,
            even: false,
            padded_height,
            padded_width,
        }
    }

    /// Returns the factors: one quadrant, (W'/2 + 1, H'/2 + 1), if they are even, else (W', H').
    pub fn factors(&self) -> &[Complex32] {
        &self.factors
    }

    /// Returns [`Self::factors`] behind an aperture of `radius`, where 1 reaches the Nyquist frequency.
    pub fn factors_through(&self, radius: f64) -> Vec<Complex32> {
        let (width, height) = (self.padded_width, self.padded_height);
        let rows = if self.even { height / 2 + 1 } else { height };
        let stopped = |(at, factor): (usize, &Complex32)| {
            let (kx, ky) = (at / rows, at % rows);
            let fx = kx.min(width - kx) as f64 / width as f64;
            let fy = ky.min(height - ky) as f64 / height as f64;
            if passes(fx, fy, radius) {
                *factor
            } else {
                Complex32::ZERO
            }
        };
        self.factors.iter().enumerate().map(stopped).collect()
    }

    /// Multiplies column `x` of a spectrum by the transfer function.
    pub fn apply(&self, x: usize, column: &mut [Complex32]) {
        wide!(self.each(x, column, |value, factor| *value *= factor));
    }

    /// Multiplies column `x` of a spectrum by the conjugate of the transfer function and adds it to `sum`: the adjoint
    /// of the propagation.
    pub fn add_adjoint(&self, x: usize, column: &mut [Complex32], sum: &mut [Complex32]) {
        wide!({
            self.each(x, column, |value, factor| *value *= factor.conj());
            for (sum, value) in sum.iter_mut().zip(column) {
                *sum += *value;
            }
        });
    }

    /// Calls `change` with each value of column `x` and its factor.
    #[inline(always)]
    fn each(&self, x: usize, column: &mut [Complex32], change: impl Fn(&mut Complex32, &Complex32)) {
        if !self.even {
            let factors = &self.factors[x * self.padded_height..][..self.padded_height];
            for (value, factor) in column.iter_mut().zip(factors) {
                change(value, factor);
            }
            return;
        }
        let rows = self.padded_height / 2 + 1;
        let x = x.min(self.padded_width - x);
        let transfer = &self.factors[x * rows..][..rows];
        let (near, far) = column.split_at_mut(rows);
        for (value, factor) in near.iter_mut().zip(transfer) {
            change(value, factor);
        }
        for (value, factor) in far.iter_mut().rev().zip(&transfer[1..]) {
            change(value, factor);
        }
    }
}

/// Returns `scale`·exp(i·`phase`), with the angle in f64.
fn polar(scale: f64, phase: f64) -> Complex32 {
    let (sin, cos) = phase.sin_cos();
    Complex32::new((cos * scale) as f32, (sin * scale) as f32)
}

/// Returns the predicate `keep` of [`Transfer::new`] for `padding`. It keeps all frequencies, or only those under the
/// band limit if the doubled plane cannot hold the kernel.
fn band_limit(
    Size {
        width: padded_width,
        height: padded_height,
    }: Size,
    pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
    padding: Padding,
) -> impl Fn(f64, f64) -> bool {
    // Matsushima's limit 1/(λ√((2s·Δf)² + 1)), where Δf is the sampling interval of the spectrum.
    let limit = |n: usize| match padding {
        Padding::Double => {
            let df = 1.0 / (n as f64 * pitch_m);
            1.0 / (wavelength_m * ((2.0 * distance_m * df).powi(2) + 1.0).sqrt())
        }
        _ => f64::INFINITY,
    };
    let (limit_x, limit_y) = (limit(padded_width), limit(padded_height));
    move |mu, nu| mu <= limit_x && nu <= limit_y
}

/// A plan for one shape, wavelength and distance. It is immutable and can be shared between threads.
///
/// ```
/// use num_complex::Complex32;
/// use phasefront_core::Size;
/// use phasefront_core::optics::asm::{Padding, Propagator};
///
/// let plan = Propagator::new(Size { width: 48, height: 64 }, 8e-6, 520e-9, 3e-3, Padding::Reach)?;
/// let mut scratch = plan.scratch();
/// let mut plane = vec![Complex32::new(1.0, 0.0); 64 * 48];
/// plan.propagate(&mut plane, &mut scratch);
/// # Ok::<(), phasefront::Error>(())
/// ```
#[derive(Clone)]
pub struct Propagator {
    size: Size,
    fft: Arc<Fft2>,
    transfer: Arc<Transfer>,
}

impl Propagator {
    /// Plans ASM(·, `distance_m`) of planes of `size`.
    ///
    /// # Errors
    /// Returns an error if [`padded_size`] does.
    pub fn new(size: Size, pitch_m: f64, wavelength_m: f64, distance_m: f64, padding: Padding) -> Result<Self> {
        let padded = padded_size(size, pitch_m, wavelength_m, distance_m, padding)?;
        let keep = band_limit(padded, pitch_m, wavelength_m, distance_m, padding);
        Ok(Propagator {
            size,
            fft: Arc::new(Fft2::new(size, padded)),
            transfer: Arc::new(Transfer::new(padded, pitch_m, wavelength_m, distance_m, keep)),
        })
    }

    /// Creates a plan for each wavelength. The plans share the padded size of the longest wavelength, which is the
    /// largest, and can therefore share one [`ConvolveScratch`].
    ///
    /// # Errors
    /// Returns an error if [`padded_size`] does.
    pub fn for_colours(
        size: Size,
        pitch_m: f64,
        wavelengths_m: &[f64],
        distance_m: f64,
        padding: Padding,
    ) -> Result<Vec<Self>> {
        let longest = wavelengths_m.iter().copied().fold(0.0, f64::max);
        let padded = padded_size(size, pitch_m, longest, distance_m, padding)?;
        let fft = Arc::new(Fft2::new(size, padded));
        let plan = |&wavelength_m: &f64| {
            let keep = band_limit(padded, pitch_m, wavelength_m, distance_m, padding);
            Propagator {
                size,
                fft: fft.clone(),
                transfer: Arc::new(Transfer::new(padded, pitch_m, wavelength_m, distance_m, keep)),
            }
        };
        Ok(wavelengths_m.iter().map(plan).collect())
    }

    /// Creates plans like [`Self::for_colours`] with [`Padding::Reach`], which also apply the correction `aberration`
    /// of a modulator of `modulator_pitch_m` to each colour.
    ///
    /// # Errors
    /// Returns an error if [`padded_size`] does for planes padded by the reach of the correction too, or if the
    /// correction has another number of colours.
    pub fn for_colours_corrected(
        size: Size,
        pitch_m: f64,
        wavelengths_m: &[f64],
        distance_m: f64,
        aberration: &Aberration,
        modulator_pitch_m: f64,
    ) -> Result<Vec<Self>> {
        if aberration.coefficients().len() != wavelengths_m.len() {
            return Err(Error::Setting(format!(
                "a correction of {} colours for {}; both must have as many",
                aberration.coefficients().len(),
                wavelengths_m.len()
            )));
        }
        let longest = wavelengths_m.iter().copied().fold(0.0, f64::max);
        let more = (aberration.reach_m(modulator_pitch_m) / pitch_m).ceil() as usize;
        let wider = Size {
            width: size.width.saturating_add(more),
            height: size.height.saturating_add(more),
        };
        let padded = padded_size(wider, pitch_m, longest, distance_m, Padding::Reach)?;
        let fft = Arc::new(Fft2::new(size, padded));
        let plan = |(colour, &wavelength_m): (usize, &f64)| {
            let transfer = Transfer::corrected(padded, pitch_m, wavelength_m, distance_m, |mu, nu| {
                aberration.phase(colour, mu, nu, modulator_pitch_m)
            });
            Propagator {
                size,
                fft: fft.clone(),
                transfer: Arc::new(transfer),
            }
        };
        Ok(wavelengths_m.iter().enumerate().map(plan).collect())
    }

    /// Returns the size.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Returns (H', W').
    pub fn padded_size(&self) -> Size {
        self.fft.padded_size()
    }

    /// Returns the transfer function.
    pub fn transfer(&self) -> &Transfer {
        &self.transfer
    }

    /// Allocates working memory for one call at a time, sized for the current thread pool.
    pub fn scratch(&self) -> ConvolveScratch {
        self.fft.convolve_scratch()
    }

    /// Replaces `plane`, (H, W), by the field at the planned distance. Does not allocate.
    ///
    /// # Panics
    /// Panics if `plane` does not have H·W values or `scratch` belongs to another plan.
    pub fn propagate(&self, plane: &mut [Complex32], scratch: &mut ConvolveScratch) {
        self.fft
            .convolve(plane, |x, column| self.transfer.apply(x, column), scratch);
    }

    /// Filters `plane`, (H, W), on the padded plane of this propagation: `filter` replaces its transfer function. Does
    /// not allocate.
    ///
    /// # Panics
    /// Panics in the cases of [`Self::propagate`].
    pub fn convolve(
        &self,
        plane: &mut [Complex32],
        filter: impl Fn(usize, &mut [Complex32]) + Sync,
        scratch: &mut ConvolveScratch,
    ) {
        self.fft.convolve(plane, filter, scratch);
    }

    /// Propagates like [`Self::propagate`] through an aperture of `radius`, where 1 reaches the Nyquist frequency.
    ///
    /// # Panics
    /// Panics in the cases of [`Self::propagate`].
    pub fn propagate_through(&self, plane: &mut [Complex32], radius: f64, scratch: &mut ConvolveScratch) {
        let (size, opening) = (self.padded_size(), Opening::centred(radius));
        let filter = |x: usize, column: &mut [Complex32]| {
            opening.stop(x, size, column);
            self.transfer.apply(x, column);
        };
        self.fft.convolve(plane, filter, scratch);
    }
}
