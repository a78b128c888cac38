//! The filters of one colour: a step between planes, several merged steps through empty space, and the final filter
//! from the planes to the hologram.
//!
//! All are made from one step H and one filter B from plane 0 to the hologram, both fitted ([`super::fit`]). Over a gap
//! of m empty planes, Hᵐ is one filter, little longer than light's reach over the gap. From plane k, the filter to the
//! hologram is HᵏB. Both are cut where their tails hold less than [`TAIL`] of the light, so merging empty planes does
//! not affect the result.

use super::fit::{self, Coefficients};
use num_complex::Complex64;
use phasefront_kernels::fir::Taps;
use rustfft::algorithm::Radix4;
use rustfft::{Fft, FftDirection};

/// The sum of magnitudes that a merged filter may lose at its ends.
const TAIL: f64 = 2e-5;
/// The cost of reading and writing the field in a pass, expressed in taps.
const PASS: usize = 3;
/// The number of taps that the final filter has beyond light's reach, on each side.
const MARGIN: usize = 6;

/// The optics of one colour between the planes.
#[derive(Debug, Clone, Copy)]
pub struct Optics {
    pub(super) pitch_m: f64,
    pub(super) wavelength_m: f64,
    /// The distance between neighbouring planes.
    pub step_m: f64,
    pub(super) planes: usize,
    /// The distance from plane 0, the nearest to the viewer, to the hologram.
    pub home_m: f64,
}

impl Optics {
    /// Returns how far light spreads over `distance_m`, in pixels.
    pub fn reach(&self, distance_m: f64) -> usize {
        let reach_m = crate::optics::asm::reach_m(distance_m, self.wavelength_m, self.pitch_m);
        (reach_m / self.pitch_m).ceil() as usize
    }

    /// Returns the radius of the final filter.
    pub(super) fn home_radius(&self) -> usize {
        match self.home_m {
            0.0 => 1,
            distance => self.reach(distance) + MARGIN,
        }
    }
}

/// The filters of one colour.
pub struct Filters {
    /// H and B as rounded, for the oracle: the centre, then the taps at distances 1, 2 …
    pub step: Vec<[f32; 2]>,
    pub home: Vec<[f32; 2]>,
    /// The weighted errors of H and of its power over the whole volume.
    pub(super) errors: [f64; 2],
    /// Hᵐ at index m − 1. Only the filters that [`Filters::part`] returns are used.
    merged: Vec<Taps>,
    /// The number of steps in the first part of the cheapest path over a gap of m steps, at index m − 1.
    parts: Vec<usize>,
    /// HᵏB for each plane k.
    ends: Vec<Taps>,
    /// The number of steps before the filter in `ends`, on the cheapest path from plane k.
    before_end: Vec<usize>,
}

impl Filters {
    /// Fits a step of `radius` taps on each side, and the final filter.
    pub(super) fn new(optics: &Optics, radius: usize) -> Self {
        let &Optics {
            pitch_m,
            wavelength_m,
            step_m,
            planes,
            home_m,
        } = optics;
        let free = |f: f64, distance_m: f64| fit::transfer(f, distance_m, wavelength_m, pitch_m);
        let steps = (planes - 1).max(1);
        let step = taps(&fit::powers(radius, steps, |f| free(f, step_m)));
        // All other filters follow the step as it is rounded.
        let (first, step) = (step.clone(), coefficients(&step));
        let errors = [1, steps].map(|power| fit::error(&step, |f| free(f, step_m), power));
        // The best final filter for the light from all planes together. It also compensates the errors of the steps.
        let home = fit::once(optics.home_radius(), |f| {
            let h = fit::gain(&step, f);
            let (mut right, mut energy) = (Complex64::ZERO, 0.0);
            let mut power = Complex64::ONE;
            for k in 0..planes {
                right += power.conj() * free(f, home_m + k as f64 * step_m);
                energy += power.norm_sqr();
                power *= h;
            }
            right / energy
        });
        let last = taps(&home);
        let home = coefficients(&last);
        let grid = Grid::new(optics);
        let spectrum = grid.spectrum(&step);
        let merged: Vec<Taps> = (1..planes.max(2))
            .map(|m| match m {
                1 => first.clone(),
                _ => grid.cut(spectrum.iter().map(|h| h.powu(m as u32))),
            })
            .collect();
        let home_spectrum = grid.spectrum(&home);
        let ends: Vec<Taps> = (0..planes)
            .map(|k| match k {
                0 => last.clone(),
                _ => grid.cut((spectrum.iter().zip(&home_spectrum)).map(|(h, b)| h.powu(k as u32) * b)),
            })
            .collect();
        let mut filters = Filters {
            step: first.values(),
            home: last.values(),
            errors,
            merged,
            parts: Vec::new(),
            ends,
            before_end: Vec::new(),
        };
        filters.choose_ways();
        filters
    }

    /// Finds the cheapest paths over gaps and to the hologram, by dynamic programming over their lengths.
    fn choose_ways(&mut self) {
        let cost = |taps: &Taps| taps.radius() + 1 + PASS;
        let mut costs = vec![0];
        for gap in 1..=self.merged.len() {
            let (part, least) = (1..=gap)
                .map(|part| (part, cost(&self.merged[part - 1]) + costs[gap - part]))
                .min_by_key(|(_, cost)| *cost)
                .unwrap_or((gap, 0));
            self.parts.push(part);
            costs.push(least);
        }
        for k in 0..self.ends.len() {
            let (before, _) = (0..=k)
                .map(|before| (before, costs[before] + cost(&self.ends[k - before])))
                .min_by_key(|(_, cost)| *cost)
                .unwrap_or((0, 0));
            self.before_end.push(before);
        }
    }

    /// Replaces merged filters by single steps, over gaps and to the hologram.
    pub(super) fn unmerge(&mut self) {
        self.parts.fill(1);
        for (k, before) in self.before_end.iter_mut().enumerate() {
            *before = k;
        }
    }

    /// Returns the filter and the number of steps of the first part of the path over a gap of `steps`, at least 1.
    pub(super) fn part(&self, steps: usize) -> (&Taps, usize) {
        let part = self.parts[steps - 1];
        (&self.merged[part - 1], part)
    }

    /// Returns the number of steps from plane `k` before [`Filters::end`].
    pub(super) fn before_end(&self, k: usize) -> usize {
        self.before_end[k]
    }

    /// Returns the filter from plane `k` to the hologram.
    pub(super) fn end(&self, k: usize) -> &Taps {
        &self.ends[k]
    }

    /// Returns the longest radius of a filter between planes.
    pub(super) fn longest_part(&self) -> usize {
        let used = self.parts.iter().map(|part| &self.merged[part - 1]);
        used.map(Taps::radius).max().unwrap_or(0)
    }
}

/// Rounds a filter's coefficients to taps.
fn taps(coefficients: &Coefficients) -> Taps {
    Taps::new(&coefficients.iter().map(|c| [c.re, c.im]).collect::<Vec<_>>())
}

/// Returns the coefficients of rounded taps.
fn coefficients(taps: &Taps) -> Coefficients {
    let sides = taps.values().into_iter().skip(1);
    sides.map(|[re, im]| Complex64::new(re.into(), im.into())).collect()
}

/// A frequency grid fine enough for the longest filter not to wrap around.
struct Grid {
    size: usize,
    /// A planner would compile all its algorithms once more for `f64`.
    inverse: Radix4<f64>,
}

impl Grid {
    fn new(optics: &Optics) -> Self {
        let volume_m = optics.step_m * (optics.planes - 1) as f64;
        let longest = optics.reach(volume_m) + optics.home_radius();
        let size = (4 * longest).next_power_of_two().max(1024);
        Grid {
            size,
            inverse: Radix4::new(size, FftDirection::Inverse),
        }
    }

    fn spectrum(&self, coefficients: &Coefficients) -> Vec<Complex64> {
        let f = |i: usize| 2.0 * i.min(self.size - i) as f64 / self.size as f64;
        (0..self.size).map(|i| fit::gain(coefficients, f(i))).collect()
    }

    /// Returns the filter of a spectrum, as long as [`TAIL`] requires.
    fn cut(&self, spectrum: impl Iterator<Item = Complex64>) -> Taps {
        let mut filter: Vec<_> = spectrum.collect();
        self.inverse.process(&mut filter);
        let scale = 1.0 / self.size as f64;
        let mut radius = self.size / 2 - 1;
        let mut tail = 0.0;
        while radius > 1 {
            tail += 2.0 * filter[radius].norm() * scale;
            if tail > TAIL {
                break;
            }
            radius -= 1;
        }
        let sides = filter[1..=radius].iter().map(|c| c * scale);
        taps(&sides.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn optics() -> Optics {
        Optics {
            pitch_m: 8e-6,
            wavelength_m: 638e-9,
            step_m: 6e-3 / 24.0,
            planes: 24,
            home_m: -2.9e-3,
        }
    }

    fn gain(taps: &[[f32; 2]], f: f64) -> Complex64 {
        let tap = |j: usize| Complex64::new(taps[j][0].into(), taps[j][1].into());
        let sides = (1..taps.len()).map(|j| tap(j) * 2.0 * (std::f64::consts::PI * j as f64 * f).cos());
        tap(0) + sides.sum::<Complex64>()
    }

    #[test]
    fn merged_filters_are_powers_and_keep_the_mean_of_a_field() {
        let filters = Filters::new(&optics(), 4);
        for gap in 1..24 {
            let (mut left, mut total) = (gap, Complex64::ONE);
            while left > 0 {
                let (taps, part) = filters.part(left);
                assert!((gain(&taps.values(), 0.0) - 1.0).norm() < 2e-7, "{gap}");
                total *= gain(&taps.values(), 0.37);
                left -= part;
            }
            let power = gain(&filters.step, 0.37).powu(gap as u32);
            assert!((total - power).norm() < 1e-3, "{gap}: {total} for {power}");
        }
        for k in 0..24 {
            let end = gain(&filters.end(k).values(), 0.37);
            let power = gain(&filters.step, 0.37).powu(k as u32) * gain(&filters.home, 0.37);
            assert!((end - power).norm() < 1e-3, "{k}: {end} for {power}");
            assert!(filters.before_end(k) <= k);
        }
    }

    #[test]
    fn wide_gaps_cost_less_than_their_steps() {
        let filters = Filters::new(&optics(), 4);
        let (taps, part) = filters.part(16);
        assert!(part > 2 && taps.radius() < 5 * part);
    }
}
