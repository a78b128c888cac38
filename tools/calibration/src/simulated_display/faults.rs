//! Faults that no calibration knows in form: crosstalk between pixels, gaps between them, a ghost that makes fringes, a
//! speckled aperture, and a laser whose power drifts.
//!
//! The field is computed on a grid of [`PARTS`]² parts for each pixel. Crosstalk blurs the phase by a kernel that falls
//! exponentially, faster to the left than to the right, as fringing fields in a liquid crystal do (Moser et al., Opt.
//! Express 27, 25046, 2019).

use num_complex::{Complex32, Complex64};
use phasefront::Size;
use phasefront_io::dice::Dice;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The number of parts of a pixel along an axis.
pub(super) const PARTS: usize = 4;
/// The decay lengths of the crosstalk to the right, to the left, and up and down, in pixels.
const CROSSTALK: [f64; 3] = [0.16, 0.10, 0.13];
/// The number of parts to each side that crosstalk reaches.
const REACH: usize = 8;
/// The share of light that a gap passes on as the pixel beside it, and the light that it reflects itself.
const GAP: (f64, f64) = (0.75, 0.1);
/// The amplitude of the ghost: the reflection of a window in front of the panel.
const GHOST: f64 = 0.05;
/// The RMS deviation of the aperture's amplitude, and of its phase in radians.
const SPECKLE: (f64, f64) = (0.06, 0.25);
/// The number of waves that make the aperture's speckle, and how far each moves light, in pixels.
const WAVES: usize = 24;
const HALO: f64 = 6.0;

/// The faults of a display, determined by its seed.
#[derive(Debug, Clone)]
pub(super) struct Faults {
    seed: u64,
    /// The frequency of the ghost along x and y, in cycles per pixel, and its phase.
    ghost: [f64; 3],
    /// The frequency along both axes, the amplitude and the phase of the waves over the aperture.
    speckle: Vec<[f64; 4]>,
}

impl Faults {
    pub(super) fn new(seed: u64) -> Self {
        let mut dice = Dice::new(seed ^ 0x4641_554c_5453);
        let ghost = [dice.range(0.01, 0.03), dice.range(-0.02, 0.02), dice.range(0.0, TAU)];
        let wave = |_| {
            [
                dice.range(-HALO, HALO),
                dice.range(-HALO, HALO),
                dice.range(0.5, 1.5),
                dice.range(0.0, TAU),
            ]
        };
        Faults {
            seed,
            ghost,
            speckle: (0..2 * WAVES).map(wave).collect(),
        }
    }

    /// Returns the laser's intensity in photograph `shot`, relative to its mean.
    pub(super) fn power(&self, shot: u64) -> f64 {
        let slow = (TAU * shot as f64 / 41.0).sin();
        let fast = Dice::new(self.seed ^ shot.wrapping_mul(0x9e37_79b9_7f4a_7c15)).range(-1.0, 1.0);
        1.0 + 0.05 * slow + 0.03 * fast
    }

    /// Returns the factor of the aperture at a frequency, in cycles per pixel.
    pub(super) fn aperture(&self, fx: f64, fy: f64) -> Complex32 {
        let sum = |waves: &[[f64; 4]]| {
            let value = |[u, v, height, start]: &[f64; 4]| height * (TAU * (u * fx + v * fy) + start).sin();
            waves.iter().map(value).sum::<f64>() / (WAVES as f64 / 2.0).sqrt()
        };
        let (amplitude, phase) = self.speckle.split_at(WAVES);
        let value = Complex64::from_polar(1.0 + SPECKLE.0 * sum(amplitude), SPECKLE.1 * sum(phase));
        Complex32::new(value.re as f32, value.im as f32)
    }

    /// Returns the field of `size` on the grid of their parts, (PARTS·H, PARTS·W). `phase`(y, x) and
    /// `light`(y, x) are those of a pixel.
    pub(super) fn field(
        &self,
        Size { width, height }: Size,
        phase: impl Fn(usize, usize) -> f64 + Sync,
        light: impl Fn(usize, usize) -> f64 + Sync,
    ) -> Vec<Complex32> {
        let (rows, columns) = (height * PARTS, width * PARTS);
        let [right, left, along] = CROSSTALK;
        let (across, down) = (taps(right, left), taps(along, along));
        let blur = |taps: &[f64], at: usize, count: usize, value: &dyn Fn(usize) -> f64| -> f64 {
            let tap = |(i, tap): (usize, &f64)| tap * value((at + REACH).saturating_sub(i).min(count - 1));
            taps.iter().enumerate().map(tap).sum()
        };
        let mut blurred = vec![0.0; height * columns];
        blurred.par_chunks_exact_mut(columns).enumerate().for_each(|(y, row)| {
            let phases: Vec<f64> = (0..width).map(|x| phase(y, x)).collect();
            for (i, value) in row.iter_mut().enumerate() {
                *value = blur(&across, i, columns, &|i| phases[i / PARTS]);
            }
        });
        let mut field = vec![Complex32::ZERO; rows * columns];
        field.par_chunks_exact_mut(columns).enumerate().for_each(|(j, row)| {
            for (i, value) in row.iter_mut().enumerate() {
                let (y, x) = (j / PARTS, i / PARTS);
                let phase = blur(&down, j, rows, &|j| blurred[j / PARTS * columns + i]);
                let mut sum = Complex64::from_polar(1.0, phase);
                if i % PARTS == PARTS - 1 || j % PARTS == PARTS - 1 {
                    sum = sum * GAP.0 + GAP.1;
                }
                let [u, v, start] = self.ghost;
                let (px, py) = (i as f64 / PARTS as f64, j as f64 / PARTS as f64);
                sum += Complex64::from_polar(GHOST, TAU * (u * px + v * py) + start);
                sum *= light(y, x);
                *value = Complex32::new(sum.re as f32, sum.im as f32);
            }
        });
        field
    }
}

/// Returns the kernel of crosstalk over parts, with decay lengths in pixels. Tap i weighs the part i − REACH before.
fn taps(after: f64, before: f64) -> Vec<f64> {
    let tap = |i: usize| {
        let parts = i as f64 - REACH as f64;
        let decay = if parts >= 0.0 { after } else { before };
        (-parts.abs() / (PARTS as f64 * decay)).exp()
    };
    let taps: Vec<f64> = (0..=2 * REACH).map(tap).collect();
    let sum: f64 = taps.iter().sum();
    taps.iter().map(|tap| tap / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crosstalk_keeps_flat_phases_and_blurs_steps_to_the_right() {
        let faults = Faults::new(1);
        let (height, width) = (4, 8);
        let field = |phase: &(dyn Fn(usize, usize) -> f64 + Sync)| {
            let field = faults.field(Size { width, height }, phase, |_, _| 1.0);
            let ghost = faults.field(Size { width, height }, |_, _| 0.0, |_, _| 0.0);
            assert!(ghost.iter().all(|value| value.norm() == 0.0));
            field
        };
        let [u, v, start] = faults.ghost;
        let plain = |value: &Complex32, j: usize, i: usize| {
            let (x, y) = (i as f64 / PARTS as f64, j as f64 / PARTS as f64);
            let ghost = Complex64::from_polar(GHOST, TAU * (u * x + v * y) + start);
            Complex64::new(value.re.into(), value.im.into()) - ghost
        };
        let flat = field(&|_, _| 1.3);
        let inner = plain(&flat[5 * PARTS * width + 5], 5, 5);
        assert!((inner - Complex64::from_polar(1.0, 1.3)).norm() < 1e-6, "{inner}");
        // A step up at pixel 4: the phase half a part before and behind it, away from the gaps.
        let step = field(&|_, x| if x < 4 { 0.0 } else { 2.0 });
        let row = 5 * PARTS * width;
        let (before, behind) = (plain(&step[row + 14], 5, 14).arg(), plain(&step[row + 17], 5, 17).arg());
        assert!(before > 0.01 && 2.0 - behind > 1.5 * before, "{before} {behind}");
    }

    #[test]
    fn the_aperture_and_the_power_vary_as_much_as_they_should() {
        let faults = Faults::new(7);
        let factors: Vec<_> = (0..400)
            .map(|i| faults.aperture(f64::from(i % 20) / 40.0 - 0.25, f64::from(i / 20) / 40.0 - 0.25))
            .collect();
        let rms = |f: &dyn Fn(&Complex32) -> f32| (factors.iter().map(|v| f(v).powi(2)).sum::<f32>() / 400.0).sqrt();
        let (amplitude, phase) = (rms(&|v| v.norm() - 1.0), rms(&|v| v.arg()));
        assert!(
            (0.03..0.12).contains(&amplitude) && (0.12..0.5).contains(&phase),
            "{amplitude} {phase}"
        );
        let powers: Vec<f64> = (0..200).map(|shot| faults.power(shot)).collect();
        let mean = powers.iter().sum::<f64>() / 200.0;
        let spread = (powers.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / 200.0).sqrt();
        assert!(
            (mean - 1.0).abs() < 0.01 && (0.02..0.06).contains(&spread),
            "{mean} {spread}"
        );
    }
}
