//! Measures whether a frame's depth is clean: conditioning leaves clean depth alone, and its wave is a truth to compare
//! holograms with.
//!
//! Rendered depth changes between surfaces within one pixel, at the same place as the colour, and is smooth on
//! surfaces. Enlarged depth ramps over several pixels, the depth of a camera beside the colour camera changes at other
//! places, and sensors have noise.

use crate::frame::RgbdFrame;
use rayon::prelude::*;
use std::ops::Range;

/// The difference between the depths at the ends of a [`WINDOW`] above which they belong to two surfaces, as a share of
/// the volume.
const EDGE: f32 = 0.06;
/// The number of steps of the window in which an edge is searched; odd.
const WINDOW: usize = 5;
/// The share of the window's change that a sharp edge makes in one step.
const ONE_STEP: f32 = 0.75;
/// The least share of sharp edges in clean depth.
pub const SHARP_EDGES: f32 = 0.6;
/// The largest noise of clean depth, as a share of the volume.
pub const SMOOTH: f32 = 1.5e-3;

/// The result of [`measure`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sharpness {
    /// The share of the edges between surfaces, along rows and columns, that are one step wide and lie at the largest
    /// colour change among the five steps around them; 1 in a frame without edges.
    pub edges: f32,
    /// The standard deviation of the noise, as a share of the volume, estimated from the median of second differences
    /// along rows.
    pub noise: f32,
}

impl Sharpness {
    /// Returns whether the depth is clean: edges of at least [`SHARP_EDGES`], and noise of at most [`SMOOTH`].
    pub fn is_clean(&self) -> bool {
        self.edges >= SHARP_EDGES && self.noise <= SMOOTH
    }
}

/// The number of lines in a thread's unit of work.
const LINES: usize = 16;

/// Measures the depth of `frame` on the current rayon pool. Does not allocate. A frame with both sides under six pixels
/// has no edges, and a frame narrower than three pixels has no noise.
pub fn measure(frame: &RgbdFrame) -> Sharpness {
    let (rgb, depth) = frame.values();
    measure_planes(rgb, depth, frame.shape().1)
}

/// Measures `depth`, rows of `width`, beside `rgb`, (C, H, W), like [`measure`].
pub(crate) fn measure_planes(rgb: &[f32], depth: &[f32], width: usize) -> Sharpness {
    let height = depth.len() / width;
    let along_rows = (0..height.div_ceil(LINES)).into_par_iter();
    let along_columns = (0..width.div_ceil(LINES)).into_par_iter();
    let lines = |part: usize, of: usize| part * LINES..((part + 1) * LINES).min(of);
    let rows = along_rows.map(|part| edges((rgb, depth), lines(part, height), (1, width), width));
    let columns = along_columns.map(|part| edges((rgb, depth), lines(part, width), (width, height), 1));
    let (sharp, all) = rows.chain(columns).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    let edges = match all {
        0 => 1.0,
        all => sharp as f32 / all as f32,
    };
    Sharpness {
        edges,
        noise: noise(depth, width),
    }
}

/// Returns the number of sharp edges and of all edges along `lines`. Successive lines start `next` values apart and
/// have `along` values, `step` apart.
fn edges(
    (rgb, depth): (&[f32], &[f32]),
    lines: Range<usize>,
    (step, along): (usize, usize),
    next: usize,
) -> (u32, u32) {
    let (size, colours) = (depth.len(), rgb.len() / depth.len());
    let (mut sharp, mut all) = (0, 0);
    for line in lines {
        for i in 0..along.saturating_sub(WINDOW) {
            let at = line * next + i * step;
            let whole = (depth[at + WINDOW * step] - depth[at]).abs();
            if whole <= EDGE {
                continue;
            }
            let change = |j: usize| {
                let (a, b) = (at + j * step, at + (j + 1) * step);
                (depth[b] - depth[a]).abs()
            };
            let colour = |j: usize| {
                let (a, b) = (at + j * step, at + (j + 1) * step);
                let planes = (0..colours).map(|c| c * size);
                planes.map(|c| (rgb[c + b] - rgb[c + a]).abs()).sum::<f32>()
            };
            // Each edge is counted once, where its largest step is in the middle.
            let middle = change(WINDOW / 2);
            if (0..WINDOW).any(|j| change(j) > middle) {
                continue;
            }
            all += 1;
            if middle >= ONE_STEP * whole {
                let here = colour(WINDOW / 2);
                sharp += u32::from((0..WINDOW).all(|j| colour(j) <= here));
            }
        }
    }
    (sharp, all)
}

/// The resolution and the number of the bins of second differences, as a share of the volume. The last bin holds all
/// larger differences.
const DIFFERENCE: f32 = 2e-5;
const DIFFERENCES: usize = 2048;

/// Returns the median of |d(x−1) − 2d(x) + d(x+1)| over 0.6745·√6, which is the standard deviation of independent
/// normal noise.
fn noise(depth: &[f32], width: usize) -> f32 {
    let none = || [0u32; DIFFERENCES];
    let counts = depth
        .par_chunks(width * LINES)
        .fold(none, |mut counts, rows| {
            for d in rows.chunks_exact(width).flat_map(|row| row.windows(3)) {
                let step = (d[0] - 2.0 * d[1] + d[2]).abs() / DIFFERENCE;
                counts[(step as usize).min(DIFFERENCES - 1)] += 1;
            }
            counts
        })
        .reduce(none, |mut a, b| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            a
        });
    let half = counts.iter().sum::<u32>() / 2;
    let mut below = 0;
    let median = counts.iter().position(|count| {
        below += count;
        below > half
    });
    median.map_or(0.0, |step| step as f32 * DIFFERENCE / (0.6745 * 6f32.sqrt()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::{Array2, Array3};

    const SIZE: usize = 60;

    /// Measures a square in front of a wall. Its depth is shifted to the right of its colour, ramps over `ramp` pixels,
    /// and is noisy.
    fn square(shift: usize, ramp: usize, noise: f32) -> Sharpness {
        let inside = |y: usize, x: usize| (20..40).contains(&y) && (20..40).contains(&x);
        let rgb = Array3::from_shape_fn((3, SIZE, SIZE), |(_, y, x)| {
            // A texture fainter than the edge.
            0.2 + 0.5 * f32::from(inside(y, x)) + 0.02 * ((x * 7 + y * 3) % 5) as f32
        });
        let depth = Array2::from_shape_fn((SIZE, SIZE), |(y, x)| {
            let around = |at: usize, i: usize| (at + i).saturating_sub(ramp / 2);
            let places = (0..ramp * ramp).map(|i| (around(y, i / ramp), around(x, i % ramp)));
            let hits = places.filter(|(y, x)| inside(*y, x.saturating_sub(shift)));
            let mixed = (y as u32 * 7919 + x as u32).wrapping_mul(0x9e37_79b9);
            let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca6b);
            let random = (mixed >> 8) as f32 / (1 << 23) as f32 - 1.0;
            0.8 - 0.5 * hits.count() as f32 / (ramp * ramp) as f32 + noise * random
        });
        measure(&RgbdFrame::new(rgb, depth).unwrap())
    }

    #[test]
    fn clean_depth_is_told_from_noisy_depth() {
        let clean = square(0, 1, 0.0);
        assert!(clean.edges > 0.9 && clean.noise == 0.0, "{clean:?}");
        assert!(clean.is_clean());
        let [shifted, ramps, noisy] = [square(2, 1, 0.0), square(0, 4, 0.0), square(0, 1, 0.01)];
        assert!(shifted.edges < 0.6, "{shifted:?}");
        assert!(ramps.edges < 0.1, "{ramps:?}");
        // The noise is uniform in ±0.01.
        assert!((0.003..0.01).contains(&noisy.noise), "{noisy:?}");
        for bad in [shifted, ramps, noisy] {
            assert!(!bad.is_clean(), "{bad:?}");
        }
    }

    #[test]
    fn frames_without_edges_are_clean() {
        for (height, width) in [(1, 1), (2, 9), (40, 40)] {
            let depth = Array2::from_elem((height, width), 0.4);
            let rgb = Array3::from_elem((3, height, width), 0.5);
            let flat = measure(&RgbdFrame::new(rgb, depth).unwrap());
            assert_eq!((flat.edges, flat.noise), (1.0, 0.0));
            assert!(flat.is_clean());
        }
    }
}
