//! The least squares fit of a line of pixels by an enlarged line of readings.

use super::Enlarging;
use crate::Bounds;
use ndarray::ArrayView2;

/// The number of readings that make a pixel, at most.
const TAPS: usize = 4;
/// The readings beyond both ends of a line that a shifted grid needs.
const BEYOND: usize = 2;
/// What is added to the diagonal of the normal equations, for readings beyond the ends that make no pixel.
const RIDGE: f64 = 1e-9;

/// A map from readings to pixels along one axis. The middle of pixel x lies at (x + ½)/factor − ½ among the readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kernel {
    /// The reading nearest to the pixel's middle.
    Nearest,
    /// The reading nearest to the pixel's left end, as OpenCV and PyTorch take it. The same with whole factors.
    NearestAtCorner,
    Linear,
    /// Keys' cubic with a = −½: Pillow, Catmull and Rom.
    CubicHalf,
    /// Keys' cubic with a = −¾: OpenCV, PyTorch.
    CubicThreeQuarters,
}

impl Kernel {
    pub(super) const ALL: [Kernel; 5] = [
        Kernel::Nearest,
        Kernel::NearestAtCorner,
        Kernel::Linear,
        Kernel::CubicHalf,
        Kernel::CubicThreeQuarters,
    ];

    pub(super) fn enlarging(self) -> Enlarging {
        match self {
            Kernel::Nearest | Kernel::NearestAtCorner => Enlarging::Nearest,
            Kernel::Linear => Enlarging::Bilinear,
            Kernel::CubicHalf | Kernel::CubicThreeQuarters => Enlarging::Bicubic,
        }
    }

    /// Returns the first reading that makes a pixel at `place` among the readings, and the weights from there on.
    fn weights(self, place: f64) -> (f64, [f64; TAPS]) {
        /// Places that lie on the border of two readings but for rounding belong to the second.
        const ROUNDING: f64 = 1e-9;
        let before = place.floor();
        let t = place - before;
        match self {
            Kernel::Nearest | Kernel::NearestAtCorner => ((place + 0.5 + ROUNDING).floor(), [1.0, 0.0, 0.0, 0.0]),
            Kernel::Linear => (before, [1.0 - t, t, 0.0, 0.0]),
            Kernel::CubicHalf => (before - 1.0, cubic(t, -0.5)),
            Kernel::CubicThreeQuarters => (before - 1.0, cubic(t, -0.75)),
        }
    }
}

/// Returns Keys' weights of the four readings around a place `t` after the second.
fn cubic(t: f64, a: f64) -> [f64; TAPS] {
    let near = |s: f64| ((a + 2.0) * s - (a + 3.0)) * s * s + 1.0;
    let far = |s: f64| ((a * s - 5.0 * a) * s + 8.0 * a) * s - 4.0 * a;
    [far(1.0 + t), near(t), near(1.0 - t), far(2.0 - t)]
}

/// The fit of lines of a given length.
pub(super) struct Fit {
    /// For each pixel the first of the readings that make it, and their weights. Beyond the ends, readings repeat.
    taps: Vec<(usize, [f64; TAPS])>,
    /// The Cholesky factor of the normal equations: of each row, the diagonal and the three entries left of it.
    factor: Vec<[f64; TAPS]>,
    /// The readings beyond the first that are no readings of the grid.
    beyond: usize,
    grid: usize,
    is_cubic: bool,
}

/// The least and the largest number of depth. A bicubic map swings beyond its readings, and what lies beyond the
/// numbers of a file was cut off.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub(super) least: f32,
    pub(super) most: f32,
}

impl Limits {
    /// Nothing was cut off.
    pub(super) const NONE: Limits = Limits {
        least: f32::NEG_INFINITY,
        most: f32::INFINITY,
    };

    /// Returns the ends of the numbers of `depth` that are finite.
    pub(super) fn of(depth: ArrayView2<'_, f32>) -> Self {
        let finite = depth.iter().filter(|v| v.is_finite());
        let (least, most) = finite.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), v| {
            (v.at_most(a), v.at_least(b))
        });
        Limits { least, most }
    }

    /// Returns the limits of depth from which `low` is subtracted and that is divided by `range`.
    pub(super) fn scaled(self, low: f32, range: f32) -> Self {
        let Limits { least, most } = self;
        let [least, most] = [least, most].map(|end| (end - low) / range);
        Limits { least, most }
    }

    /// Checks whether `value` may have been cut off from `made`.
    fn hide(self, value: f64, made: f64) -> bool {
        // Readings of rows, which columns are fitted to, lie on the limits but for rounding.
        let near = 1e-3 * (self.most - self.least);
        let [low, high] = [self.least + near, self.most - near].map(f64::from);
        value <= low && made < value || value >= high && made > value
    }
}

/// The most rounds in which pixels that were cut off take the numbers of the fit.
const ROUNDS: usize = 12;
/// The change of a pixel, as a share of the range, below which the rounds end.
const SETTLED: f64 = 2e-4;

/// The number of lines that are fitted together. Each step of a line's solution needs the one before, so the steps of
/// several lines fill the time.
pub(super) const LANES: usize = 8;
/// A number of each line; 0 of those that are missing.
pub(super) type Lanes = [f64; LANES];

/// Working memory.
pub(super) struct FitScratch {
    values: Vec<Lanes>,
    wanted: Vec<Lanes>,
    readings: Vec<Lanes>,
    solved: Vec<Lanes>,
    errors: Vec<Lanes>,
}

impl Fit {
    /// Plans lines of `pixels` that `kernel` made of `grid` readings, shifted by `shift` readings.
    pub(super) fn new(pixels: usize, grid: usize, kernel: Kernel, shift: f64) -> Self {
        let beyond = if shift == 0.0 { 0 } else { BEYOND };
        let (count, factor) = (grid + 2 * beyond, pixels as f64 / grid as f64);
        let corner = if kernel == Kernel::NearestAtCorner {
            0.5 / factor
        } else {
            0.0
        };
        let taps = (0..pixels).map(|x| {
            let place = (x as f64 + 0.5) / factor - 0.5 - corner + shift + beyond as f64;
            let (first, weights) = kernel.weights(place);
            let last = count as f64 - 1.0;
            let from = first.clamp(0.0, (count - TAPS) as f64);
            let mut clamped = [0.0; TAPS];
            for (i, weight) in weights.into_iter().enumerate() {
                // A weight of 0 may lie past the window.
                let at = ((first + i as f64).clamp(0.0, last) - from) as usize;
                clamped[at.min(TAPS - 1)] += weight;
            }
            (from as usize, clamped)
        });
        let taps: Vec<_> = taps.collect();
        let factor = cholesky(&taps, count);
        Fit {
            taps,
            factor,
            beyond,
            grid,
            is_cubic: kernel.enlarging() == Enlarging::Bicubic,
        }
    }

    pub(super) fn scratch(&self) -> FitScratch {
        let [pixels, readings] = [self.taps.len(), self.factor.len()].map(|count| vec![[0.0; LANES]; count]);
        FitScratch {
            values: pixels.clone(),
            wanted: pixels.clone(),
            readings: readings.clone(),
            solved: readings,
            errors: pixels,
        }
    }

    /// Returns the readings of the grid whose enlargement, cut off at `limits`, is nearest to each of up to [`LANES`]
    /// `lines`.
    pub(super) fn readings<'a>(
        &self,
        lines: &[impl AsRef<[f32]>],
        limits: Limits,
        scratch: &'a mut FitScratch,
    ) -> &'a [Lanes] {
        self.fit(lines, limits, scratch);
        &scratch.readings[self.beyond..][..self.grid]
    }

    /// Returns how much each pixel of up to [`LANES`] `lines` differs from the nearest enlargement, cut off at
    /// `limits`.
    pub(super) fn errors<'a>(
        &self,
        lines: &[impl AsRef<[f32]>],
        limits: Limits,
        scratch: &'a mut FitScratch,
    ) -> &'a [Lanes] {
        self.fit(lines, limits, scratch);
        let FitScratch {
            values,
            readings,
            errors,
            ..
        } = scratch;
        for ((errors, values), taps) in errors.iter_mut().zip(values).zip(&self.taps) {
            let made = made(taps, readings);
            for ((error, value), made) in errors.iter_mut().zip(values).zip(made) {
                let hidden = self.is_cubic && limits.hide(*value, made);
                *error = if hidden { 0.0 } else { *value - made };
            }
        }
        errors
    }

    /// Fits `lines`. A pixel on the limits that a cubic fit carries beyond them was cut off, and takes the fit's number
    /// in the next round.
    fn fit(&self, lines: &[impl AsRef<[f32]>], limits: Limits, scratch: &mut FitScratch) {
        let FitScratch {
            values,
            wanted,
            readings,
            solved,
            ..
        } = scratch;
        for lane in 0..LANES {
            match lines.get(lane) {
                Some(line) => (values.iter_mut().zip(line.as_ref())).for_each(|(to, v)| to[lane] = f64::from(*v)),
                None => values.iter_mut().for_each(|to| to[lane] = 0.0),
            }
        }
        wanted.copy_from_slice(values);
        self.solve(wanted, readings);
        if !self.is_cubic || !limits.least.is_finite() {
            return;
        }
        let settled = SETTLED * f64::from(limits.most - limits.least);
        let mut is_settled = [false; LANES];
        for _ in 0..ROUNDS {
            let mut changed: Lanes = [0.0; LANES];
            for ((wanted, values), taps) in wanted.iter_mut().zip(&*values).zip(&self.taps) {
                let made = made(taps, readings);
                for lane in 0..LANES {
                    let is_hidden = limits.hide(values[lane], made[lane]);
                    let now = if is_hidden { made[lane] } else { values[lane] };
                    changed[lane] = changed[lane].at_least((now - wanted[lane]).abs());
                    wanted[lane] = now;
                }
            }
            for (is_settled, changed) in is_settled.iter_mut().zip(changed) {
                *is_settled |= changed <= settled;
            }
            if !is_settled.contains(&false) {
                break;
            }
            self.solve(wanted, solved);
            // A line that has settled keeps its readings, whichever lines are fitted beside it.
            for (to, from) in readings.iter_mut().zip(&*solved) {
                for lane in (0..LANES).filter(|lane| !is_settled[*lane]) {
                    to[lane] = from[lane];
                }
            }
        }
    }

    fn solve(&self, lines: &[Lanes], readings: &mut [Lanes]) {
        readings.fill([0.0; LANES]);
        for (values, (first, weights)) in lines.iter().zip(&self.taps) {
            for (reading, weight) in readings[*first..][..TAPS].iter_mut().zip(weights) {
                add(reading, *weight, values);
            }
        }
        let count = readings.len();
        for i in 0..count {
            let mut below = [0.0; LANES];
            for k in 1..TAPS.min(i + 1) {
                add(&mut below, self.factor[i][k], &readings[i - k]);
            }
            subtract_and_divide(&mut readings[i], &below, self.factor[i][0]);
        }
        for i in (0..count).rev() {
            let mut above = [0.0; LANES];
            for k in 1..TAPS.min(count - i) {
                add(&mut above, self.factor[i + k][k], &readings[i + k]);
            }
            subtract_and_divide(&mut readings[i], &above, self.factor[i][0]);
        }
    }
}

/// Adds `values` times `weight` to `sums`.
fn add(sums: &mut Lanes, weight: f64, values: &Lanes) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += weight * value;
    }
}

/// Takes `less` from `values` and divides them by `divisor`.
fn subtract_and_divide(values: &mut Lanes, less: &Lanes, divisor: f64) {
    for (value, less) in values.iter_mut().zip(less) {
        *value = (*value - less) / divisor;
    }
}

/// Returns the pixel of each line that `readings` make.
fn made((first, weights): &(usize, [f64; TAPS]), readings: &[Lanes]) -> Lanes {
    let mut made = [0.0; LANES];
    for (weight, readings) in weights.iter().zip(&readings[*first..][..TAPS]) {
        add(&mut made, *weight, readings);
    }
    made
}

/// Returns the Cholesky factor of the normal equations of `taps` for `count` readings: entry k of row i is that of
/// column i − k.
fn cholesky(taps: &[(usize, [f64; TAPS])], count: usize) -> Vec<[f64; TAPS]> {
    let mut rows = vec![[0.0; TAPS]; count];
    for (first, weights) in taps {
        for (i, weight) in weights.iter().enumerate() {
            for (k, entry) in rows[first + i].iter_mut().take(i + 1).enumerate() {
                *entry += weight * weights[i - k];
            }
        }
    }
    rows.iter_mut().for_each(|row| row[0] += RIDGE);
    for i in 0..count {
        for k in (0..TAPS.min(i + 1)).rev() {
            let column = i - k;
            let known: f64 = (1..TAPS - k)
                .filter(|m| *m <= column)
                .map(|m| rows[i][k + m] * rows[column][m])
                .sum();
            let rest = rows[i][k] - known;
            rows[i][k] = if k == 0 { rest.sqrt() } else { rest / rows[column][0] };
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Returns what a fit says of the only line.
    fn only(lanes: &[Lanes]) -> Vec<f64> {
        lanes.iter().map(|lanes| lanes[0]).collect()
    }

    #[test]
    fn the_fit_is_that_of_the_dense_normal_equations() {
        let line: Vec<f32> = (0..70).map(|x| ((x * 37 + 11) % 29) as f32 / 29.0).collect();
        for kernel in Kernel::ALL {
            for (grid, shift) in [(35, 0.0), (20, 0.0), (10, 0.25), (14, 0.5)] {
                let fit = Fit::new(line.len(), grid, kernel, shift);
                let errors = only(fit.errors(&[&line], Limits::NONE, &mut fit.scratch()));
                // The errors of a least squares fit are orthogonal to every reading's enlargement.
                let mut along = vec![0.0; fit.factor.len()];
                for (error, (first, weights)) in errors.iter().zip(&fit.taps) {
                    weights
                        .iter()
                        .enumerate()
                        .for_each(|(i, weight)| along[first + i] += weight * error);
                }
                let most = along.iter().fold(0.0f64, |most, v| most.max(v.abs()));
                assert!(most < 1e-6, "{kernel:?} {grid} {shift}: {most}");
            }
        }
    }

    #[test]
    fn readings_of_an_enlarged_line_are_those_that_made_it() {
        let readings: Vec<f64> = (0..20).map(|i| f64::from((i * 7 + 3) % 11)).collect();
        for kernel in Kernel::ALL {
            for pixels in [40, 50, 60, 150] {
                let fit = Fit::new(pixels, readings.len(), kernel, 0.0);
                let line = fit.taps.iter().map(|(first, weights)| {
                    weights
                        .iter()
                        .zip(&readings[*first..])
                        .map(|(weight, reading)| weight * reading)
                        .sum::<f64>() as f32
                });
                let line: Vec<f32> = line.collect();
                let mut scratch = fit.scratch();
                let found = only(fit.readings(&[&line], Limits::NONE, &mut scratch));
                let apart = found
                    .iter()
                    .zip(&readings)
                    .map(|(a, b)| (a - b).abs())
                    .fold(0.0, f64::max);
                assert!(apart < 1e-4, "{kernel:?} {pixels}: {apart}");
            }
        }
    }

    /// Lines that are fitted together have the bits that each has alone, also where some settle before others.
    #[test]
    fn lines_do_not_touch_each_other() {
        let limits = Limits { least: 0.0, most: 1.0 };
        let lines: Vec<Vec<f32>> = (0..LANES as i32)
            .map(|lane| {
                (0..70)
                    .map(|x| ((x / (2 + lane) * 5 + lane) % 4 - 1).clamp(0, 1) as f32)
                    .collect()
            })
            .collect();
        for kernel in Kernel::ALL {
            for (grid, shift) in [(35, 0.0), (20, 0.25)] {
                let fit = Fit::new(70, grid, kernel, shift);
                let together = fit.readings(&lines, limits, &mut fit.scratch()).to_vec();
                for (lane, line) in lines.iter().enumerate() {
                    let alone = only(fit.readings(&[line], limits, &mut fit.scratch()));
                    let beside: Vec<f64> = together.iter().map(|lanes| lanes[lane]).collect();
                    assert_eq!(alone, beside, "{kernel:?} {grid}, line {lane}");
                }
            }
        }
    }
}
