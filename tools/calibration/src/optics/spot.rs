//! The coefficients of an aberration from photographs of a focused spot, by search.
//!
//! A sub-hologram (Eq. 19) focuses light to a distance; the camera stands focused there. Each round shows the best
//! coefficients so far, and steps to either side of them along five directions that are at right angles and turned from
//! round to round. [`crate::optics::pupil`] finds the aberration that explains how sharp all spots of all rounds were;
//! the next round begins there. Steps stay large: a spot tells most where its sharpness falls, and nothing where it is
//! sharpest. Directions mix the terms because sharpness is the same for a pupil and its mirror images: steps of one
//! term at a time hardly tell them apart.

use crate::camera::photograph::{Photograph, SATURATED_SHARE};
use crate::optics::pupil::{Pupil, Spot};
use ndarray::Array2;
use num_complex::Complex32;
use phasefront::{Display, Target};
use phasefront_core::encode::double_phase;
use phasefront_core::optics::sub_hologram;
use phasefront_core::optics::zernike::{self, Coefficients, TERMS};
use phasefront_io::dice::Dice;
use phasefront_io::{Error, Result};
use serde::{Deserialize, Serialize};

/// Photographs of a round.
pub const TRIALS: usize = 1 + 2 * TERMS.len();
/// Rounds of a search.
pub const ROUNDS: usize = 3;
/// A step, radians RMS of the wavefront: about where sharpness falls the fastest.
const STEP: f64 = 0.6;
/// The mean squares of the terms over the pupil.
const MEAN_SQUARES: Coefficients = [1.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 8.0, 1.0 / 8.0];
/// From how many places around the best the first round looks for what explains it, and the others.
const STARTS: [usize; 2] = [16, 2];
/// How far around, radians.
const AROUND: f64 = 2.0;

/// A search under way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Search {
    /// The best coefficients so far.
    pub best: Coefficients,
    /// Rounds done.
    pub round: usize,
    /// The spots that were displayed so far, and how sharp each was.
    pub seen: Vec<Spot>,
    /// The root mean square of what the best leaves unexplained of that, as a part of it.
    pub residual: f64,
}

impl Search {
    /// A search from `best`.
    pub fn from(best: Coefficients) -> Self {
        Search {
            best,
            round: 0,
            seen: Vec::new(),
            residual: 0.0,
        }
    }

    /// Whether all rounds are done.
    pub fn is_done(&self) -> bool {
        self.round >= ROUNDS
    }

    /// What the round shows: the best, then a step to either side of it in each direction.
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

    /// The next round, from how sharp each trial's spot was.
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

/// Five wavefronts of 1 rad RMS at right angles: random ones, each less what it has of those before (Gram and Schmidt).
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

/// The middle of the frame, as a place of a spot.
pub const MIDDLE: [f64; 2] = [0.5, 0.5];

/// The levels of `target`, (H, W), that focus one colour's light to `z_m` at `place` (x and y, parts of the frame) by
/// the correction `a`: the sub-hologram around there, double phase for the dark around it.
///
/// # Errors
/// A z at the modulator, or so far from it that the sub-hologram does not fit.
pub fn levels(target: &Target, colour: usize, z_m: f64, place: [f64; 2], a: &Coefficients) -> Result<Array2<u8>> {
    let display = &target.display;
    let (height, width) = (display.height(), display.width());
    let (pitch_m, wavelength_m) = (display.pitch_m(), display.wavelengths_m()[colour]);
    let distance_m = z_m - display.offset_m();
    let radius_m = sub_hologram::sub_hologram_radius_m(distance_m, wavelength_m, pitch_m);
    let radius = (radius_m / pitch_m).ceil().min(65536.0) as usize;
    let side = 2 * radius + 1;
    let part = sub_hologram::sub_hologram(side, side, pitch_m, wavelength_m, distance_m, a)?;
    let corner = |at: f64, n: usize| ((at * n as f64) as usize).checked_sub(radius);
    let (Some(left), Some(top)) = (corner(place[0], width), corner(place[1], height)) else {
        return Err(outside(place, side, (width, height)));
    };
    if left + side > width || top + side > height {
        return Err(outside(place, side, (width, height)));
    }
    let first = colour * height * width;
    let mut levels = Array2::zeros((height, width));
    for ((y, x), level) in levels.indexed_iter_mut() {
        let within = (top..top + side).contains(&y) && (left..left + side).contains(&x);
        let value = match within {
            true => part[(y - top) * side + x - left],
            false => Complex32::ZERO,
        };
        let phase = double_phase::encode_value(value, x, y, 1.0);
        *level = target.response.level(phase, first + y * width + x);
    }
    Ok(levels)
}

fn outside([x, y]: [f64; 2], side: usize, (width, height): (usize, usize)) -> Error {
    Error::Input(format!(
        "a sub-hologram of {side} pixels does not fit around ({x}, {y}) of a frame of {width}×{height}; a larger frame, a z nearer to the modulator or a place nearer to the middle is needed"
    ))
}

/// How sharp the spot of a photograph is: ΣI²/(ΣI)² around its brightest place, in a square of `side` pixels, what lies
/// around taken away; 1 for a single pixel.
///
/// # Errors
/// A photograph that is saturated, or without a spot.
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
    // Of a normal distribution 68 % lie within one σ.
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
    // What noise alone adds to the squares is taken away.
    let squares = squares - count * noise * noise;
    Ok(squares.max(0.0) / (sum * sum).max(f64::MIN_POSITIVE))
}

/// Where the mean of 5×5 pixels is largest, (y, x).
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

/// The exposure at which a spot without aberration fills 0.7 of the sensor, where a flat phase would fill all at 1: the
/// spot is brighter by the square of the sub-hologram's Fresnel number times π.
pub fn exposure(display: &Display, colour: usize, z_m: f64) -> f64 {
    let distance_m = z_m - display.offset_m();
    let wavelength_m = display.wavelengths_m()[colour];
    let radius_m = sub_hologram::sub_hologram_radius_m(distance_m, wavelength_m, display.pitch_m());
    let gain = std::f64::consts::PI * radius_m * radius_m / (wavelength_m * distance_m.abs());
    0.7 / (gain * gain).max(1.0)
}

/// Side of the square in which [`sharpness`] looks, pixels of a photograph that shows each of the modulator's with
/// `zoom` of its own: the reach of aberrations that the search can find.
pub fn window(zoom: f64) -> usize {
    (32.0 * zoom) as usize
}

/// The Strehl ratio of a pupil with the terms `a`: the light in the middle of the spot as a part of what it would be
/// without them, |mean exp(i·terms)|² over ρ ≤ 1.
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
        // exp(−σ²), σ² = a²/6 for astigmatism.
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
