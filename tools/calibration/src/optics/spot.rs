//! Search for the coefficients of an aberration, using photographs of a focused spot.
//!
//! A sub-hologram (Eq. 19) focuses light to a distance, at which the camera is focused. Each round displays the best
//! coefficients so far, and steps to either side of them along five orthogonal directions that change from round to
//! round. [`crate::optics::pupil`] finds the aberration that explains the sharpness of all spots of all rounds, and the
//! next round begins there. Steps stay large: a spot carries most information where its sharpness falls, and none where
//! it is sharpest. The directions mix the terms because a pupil and its mirror images have the same sharpness, so steps
//! of one term at a time hardly distinguish them.

use crate::camera::photograph::{Photograph, SATURATED_SHARE};
use crate::optics::pupil::{Pupil, Spot};
use ndarray::Array2;
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Display, Target};
use phasefront_core::encode::double_phase;
use phasefront_core::optics::sub_hologram;
use phasefront_core::optics::zernike::{self, Coefficients, TERMS};
use phasefront_io::dice::Dice;
use phasefront_io::{Error, Result};
use serde::{Deserialize, Serialize};

/// The number of photographs in a round.
pub const TRIALS: usize = 1 + 2 * TERMS.len();
/// The number of rounds of a search.
pub const ROUNDS: usize = 3;
/// The size of a step, in radians RMS of the wavefront: about where sharpness falls fastest.
const STEP: f64 = 0.6;
/// The mean squares of the terms over the pupil.
const MEAN_SQUARES: Coefficients = [1.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 8.0, 1.0 / 8.0];
/// The number of starting points around the best coefficients, in the first round and in the other rounds.
const STARTS: [usize; 2] = [16, 2];
/// The distance of the starting points from the best coefficients, in radians.
const AROUND: f64 = 2.0;

/// The state of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Search {
    /// The best coefficients so far.
    pub best: Coefficients,
    /// The number of rounds done.
    pub round: usize,
    /// The spots displayed so far and their sharpness.
    pub seen: Vec<Spot>,
    /// The RMS residual of the sharpness for the best coefficients, relative to the sharpness.
    pub residual: f64,
}

impl Search {
    /// Starts a search at `best`.
    pub fn from(best: Coefficients) -> Self {
        Search {
            best,
            round: 0,
            seen: Vec::new(),
            residual: 0.0,
        }
    }

    /// Checks whether all rounds are done.
    pub fn is_done(&self) -> bool {
        self.round >= ROUNDS
    }

    /// Returns the coefficients that this round displays: the best, then a step to either side of it in each direction.
    pub fn trials(&self) -> [Coefficients; TRIALS] {
        let directions = directions(self.round as u64);
        std::array::from_fn(|i| match i.checked_sub(1) {
            None => self.best,
            Some(i) => {
                let step = if i % 2 == 0 { -STEP } else { STEP };
                std::array::from_fn(|j| self.best[j] + step * directions[i / 2][j])
            }
        })
    }

    /// Returns the search after this round, given the sharpness of each trial's spot.
    pub fn learn(&self, sharpness: &[f64; TRIALS]) -> Search {
        let mut seen = self.seen.clone();
        seen.extend(self.trials().into_iter().zip(*sharpness));
        let sharpest = (seen.iter()).max_by(|a, b| a.1.total_cmp(&b.1));
        let mut starts = vec![self.best];
        starts.extend(sharpest.map(|(shown, _)| *shown));
        let mut dice = Dice::new(self.round as u64);
        starts.extend((0..STARTS[self.round.min(1)]).map(|_| {
            let beside = |a: f64| a + dice.range(-AROUND, AROUND);
            self.best.map(beside)
        }));
        let explained = Pupil::new().explain(&seen, &starts);
        Search {
            best: explained.map_or(self.best, |e| e.correction),
            round: self.round + 1,
            seen,
            residual: explained.map_or(1.0, |e| e.residual),
        }
    }
}

/// Returns five random orthogonal wavefronts of 1 rad RMS (Gram–Schmidt).
fn directions(seed: u64) -> [Coefficients; TERMS.len()] {
    let mut dice = Dice::new(seed ^ 0x0044_4952);
    let mut directions = [[0.0; TERMS.len()]; TERMS.len()];
    for n in 0..TERMS.len() {
        let mut new: Coefficients = std::array::from_fn(|_| dice.range(-1.0, 1.0));
        let dot = |a: &Coefficients, b: &Coefficients| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for before in &directions[..n] {
            let along = dot(&new, before);
            (new.iter_mut().zip(before)).for_each(|(v, b)| *v -= along * b);
        }
        let length = dot(&new, &new).sqrt();
        directions[n] = new.map(|v| v / length);
    }
    directions.map(|d| std::array::from_fn(|j| d[j] / MEAN_SQUARES[j].sqrt()))
}

/// The position of a spot in the middle of the frame.
pub const MIDDLE: [f64; 2] = [0.5, 0.5];

/// Returns the levels of `target`, (H, W), that focus one colour's light to `z_m` at `place` (x and y, as fractions of
/// the frame) with the correction `a`. The sub-hologram lies around that place. A double phase makes the area around it
/// dark.
///
/// # Errors
/// Returns an error if z is at the modulator, or so far from it that the sub-hologram does not fit.
pub fn levels(target: &Target, colour: usize, z_m: f64, place: [f64; 2], a: &Coefficients) -> Result<Array2<u8>> {
    let display = &target.display;
    let Size { width, height } = display.size();
    let (pitch_m, wavelength_m) = (display.pitch_m(), display.wavelengths_m()[colour]);
    let distance_m = z_m - display.offset_m();
    let radius_m = sub_hologram::sub_hologram_radius_m(distance_m, wavelength_m, pitch_m);
    let radius = (radius_m / pitch_m).ceil().min(65536.0) as usize;
    let side = 2 * radius + 1;
    let part = sub_hologram::sub_hologram(
        Size {
            width: side,
            height: side,
        },
        pitch_m,
        wavelength_m,
        distance_m,
        a,
    )?;
    let corner = |at: f64, n: usize| ((at * n as f64) as usize).checked_sub(radius);
    let (Some(left), Some(top)) = (corner(place[0], width), corner(place[1], height)) else {
        return Err(outside(place, side, display.size()));
    };
    if left + side > width || top + side > height {
        return Err(outside(place, side, display.size()));
    }
    let first = colour * height * width;
    let mut levels = Array2::zeros((height, width));
    for ((y, x), level) in levels.indexed_iter_mut() {
        let within = (top..top + side).contains(&y) && (left..left + side).contains(&x);
        let value = if within {
            part[(y - top) * side + x - left]
        } else {
            Complex32::ZERO
        };
        let phase = double_phase::encode_value(value, x, y, 1.0);
        *level = target.response.level(phase, first + y * width + x);
    }
    Ok(levels)
}

fn outside([x, y]: [f64; 2], side: usize, size: Size) -> Error {
    Error::Input(format!(
        "a sub-hologram of {side} pixels does not fit around ({x}, {y}) of a frame of {size}; a larger frame, a z nearer to the modulator or a place nearer to the middle is needed"
    ))
}

/// Returns the sharpness of the spot in a photograph: ΣI²/(ΣI)² around its brightest place, in a square of `side`
/// pixels, after subtraction of the background. A single pixel gives 1.
///
/// # Errors
/// Returns an error if the photograph is saturated or has no spot.
pub fn sharpness(photograph: &Photograph, side: usize) -> Result<f64> {
    if photograph.saturated() > SATURATED_SHARE / 100.0 {
        return Err(Error::Input(
            "its spot is saturated; shorten the exposure and photograph the whole round again".into(),
        ));
    }
    let mut sorted = photograph.values.clone();
    sorted.sort_unstable();
    let part = |percent: usize| f64::from(sorted[(sorted.len() - 1) * percent / 100]);
    let (dark, most) = (part(50), part(100));
    // In a normal distribution, 68 % of the values lie within one σ.
    let noise = ((part(84) - part(16)) / 2.0).max(0.5);
    let (y0, x0) = brightest(photograph);
    if most - dark < 12.0 * noise {
        return Err(Error::Input(
            "shows no spot; expose longer, or focus the camera where the spot shall be".into(),
        ));
    }
    let near = |n: usize, end: usize| n.saturating_sub(side / 2)..(n + side / 2 + 1).min(end);
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
    for y in near(y0, photograph.height) {
        for x in near(x0, photograph.width) {
            let value = f64::from(photograph.values[y * photograph.width + x]) - dark;
            sum += value;
            squares += value * value;
            count += 1.0;
        }
    }
    // This subtracts the contribution of noise to the squares.
    let squares = squares - count * noise * noise;
    Ok(squares.max(0.0) / (sum * sum).max(f64::MIN_POSITIVE))
}

/// Returns the position, (y, x), of the largest mean over 5×5 pixels.
fn brightest(photograph: &Photograph) -> (usize, usize) {
    let (height, width) = (photograph.height, photograph.width);
    let mut best = (0, (0, 0));
    for y in 2..height.saturating_sub(2) {
        for x in 2..width.saturating_sub(2) {
            let sum: u32 = (y - 2..y + 3)
                .flat_map(|y| &photograph.values[y * width + x - 2..y * width + x + 3])
                .map(|v| u32::from(*v))
                .sum();
            if sum > best.0 {
                best = (sum, (y, x));
            }
        }
    }
    best.1
}

/// Returns the exposure at which a spot without aberration reaches 0.7 of the sensor's range, where a flat phase would
/// fill the range at exposure 1. The spot is brighter by the square of π times the sub-hologram's Fresnel number.
pub fn exposure(display: &Display, colour: usize, z_m: f64) -> f64 {
    let distance_m = z_m - display.offset_m();
    let wavelength_m = display.wavelengths_m()[colour];
    let radius_m = sub_hologram::sub_hologram_radius_m(distance_m, wavelength_m, display.pitch_m());
    let gain = std::f64::consts::PI * radius_m * radius_m / (wavelength_m * distance_m.abs());
    0.7 / (gain * gain).max(1.0)
}

/// Returns the side of the square that [`sharpness`] evaluates, in pixels of a photograph with `zoom` pixels per
/// modulator pixel. It covers all aberrations that the search can find.
pub fn window(zoom: f64) -> usize {
    (32.0 * zoom) as usize
}

/// Computes the Strehl ratio of a pupil with the terms `a`: the light in the centre of the spot relative to that
/// without aberration, |mean exp(i·terms)|² over ρ ≤ 1.
pub fn strehl(a: &Coefficients) -> f64 {
    const N: i32 = 60;
    let (mut sum, mut count) = (num_complex::Complex64::ZERO, 0.0);
    for i in -N..=N {
        for j in -N..=N {
            let (x, y) = (f64::from(j) / f64::from(N), f64::from(i) / f64::from(N));
            if x * x + y * y <= 1.0 {
                sum += num_complex::Complex64::from_polar(1.0, zernike::terms(a, x, y));
                count += 1.0;
            }
        }
    }
    (sum / count).norm_sqr()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::simulated_display::SimulatedDisplay;
    use phasefront::target::Aberration;

    #[test]
    fn a_flat_pupil_has_a_strehl_ratio_of_one_and_small_terms_follow_marechal() {
        assert_eq!(strehl(&[0.0; 5]), 1.0);
        // The expected value is exp(−σ²), with σ² = a²/6 for astigmatism.
        let a = 0.3f64;
        assert!((strehl(&[0.0, a, 0.0, 0.0, 0.0]) - (-a * a / 6.0).exp()).abs() < 2e-3);
    }

    #[test]
    fn directions_are_wavefronts_at_right_angles() {
        for seed in 0..5 {
            let all = directions(seed);
            for (i, a) in all.iter().enumerate() {
                for (j, b) in all.iter().enumerate() {
                    let (mut sum, mut count) = (0.0, 0.0);
                    for n in 0..120 * 120 {
                        let at = |n: usize| (2 * n + 1) as f64 / 120.0 - 1.0;
                        let (x, y) = (at(n % 120), at(n / 120));
                        if x * x + y * y <= 1.0 {
                            sum += zernike::terms(a, x, y) * zernike::terms(b, x, y);
                            count += 1.0;
                        }
                    }
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((sum / count - expected).abs() < 2e-2, "{seed} {i} {j}");
                }
            }
        }
    }

    #[test]
    fn the_search_finds_random_aberrations() {
        let display = Display::from_toml("width = 96\nheight = 96").unwrap();
        let z_m = 9e-3;
        let mut dice = Dice::new(11);
        for seed in 0..4 {
            let wanted: Coefficients = std::array::from_fn(|_| dice.range(-1.4, 1.4));
            let colour = seed as usize % 3;
            let mut coefficients = [[0.0; 5]; 3];
            coefficients[colour] = wanted;
            let simulated = SimulatedDisplay::new(&display, 2.0, seed)
                .unwrap()
                .with_aberration(Aberration::new(coefficients).unwrap());
            let mut camera = simulated.camera().clone();
            camera.exposure = exposure(&display, colour, z_m);
            let simulated = simulated.with_camera(camera);
            let target = Target {
                response: simulated.response().unwrap(),
                ..Target::from(&display)
            };
            let mut search = Search::from([0.0; 5]);
            while !search.is_done() {
                let sharp: Vec<f64> = (search.trials().iter().enumerate())
                    .map(|(i, trial)| {
                        let levels = levels(&target, colour, z_m, MIDDLE, trial).unwrap();
                        let shot = (search.round * TRIALS + i) as u64;
                        let photo = simulated.photograph(levels.view(), colour, z_m, shot).unwrap();
                        sharpness(&photo, window(2.0)).unwrap()
                    })
                    .collect();
                search = search.learn(&sharp.try_into().unwrap());
            }
            let left: Coefficients = std::array::from_fn(|i| wanted[i] - search.best[i]);
            let (before, after) = (strehl(&wanted), strehl(&left));
            assert!(after > 0.95, "{seed}: {before} {after} {wanted:?} {left:?}");
        }
    }

    #[test]
    fn spots_that_cannot_be_judged_are_named() {
        let mut p = Photograph {
            height: 40,
            width: 40,
            values: (0..1600).map(|i| 100 + i * 7 % 13).collect(),
            full: 65535,
        };
        assert!(sharpness(&p, 20).unwrap_err().to_string().contains("no spot"));
        p.values[820] = 65535;
        assert!(sharpness(&p, 20).unwrap_err().to_string().contains("saturated"));
        p.values[820] = 60000;
        assert!(sharpness(&p, 20).unwrap() > 0.9);
    }
}
