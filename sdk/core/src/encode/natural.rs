//! Natural focus: steps that bring the displayed light to the focal stack of incoherent light ([`crate::focus`]).
//!
//! A smooth wave is sharp in focus but shows halos and rings out of focus, where the world is soft. Each step looks at
//! the displayed light at several planes and moves the phases so that its amplitudes come nearer to those of the stack.
//!
//! Let φₙ be the phases of map n of N, which the eye adds, L the light on the modulator, K_p the path to plane p behind
//! the aperture, A_p the amplitudes of the stack divided by the scale, and w_p the weight of a pixel, which is larger
//! where plane p is in focus. A step looks at P planes, those of its turn, and is
//!
//!   uₙ = K_p·L·exp(iφₙ),  a = √(Σₙ|uₙ|²/N),  r_p = w_p·(a − A_p)/a,
//!   vₙ ← μ·vₙ + 2/P·Im(Σ_p K_pᴴ(r_p·uₙ)·conj(L·exp(iφₙ))),  φₙ ← φₙ − γ·vₙ,
//!
//! a gradient with momentum μ whose length γ is scaled for pixels of full light. It starts from the encoder's phases: a
//! random phase as start ends far lower.

use super::still::Still;
use crate::Bounds;
use crate::Size;
use crate::display::Display;
use crate::display::illumination::Illumination;
use crate::display::registration::RegistrationPlan;
use crate::display::response::wrap;
use crate::display::target::Target;
use crate::focus::{FocalStack, FocalStackScratch, motion_per_m};
use crate::frame::RgbdFrame;
use crate::optics::aperture::Opening;
use crate::optics::asm::{Padding, Transfer, padded_size};
use crate::optics::fft::{Fft2, Scratch};
use crate::optics::zernike::Aberration;
use crate::parallel::prelude::*;
use crate::runtime::cancel::Cancel;
use crate::runtime::error::{Error, Result};
use num_complex::{Complex32, Complex64};
use phasefront_kernels::wide;

/// The share of the volume between the first and the last plane.
pub const SPAN: f64 = 0.9;
/// The largest blur, in pixels, that neighbouring planes have of each other. Wider, the steps fit the planes alone: at
/// 3 pixels eight maps have 1 dB less, and nearer than 2 pixels they gain 0.1 dB.
const SPACING_PX: f64 = 2.0;
/// The least and the largest number of planes, spread evenly over [`SPAN`] of the volume.
const PLANES: [f64; 2] = [3.0, 21.0];
/// The fewest planes of a step that does not look at all of them.
const FEWEST: usize = 4;
/// How much more a pixel counts in focus than far out of focus.
pub const IN_FOCUS: f64 = 2.0;
/// The blur, in pixels, over which that falls to 1/e.
pub const FOCUS_PX: f64 = 3.0;
/// μ, the share of the last step that a step continues.
pub const MOMENTUM: f32 = 0.8;
/// The amplitude that keeps the division by a finite.
pub const FLOOR: f32 = 1e-3;
/// The largest number of steps.
pub(super) const MAX_STEPS: usize = 1000;

/// A plan for one size and target. It is immutable and can be shared between threads.
pub struct NaturalSteps {
    size: Size,
    steps: usize,
    opening: Opening,
    stack: FocalStack,
    display: Display,
    fft: Fft2,
    /// K_p without the aperture, colour by colour.
    paths: Vec<Transfer>,
    registration: Option<RegistrationPlan>,
    /// The illumination and the modulator's size. The hologram is in the middle of the modulator.
    illumination: Option<(Illumination, Size)>,
}

/// The working memory of [`NaturalSteps`] for one call at a time.
pub struct NaturalScratch {
    still: Still,
    /// The frame: amplitudes, (C, H, W), and depth, (H, W).
    rgb: Vec<f32>,
    depth: Vec<f32>,
    stack: FocalStackScratch,
    /// A_p times the scale and w_p of one colour, (P, H, W).
    wanted: Vec<f32>,
    weights: Vec<f32>,
    /// L of one colour.
    light: Vec<f32>,
    transform: Scratch,
    maps: Vec<OfMap>,
    /// A plane for registration.
    moved: [Vec<Complex32>; 2],
    /// The number of the first step, so that few steps of each frame of a video look at all planes in the end.
    first: usize,
    cancel: Cancel,
}

/// The working memory of one map.
struct OfMap {
    /// The spectrum of L·e, and the sum of K_pᴴ(r_p·u) in the Fourier domain.
    spectrum: Vec<Complex32>,
    sum: Vec<Complex32>,
    /// L·e, then u, then r_p·u, (H, W).
    view: Vec<Complex32>,
    /// v, (H, W).
    speed: Vec<f32>,
}

impl NaturalScratch {
    /// Makes the steps stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.cancel = cancel.clone();
    }
}

/// Returns γ of `maps` maps: the more there are, the less each changes the amplitudes. One map diverges at 1.
pub fn rate(maps: usize) -> f32 {
    (0.4 + 0.3 * maps as f32).at_most(1.5)
}

/// Returns after how many steps each of `planes` planes has had its turn. Steps that take the even and the odd planes
/// in turn bring as much as steps at all planes, steps at a third bring less.
pub fn turns(planes: usize) -> usize {
    if planes < 2 * FEWEST { 1 } else { 2 }
}

/// Returns the number of a frame's first step, if that of the frame before was `last` and `follows`, else 0.
pub fn first_step(last: usize, steps: usize, planes: usize, follows: bool) -> usize {
    if follows { (last + steps) % turns(planes) } else { 0 }
}

/// Returns the numbers of those of `planes` planes that step number `step` looks at.
pub fn turn(step: usize, planes: usize) -> impl ExactSizeIterator<Item = usize> {
    (step % turns(planes)..planes).step_by(turns(planes))
}

/// Returns z of the planes for `display`, in metres.
pub fn planes(display: &Display) -> Vec<f64> {
    let span_m = SPAN * display.volume_depth_m();
    let blur = span_m * motion_per_m(display, display.longest_wavelength_m());
    let last = ((blur / SPACING_PX).ceil() + 1.0).clamp(PLANES[0], PLANES[1]) as usize - 1;
    (0..=last)
        .map(|plane| (plane as f64 / last as f64 - 0.5) * span_m)
        .collect()
}

impl NaturalSteps {
    /// Plans `steps` for frames of `size` on `target`.
    ///
    /// # Errors
    /// Returns an error if the target has a learned model, or if a plane is too far to propagate to.
    pub fn new(size: Size, target: &Target, steps: usize) -> Result<Self> {
        if target.model.is_some() {
            return Err(Error::Setting(
                "steps of natural focus do not know a learned model; leave the model out, or use coherent focus".into(),
            ));
        }
        let display = &target.display;
        let z_m = planes(display);
        let reversed = target.correction.as_ref().map(Aberration::reversed);
        let (pitch_m, colours) = (display.pitch_m(), display.wavelengths_m());
        let more = (reversed.as_ref()).map_or(0, |a| (a.reach_m(pitch_m) / pitch_m).ceil() as usize);
        let farthest_m = z_m.iter().map(|z| (z - display.offset_m()).abs()).fold(0.0, f64::max);
        let wider = Size {
            width: size.width.saturating_add(more),
            height: size.height.saturating_add(more),
        };
        let padded = padded_size(
            wider,
            pitch_m,
            display.longest_wavelength_m(),
            farthest_m,
            Padding::Reach,
        )?;
        let path = |colour: usize, z_m: f64| {
            let distance_m = z_m - display.offset_m();
            match &reversed {
                None => Transfer::new(padded, pitch_m, colours[colour], distance_m, |_, _| true),
                Some(aberration) => Transfer::corrected(padded, pitch_m, colours[colour], distance_m, |mu, nu| {
                    aberration.phase(colour, mu, nu, pitch_m)
                }),
            }
        };
        let paths = (0..colours.len()).flat_map(|colour| z_m.iter().map(move |z_m| (colour, *z_m)));
        Ok(NaturalSteps {
            size,
            steps,
            opening: Opening::centred(display.aperture_radius()),
            stack: FocalStack::new(size, display, &z_m)?,
            display: display.clone(),
            fft: Fft2::new(size, padded),
            paths: paths.map(|(colour, z_m)| path(colour, z_m)).collect(),
            registration: RegistrationPlan::new(size, colours.len(), &target.registration)?,
            illumination: (target.illumination.clone()).map(|light| (light, target.modulator())),
        })
    }

    /// Returns K_p without the aperture, colour by colour, on planes of [`Self::padded_size`].
    pub fn paths(&self) -> &[Transfer] {
        &self.paths
    }

    /// Returns the padded size of the paths.
    pub fn padded_size(&self) -> Size {
        self.fft.padded_size()
    }

    /// Returns the stack that the steps aim at, without the memory of the paths.
    pub fn into_stack(self) -> FocalStack {
        self.stack
    }

    /// Returns working memory for `maps` maps and one call at a time, sized for the current thread pool.
    pub fn scratch(&self, maps: usize) -> NaturalScratch {
        let (plane, colours, planes) = (self.size.pixels(), self.display.colours(), self.stack.z_m().len());
        let padded = self.fft.padded_size().pixels();
        let moved = if self.registration.is_some() { plane } else { 0 };
        NaturalScratch {
            still: Still::new(colours * plane, self.size.width),
            rgb: vec![0.0; colours * plane],
            depth: vec![0.0; plane],
            stack: self.stack.scratch(),
            wanted: vec![0.0; planes * plane],
            weights: vec![0.0; planes * plane],
            light: vec![1.0; plane],
            transform: self.fft.scratch(),
            maps: (0..maps)
                .map(|_| OfMap {
                    spectrum: vec![Complex32::ZERO; padded],
                    sum: vec![Complex32::ZERO; padded],
                    view: vec![Complex32::ZERO; plane],
                    speed: vec![0.0; plane],
                })
                .collect(),
            moved: [vec![Complex32::ZERO; moved], vec![Complex32::ZERO; moved]],
            first: 0,
            cancel: Cancel::default(),
        }
    }

    /// Stores `frame`, whose focal stack [`Self::correct`] aims at.
    ///
    /// # Panics
    /// Panics if the frame has another shape or other colours.
    pub fn aim(&self, frame: &RgbdFrame, scratch: &mut NaturalScratch) {
        let (rgb, depth) = frame.values();
        scratch.rgb.copy_from_slice(rgb);
        scratch.depth.copy_from_slice(depth);
        self.stack.prepare(&scratch.depth, &mut scratch.stack);
    }

    /// Stores `field`, (C, H, W) at the modulator. If the frame follows one of scale `past`, its unchanged pixels start
    /// from their previous phases, and the planes go on having their turns.
    ///
    /// # Panics
    /// Panics if `field` does not have C·H·W values.
    pub fn keep(&self, field: &[Complex32], past: Option<f32>, scratch: &mut NaturalScratch) {
        scratch.still.keep(field, past);
        scratch.first = first_step(scratch.first, self.steps, self.stack.z_m().len(), past.is_some());
    }

    /// Corrects `phases`, (C, H, W) in \[0, 2π), toward the stack of the stored frame. `scale` is the amplitude that
    /// maps to full light.
    ///
    /// # Panics
    /// Panics if `phases` does not have C·H·W values or `scratch` is for several maps.
    pub fn correct(&self, scale: f32, phases: &mut [f32], scratch: &mut NaturalScratch) {
        if scale <= 0.0 {
            scratch.still.forget();
            return; // Darkness needs no correction.
        }
        scratch.still.start(phases);
        self.correct_maps(scale, &mut [phases], scratch);
        scratch.still.end(phases);
    }

    /// Corrects several maps, (C, H, W) each, whose mean intensity the eye sees, toward the stack of the stored frame.
    ///
    /// # Panics
    /// Panics if `scratch` is for another number of maps, or if a map does not have C·H·W values.
    pub fn correct_maps(&self, scale: f32, maps: &mut [&mut [f32]], scratch: &mut NaturalScratch) {
        assert_eq!(maps.len(), scratch.maps.len());
        let plane = self.size.pixels();
        for colour in 0..self.display.colours() {
            self.aim_colour(colour, scratch);
            scratch.maps.iter_mut().for_each(|map| map.speed.fill(0.0));
            for number in scratch.first..scratch.first + self.steps {
                if scratch.cancel.requested() {
                    return;
                }
                let of_colour = maps.iter_mut().map(|map| &mut map[colour * plane..][..plane]);
                self.step(number, colour, 1.0 / scale, of_colour, scratch);
            }
        }
    }

    /// Computes the stack, the weights and the light of `colour`.
    fn aim_colour(&self, colour: usize, scratch: &mut NaturalScratch) {
        let plane = self.size.pixels();
        let amplitude = &scratch.rgb[colour * plane..][..plane];
        for (index, wanted) in scratch.wanted.chunks_exact_mut(plane).enumerate() {
            self.stack.write(colour, index, amplitude, wanted, &mut scratch.stack);
            self.register(colour, wanted, &mut scratch.moved);
        }
        let per_m = motion_per_m(&self.display, self.display.wavelengths_m()[colour]);
        let weight = |depth: f32, z_m: f64| {
            let blur = (self.display.z_of_depth(depth.into()) - z_m) * per_m;
            (1.0 + IN_FOCUS * (-(blur / FOCUS_PX).powi(2)).exp()) as f32
        };
        for (weights, z_m) in scratch.weights.chunks_exact_mut(plane).zip(self.stack.z_m()) {
            let values = weights.par_iter_mut().zip(&scratch.depth);
            values.for_each(|(to, depth)| *to = weight(*depth, *z_m));
        }
        let planes = self.stack.z_m().len();
        let mut sums = vec![0.0; plane];
        for weights in scratch.weights.chunks_exact(plane) {
            (sums.par_iter_mut().zip(weights)).for_each(|(sum, weight)| *sum += weight);
        }
        for weights in scratch.weights.chunks_exact_mut(plane) {
            let values = weights.par_iter_mut().zip(&sums);
            values.for_each(|(weight, sum)| *weight *= planes as f32 / sum);
            self.register(colour, weights, &mut scratch.moved);
        }
        if let Some((illumination, modulator)) = &self.illumination {
            let height = self.size.height;
            let rows = scratch.light.par_chunks_exact_mut(self.size.width).enumerate();
            rows.for_each(|(y, row)| illumination.light_row(row, colour * height + y, height, *modulator));
        }
    }

    /// Moves `plane` as the colour's field is moved at the modulator.
    fn register(&self, colour: usize, plane: &mut [f32], [wave, scratch]: &mut [Vec<Complex32>; 2]) {
        if let Some(registration) = &self.registration {
            (wave.iter_mut().zip(plane.iter())).for_each(|(wave, value)| *wave = Complex32::new(*value, 0.0));
            registration.apply(colour, wave, scratch);
            (plane.iter_mut().zip(wave.iter())).for_each(|(value, wave)| *value = wave.re.at_least(0.0));
        }
    }

    fn step<'a>(
        &self,
        number: usize,
        colour: usize,
        per_scale: f32,
        phases: impl Iterator<Item = &'a mut [f32]>,
        scratch: &mut NaturalScratch,
    ) {
        let phases: Vec<_> = phases.collect();
        let (fft, plane, padded) = (&self.fft, self.size.pixels(), self.fft.padded_size());
        let NaturalScratch {
            maps,
            transform,
            light,
            wanted,
            weights,
            ..
        } = scratch;
        let Scratch { rows, columns, work } = transform;
        for (map, phases) in maps.iter_mut().zip(&phases) {
            displayed(&mut map.view, phases, light);
            fft.rows_forward(&map.view, rows, work);
            fft.spectrum(
                rows,
                &mut map.spectrum,
                |x, column, _| self.opening.stop(x, padded, column),
                work,
            );
            map.sum.fill(Complex32::ZERO);
        }
        let planes = self.stack.z_m().len();
        for index in turn(number, planes) {
            let path = &self.paths[colour * planes + index];
            for map in maps.iter_mut() {
                let from = |x: usize, column: &mut [Complex32]| {
                    column.copy_from_slice(&map.spectrum[x * padded.height..][..padded.height]);
                    path.apply(x, column);
                };
                fft.columns_inverse(columns, from, work);
                fft.rows_inverse(columns, rows, work);
                fft.crop(rows, &mut map.view);
            }
            let at = index * plane..(index + 1) * plane;
            self.missing(maps, &wanted[at.clone()], &weights[at], per_scale);
            for map in maps.iter_mut() {
                fft.rows_forward(&map.view, rows, work);
                fft.spectrum(rows, columns, |_, _, _| {}, work);
                let columns = columns
                    .par_chunks_exact_mut(padded.height)
                    .zip(map.sum.par_chunks_exact_mut(padded.height));
                columns
                    .enumerate()
                    .for_each(|(x, (column, sum))| path.add_adjoint(x, column, sum));
            }
        }
        let rate = rate(maps.len());
        let share = 2.0 / turn(number, planes).len() as f32;
        for (map, phases) in maps.iter_mut().zip(phases) {
            fft.columns_inverse(&mut map.sum, |x, column| self.opening.stop(x, padded, column), work);
            fft.rows_inverse(&map.sum, rows, work);
            fft.crop(rows, &mut map.view);
            let width = self.size.width;
            let rows = (phases
                .par_chunks_exact_mut(width)
                .zip(map.speed.par_chunks_exact_mut(width)))
            .zip(map.view.par_chunks_exact(width).zip(light.par_chunks_exact(width)));
            rows.for_each(|((phases, speed), (gradient, light))| {
                step_on(phases, speed, gradient, light, (rate, share));
            });
        }
    }

    /// Replaces u by r_p·u in the views of all maps.
    fn missing(&self, maps: &mut [OfMap], wanted: &[f32], weights: &[f32], per_scale: f32) {
        // One task holds a row of every map.
        let width = self.size.width;
        let mut rows: Vec<Vec<&mut [Complex32]>> = (0..self.size.height).map(|_| Vec::new()).collect();
        let per_map = 1.0 / maps.len() as f32;
        for map in maps {
            for (row, view) in rows.iter_mut().zip(map.view.chunks_exact_mut(width)) {
                row.push(view);
            }
        }
        let rows = rows
            .par_iter_mut()
            .zip(wanted.par_chunks_exact(width).zip(weights.par_chunks_exact(width)));
        rows.for_each(|(views, (wanted, weights))| {
            wide!({
                for (x, (wanted, weight)) in wanted.iter().zip(weights).enumerate() {
                    let intensity: f32 = views.iter().map(|view| view[x].norm_sqr()).sum();
                    let amplitude = (intensity * per_map).sqrt() + FLOOR;
                    let factor = weight * (amplitude - wanted * per_scale) / amplitude;
                    views.iter_mut().for_each(|view| view[x] *= factor);
                }
            });
        });
    }
}

/// Writes L·exp(iφ) into `wave`.
fn displayed(wave: &mut [Complex32], phases: &[f32], light: &[f32]) {
    (wave.par_iter_mut().zip(phases).zip(light))
        .for_each(|((wave, phase), light)| *wave = Complex32::from_polar(*light, *phase));
}

/// Moves φ by a step of length γ = `rate` along `gradient`, Σ_p K_pᴴ(r_p·u), with `share` = 2/P.
fn step_on(phases: &mut [f32], speed: &mut [f32], gradient: &[Complex32], light: &[f32], (rate, share): (f32, f32)) {
    for (((phase, speed), gradient), light) in phases.iter_mut().zip(speed).zip(gradient).zip(light) {
        let (sin, cos) = phase.sin_cos();
        let slope = light * (gradient.im * cos - gradient.re * sin);
        *speed = MOMENTUM * *speed + share * slope;
        *phase = wrap(*phase - rate * *speed);
    }
}

/// Computes the steps of one colour in f64, value by value, as the oracle for tests. `to_plane(p, …)` is K_p and
/// `to_modulator(p, …)` its adjoint; `wanted` is A_p and `weights` w_p of each plane; `light` is L.
pub fn reference(
    to_plane: impl Fn(usize, &[Complex64]) -> Vec<Complex64>,
    to_modulator: impl Fn(usize, &[Complex64]) -> Vec<Complex64>,
    (wanted, weights): (&[Vec<f64>], &[Vec<f64>]),
    maps: &mut [Vec<f64>],
    light: &[f64],
    steps: usize,
) {
    let (count, planes) = (maps.len(), wanted.len());
    let rate = f64::from(rate(count));
    let mut speeds = vec![vec![0.0; light.len()]; count];
    for step in 0..steps {
        let shown = |map: &Vec<f64>| -> Vec<Complex64> {
            let values = map.iter().zip(light);
            values
                .map(|(phase, light)| Complex64::from_polar(*light, *phase))
                .collect()
        };
        let shown: Vec<_> = maps.iter().map(shown).collect();
        let mut sums = vec![vec![Complex64::ZERO; light.len()]; count];
        for p in turn(step, planes) {
            let mut views: Vec<_> = shown.iter().map(|wave| to_plane(p, wave)).collect();
            for x in 0..light.len() {
                let intensity: f64 = views.iter().map(|view| view[x].norm_sqr()).sum();
                let amplitude = (intensity / count as f64).sqrt() + f64::from(FLOOR);
                let factor = weights[p][x] * (amplitude - wanted[p][x]) / amplitude;
                views.iter_mut().for_each(|view| view[x] *= factor);
            }
            for (sum, view) in sums.iter_mut().zip(&views) {
                let back = to_modulator(p, view);
                sum.iter_mut().zip(back).for_each(|(sum, back)| *sum += back);
            }
        }
        let share = 2.0 / turn(step, planes).len() as f64;
        for (((map, speed), sum), shown) in maps.iter_mut().zip(&mut speeds).zip(&sums).zip(&shown) {
            for (((phase, speed), sum), shown) in map.iter_mut().zip(speed).zip(sum).zip(shown) {
                *speed = f64::from(MOMENTUM) * *speed + share * (sum * shown.conj()).im;
                *phase -= rate * *speed;
            }
        }
    }
}
