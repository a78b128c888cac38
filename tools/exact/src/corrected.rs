//! SM-LBM with aberration correction, Eq. 5: the content of each plane goes through the silhouettes of
//! all planes before it, back to where it started, through a correction kernel Φ of its depth in
//! the Fourier domain, and on to z = 0.
//!
//! # Cost
//! Taken literally that is a sweep for each plane, N²/2 propagations. But Φ is interpolated piecewise
//! linearly between M calibrated distances, Φ(z) = Σ wᵢ(z)·Φᵢ, and everything else is linear in the content:
//! so one sweep for each calibrated distance, its contents weighted by wᵢ, gives the same sum with
//! N·M propagations at most, and N²/2 only where every plane has a kernel of its own. The way back
//! to the start and on to z = 0 is one propagation, from the front plane to z = 0.
//!
//! Kernels come from the calibrated coefficients of a display, [`Correction::of_aberrations`], or are taken as they
//! are. What differs over the frame is [`spatial`]'s.

pub mod spatial;

use crate::sm_lbm::{Planes, Point, check_planes, crop, cross, place, plane_z_m};
use ndarray::{Array3, Axis};
use num_complex::{Complex32, Complex64};
use phasefront::Display;
use phasefront_core::optics::asm::{self, Padding, Transfer};
use phasefront_core::optics::fft::{Fft2, Scratch};
use phasefront_core::optics::zernike::Aberrations;
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use std::cell::Cell;
use std::ops::Range;

/// The most propagations of one colour: those of 512 planes with a kernel each.
pub const MAX_PROPAGATIONS: usize = 512 * 512 / 2;

/// What neighbouring kernels may differ by, radians: between two of unit magnitude the mean has cos(BLEND/2).
pub const BLEND: f64 = 0.28;

/// Correction kernels at calibrated distances; between two they are interpolated linearly, beyond the
/// ends the last one holds.
pub struct Correction {
    z_m: Vec<f64>,
    /// For each distance (C, W', H'): transposed, as spectra are kept.
    kernels: Vec<Array3<Complex32>>,
}

impl Correction {
    /// Takes, for each of `z_m` (ascending, metres against z = 0, positive toward the viewer), the kernels of the
    /// colours, (C, H', W'): a factor for each frequency of the padded plane in the order of the
    /// discrete Fourier transform, zero first; 1 leaves it as it is.
    ///
    /// The padded plane of a scene must be at least [`padded_shape`]; a kernel that moves light by more pixels
    /// than it spreads over the volume needs as many more.
    ///
    /// # Errors
    /// No distances, or ones that do not ascend; kernels of different shapes or with values that are not
    /// finite.
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

    /// The same from a function of z, wavelength and the frequencies µ and ν (cycles a metre, along x and y),
    /// sampled for a padded plane of `shape`, (H', W').
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn sampled(
        z_m: Vec<f64>,
        shape: (usize, usize),
        display: &Display,
        kernel: impl Fn(f64, f64, f64, f64) -> Complex64,
    ) -> Result<Self> {
        let frequency = |k: usize, n: usize| {
            let signed = if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
            signed / (n as f64 * display.pitch_m())
        };
        let kernels = (z_m.iter())
            .map(|&z| {
                Array3::from_shape_fn((display.colours(), shape.0, shape.1), |(c, ky, kx)| {
                    let lambda = display.wavelengths_m()[c];
                    let v = kernel(z, lambda, frequency(kx, shape.1), frequency(ky, shape.0));
                    Complex32::new(v.re as f32, v.im as f32)
                })
            })
            .collect();
        Self::new(z_m, kernels)
    }

    /// The kernels Φ = exp(i·terms) of `aberrations` for frames of (`height`, `width`) cut into `planes`. Coefficients
    /// run piecewise linearly over z, kernels between neighbours here; so where coefficients change, distances are put
    /// between the calibrated ones until neighbours differ by at most [`BLEND`] rad, which costs 1 % of the light at
    /// most.
    ///
    /// # Errors
    /// No planes or too many, a volume whose reach, or light that the correction moves so far that it, cannot be
    /// padded.
    pub fn of_aberrations(
        aberrations: &Aberrations,
        (height, width): (usize, usize),
        planes: usize,
        display: &Display,
    ) -> Result<Self> {
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
            // The terms' largest values over the square of frequencies.
            let most = [3.0, 1.0, 2.0, 4.0, 4.0];
            let apart = (a.coefficients().iter().zip(b.coefficients()))
                .map(|(a, b)| (0..5).map(|j| most[j] * (a[j] - b[j]).abs()).sum::<f64>())
                .fold(0.0, f64::max);
            let steps = (apart / BLEND).ceil().max(1.0) as usize;
            z_m.extend((1..=steps).map(|i| begin + (end - begin) * i as f64 / steps as f64));
        }
        if z_m.len() > planes {
            // Every plane has its own kernel then.
            z_m = (0..planes).rev().map(|k| plane_z_m(k, planes, display)).collect();
        }
        let reach_m = (aberrations.calibrated().iter())
            .map(|(_, a)| a.reach_m(pitch_m))
            .fold(0.0, f64::max);
        let shape = padded_shape_with(height, width, display, reach_m)?;
        let frequency = |k: usize, n: usize| {
            let k = if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
            k / (n as f64 * pitch_m)
        };
        let kernels = (z_m.iter())
            .map(|z| {
                let aberration = aberrations.at(*z);
                Array3::from_shape_fn((display.colours(), shape.0, shape.1), |(c, ky, kx)| {
                    let (mu, nu) = (frequency(kx, shape.1), frequency(ky, shape.0));
                    let phase = aberration.phase(c, mu, nu, pitch_m);
                    Complex32::new(phase.cos() as f32, phase.sin() as f32)
                })
            })
            .collect();
        Self::new(z_m, kernels)
    }

    /// (H', W').
    pub fn shape(&self) -> (usize, usize) {
        let (_, width, height) = self.kernels[0].dim();
        (height, width)
    }

    /// How much of the kernel of distance `i` is in Φ(z).
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

/// The least padded plane, (H', W'), for scenes of (`height`, `width`): that of the plain SM-LBM.
///
/// # Errors
/// A volume whose reach cannot be padded.
pub fn padded_shape(height: usize, width: usize, display: &Display) -> Result<(usize, usize)> {
    padded_shape_with(height, width, display, 0.0)
}

/// [`padded_shape`] with room for light that a correction moves by up to `reach_m`.
fn padded_shape_with(height: usize, width: usize, display: &Display, reach_m: f64) -> Result<(usize, usize)> {
    let more = (reach_m / display.pitch_m()).ceil() as usize;
    Ok(asm::padded_shape(
        height.saturating_add(more),
        width.saturating_add(more),
        display.pitch_m(),
        display.longest_wavelength_m(),
        display.volume_depth_m(),
        Padding::Reach,
    )?)
}

/// The corrected complex midpoint hologram of `ldi`, (C, H, W), at z = 0, from `planes` planes. `progress` hears of
/// the propagations done, of all.
///
/// Memory: five buffers of (H', W') complex numbers beside the kernels, and 20 bytes a point.
///
/// # Errors
/// No planes, a padded plane too small for the scene, or more propagations than [`MAX_PROPAGATIONS`] a colour.
pub fn hologram(
    ldi: &Ldi,
    display: &Display,
    planes: usize,
    correction: &Correction,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Array3<Complex32>> {
    check_planes(planes)?;
    let (height, width) = ldi.shape();
    let shape @ (padded_height, padded_width) = correction.shape();
    let of = correction.kernels[0].dim().0;
    if of != display.colours() {
        return Err(Error::Input(format!(
            "correction: kernels of {of} colours for a display of {}; both must have as many",
            display.colours()
        )));
    }
    let (least_height, least_width) = padded_shape(height, width, display)?;
    if padded_height < least_height || padded_width < least_width {
        return Err(Error::Input(format!(
            "correction: kernels of {padded_width}×{padded_height}; a scene of {width}×{height} needs at least {least_width}×{least_height}"
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
    let fft = Fft2::new(padded_height, padded_width, padded_height, padded_width);
    let mut scratch = fft.scratch();
    let mut plane = vec![Complex32::ZERO; padded_height * padded_width];
    let mut sum = vec![Complex32::ZERO; padded_height * padded_width];
    let mut hologram = Array3::zeros((colours, height, width));
    let done = Cell::new(0);
    for (colour, &wavelength_m) in display.wavelengths_m().iter().enumerate() {
        let transfer = |distance_m| Transfer::new(shape, display.pitch_m(), wavelength_m, distance_m, |_, _| true);
        let step_m = display.volume_depth_m() / planes as f64;
        let wave = Wave {
            fft: &fft,
            points: &scene.points,
            neighbour: transfer(step_m),
            across: &|steps| transfer(steps as f64 * step_m),
            // To the start of each content and on to z = 0 is −z of the front plane for all.
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
            // Φ on the way.
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

/// Adds `values` times `factors`, by runs of `length`.
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
    /// From one plane to the next.
    neighbour: Transfer,
    /// Over so many planes.
    across: &'a dyn Fn(usize) -> Transfer,
    /// From the front plane to z = 0.
    home: Transfer,
    /// Told of each propagation.
    done: &'a dyn Fn(),
}

impl Wave<'_> {
    /// The spectrum at z = 0, in the scratch's columns, of what `content` gives for the points of the planes `swept`,
    /// back first; `plane` is room for one plane.
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
        let width = fft.padded_shape().1;
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
            // Content that this kernel does not correct is weighted 0: its silhouette still blocks.
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
