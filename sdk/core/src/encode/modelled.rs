//! Correction of phases for a display whose behaviour was learned from photographs
//! ([`crate::display::model`]). The phases of the encoder are those of an ideal display; these steps replace them by
//! phases whose light on this display is nearest to the target field at the midpoint.
//!
//! The steps begin with the encoder's phases turned by π, so that they wrap as little as possible: where neighbours lie
//! on both sides of the wrap, crosstalk passes through all phases between. Phases then go through the inverse of the
//! learned curve. Without steps, the phases are turned into the middle of what a pixel reaches, and crosstalk is undone
//! as far as the pixels reach: `SHARPENINGS` steps r ← r + μ·(ψ − W∗r), μ = `SHARPER`, bring the pixels' own phases
//! r to those whose blurred phases are ψ. Other steps that begin there end lower. A step follows the gradient of
//!
//!   E = λ·Σ|u − cT|² + (1 − λ)·Σ(|u| − |cT|)²,  u = K(v(θ)),
//!
//! with T the target field at the midpoint, K the path to it through the learned pupil, v the learned field at the
//! modulator, and λ = [`WAVE`] as in [`super::midpoint`]. The factor c, one complex number for each colour, is the one
//! that brings cT nearest to u: the brightness that this display reaches, and a phase that the eye does not see.

use super::midpoint::{MidpointSteps, WAVE};
use crate::Bounds;
use crate::Size;
use crate::display::model::Model;
use crate::display::response::wrap;
use crate::display::target::Target;
use crate::optics::aperture::Opening;
use crate::optics::asm::Propagator;
use crate::optics::fft::{ConvolveScratch, frequency};
use crate::parallel::prelude::*;
use crate::runtime::cancel::Cancel;
use crate::runtime::error::Result;
use num_complex::{Complex32, Complex64};
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// The length of a step, relative to that of Newton's method for pixels that do not depend on each other.
const GAIN: f32 = 1.5;
/// The share of the last step that a step continues.
const MOMENTUM: f32 = 0.5;
/// The laser's amplitude below which steps of a pixel do not become longer.
const DIMMEST: f32 = 0.1;

/// The number of steps that undo crosstalk, and their length. Steps below 2 converge, because the weights of crosstalk
/// have the sum 1.
const SHARPENINGS: usize = 6;
const SHARPER: f32 = 1.5;

/// A plan for one shape and target. It is immutable and can be shared between threads.
pub struct ModelSteps {
    height: usize,
    width: usize,
    steps: usize,
    model: Arc<Model>,
    colours: Vec<OfColour>,
}

/// The light and the path of one colour.
struct OfColour {
    /// Λ·L and Λ·Q, (H, W).
    light: Vec<Complex32>,
    undiffracted: Vec<Complex32>,
    /// The free path from the modulator to the midpoint.
    free: Propagator,
    /// The factors of the spectrum on the same path through the aperture and the pupil, (W', H').
    way: Vec<Complex32>,
}

/// The working memory of [`ModelSteps`] for one call at a time.
pub struct ModelScratch {
    wave: ConvolveScratch,
    /// The field at the modulator in all colours.
    field: Vec<Complex32>,
    /// Λ·L·exp(iψ).
    shown: Vec<Complex32>,
    /// u, then what is missing at the midpoint, then at the modulator.
    missing: Vec<Complex32>,
    /// The responses of the phases, then the gradient by ψ.
    responses: Vec<f32>,
    /// ψ, then the gradient by the responses.
    spread: Vec<f32>,
    /// The last step.
    step: Vec<f32>,
    /// Sums over rows.
    sums: Vec<[Complex64; 2]>,
    cancel: Cancel,
}

impl ModelScratch {
    /// Makes the steps stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.cancel = cancel.clone();
    }
}

impl ModelSteps {
    /// Plans `steps` for fields of `size` at the modulator of `target`, or returns `None` if the target
    /// has no model.
    ///
    /// # Errors
    /// Returns an error if the offset or correction cannot be planned.
    pub fn new(size: Size, target: &Target, steps: usize) -> Result<Option<Self>> {
        let Some(model) = target.model.clone() else {
            return Ok(None);
        };
        let ideal = MidpointSteps::new(size, target, steps)?;
        let Size { width, height } = size;
        let modulator = target.modulator();
        let corner = (
            modulator.height.saturating_sub(height) / 2,
            modulator.width.saturating_sub(width) / 2,
        );
        let colour = |(colour, free): (usize, &Propagator)| {
            let mut light = vec![1.0; width];
            let mut planes = [vec![], vec![]];
            for y in 0..height {
                if let Some(of) = &target.illumination {
                    of.light_row(&mut light, colour * height + y, height, modulator);
                }
                for (x, light) in light.iter().enumerate() {
                    let learned = model.light(colour, y + corner.0, x + corner.1, modulator);
                    (planes.iter_mut().zip(learned)).for_each(|(plane, value)| plane.push(value * light));
                }
            }
            let [light, undiffracted] = planes;
            OfColour {
                light,
                undiffracted,
                way: way(free, target.display.aperture_radius(), |fx, fy| {
                    model.colours()[colour].pupil_at(fx, fy)
                }),
                free: free.clone(),
            }
        };
        Ok(Some(ModelSteps {
            height,
            width,
            steps,
            colours: ideal.back().iter().enumerate().map(colour).collect(),
            model,
        }))
    }

    /// Returns working memory for one call at a time, sized for the current thread pool.
    pub fn scratch(&self) -> ModelScratch {
        let area = self.height * self.width;
        let plane = || vec![Complex32::ZERO; area];
        ModelScratch {
            wave: self.colours[0].free.scratch(),
            field: vec![Complex32::ZERO; self.colours.len() * area],
            shown: plane(),
            missing: plane(),
            responses: vec![0.0; area],
            spread: vec![0.0; area],
            step: vec![0.0; area],
            sums: vec![[Complex64::ZERO; 2]; self.height],
            cancel: Cancel::default(),
        }
    }

    /// Stores `field`, (C, H, W) at the modulator, neither filtered nor scaled, as the target of [`Self::correct`].
    ///
    /// # Panics
    /// Panics if `field` does not have C·H·W values.
    pub fn keep(&self, field: &[Complex32], scratch: &mut ModelScratch) {
        scratch.field.copy_from_slice(field);
    }

    /// Replaces `phases`, (C, H, W) in \[0, 2π), for an ideal display by those for this one. A colour whose field
    /// contains NaN or infinity takes no steps. Allocates nothing.
    ///
    /// # Panics
    /// Panics if `phases` does not have C·H·W values.
    pub fn correct(&self, phases: &mut [f32], scratch: &mut ModelScratch) {
        assert_eq!(phases.len(), scratch.field.len());
        let area = self.height * self.width;
        for (colour, phases) in phases.chunks_exact_mut(area).enumerate() {
            if self.steps == 0 {
                self.undo(colour, phases, scratch);
            } else {
                self.begin(colour, phases);
            }
            let mut wanted = std::mem::take(&mut scratch.field);
            self.correct_colour(colour, &mut wanted[colour * area..][..area], phases, scratch);
            scratch.field = wanted;
        }
    }

    /// Replaces `phases` by those from which the steps begin.
    fn begin(&self, colour: usize, phases: &mut [f32]) {
        let model = &self.model.colours()[colour];
        (phases.par_chunks_exact_mut(self.width).flatten())
            .for_each(|phase| *phase = model.inverse(model.nearest(wrap(*phase + PI))).at_most(TAU.next_down()));
    }

    /// Replaces `phases` by those that undo crosstalk and the learned curve, as far as the pixels reach.
    fn undo(&self, colour: usize, phases: &mut [f32], scratch: &mut ModelScratch) {
        let (model, width) = (&self.model.colours()[colour], self.width);
        let [low, high] = model.reach();
        let middle = 0.5 * (low + high);
        let ModelScratch { responses, spread, .. } = scratch;
        (phases
            .par_chunks_exact_mut(width)
            .zip(responses.par_chunks_exact_mut(width)))
        .for_each(|(phases, own)| {
            for (phase, own) in phases.iter_mut().zip(own) {
                *phase = (middle + wrap(*phase + PI) - PI).clamp(low, high);
                *own = *phase;
            }
        });
        for _ in 0..SHARPENINGS {
            let own = &*responses;
            (spread.par_chunks_exact_mut(width).enumerate()).for_each(|(y, row)| model.spread_row(own, y, row));
            let rows = (responses
                .par_chunks_exact_mut(width)
                .zip(phases.par_chunks_exact(width)))
            .zip(spread.par_chunks_exact(width));
            rows.for_each(|((own, wanted), spread)| {
                for ((own, wanted), spread) in own.iter_mut().zip(wanted).zip(spread) {
                    *own = (*own + SHARPER * (wanted - spread)).clamp(low, high);
                }
            });
        }
        let rows = phases
            .par_chunks_exact_mut(width)
            .zip(responses.par_chunks_exact(width));
        rows.for_each(|(phases, own)| {
            for (phase, own) in phases.iter_mut().zip(own) {
                *phase = model.inverse(*own).at_most(TAU.next_down());
            }
        });
    }

    fn correct_colour(&self, colour: usize, wanted: &mut [Complex32], phases: &mut [f32], scratch: &mut ModelScratch) {
        if self.steps == 0 {
            return;
        }
        self.colours[colour].free.propagate(wanted, &mut scratch.wave);
        if !wanted.par_iter().all(|value| value.is_finite()) {
            return; // A transform would spread such a value over the whole frame.
        }
        scratch.step.fill(0.0);
        for _ in 0..self.steps {
            if scratch.cancel.requested() {
                return;
            }
            self.show(colour, phases, scratch);
            let factor = self.nearest(wanted, scratch);
            self.descend(colour, wanted, factor, phases, scratch);
        }
    }

    /// Computes Λ·L·exp(iψ) and u of `phases`.
    fn show(&self, colour: usize, phases: &[f32], scratch: &mut ModelScratch) {
        let (model, of, width) = (&self.model.colours()[colour], &self.colours[colour], self.width);
        let ModelScratch {
            wave,
            shown,
            missing,
            responses,
            spread,
            ..
        } = scratch;
        let rows = responses
            .par_chunks_exact_mut(width)
            .zip(phases.par_chunks_exact(width));
        rows.for_each(|(responses, phases)| {
            for (response, phase) in responses.iter_mut().zip(phases) {
                *response = model.response(*phase).0;
            }
        });
        let responses = &*responses;
        let rows = (shown
            .par_chunks_exact_mut(width)
            .zip(missing.par_chunks_exact_mut(width)))
        .zip(spread.par_chunks_exact_mut(width));
        rows.enumerate().for_each(|(y, ((shown, field), spread))| {
            model.spread_row(responses, y, spread);
            let lights = of.light[y * width..].iter().zip(&of.undiffracted[y * width..]);
            let values = shown.iter_mut().zip(field).zip(spread).zip(lights);
            for (((shown, field), psi), (light, undiffracted)) in values {
                *shown = light * Complex32::from_polar(1.0, *psi);
                *field = *shown + undiffracted;
            }
        });
        self.filter(colour, missing, wave, |value, factor| value * factor);
    }

    /// Returns the factor c of `wanted` for u in `scratch`.
    fn nearest(&self, wanted: &[Complex32], scratch: &mut ModelScratch) -> Complex32 {
        let rows = wanted
            .par_chunks_exact(self.width)
            .zip(scratch.missing.par_chunks_exact(self.width));
        scratch.sums.par_iter_mut().zip(rows).for_each(|(sums, (wanted, u))| {
            *sums = [Complex64::ZERO; 2];
            for (wanted, u) in wanted.iter().zip(u) {
                let both = wanted.conj() * u;
                sums[0] += Complex64::new(both.re.into(), both.im.into());
                sums[1] += f64::from(wanted.norm_sqr());
            }
        });
        let (mut both, mut own) = (Complex64::ZERO, 0.0);
        for sums in &scratch.sums {
            both += sums[0];
            own += sums[1].re;
        }
        let factor = both / own.max(f64::MIN_POSITIVE);
        Complex32::new(factor.re as f32, factor.im as f32)
    }

    /// Moves `phases` by one step toward `factor`·`wanted`, from u in `scratch`.
    fn descend(
        &self,
        colour: usize,
        wanted: &[Complex32],
        factor: Complex32,
        phases: &mut [f32],
        scratch: &mut ModelScratch,
    ) {
        let (model, width) = (&self.model.colours()[colour], self.width);
        self.gradient(colour, wanted, factor, scratch);
        let responses = &scratch.responses;
        let rows = (scratch
            .step
            .par_chunks_exact_mut(width)
            .zip(scratch.spread.par_chunks_exact_mut(width)))
        .zip(phases.par_chunks_exact_mut(width));
        rows.enumerate().for_each(|(y, ((steps, gathered), phases))| {
            model.gather_row(responses, y, gathered);
            for ((phase, step), gathered) in phases.iter_mut().zip(steps).zip(gathered) {
                *step = MOMENTUM * *step - GAIN * model.response(*phase).1 * *gathered;
                *phase = (*phase + *step).clamp(0.0, TAU.next_down());
            }
        });
    }

    /// Replaces the responses in `scratch` by ∂E/∂ψ/(2|Λ·L|²), from u and the field in `scratch`.
    fn gradient(&self, colour: usize, wanted: &[Complex32], factor: Complex32, scratch: &mut ModelScratch) {
        let (of, width) = (&self.colours[colour], self.width);
        let ModelScratch {
            wave,
            shown,
            missing,
            responses,
            ..
        } = scratch;
        let rows = missing.par_chunks_exact_mut(width).zip(wanted.par_chunks_exact(width));
        rows.for_each(|(u, wanted)| {
            for (u, wanted) in u.iter_mut().zip(wanted) {
                let wanted = wanted * factor;
                let keep = (1.0 - WAVE) * wanted.norm() / u.norm().at_least(f32::MIN_POSITIVE) - 1.0;
                *u = wanted * WAVE + *u * keep;
            }
        });
        self.filter(colour, missing, wave, |value, factor| value * factor.conj());
        let rows = (responses.par_chunks_exact_mut(width).zip(shown.par_chunks_exact(width)))
            .zip(missing.par_chunks_exact(width));
        rows.zip(of.light.par_chunks_exact(width))
            .for_each(|(((slopes, shown), missing), light)| {
                for (((slope, shown), missing), light) in slopes.iter_mut().zip(shown).zip(missing).zip(light) {
                    *slope = -(shown.conj() * missing).im / light.norm_sqr().at_least(DIMMEST * DIMMEST);
                }
            });
    }

    /// Filters `plane` by the way of `colour`. The path backward is the transpose of the path forward but for the
    /// normalization, which both share.
    fn filter(
        &self,
        colour: usize,
        plane: &mut [Complex32],
        wave: &mut ConvolveScratch,
        by: impl Fn(Complex32, Complex32) -> Complex32 + Sync,
    ) {
        let of = &self.colours[colour];
        let height = of.free.padded_size().height;
        of.free.convolve(
            plane,
            |x, column| {
                for (value, factor) in column.iter_mut().zip(&of.way[x * height..]) {
                    *value = by(*value, *factor);
                }
            },
            wave,
        );
    }
}

/// Computes the factors of `free` behind an aperture of `radius` and a pupil, which is a function of the frequency in
/// cycles per pixel, (W', H').
pub fn way(free: &Propagator, radius: f64, pupil: impl Fn(f64, f64) -> Complex32 + Sync) -> Vec<Complex32> {
    let size @ Size { width, height } = free.padded_size();
    let mut way = vec![Complex32::ONE; height * width];
    way.par_chunks_exact_mut(height).enumerate().for_each(|(kx, column)| {
        Opening::centred(radius).stop(kx, size, column);
        free.transfer().apply(kx, column);
        for (ky, factor) in column.iter_mut().enumerate() {
            *factor *= pupil(frequency(kx, width), frequency(ky, height));
        }
    });
    way
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;
    use crate::display::illumination::Illumination;
    use crate::display::model::{ColourModel, PUPIL};
    use crate::optics::reference::dft;
    use ndarray::{Array2, Array3, s};

    const SIZE: Size = Size { width: 14, height: 9 };

    fn target(offset_m: f64) -> Target {
        let display = Display::from_toml("width = 18\nheight = 11\nwavelengths_nm = [532]").unwrap();
        let wave = |i: usize, by: f32| Complex32::from_polar(1.0 + by * (i % 5) as f32, by * (i % 7) as f32);
        let colour = ColourModel {
            curve: std::array::from_fn(|k| 0.15 * (k as f32 * 0.7).sin()),
            crosstalk: [0.01, 0.05, 0.02, 0.1, 0.7, 0.04, 0.0, 0.06, 0.02],
            pupil: (0..PUPIL * PUPIL).map(|i| wave(i, 0.03)).collect(),
            light: (0..12).map(|i| wave(i, 0.02)).collect(),
            undiffracted: (0..12).map(|i| wave(i, 0.1) * 0.05).collect(),
        };
        let beam = Array3::from_shape_fn((1, 3, 4), |(_, y, x)| 1.0 - 0.05 * (x + y) as f32);
        Target {
            illumination: Some(Illumination::new(beam.view()).unwrap()),
            model: Some(Model::new((3, 4), vec![colour]).unwrap().into()),
            ..display.with_offset_m(offset_m).unwrap().into()
        }
    }

    /// Computes E of `phases` in f64 by direct sums, as [`crate::display::model`] defines it.
    fn energy(target: &Target, phases: &[f64], wanted: &[Complex64], factor: Complex64) -> f64 {
        let Size { width: w, height: h } = SIZE;
        let model = target.model.as_ref().unwrap();
        let colour = &model.colours()[0];
        let curve = |phase: f64| {
            let at = phase / f64::from(TAU) * 16.0;
            let k = (at as usize).min(15);
            let [a, b] = [k, k + 1].map(|k| f64::from(colour.curve[k]));
            phase + a + (at - k as f64) * (b - a)
        };
        let (top, left) = (1, 2);
        let field = Array2::from_shape_fn(SIZE.shape(), |(y, x)| {
            let mut psi = 0.0;
            for (i, weight) in colour.crosstalk.iter().enumerate() {
                let at = |at: usize, d: usize, n: usize| (at + d).saturating_sub(1).min(n - 1);
                psi += f64::from(*weight) * curve(phases[at(y, i / 3, h) * w + at(x, i % 3, w)]);
            }
            let laser = 1.0
                / target
                    .illumination
                    .as_ref()
                    .unwrap()
                    .gain(0, y + top, x + left, Size { width: 18, height: 11 });
            let [light, rest] = (model.light(0, y + top, x + left, Size { width: 18, height: 11 }))
                .map(|v| Complex64::new(v.re.into(), v.im.into()) * f64::from(laser));
            light * Complex64::from_polar(1.0, psi) + rest
        });
        let steps = MidpointSteps::new(SIZE, target, 1).unwrap();
        let padded @ Size { width: pw, height: ph } = steps.back()[0].padded_size();
        let mut plane = Array2::zeros(padded.shape());
        plane.slice_mut(s![..h, ..w]).assign(&field);
        let mut spectrum = dft(&plane, -1.0);
        for ((ky, kx), value) in spectrum.indexed_iter_mut() {
            let f = |k: usize, n: usize| (if 2 * k < n { k as f64 } else { k as f64 - n as f64 }) / n as f64;
            let (fx, fy) = (f(kx, pw), f(ky, ph));
            let (lambda, pitch) = (532e-9, 8e-6);
            let square: f64 = 1.0 - lambda * lambda * (fx * fx + fy * fy) / (pitch * pitch);
            let phase = f64::from(TAU) * -target.display.offset_m() / lambda * (square.sqrt() - 1.0);
            let pupil = colour.pupil_at(fx, fy);
            let pupil = Complex64::new(pupil.re.into(), pupil.im.into());
            let passes = fx * fx + fy * fy <= 0.25;
            *value *= pupil * Complex64::from_polar(if passes { 1.0 } else { 0.0 }, phase);
        }
        let u = dft(&spectrum, 1.0) / (ph * pw) as f64;
        let wave = f64::from(WAVE);
        u.slice(s![..h, ..w])
            .iter()
            .zip(wanted)
            .map(|(u, wanted)| {
                let wanted = wanted * factor;
                wave * (u - wanted).norm_sqr() + (1.0 - wave) * (u.norm() - wanted.norm()).powi(2)
            })
            .sum()
    }

    fn wanted() -> Vec<Complex32> {
        (0..SIZE.pixels())
            .map(|i| Complex32::from_polar(0.3 + 0.02 * (i % 17) as f32, (i % 5) as f32 * 0.2))
            .collect()
    }

    #[test]
    fn steps_follow_the_gradient_of_direct_sums() {
        for offset_m in [0.0, 1e-3] {
            let target = target(offset_m);
            let plan = ModelSteps::new(SIZE, &target, 1).unwrap().unwrap();
            let mut scratch = plan.scratch();
            let phases: Vec<f32> = (0..SIZE.pixels())
                .map(|i| 2.0 + (i * 37 % 251) as f32 / 100.0)
                .collect();
            let wanted = wanted();
            plan.show(0, &phases, &mut scratch);
            let factor = plan.nearest(&wanted, &mut scratch);
            plan.gradient(0, &wanted, factor, &mut scratch);
            // ∂E/∂ψ, then ∂E/∂θ.
            for (slope, light) in scratch.responses.iter_mut().zip(&plan.colours[0].light) {
                *slope *= 2.0 * light.norm_sqr();
            }
            let colour = &target.model.as_ref().unwrap().colours()[0];
            let mut slopes = vec![0.0; phases.len()];
            for (y, row) in slopes.chunks_exact_mut(SIZE.width).enumerate() {
                colour.gather_row(&scratch.responses, y, row);
            }
            let double = |v: &Complex32| Complex64::new(v.re.into(), v.im.into());
            let (wanted, factor): (Vec<_>, _) = (wanted.iter().map(double).collect(), double(&factor));
            for at in [0, 13, 20, 57, 100, 125] {
                let of = |by: f64| {
                    let mut moved: Vec<f64> = phases.iter().map(|phase| f64::from(*phase)).collect();
                    moved[at] += by;
                    energy(&target, &moved, &wanted, factor)
                };
                let expected = (of(1e-5) - of(-1e-5)) / 2e-5;
                let got = f64::from(slopes[at] * colour.response(phases[at]).1);
                assert!((got - expected).abs() < 2e-4, "{at}: {got} {expected}");
                assert!(expected.abs() > 1e-3 || at > 0, "a pixel that matters");
            }
        }
    }

    #[test]
    fn crosstalk_and_the_curve_are_undone() {
        let target = target(0.0);
        let plan = ModelSteps::new(SIZE, &target, 0).unwrap().unwrap();
        let model = &plan.model.colours()[0];
        let [low, high] = model.reach();
        // The phases of a double phase around 0.
        let asked: Vec<f32> = (0..SIZE.pixels())
            .map(|i| {
                wrap(
                    if (i / SIZE.width + i).is_multiple_of(2) {
                        0.9
                    } else {
                        -0.9
                    } + 0.1 * (i % 3) as f32,
                )
            })
            .collect();
        let mut scratch = plan.scratch();
        let mut phases = asked.clone();
        plan.undo(0, &mut phases, &mut scratch);
        let responses: Vec<f32> = phases.iter().map(|phase| model.response(*phase).0).collect();
        let mut row = vec![0.0; SIZE.width];
        for y in 0..SIZE.height {
            model.spread_row(&responses, y, &mut row);
            for (x, shown) in row.iter().enumerate() {
                let off = wrap(shown - 0.5 * (low + high) - asked[y * SIZE.width + x] + PI) - PI;
                assert!(off.abs() < 0.02, "{y} {x}: {off}");
            }
        }
    }

    /// Returns the wanted field at the z of the steps, and the factor that brings it nearest to the light of `phases`.
    fn seen(plan: &ModelSteps, phases: &[f32]) -> (Vec<Complex32>, Complex32) {
        let (mut scratch, mut field) = (plan.scratch(), wanted());
        plan.colours[0].free.propagate(&mut field, &mut scratch.wave);
        plan.show(0, phases, &mut scratch);
        let factor = plan.nearest(&field, &mut scratch);
        (field, factor)
    }

    #[test]
    fn steps_bring_the_light_nearer_and_have_the_same_bits_on_any_number_of_threads() {
        let target = target(1e-3);
        let double = |v: &Complex32| Complex64::new(v.re.into(), v.im.into());
        let error = |phases: &[f32], (field, factor): (Vec<Complex32>, Complex32)| {
            let phases: Vec<f64> = phases.iter().map(|phase| f64::from(*phase)).collect();
            let field: Vec<_> = field.iter().map(double).collect();
            energy(&target, &phases, &field, double(&factor))
        };
        let asked: Vec<f32> = (0..SIZE.pixels()).map(|i| (i % 62) as f32 * 0.1).collect();
        let mut errors = vec![];
        for steps in [0, 1, 20] {
            let mut results = [1, 3].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
                pool.build().unwrap().install(|| {
                    let plan = ModelSteps::new(SIZE, &target, steps).unwrap().unwrap();
                    let (mut phases, mut scratch) = (asked.clone(), plan.scratch());
                    plan.keep(&wanted(), &mut scratch);
                    plan.correct(&mut phases, &mut scratch);
                    let seen = seen(&plan, &phases);
                    (phases, seen)
                })
            });
            assert!(results[0] == results[1], "other bits on other threads");
            let (phases, seen) = std::mem::take(&mut results[0]);
            assert!(phases.iter().all(|phase| (0.0..TAU).contains(phase)));
            errors.push(error(&phases, seen));
        }
        // Without steps, the phases are others than those from which steps begin.
        let plan = ModelSteps::new(SIZE, &target, 1).unwrap().unwrap();
        let mut begun = asked;
        plan.begin(0, &mut begun);
        errors[0] = error(&begun, seen(&plan, &begun));
        assert!(errors[1] < errors[0] && errors[2] < 0.5 * errors[0], "{errors:?}");
    }
}
