//! SM-LBM with aberration correction, Eq. 5. The content of each plane passes the silhouettes of all planes in front of
//! it, goes back to its own plane, is multiplied by a correction kernel Φ for its depth in the Fourier domain, and
//! propagates to z = 0.
//!
//! # Cost
//! Computed literally, Eq. 5 needs a sweep for each plane: N²/2 propagations. But Φ is interpolated piecewise linearly
//! between M calibrated distances, Φ(z) = Σ wᵢ(z)·Φᵢ, and every other step is linear in the content. One sweep for each
//! calibrated distance, with contents weighted by wᵢ, therefore gives the same sum with at most N·M propagations. It
//! needs N²/2 only if every plane has its own kernel. The way back to the plane and on to z = 0 is a single
//! propagation, from the front plane to z = 0.
//!
//! Kernels come from the calibrated coefficients of a display, [`Correction::of_aberrations`], or from the caller. The
//! module [`spatial`] corrects aberrations that differ over the frame.

pub mod spatial;

use crate::sm_lbm::{Planes, Point, check_planes, crop, cross, place, plane_z_m};
use ndarray::{Array3, Axis};
use num_complex::{Complex32, Complex64};
use phasefront::Display;
use phasefront::Size;
use phasefront_core::optics::asm::{self, Padding, Transfer};
use phasefront_core::optics::fft::{Fft2, Scratch};
use phasefront_core::optics::zernike::Aberrations;
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use std::cell::Cell;
use std::ops::Range;

/// The most propagations for one colour: those of 512 planes with a kernel each.
pub const MAX_PROPAGATIONS: usize = 512 * 512 / 2;

/// The largest phase difference between neighbouring kernels, in radians. The mean of two kernels of unit magnitude has
/// the magnitude cos(BLEND/2).
pub const BLEND: f64 = 0.28;

/// Correction kernels at calibrated distances. Kernels between two distances are interpolated linearly; beyond the
/// first and the last distance the kernel stays constant.
pub struct Correction {
    z_m: Vec<f64>,
    /// For each distance the kernels, (C, W', H'): transposed, in the layout of the spectra.
    kernels: Vec<Array3<Complex32>>,
}

impl Correction {
    /// Makes a correction from kernels, (C, H', W'), for each of `z_m` (ascending, metres from z = 0, positive toward
    /// the viewer). A kernel has a factor for each frequency of the padded plane in the order of the discrete Fourier
    /// transform, zero first. A factor of 1 leaves the frequency unchanged.
    ///
    /// The padded plane of a scene must be at least [`padded_size`]. A kernel that moves light by more pixels than the
    /// light spreads over the volume needs as many pixels more.
    ///
    /// # Errors
    /// Returns an error if there are no distances or they do not ascend, or if kernels differ in shape or have values
    /// that are not finite.
    pub fn new(z_m: Vec<f64>, kernels: Vec<Array3<Complex32>>) -> Result<Self> {
        let refuse = |reason: String| Err(Error::Input(format!("correction: {reason}")));
        if z_m.is_empty() || z_m.len() != kernels.len() {
            return refuse(format!(
                "{} distances and {} kernels; there must be one kernel a distance and at least one",
                z_m.len(),
                kernels.len()
            ));
        }
        if !z_m.iter().all(|z| z.is_finite()) || !z_m.is_sorted_by(|a, b| a < b) {
            return refuse(format!("distances {z_m:?} m; they must ascend"));
        }
        let shape = kernels[0].dim();
        for (kernel, z) in kernels.iter().zip(&z_m) {
            if kernel.dim() != shape || kernel.is_empty() {
                return refuse(format!(
                    "the kernel of z = {z} m has shape {:?}; all must have one shape (C, H, W)",
                    kernel.dim()
                ));
            }
            if !kernel.iter().all(|v| v.is_finite()) {
                return refuse(format!("the kernel of z = {z} m has values that are no numbers"));
            }
        }
        let transposed = |kernel: Array3<Complex32>| {
            let view = kernel.permuted_axes([0, 2, 1]);
            view.as_standard_layout().into_owned()
        };
        Ok(Correction {
            z_m,
            kernels: kernels.into_iter().map(transposed).collect(),
        })
    }

    /// Makes a correction from a function of z, the wavelength and the frequencies µ and ν (cycles per metre, along x
    /// and y). The function is sampled for a padded plane of `size`.
    ///
    /// # Errors
    /// Returns an error if [`Self::new`] does.
    pub fn sampled(
        z_m: Vec<f64>,
        size: Size,
        display: &Display,
        kernel: impl Fn(f64, f64, f64, f64) -> Complex64,
    ) -> Result<Self> {
        let frequency = |k: usize, n: usize| {
            let signed = if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
            signed / (n as f64 * display.pitch_m())
        };
        let kernels = (z_m.iter())
            .map(|&z| {
                Array3::from_shape_fn((display.colours(), size.height, size.width), |(c, ky, kx)| {
                    let lambda = display.wavelengths_m()[c];
                    let v = kernel(z, lambda, frequency(kx, size.width), frequency(ky, size.height));
                    Complex32::new(v.re as f32, v.im as f32)
                })
            })
            .collect();
        Self::new(z_m, kernels)
    }

    /// Makes the kernels Φ = exp(i·terms) of `aberrations` for frames of `size` with `planes` planes.
    /// Coefficients are piecewise linear over z, but the kernels are interpolated linearly between neighbours. Where
    /// coefficients change, further distances are therefore inserted between the calibrated ones until neighbours
    /// differ by at most [`BLEND`] rad, which costs at most 1 % of the light.
    ///
    /// # Errors
    /// Returns an error if there are no planes or too many, or if the reach of the volume, or the distance by which the
    /// correction moves light, is too large to pad.
    pub fn of_aberrations(aberrations: &Aberrations, size: Size, planes: usize, display: &Display) -> Result<Self> {
        check_planes(planes)?;
        let pitch_m = display.pitch_m();
        let (near, far) = (display.z_of_depth(0.0), display.z_of_depth(1.0));
        let mut z_m = vec![far];
        let one = aberrations.constant().is_some();
        let inside = aberrations.calibrated().iter().map(|(z, _)| *z);
        let ends = inside.filter(|z| far < *z && *z < near).chain([near]);
        for end in ends.filter(|_| !one) {
            let begin = z_m[z_m.len() - 1];
            let (a, b) = (aberrations.at(begin), aberrations.at(end));
            // The largest values of the terms over the square of frequencies.
            let most = [3.0, 1.0, 2.0, 4.0, 4.0];
            let apart = (a.coefficients().iter().zip(b.coefficients()))
                .map(|(a, b)| (0..5).map(|j| most[j] * (a[j] - b[j]).abs()).sum::<f64>())
                .fold(0.0, f64::max);
            let steps = (apart / BLEND).ceil().max(1.0) as usize;
            z_m.extend((1..=steps).map(|i| begin + (end - begin) * i as f64 / steps as f64));
        }
        if z_m.len() > planes {
            // Every plane gets its own kernel.
            z_m = (0..planes).rev().map(|k| plane_z_m(k, planes, display)).collect();
        }
        let reach_m = (aberrations.calibrated().iter())
            .map(|(_, a)| a.reach_m(pitch_m))
            .fold(0.0, f64::max);
        let padded = padded_size_with(size, display, reach_m)?;
        let frequency = |k: usize, n: usize| {
            let k = if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
            k / (n as f64 * pitch_m)
        };
        let kernels = (z_m.iter())
            .map(|z| {
                let aberration = aberrations.at(*z);
                Array3::from_shape_fn((display.colours(), padded.height, padded.width), |(c, ky, kx)| {
                    let (mu, nu) = (frequency(kx, padded.width), frequency(ky, padded.height));
                    let phase = aberration.phase(c, mu, nu, pitch_m);
                    Complex32::new(phase.cos() as f32, phase.sin() as f32)
                })
            })
            .collect();
        Self::new(z_m, kernels)
    }

    /// Returns the size of the padded plane.
    pub fn size(&self) -> Size {
        let (_, width, height) = self.kernels[0].dim();
        Size { width, height }
    }

    /// Returns the weight of the kernel of distance `i` in Φ(z).
    fn weight(&self, i: usize, z_m: f64) -> f32 {
        let at = |j: usize| self.z_m[j];
        let last = self.z_m.len() - 1;
        let weight = match z_m <= at(i) {
            true if i == 0 => 1.0,
            true => 1.0 - (at(i) - z_m) / (at(i) - at(i - 1)),
            false if i == last => 1.0,
            false => 1.0 - (z_m - at(i)) / (at(i + 1) - at(i)),
        };
        weight.max(0.0) as f32
    }
}

/// Returns the size of the smallest padded plane for scenes of `size`, which is that of plain SM-LBM.
///
/// # Errors
/// Returns an error if the reach of the volume cannot be padded.
pub fn padded_size(size: Size, display: &Display) -> Result<Size> {
    padded_size_with(size, display, 0.0)
}

/// Returns [`padded_size`] with extra pixels for light that a correction moves by up to `reach_m`.
fn padded_size_with(size: Size, display: &Display, reach_m: f64) -> Result<Size> {
    let more = (reach_m / display.pitch_m()).ceil() as usize;
    Ok(asm::padded_size(
        Size {
            width: size.width.saturating_add(more),
            height: size.height.saturating_add(more),
        },
        display.pitch_m(),
        display.longest_wavelength_m(),
        display.volume_depth_m(),
        Padding::Reach,
    )?)
}

/// Returns the corrected complex midpoint hologram of `ldi`, (C, H, W), at z = 0, from `planes` planes. `progress`
/// receives the number of finished propagations and their total.
///
/// Memory: five buffers of (H', W') complex numbers besides the kernels, and 20 bytes per point.
///
/// # Errors
/// Returns an error if there are no planes, if the padded plane is too small for the scene, or if a colour needs more
/// propagations than [`MAX_PROPAGATIONS`].
pub fn hologram(
    ldi: &Ldi,
    display: &Display,
    planes: usize,
    correction: &Correction,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Array3<Complex32>> {
    check_planes(planes)?;
    let Size { width, height } = ldi.size();
    let size @ Size {
        width: padded_width,
        height: padded_height,
    } = correction.size();
    let of = correction.kernels[0].dim().0;
    if of != display.colours() {
        return Err(Error::Input(format!(
            "correction: kernels of {of} colours for a display of {}; both must have as many",
            display.colours()
        )));
    }
    let least = padded_size(ldi.size(), display)?;
    if padded_height < least.height || padded_width < least.width {
        return Err(Error::Input(format!(
            "correction: kernels of {size}; a scene of {} needs at least {least}",
            ldi.size()
        )));
    }
    let colours = display.colours();
    let scene = Planes::of(&ldi.for_display(display), planes);
    let z = |k: usize| plane_z_m(k, planes, display);
    let Some(front) = scene.occupied.last().map(|(k, _)| *k) else {
        return Ok(Array3::zeros((colours, height, width)));
    };
    // For each distance with content: its kernel, and the planes from its first content to the front.
    let sweeps: Vec<_> = (0..correction.z_m.len())
        .filter_map(|i| {
            let lit = |(k, _): &(usize, _)| correction.weight(i, z(*k)) > 0.0;
            let first = scene.occupied.iter().position(lit)?;
            Some((i, &scene.occupied[first..]))
        })
        .collect();
    let propagations: usize = sweeps.iter().map(|(_, swept)| swept.len()).sum();
    if propagations > MAX_PROPAGATIONS {
        return Err(Error::Input(format!(
            "{propagations} propagations a colour for {planes} planes and {} calibrated distances; at most {MAX_PROPAGATIONS} are done: fewer of either are needed",
            correction.z_m.len()
        )));
    }
    let fft = Fft2::new(size, size);
    let mut scratch = fft.scratch();
    let mut plane = vec![Complex32::ZERO; padded_height * padded_width];
    let mut sum = vec![Complex32::ZERO; padded_height * padded_width];
    let mut hologram = Array3::zeros((colours, height, width));
    let done = Cell::new(0);
    for (colour, &wavelength_m) in display.wavelengths_m().iter().enumerate() {
        let transfer = |distance_m| Transfer::new(size, display.pitch_m(), wavelength_m, distance_m, |_, _| true);
        let step_m = display.volume_depth_m() / planes as f64;
        let wave = Wave {
            fft: &fft,
            points: &scene.points,
            neighbour: transfer(step_m),
            across: &|steps| transfer(steps as f64 * step_m),
            // The way back to the plane of a content and on to z = 0 covers −z of the front plane for every content.
            home: transfer(-z(front)),
            done: &|| {
                done.set(done.get() + 1);
                progress(done.get(), colours * propagations);
            },
        };
        sum.fill(Complex32::ZERO);
        for (i, swept) in &sweeps {
            let content = |k: usize, rgb: &[f32; 3]| Complex32::from(correction.weight(*i, z(k)) * rgb[colour]);
            wave.sweep(swept, &content, &mut plane, &mut scratch);
            // Applies Φ.
            let kernel = correction.kernels[*i].index_axis(Axis(0), colour);
            let kernel = kernel.to_slice().expect("standard layout");
            add_product(&mut sum, &scratch.columns, kernel, padded_height);
        }
        fft.columns_inverse(&mut sum, |_, _| {}, &mut scratch.work);
        fft.rows_inverse(&sum, &mut scratch.rows, &mut scratch.work);
        let frame = hologram.index_axis_mut(Axis(0), colour);
        crop(&scratch.rows, padded_width, frame);
    }
    Ok(hologram)
}

/// Adds the products of `values` and `factors` to `sum`, in parallel blocks of `length`.
fn add_product(sum: &mut [Complex32], values: &[Complex32], factors: &[Complex32], length: usize) {
    sum.par_chunks_exact_mut(length)
        .zip(values.par_chunks_exact(length))
        .zip(factors.par_chunks_exact(length))
        .for_each(|((sum, values), factors)| {
            for ((sum, value), factor) in sum.iter_mut().zip(values).zip(factors) {
                *sum += value * factor;
            }
        });
}

/// One colour's wave through a scene.
struct Wave<'a> {
    fft: &'a Fft2,
    points: &'a [Point],
    /// The transfer from one plane to the next.
    neighbour: Transfer,
    /// Makes the transfer over the given number of planes.
    across: &'a dyn Fn(usize) -> Transfer,
    /// The transfer from the front plane to z = 0.
    home: Transfer,
    /// Called after each propagation.
    done: &'a dyn Fn(),
}

impl Wave<'_> {
    /// Sweeps the points of the planes `swept`, back first, with the values that `content` gives them. Leaves their
    /// spectrum at z = 0 in the columns of `scratch`; `plane` is a buffer for one plane.
    fn sweep(
        &self,
        swept: &[(usize, Range<usize>)],
        content: &(dyn Fn(usize, &[f32; 3]) -> Complex32 + Sync),
        plane: &mut [Complex32],
        scratch: &mut Scratch,
    ) {
        let fft = self.fft;
        let (back, points) = &swept[0];
        let points = &self.points[points.clone()];
        let width = fft.padded_size().width;
        place(points, plane, width, |point| content(*back, &point.rgb));
        fft.rows_forward(plane, &mut scratch.rows, &mut scratch.work);
        let mut at = *back;
        for (k, points) in &swept[1..] {
            let points = &self.points[points.clone()];
            let across;
            let transfer = match at - k {
                1 => &self.neighbour,
                steps => {
                    across = (self.across)(steps);
                    &across
                }
            };
            // A content that this kernel does not correct has weight 0, but its silhouette still blocks.
            cross(fft, scratch, transfer, points, |point| content(*k, &point.rgb));
            at = *k;
            (self.done)();
        }
        let home = &self.home;
        fft.spectrum(
            &scratch.rows,
            &mut scratch.columns,
            |x, column, _| home.apply(x, column),
            &mut scratch.work,
        );
        (self.done)();
    }
}
