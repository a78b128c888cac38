//! Correction of phases at the midpoint. Each step propagates the displayed wave to the midpoint, moves it toward the
//! target field and propagates it back, with four transforms for each colour. In video, a pixel whose field did not
//! change continues from the previous frame, so one step for each frame converges like many steps.
//!
//! Let e be the displayed phasors, L the light that falls on the modulator, K the path to the midpoint (the aperture
//! and propagation back over the offset), and T the target field at the midpoint divided by the scale. A step computes
//!
//!   u = K·L·e,  r = λ·T + (1 − λ)·|T|·u/|u| − u,  z = L·e + γ·Kᴴ·r,  e' = z/|z|.
//!
//! λ = 0 corrects only the amplitude, as in Gerchberg and Saxton (Optik 35, 237, 1972), and leaves other depths out of
//! focus. λ = 1 corrects the whole wave, including the phase, which the eye does not see.

use super::still::Still;
use crate::Bounds;
use crate::Size;
use crate::display::illumination::Illumination;
use crate::display::target::Target;
use crate::optics::asm::{Padding, Propagator};
use crate::optics::fft::ConvolveScratch;
use crate::optics::zernike::Aberration;
use crate::parallel::prelude::*;
use crate::runtime::cancel::Cancel;
use crate::runtime::error::Result;
use num_complex::{Complex32, Complex64};
use phasefront_kernels::wide;

/// λ, the weight of the wave against the amplitude alone. Chosen on validation scenes by the focal stack.
pub const WAVE: f32 = 0.5;
/// γ, the length of a step.
pub const GAIN: f32 = 1.5;
pub use super::still::STILL;
/// The largest number of steps. Steps after the third bring little gain.
pub(super) const MAX_STEPS: usize = 100;

/// A plan for one shape and target. It is immutable and can be shared between threads.
pub struct MidpointSteps {
    height: usize,
    width: usize,
    steps: usize,
    aperture_radius: f64,
    /// The propagation from the modulator to the midpoint, and from there to the modulator.
    back: Vec<Propagator>,
    forth: Vec<Propagator>,
    /// The illumination and the modulator's size. The hologram is in the middle of the modulator.
    illumination: Option<(Illumination, Size)>,
}

/// The working memory of [`MidpointSteps`] for one call at a time.
pub struct MidpointScratch {
    wave: ConvolveScratch,
    still: Still,
    /// T of one colour.
    wanted: Vec<Complex32>,
    /// u, then r.
    missing: Vec<Complex32>,
    /// L·e.
    shown: Vec<Complex32>,
    /// L.
    light: Vec<f32>,
    cancel: Cancel,
}

impl MidpointScratch {
    /// Makes the steps stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.cancel = cancel.clone();
    }
}

impl MidpointSteps {
    /// Plans `steps` for fields of `size` at the modulator of `target`.
    ///
    /// # Errors
    /// Returns an error if the offset or correction cannot be planned.
    pub fn new(size: Size, target: &Target, steps: usize) -> Result<Self> {
        let offset_m = target.display.offset_m();
        let reversed = target.correction.as_ref().map(Aberration::reversed);
        // A path without offset and correction still has the aperture.
        let ways = |distance_m: f64, correction: Option<&Aberration>| match target
            .propagators(size, 1, distance_m, correction)?
        {
            Some(ways) => Ok(ways),
            None => {
                let (pitch_m, colours) = (target.display.pitch_m(), target.display.wavelengths_m());
                Propagator::for_colours(size, pitch_m, colours, distance_m, Padding::Reach)
            }
        };
        Ok(MidpointSteps {
            height: size.height,
            width: size.width,
            steps,
            aperture_radius: target.display.aperture_radius(),
            back: ways(-offset_m, reversed.as_ref())?,
            forth: ways(offset_m, target.correction.as_ref())?,
            illumination: (target.illumination.clone()).map(|light| (light, target.modulator())),
        })
    }

    /// Returns the propagation from the modulator to the midpoint for each colour.
    pub fn back(&self) -> &[Propagator] {
        &self.back
    }

    /// Returns the propagation from the midpoint to the modulator for each colour.
    pub fn forth(&self) -> &[Propagator] {
        &self.forth
    }

    /// Returns working memory for one call at a time, sized for the current thread pool.
    pub fn scratch(&self) -> MidpointScratch {
        let plane = || vec![Complex32::ZERO; self.height * self.width];
        let values = self.back.len() * self.height * self.width;
        MidpointScratch {
            wave: self.back[0].scratch(),
            still: Still::new(values, self.width),
            wanted: plane(),
            missing: plane(),
            shown: plane(),
            light: vec![1.0; self.height * self.width],
            cancel: Cancel::default(),
        }
    }

    /// Stores `field`, (C, H, W) at the modulator, neither filtered nor scaled, as the target of [`Self::correct`]. If
    /// the frame follows one of scale `past`, its unchanged pixels start from their previous phases.
    ///
    /// # Panics
    /// Panics if `field` does not have C·H·W values.
    pub fn keep(&self, field: &[Complex32], past: Option<f32>, scratch: &mut MidpointScratch) {
        scratch.still.keep(field, past);
    }

    /// Corrects `phases`, (C, H, W) in \[0, 2π), toward the stored field. `scale` is the amplitude that maps to full
    /// light. A colour whose field contains NaN or infinity stays unchanged. Allocates nothing.
    ///
    /// # Panics
    /// Panics if `phases` does not have C·H·W values.
    pub fn correct(&self, scale: f32, phases: &mut [f32], scratch: &mut MidpointScratch) {
        assert_eq!(phases.len(), scratch.still.field.len());
        if scale <= 0.0 {
            scratch.still.forget();
            return; // Darkness needs no correction.
        }
        scratch.still.start(phases);
        for (colour, phases) in phases.chunks_exact_mut(self.height * self.width).enumerate() {
            self.correct_colour(colour, 1.0 / scale, phases, scratch);
        }
        scratch.still.end(phases);
    }

    fn correct_colour(&self, colour: usize, per_scale: f32, phases: &mut [f32], scratch: &mut MidpointScratch) {
        let MidpointScratch {
            wave,
            still,
            wanted,
            missing,
            shown,
            light,
            cancel,
        } = scratch;
        let (width, radius) = (self.width, self.aperture_radius);
        if let Some((illumination, modulator)) = &self.illumination {
            let rows = light.par_chunks_exact_mut(width).enumerate();
            rows.for_each(|(y, row)| illumination.light_row(row, colour * self.height + y, self.height, *modulator));
        }
        wanted.copy_from_slice(&still.field[colour * phases.len()..][..phases.len()]);
        self.back[colour].propagate(wanted, wave);
        if !wanted.par_iter().all(|value| value.is_finite()) {
            return; // A transform would spread such a value over the whole frame.
        }
        let rows =
            (shown.par_chunks_exact_mut(width).zip(phases.par_chunks_exact(width))).zip(light.par_chunks_exact(width));
        rows.for_each(|((shown, phases), light)| {
            for ((shown, phase), light) in shown.iter_mut().zip(phases).zip(light) {
                *shown = Complex32::from_polar(*light, *phase);
            }
        });
        for _ in 0..self.steps {
            if cancel.requested() {
                return;
            }
            missing.copy_from_slice(shown);
            self.back[colour].propagate_through(missing, radius, wave);
            let rows = missing.par_chunks_exact_mut(width).zip(wanted.par_chunks_exact(width));
            rows.for_each(|(u, wanted)| wide!(missing_of(u, wanted, per_scale)));
            self.forth[colour].propagate_through(missing, radius, wave);
            let rows = (shown.par_chunks_exact_mut(width).zip(missing.par_chunks_exact(width)))
                .zip(light.par_chunks_exact(width));
            rows.for_each(|((shown, missing), light)| wide!(step_on(shown, missing, light)));
        }
        let rows = phases.par_chunks_exact_mut(width).zip(shown.par_chunks_exact(width));
        rows.for_each(|(phases, shown)| super::double_phase::phase_row(shown, phases));
    }
}

/// Replaces u by r.
#[inline(always)]
fn missing_of(u: &mut [Complex32], wanted: &[Complex32], per_scale: f32) {
    for (u, wanted) in u.iter_mut().zip(wanted) {
        let (re, im) = (wanted.re * per_scale, wanted.im * per_scale);
        let amplitude = (re * re + im * im).sqrt();
        let length = (u.re * u.re + u.im * u.im).at_least(f32::MIN_POSITIVE).sqrt();
        let keep = (1.0 - WAVE) * amplitude / length - 1.0;
        u.re = WAVE * re + keep * u.re;
        u.im = WAVE * im + keep * u.im;
    }
}

/// Replaces L·e by L·e'.
#[inline(always)]
fn step_on(shown: &mut [Complex32], missing: &[Complex32], light: &[f32]) {
    for ((shown, missing), light) in shown.iter_mut().zip(missing).zip(light) {
        let (re, im) = (shown.re + GAIN * missing.re, shown.im + GAIN * missing.im);
        let length = light / (re * re + im * im).at_least(f32::MIN_POSITIVE).sqrt();
        shown.re = re * length;
        shown.im = im * length;
    }
}

/// Computes the correction in f64, value by value, as the oracle for tests. `to_midpoint` is K and `to_modulator` is
/// Kᴴ; `wanted` is T, `shown` the initial L·e and `light` L. Returns L·e of the last step.
pub fn reference(
    to_midpoint: impl Fn(&[Complex64]) -> Vec<Complex64>,
    to_modulator: impl Fn(&[Complex64]) -> Vec<Complex64>,
    wanted: &[Complex64],
    mut shown: Vec<Complex64>,
    light: &[f64],
    steps: usize,
) -> Vec<Complex64> {
    let share = f64::from(WAVE);
    for _ in 0..steps {
        let u = to_midpoint(&shown);
        let missing = u.iter().zip(wanted);
        let missing: Vec<Complex64> = missing
            .map(|(u, t)| t * share + u / u.norm() * t.norm() * (1.0 - share) - u)
            .collect();
        let back = to_modulator(&missing);
        for ((shown, back), light) in shown.iter_mut().zip(back).zip(light) {
            let z = *shown + back * f64::from(GAIN);
            *shown = z / z.norm() * light;
        }
    }
    shown
}
