//! Measures whether a frame's depth is clean: conditioning leaves clean depth alone, and its wave is a truth to compare
//! holograms with.
//!
//! Rendered depth changes between surfaces within one pixel, at the same place as the colour, and is smooth on
//! surfaces. Enlarged depth ramps over several pixels, the depth of a camera beside the colour camera changes at other
//! places, and sensors have noise.

use crate::parallel::prelude::*;
use phasefront_kernels::wide;

/// The difference between the depths at the ends of a [`WINDOW`] above which they belong to two surfaces, as a share of
/// the volume.
const EDGE: f32 = 0.06;
/// The number of steps of the window in which an edge is searched; odd.
const WINDOW: usize = 5;
/// The share of the window's change that a sharp edge makes in one step.
const ONE_STEP: f32 = 0.75;
/// The least share of sharp edges in clean depth.
const SHARP_EDGES: f32 = 0.6;
/// The largest noise of clean depth, as a share of the volume.
const SMOOTH: f32 = 1.5e-3;
/// The number of lines in a thread's unit of work.
const LINES: usize = 16;
/// The number of windows that are passed over together where none has an edge.
const STRIDE: usize = 32;

/// Returns whether `depth`, rows of `width`, is clean beside `rgb`, (C, H, W): noise of at most 0.15 % of the volume,
/// and at least 60 % of its edges sharp.
///
/// Runs on the current rayon pool. Does not allocate. A frame with both sides under six pixels has no edges, and a
/// frame narrower than three pixels has no noise.
pub fn is_clean(rgb: &[f32], depth: &[f32], width: usize) -> bool {
    noise(depth, width) <= SMOOTH && sharp_edges(rgb, depth, width) >= SHARP_EDGES
}

/// Returns the share of the edges between surfaces, along rows and columns, that are one step wide and lie at the
/// largest colour change among the five steps around them; 1 without edges.
fn sharp_edges(rgb: &[f32], depth: &[f32], width: usize) -> f32 {
    let height = depth.len() / width;
    let rows = (0..height).into_par_iter().with_min_len(LINES);
    let of_row = |y: usize| {
        let below = if y + WINDOW < height { width } else { 0 };
        let along_row = wide!(count_edges((rgb, depth), y * width, 1, width.saturating_sub(WINDOW)));
        let along_columns = wide!(count_edges((rgb, depth), y * width, width, below));
        (along_row.0 + along_columns.0, along_row.1 + along_columns.1)
    };
    let counts = rows.map(of_row).reduce_with(|a, b| (a.0 + b.0, a.1 + b.1));
    match counts.unwrap_or_default() {
        (_, 0) => 1.0,
        (sharp, all) => sharp as f32 / all as f32,
    }
}

/// Returns the number of sharp edges and of all edges in windows that begin at `count` neighbouring places from `first`
/// on, and whose values are `step` apart.
#[inline(always)]
fn count_edges((rgb, depth): (&[f32], &[f32]), first: usize, step: usize, count: usize) -> (u32, u32) {
    if count == 0 {
        return (0, 0);
    }
    let (starts, ends) = (&depth[first..][..count], &depth[first + WINDOW * step..][..count]);
    let (mut sharp, mut all) = (0, 0);
    for (i, (starts, ends)) in starts.chunks(STRIDE).zip(ends.chunks(STRIDE)).enumerate() {
        let is_edge = |(start, end): (&f32, &f32)| (end - start).abs() > EDGE;
        if !(starts.iter().zip(ends)).fold(false, |any, window| any | is_edge(window)) {
            continue;
        }
        for k in (0..starts.len()).filter(|k| is_edge((&starts[*k], &ends[*k]))) {
            if let Some(is_sharp) = edge((rgb, depth), first + i * STRIDE + k, step) {
                all += 1;
                sharp += u32::from(is_sharp);
            }
        }
    }
    (sharp, all)
}

/// Returns whether the edge in the window from `at` on is sharp, if its largest step is in the middle. So each edge is
/// counted once.
fn edge((rgb, depth): (&[f32], &[f32]), at: usize, step: usize) -> Option<bool> {
    let size = depth.len();
    let change = |of: &[f32], i: usize| (of[at + (i + 1) * step] - of[at + i * step]).abs();
    let colour = |i: usize| rgb.chunks_exact(size).map(|plane| change(plane, i)).sum::<f32>();
    let middle = change(depth, WINDOW / 2);
    if (0..WINDOW).any(|i| change(depth, i) > middle) {
        return None;
    }
    let whole = (depth[at + WINDOW * step] - depth[at]).abs();
    let here = colour(WINDOW / 2);
    Some(middle >= ONE_STEP * whole && (0..WINDOW).all(|i| colour(i) <= here))
}

/// The resolution and the number of the bins of second differences, as a share of the volume. The last bin holds all
/// larger differences.
const DIFFERENCE: f32 = 2e-5;
const DIFFERENCES: usize = 2048;

/// Returns the noise as a share of the volume: the median of |d(x−1) − 2d(x) + d(x+1)| over 0.6745·√6, which is the
/// standard deviation of independent normal noise.
fn noise(depth: &[f32], width: usize) -> f32 {
    let of_rows = |rows: &[f32]| {
        let mut counts = [0u32; DIFFERENCES];
        for d in rows.chunks_exact(width).flat_map(|row| row.windows(3)) {
            let step = (d[0] - 2.0 * d[1] + d[2]).abs() / DIFFERENCE;
            counts[(step as usize).min(DIFFERENCES - 1)] += 1;
        }
        counts
    };
    let parts = depth.par_chunks(width * LINES).map(of_rows);
    let counts = parts.reduce_with(|mut a, b| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    });
    let counts = counts.unwrap_or([0; DIFFERENCES]);
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

    /// The share of sharp edges, and the noise.
    #[derive(Debug)]
    struct Sharpness {
        edges: f32,
        noise: f32,
        is_clean: bool,
    }

    fn measure(rgb: &Array3<f32>, depth: &Array2<f32>) -> Sharpness {
        let (rgb, width) = (rgb.as_slice().unwrap(), depth.dim().1);
        let depth = depth.as_slice().unwrap();
        Sharpness {
            edges: sharp_edges(rgb, depth, width),
            noise: noise(depth, width),
            is_clean: is_clean(rgb, depth, width),
        }
    }

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
        measure(&rgb, &depth)
    }

    #[test]
    fn clean_depth_is_told_from_noisy_depth() {
        let clean = square(0, 1, 0.0);
        assert!(clean.edges > 0.9 && clean.noise == 0.0, "{clean:?}");
        assert!(clean.is_clean);
        let [shifted, ramps, noisy] = [square(2, 1, 0.0), square(0, 4, 0.0), square(0, 1, 0.01)];
        assert!(shifted.edges < 0.6, "{shifted:?}");
        assert!(ramps.edges < 0.1, "{ramps:?}");
        // The noise is uniform in ±0.01.
        assert!((0.003..0.01).contains(&noisy.noise), "{noisy:?}");
        for bad in [shifted, ramps, noisy] {
            assert!(!bad.is_clean, "{bad:?}");
        }
    }

    #[test]
    fn frames_without_edges_are_clean() {
        for (height, width) in [(1, 1), (2, 9), (40, 40)] {
            let depth = Array2::from_elem((height, width), 0.4);
            let rgb = Array3::from_elem((3, height, width), 0.5);
            let flat = measure(&rgb, &depth);
            assert_eq!((flat.edges, flat.noise), (1.0, 0.0));
            assert!(flat.is_clean);
        }
    }
}
