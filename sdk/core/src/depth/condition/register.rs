//! Registration: finds the shift between depth and colour from their edges, and by how many readings near surfaces are
//! too wide, as sensors that compare windows of two pictures make them. The difference between two neighbouring
//! readings marks an edge of depth between them. Shift and growth are right where the most colour edges lie under
//! these.
//!
//! Growth moves an edge toward what is behind it, so the evidence of each diagonal direction is summed separately.
//! Colour is sampled at up to four places per reading along each axis, so a shift is found to a quarter of a reading.
//! Colour edges count in proportion to their surroundings: a texture has many.

use crate::Bounds;
use crate::Size;
use crate::frame::Crop;
use crate::parallel::prelude::*;
use phasefront_kernels::wide;

/// The largest number of colour samples per reading along each axis.
pub(super) const MOST_SAMPLES: usize = 4;
/// The largest shift, in samples.
pub(super) const REACH: usize = 6;
/// The number of shifts along each axis.
const SIDE: usize = 2 * REACH + 1;
const SHIFTS: usize = SIDE * SIDE;
/// The diagonal directions in which depth can grow at an edge.
const DIRECTIONS: usize = 4;
/// The number of sums in the evidence: one for each direction and shift, and the sum of the weights.
const SUMS: usize = DIRECTIONS * SHIFTS + 1;
/// The largest growth of near surfaces, in readings.
pub(super) const MOST_GROWTH: usize = 3;
/// The least ratio of the evidence for a growth to that for less.
pub(super) const GROWTH_GAIN: f32 = 1.1;
/// The least and the most difference of depth that counts at an edge, as a share of the volume.
pub(super) const EDGE: std::ops::RangeInclusive<f32> = 0.05..=0.2;
/// The colour change that counts half, as the sum of the changes of red, green and blue.
pub(super) const HALF: f32 = 0.2;
/// The side of the tiles, in samples, whose mean colour edge an edge is compared with, and the least mean.
pub(super) const TILE: usize = 16;
pub(super) const FAINT: f32 = 0.02;
/// The number of standard deviations by which the best shift must exceed the mean of all shifts.
pub(super) const DISTINCT: f32 = 2.0;
/// The least sum of differences of depth.
pub(super) const LEAST_EDGES: f32 = 8.0;
/// The best shift and growth without evidence.
const NONE: (usize, usize) = (SHIFTS / 2, 0);
/// The share of the evidence that remains in the next search.
const MEMORY: f32 = 0.7;
/// The relative gain in evidence at which the first search shifts at all, and at which a later one replaces what was
/// found, or not found, in previous frames. Each new shift moves all edges of a video.
pub(super) const GAIN: f32 = 1.02;
const LATER_GAIN: f32 = 1.1;

/// How depth lies beside colour.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Misfit {
    /// The distance (y, x) of the edges of depth from those of colour, in readings.
    pub shift: (f64, f64),
    /// The number of readings by which near surfaces are too wide on every side.
    pub growth: usize,
}

/// The steps of a search. The first frame takes all of them, and each later frame one, so that no frame takes much
/// longer than others: cameras do not move against each other.
#[derive(Debug, Clone, Copy)]
enum Step {
    Begin,
    FindEdges,
    Compare,
    Decide,
}

/// Finds the misfit of a sequence of frames.
pub(super) struct Registration {
    /// The number of readings along each axis.
    size: Size,
    /// The number of samples per reading along each axis.
    samples: usize,
    /// The display's row of each row of samples, and the column of each column, where they lie in the display.
    pixels: [Vec<Option<u32>>; 2],
    /// The size of the display.
    out: Size,
    /// The colour of each sample, (3, samples·h, samples·w).
    colour: Vec<f32>,
    /// The colour edges in a reading's size around each sample, along x and along y.
    edges: [Vec<f32>; 2],
    /// The evidence of each row of readings.
    rows: Vec<[f32; SUMS]>,
    /// The evidence of all frames so far.
    evidence: [f32; SUMS],
    /// The index of the best shift, and the best growth.
    best: (usize, usize),
    /// The depth of the frame that is searched.
    depth: Vec<f32>,
    /// The next step of the search, or `None` before the first search.
    next: Option<Step>,
    found: Misfit,
}

impl Registration {
    /// Plans the part `crop` of readings of `size` for a display of the size `out`.
    pub(super) fn new(size: Size, crop: Crop, out: Size) -> Self {
        let ratio = [out.height as f64 / crop.height, out.width as f64 / crop.width];
        let samples = (ratio[0].round() as usize).clamp(1, MOST_SAMPLES);
        let pixels = |readings: usize, from: f64, ratio: f64, out: usize| {
            let at = |i: usize| ((i as f64 + 0.5) / samples as f64 - from) * ratio;
            let pixel = |i: usize| {
                Some(at(i))
                    .filter(|at| (0.0..out as f64).contains(at))
                    .map(|at| at as u32)
            };
            (0..readings * samples).map(pixel).collect::<Vec<_>>()
        };
        let count = size.pixels() * samples * samples;
        Registration {
            size,
            samples,
            pixels: [
                pixels(size.height, crop.y, ratio[0], out.height),
                pixels(size.width, crop.x, ratio[1], out.width),
            ],
            out,
            colour: vec![0.0; 3 * count],
            edges: [vec![0.0; count], vec![0.0; count]],
            rows: vec![[0.0; SUMS]; size.height],
            evidence: [0.0; SUMS],
            best: NONE,
            depth: vec![0.0; size.pixels()],
            next: None,
            found: Misfit::default(),
        }
    }

    /// Forgets the frames so far.
    pub(super) fn reset(&mut self) {
        self.evidence.fill(0.0);
        self.best = NONE;
        self.next = None;
    }

    /// Returns how `depth`, which may contain NaN, lies beside `rgb`, (3, H, W). Without evidence it does not.
    pub(super) fn misfit(&mut self, depth: &[f32], rgb: &[f32]) -> Misfit {
        self.next = Some(match self.next {
            None => {
                self.begin(depth, rgb);
                self.find_edges();
                self.compare();
                self.decide();
                Step::Begin
            }
            Some(Step::Begin) => {
                self.begin(depth, rgb);
                Step::FindEdges
            }
            Some(Step::FindEdges) => {
                self.find_edges();
                Step::Compare
            }
            Some(Step::Compare) => {
                self.compare();
                Step::Decide
            }
            Some(Step::Decide) => {
                self.decide();
                Step::Begin
            }
        });
        self.found
    }

    /// Decides by the evidence of the frames so far.
    fn decide(&mut self) {
        let is_first = self.evidence[SUMS - 1] == 0.0;
        self.evidence.iter_mut().for_each(|v| *v *= MEMORY);
        for row in &self.rows {
            self.evidence.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
        }
        let top = self.top();
        let gain = if is_first { GAIN } else { LATER_GAIN };
        // What was found stays while later evidence is weak: it adds up in a video whose picture stands.
        if self.support(top) > gain * self.support(self.best) && self.is_distinct(top) {
            self.best = top;
        }
        let (shift, growth) = self.best;
        let steps = |i: usize| (i as f64 - REACH as f64) / self.samples as f64;
        self.found = Misfit {
            shift: (steps(shift / SIDE), steps(shift % SIDE)),
            growth,
        };
    }

    /// Returns whether there is enough evidence, and for `found` much more than for shifts in general.
    fn is_distinct(&self, found: (usize, usize)) -> bool {
        let sums = || (0..SHIFTS).map(|shift| self.support((shift, 0)));
        let mean = sums().sum::<f32>() / SHIFTS as f32;
        let variance = sums().map(|v| (v - mean) * (v - mean)).sum::<f32>() / SHIFTS as f32;
        self.evidence[SUMS - 1] >= LEAST_EDGES && self.support(found) - mean >= DISTINCT * variance.sqrt()
    }

    /// Returns the evidence for a shift and a growth.
    fn support(&self, (shift, growth): (usize, usize)) -> f32 {
        let by = growth * self.samples;
        let (down, up) = (shift + by * SIDE, shift - by * SIDE);
        let places = [down + by, down - by, up + by, up - by];
        let of_directions = self.evidence.chunks_exact(SHIFTS).zip(places);
        of_directions.map(|(sums, place)| sums[place]).sum()
    }

    /// Returns the shift and the growth with the most evidence.
    fn top(&self) -> (usize, usize) {
        let mut best = NONE;
        for growth in (0..=MOST_GROWTH).take_while(|growth| growth * self.samples <= REACH) {
            let range = growth * self.samples..SIDE - growth * self.samples;
            let shifts = range.clone().flat_map(|y| range.clone().map(move |x| y * SIDE + x));
            let top = shifts
                .map(|shift| (shift, growth))
                .max_by(|a, b| self.support(*a).total_cmp(&self.support(*b)))
                .unwrap_or(NONE);
            let gain = if growth == 0 { 1.0 } else { GROWTH_GAIN };
            if self.support(top) > gain * self.support(best) {
                best = top;
            }
        }
        best
    }

    /// Takes the depth and samples of the colours. Samples outside the display are NaN.
    fn begin(&mut self, depth: &[f32], rgb: &[f32]) {
        self.depth.copy_from_slice(depth);
        let [rows, columns] = &self.pixels;
        let Size { width, height } = self.out;
        let samples = self.colour.par_chunks_exact_mut(columns.len()).enumerate();
        samples.for_each(|(i, samples)| {
            let (colour, row) = (i / rows.len(), rows[i % rows.len()]);
            let row = row.map(|row| &rgb[(colour * height + row as usize) * width..][..width]);
            for (sample, column) in samples.iter_mut().zip(columns) {
                *sample = row.zip(*column).map_or(f32::NAN, |(row, column)| row[column as usize]);
            }
        });
    }

    /// Computes the colour edges around each sample.
    fn find_edges(&mut self) {
        let (samples, width) = (self.samples, self.samples * self.size.width);
        let size = self.edges[0].len();
        let height = size / width;
        let colour = &self.colour;
        let row = |y: usize| [0, 1, 2].map(|c| &colour[c * size + y * width..][..width]);
        // The edges lie between two readings, so the samples around an edge are as many on both sides.
        let before = 1 - samples % 2;
        let [along_x, along_y] = &mut self.edges;
        along_x.par_chunks_exact_mut(width).enumerate().for_each(|(y, to)| {
            let (row, last) = (row(y), width - 1);
            let from = |x: usize| row.map(|row| &row[x..]);
            let first = before.min(last);
            wide!({
                write_changes(from(0), from(1.min(last)), &mut to[..first]);
                write_changes(from(0), from(1.min(last) + first), &mut to[first..last]);
                write_changes(from(last - first), from(last), &mut to[last..]);
            });
        });
        along_y.par_chunks_exact_mut(width).enumerate().for_each(|(y, to)| {
            let (above, below) = (row(y.saturating_sub(before)), row((y + 1).min(height - 1)));
            wide!(write_changes(above, below, to));
        });
        let bands = along_x
            .par_chunks_mut(TILE * width)
            .zip(along_y.par_chunks_mut(TILE * width));
        bands.for_each(|(along_x, along_y)| {
            for left in (0..width).step_by(TILE) {
                let tile = left..(left + TILE).min(width);
                let sum = |edges: &[f32]| {
                    let rows = edges.chunks_exact(width);
                    rows.map(|row| row[tile.clone()].iter().sum::<f32>()).sum::<f32>()
                };
                let count = 2 * tile.len() * along_x.len() / width;
                let scale = 1.0 / ((sum(along_x) + sum(along_y)) / count as f32 + FAINT);
                for row in along_x.chunks_exact_mut(width).chain(along_y.chunks_exact_mut(width)) {
                    row[tile.clone()].iter_mut().for_each(|edge| *edge *= scale);
                }
            }
        });
        // Sums over a reading: to the right, then downward. The colours are not needed any more.
        for (edges, sums) in self.edges.iter_mut().zip(self.colour.chunks_exact_mut(size)) {
            let rows = sums.par_chunks_exact_mut(width).zip(edges.par_chunks_exact(width));
            rows.for_each(|(sums, row)| {
                wide!({
                    sums.copy_from_slice(row);
                    for beside in 1..samples.min(width) {
                        sums.iter_mut().zip(&row[beside..]).for_each(|(sum, v)| *sum += v);
                    }
                });
            });
            edges.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
                wide!({
                    row.fill(0.0);
                    for sums in sums[y * width..].chunks_exact(width).take(samples) {
                        row.iter_mut().zip(sums).for_each(|(to, sum)| *to += sum);
                    }
                });
            });
        }
    }

    /// Sums the colour edges under the depth edges of each row, for each direction and shift.
    fn compare(&mut self) {
        let depth = &self.depth;
        let Size { width: w, height: h } = self.size;
        let (samples, width, height) = (self.samples, self.samples * w, self.samples * h);
        let edges = &self.edges;
        self.rows.par_iter_mut().enumerate().for_each(|(y, sums)| {
            sums.fill(0.0);
            for x in 0..w {
                for axis in [0, 1] {
                    let Some((step, direction)) = step(depth, self.size, (y, x), axis) else {
                        continue;
                    };
                    sums[SUMS - 1] += step;
                    // The edge lies between the middles of two readings: along x, or along y.
                    let (top, left) = match axis {
                        0 => (samples * y, samples * x + samples / 2),
                        _ => (samples * y + samples / 2, samples * x),
                    };
                    let sums = &mut sums[direction * SHIFTS..][..SHIFTS];
                    for (i, sums) in sums.chunks_exact_mut(SIDE).enumerate() {
                        let row = (top + REACH).saturating_sub(i).min(height - 1);
                        for (j, sum) in sums.iter_mut().enumerate() {
                            let column = (left + REACH).saturating_sub(j).min(width - 1);
                            *sum += step * edges[axis][row * width + column];
                        }
                    }
                }
            }
        });
    }
}

/// Writes the changes of red, green and blue between the samples `a` and `b`. There may be more samples than changes.
#[inline(always)]
fn write_changes(a: [&[f32]; 3], b: [&[f32]; 3], to: &mut [f32]) {
    let count = to.len();
    let [a, b] = [a, b].map(|samples| samples.map(|samples| &samples[..count]));
    for (i, to) in to.iter_mut().enumerate() {
        let sum = (a[0][i] - b[0][i]).abs() + (a[1][i] - b[1][i]).abs() + (a[2][i] - b[2][i]).abs();
        // Nothing is known of edges outside the display.
        *to = if sum.is_nan() { 0.0 } else { sum / (sum + HALF) };
    }
}

/// Returns the weight and the direction of the edge of `depth` between the reading (`y`, `x`) and the next one along
/// x (`axis` 0) or y (1), or `None` without an edge.
///
/// An edge beside a hole does not count: the hole may hide where the near surface ends.
fn step(
    depth: &[f32],
    Size { width: w, height: h }: Size,
    (y, x): (usize, usize),
    axis: usize,
) -> Option<(f32, usize)> {
    let at = y * w + x;
    let along = [(x, w, 1), (y, h, w)];
    let ((i, n, by), (j, m, across)) = (along[axis], along[1 - axis]);
    if i + 1 >= n {
        return None;
    }
    let step = depth[at + by] - depth[at];
    let beside_hole = i > 0 && depth[at - by].is_nan() || i + 2 < n && depth[at + 2 * by].is_nan();
    if step.is_nan() || step.abs() < *EDGE.start() || beside_hole {
        return None;
    }
    let before = if j > 0 { at - across } else { at };
    let after = if j + 1 < m { at + across } else { at };
    let turn = depth[after] + depth[after + by] - depth[before] - depth[before + by];
    let (right, down) = if axis == 0 { (step, turn) } else { (turn, step) };
    let direction = 2 * usize::from(down < 0.0) + usize::from(right < 0.0);
    Some((step.abs().at_most(*EDGE.end()), direction))
}
