//! The ceiling: the phase map at which a gradient descent on one hologram ends. Every encoder can be compared with it.
//! It is far too slow for any other use.
//!
//! The descent fits the amplitudes of a wave at the midpoint, in every step, and at a few other planes of the volume,
//! which each step draws anew. With the displayed wave u at a plane and the wanted amplitude T, the loss is Σ(|u| −
//! T)². Its gradient with respect to the modulator's phases is −2·Im(conj(Kᴴ(u − T·u/|u|))·e), where e is the displayed
//! phasors and K the propagation to the plane. The steps are Adam's (Kingma and Ba, 2015).

use num_complex::Complex32;
use phasefront::Display;
use phasefront::Size;
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_io::Result;
use phasefront_io::dice::Dice;
use rayon::prelude::*;

/// The number of planes of the volume in addition to the midpoint.
const PLANES: usize = 8;
/// The number of those planes that a step draws.
const DRAWN: usize = 2;
/// The parameters of Adam: the initial step size and the decay of the averages.
const RATE: f32 = 0.05;
const MOMENTUM: f32 = 0.9;
const SPREAD: f32 = 0.99;

/// A plan for one shape and display.
pub(crate) struct Ceiling {
    size: usize,
    aperture_radius: f64,
    /// For each plane, the midpoint first: z, and the propagation from the modulator to it and back.
    planes: Vec<(f64, Vec<Propagator>, Vec<Propagator>)>,
}

impl Ceiling {
    /// Plans the descent for holograms of `size`×`size` pixels at the modulator of `display`.
    ///
    /// # Errors
    /// Returns an error if a wave cannot be propagated over one of the distances.
    pub(crate) fn new(size: usize, display: &Display) -> Result<Self> {
        let ways = |distance_m: f64| {
            let (pitch_m, colours) = (display.pitch_m(), display.wavelengths_m());
            Propagator::for_colours(
                Size {
                    width: size,
                    height: size,
                },
                pitch_m,
                colours,
                distance_m,
                Padding::Reach,
            )
        };
        let depths = (0..PLANES).map(|i| (i as f64 + 0.5) / PLANES as f64);
        let z_m = std::iter::once(0.0).chain(depths.map(|depth| display.z_of_depth(depth)));
        let planes = z_m.map(|z_m| {
            let distance_m = z_m - display.offset_m();
            Ok((z_m, ways(distance_m)?, ways(-distance_m)?))
        });
        Ok(Ceiling {
            size,
            aperture_radius: display.aperture_radius(),
            planes: planes.collect::<Result<_>>()?,
        })
    }

    /// Returns z, in metres, of the planes whose amplitudes are fitted.
    pub(crate) fn z_m(&self) -> Vec<f64> {
        self.planes.iter().map(|(z_m, ..)| *z_m).collect()
    }

    /// Moves `phases`, (C, H, W), toward the amplitudes `wanted`, (C, H, W) at each of [`Self::z_m`], which are divided
    /// by the amplitude of full light.
    pub(crate) fn optimise(&self, phases: &mut [f32], wanted: &[Vec<f32>], steps: usize) {
        let plane = self.size * self.size;
        let colours = phases.par_chunks_exact_mut(plane).enumerate();
        colours.for_each(|(colour, phases)| {
            let wanted: Vec<&[f32]> = wanted.iter().map(|all| &all[colour * plane..][..plane]).collect();
            self.optimise_colour(colour, phases, &wanted, steps);
        });
    }

    fn optimise_colour(&self, colour: usize, phases: &mut [f32], wanted: &[&[f32]], steps: usize) {
        let mut dice = Dice::new(colour as u64);
        let (mut first, mut second) = (vec![0.0f32; phases.len()], vec![0.0f32; phases.len()]);
        let mut scratches: Vec<_> = self
            .planes
            .iter()
            .map(|(_, there, _)| there[colour].scratch())
            .collect();
        for step in 0..steps {
            let shown: Vec<Complex32> = phases.iter().map(|p| Complex32::from_polar(1.0, *p)).collect();
            let mut gradient = vec![0.0f32; phases.len()];
            let drawn = (0..DRAWN).map(|_| dice.integer(1, PLANES)).collect::<Vec<_>>();
            for at in std::iter::once(0).chain(drawn) {
                let (_, there, back) = &self.planes[at];
                let mut missing = shown.clone();
                // Both directions cover the same distance, so they have the same padding.
                let scratch = &mut scratches[at];
                there[colour].propagate_through(&mut missing, self.aperture_radius, scratch);
                for (u, wanted) in missing.iter_mut().zip(wanted[at]) {
                    *u -= *u * (wanted / u.norm().max(1e-12));
                }
                back[colour].propagate_through(&mut missing, self.aperture_radius, scratch);
                // The midpoint has the weight of all drawn planes together.
                let weight = if at == 0 { 1.0 } else { 1.0 / DRAWN as f32 };
                for ((gradient, missing), e) in gradient.iter_mut().zip(&missing).zip(&shown) {
                    *gradient -= 2.0 * weight * (missing.conj() * e).im;
                }
            }
            let rate = RATE * (1.0 - step as f32 / steps as f32);
            let (ahead, wide) = (1.0 - MOMENTUM.powi(step as i32 + 1), 1.0 - SPREAD.powi(step as i32 + 1));
            let averages = first.iter_mut().zip(&mut second);
            for ((phase, gradient), (first, second)) in phases.iter_mut().zip(&gradient).zip(averages) {
                *first = MOMENTUM * *first + (1.0 - MOMENTUM) * gradient;
                *second = SPREAD * *second + (1.0 - SPREAD) * gradient * gradient;
                *phase -= rate * (*first / ahead) / ((*second / wide).sqrt() + 1e-8);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Returns the squared difference at the midpoint, to check the gradient.
    fn loss(ceiling: &Ceiling, phases: &[f32], wanted: &[f32]) -> f64 {
        let plane = ceiling.size * ceiling.size;
        let (_, there, _) = &ceiling.planes[0];
        let mut sum = 0.0;
        for (colour, phases) in phases.chunks_exact(plane).enumerate() {
            let mut shown: Vec<Complex32> = phases.iter().map(|p| Complex32::from_polar(1.0, *p)).collect();
            there[colour].propagate_through(&mut shown, 1.0, &mut there[colour].scratch());
            let wanted = &wanted[colour * plane..][..plane];
            sum += (shown.iter().zip(wanted))
                .map(|(u, t)| f64::from(u.norm() - t).powi(2))
                .sum::<f64>();
        }
        sum
    }

    #[test]
    fn descent_goes_down_at_any_offset() {
        for offset_m in [0.0, 2e-3] {
            let display = Display::default().with_offset_m(offset_m).unwrap();
            let ceiling = Ceiling::new(32, &display).unwrap();
            let start: Vec<f32> = (0..3 * 32 * 32).map(|i| (i * 37 % 628) as f32 / 100.0).collect();
            let amplitude = |i: usize| 0.3 + 0.2 * ((i % 32) as f32 * 0.4).sin();
            let wanted = vec![(0..start.len()).map(amplitude).collect::<Vec<_>>(); PLANES + 1];
            let mut losses = vec![loss(&ceiling, &start, &wanted[0])];
            for steps in [20, 120] {
                let mut phases = start.clone();
                ceiling.optimise(&mut phases, &wanted, steps);
                losses.push(loss(&ceiling, &phases, &wanted[0]));
            }
            assert!(losses[1] < losses[0] && losses[2] < 0.4 * losses[0], "{losses:?}");
        }
    }
}
