//! Registration: finds the shift between depth and colour from their edges. The difference between two neighbouring
//! readings marks an edge of depth between them, and the shift is right where the most colour edges lie under these.
//!
//! Colour is sampled at up to four places per reading along each axis, so a shift is found to a quarter of a reading.

use crate::frame::Crop;
use rayon::prelude::*;

/// The largest number of colour samples per reading along each axis.
pub(super) const MOST_SAMPLES: usize = 4;
/// The largest shift, in samples.
pub(super) const REACH: usize = 6;
/// The number of shifts along each axis.
const SIDE: usize = 2 * REACH + 1;
const SHIFTS: usize = SIDE * SIDE;
/// The least and the most difference of depth that counts at an edge, as a share of the volume.
pub(super) const EDGE: std::ops::RangeInclusive<f32> = 0.05..=0.2;
/// The colour change that counts half, as the sum of the changes of red, green and blue.
pub(super) const HALF: f32 = 0.2;
/// The number of standard deviations by which the best shift must exceed the mean of all shifts.
pub(super) const DISTINCT: f32 = 2.0;
/// The least sum of differences of depth.
pub(super) const LEAST_EDGES: f32 = 4.0;
/// The number of frames from one search to the next. Cameras do not move against each other.
const INTERVAL: u32 = 4;
/// The share of the evidence that remains in the next search.
const MEMORY: f32 = 0.7;
/// The relative gain in evidence at which a shift replaces the one of the previous frame.
pub(super) const GAIN: f32 = 1.02;

/// Finds the shift of a sequence of frames.
pub(super) struct Registration {
    /// (H, W) of the readings.
    shape: (usize, usize),
    /// The number of samples per reading along each axis.
    samples: usize,
    /// The display's row of each row of samples, and the column of each column, where they lie in the display.
    pixels: [Vec<Option<u32>>; 2],
    /// (H, W) of the display.
    out: (usize, usize),
    /// The colour of each sample, (3, samples·h, samples·w).
    colour: Vec<f32>,
    /// The colour edges in a reading's size around each sample, along x and along y.
    edges: [Vec<f32>; 2],
    /// The evidence of each row of readings: [`SHIFTS`] sums, and the sum of the weights.
    rows: Vec<[f32; SHIFTS + 1]>,
    /// The evidence of all frames so far.
    evidence: [f32; SHIFTS + 1],
    best: usize,
    /// The number of frames since the last search, or `None` before the first.
    age: Option<u32>,
    found: (f64, f64),
}

impl Registration {
    /// Plans the part `crop` of (h, w) = `shape` readings for a display of (H, W) = `out`.
    pub(super) fn new(shape: (usize, usize), crop: Crop, out: (usize, usize)) -> Self {
        let ratio = [out.0 as f64 / crop.height, out.1 as f64 / crop.width];
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
        let size = shape.0 * shape.1 * samples * samples;
        Registration {
            shape,
            samples,
            pixels: [
                pixels(shape.0, crop.y, ratio[0], out.0),
                pixels(shape.1, crop.x, ratio[1], out.1),
            ],
            out,
            colour: vec![0.0; 3 * size],
            edges: [vec![0.0; size], vec![0.0; size]],
            rows: vec![[0.0; SHIFTS + 1]; shape.0],
            evidence: [0.0; SHIFTS + 1],
            best: SHIFTS / 2,
            age: None,
            found: (0.0, 0.0),
        }
    }

    /// Forgets the frames so far.
    pub(super) fn reset(&mut self) {
        self.evidence.fill(0.0);
        self.best = SHIFTS / 2;
        self.age = None;
    }

    /// Returns the distance (y, x) of the edges of `depth`, which may contain NaN, from those of `rgb`, (3, H, W), in
    /// readings, or 0 if the evidence is weak.
    pub(super) fn shift(&mut self, depth: &[f32], rgb: &[f32]) -> (f64, f64) {
        self.age = self.age.map(|age| age + 1).filter(|age| *age < INTERVAL).or(Some(0));
        if self.age == Some(0) {
            self.found = self.search(depth, rgb);
        }
        self.found
    }

    fn search(&mut self, depth: &[f32], rgb: &[f32]) -> (f64, f64) {
        self.sample(rgb);
        self.find_edges();
        self.compare(depth);
        self.evidence.iter_mut().for_each(|v| *v *= MEMORY);
        for row in &self.rows {
            self.evidence.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
        }
        let sums = &self.evidence[..SHIFTS];
        let top = (0..SHIFTS)
            .max_by(|a, b| sums[*a].total_cmp(&sums[*b]))
            .unwrap_or(SHIFTS / 2);
        if sums[top] > GAIN * sums[self.best] {
            self.best = top;
        }
        let mean = sums.iter().sum::<f32>() / SHIFTS as f32;
        let variance = sums.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / SHIFTS as f32;
        if self.evidence[SHIFTS] < LEAST_EDGES || sums[self.best] - mean < DISTINCT * variance.sqrt() {
            return (0.0, 0.0);
        }
        let steps = |i: usize| (i as f64 - REACH as f64) / self.samples as f64;
        (steps(self.best / SIDE), steps(self.best % SIDE))
    }

    /// Samples the colours. Samples outside the display are NaN.
    fn sample(&mut self, rgb: &[f32]) {
        let [rows, columns] = &self.pixels;
        let (height, width) = self.out;
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
        let (samples, width) = (self.samples, self.samples * self.shape.1);
        let size = self.edges[0].len();
        let height = size / width;
        let colour = &self.colour;
        let change = |a: usize, b: usize| {
            let sum: f32 = (0..3)
                .map(|c| (colour[c * size + a] - colour[c * size + b]).abs())
                .sum();
            // Nothing is known of edges outside the display.
            if sum.is_nan() { 0.0 } else { sum / (sum + HALF) }
        };
        let [along_x, along_y] = &mut self.edges;
        along_x.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            let at = |x: usize| y * width + x;
            for (x, to) in row.iter_mut().enumerate() {
                *to = change(at(x.saturating_sub(1)), at((x + 1).min(width - 1)));
            }
        });
        along_y.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            let (above, below) = (y.saturating_sub(1) * width, (y + 1).min(height - 1) * width);
            for (x, to) in row.iter_mut().enumerate() {
                *to = change(above + x, below + x);
            }
        });
        // Sums over a reading: to the right, then downward. The colours are not needed any more.
        for (edges, sums) in self.edges.iter_mut().zip(self.colour.chunks_exact_mut(size)) {
            let rows = sums.par_chunks_exact_mut(width).zip(edges.par_chunks_exact(width));
            rows.for_each(|(sums, row)| {
                for (x, sum) in sums.iter_mut().enumerate() {
                    *sum = row[x..(x + samples).min(width)].iter().sum();
                }
            });
            edges.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
                row.fill(0.0);
                for sums in sums[y * width..].chunks_exact(width).take(samples) {
                    row.iter_mut().zip(sums).for_each(|(to, sum)| *to += sum);
                }
            });
        }
    }

    /// Sums the colour edges under the depth edges of each row, for each shift.
    fn compare(&mut self, depth: &[f32]) {
        let (h, w) = self.shape;
        let (samples, width, height) = (self.samples, self.samples * w, self.samples * h);
        let edges = &self.edges;
        self.rows.par_iter_mut().enumerate().for_each(|(y, sums)| {
            sums.fill(0.0);
            for x in 0..w {
                let at = y * w + x;
                // The edge lies between the middles of two readings: along x, or along y.
                for (axis, next, inside) in [(0, at + 1, x + 1 < w), (1, at + w, y + 1 < h)] {
                    if !inside {
                        continue;
                    }
                    let step = (depth[next] - depth[at]).abs();
                    if step.is_nan() || step < *EDGE.start() {
                        continue;
                    }
                    let step = step.min(*EDGE.end());
                    sums[SHIFTS] += step;
                    let (top, left) = match axis {
                        0 => (samples * y, samples * x + samples / 2),
                        _ => (samples * y + samples / 2, samples * x),
                    };
                    for (i, sums) in sums[..SHIFTS].chunks_exact_mut(SIDE).enumerate() {
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
