//! Smoothing within surfaces. Along rows and then columns, each reading moves onto the line that fits its neighbours of
//! the same surface best, so that slopes stay slopes.

use crate::Bounds;
use crate::Size;
use crate::parallel::prelude::*;
use phasefront_kernels::wide;

/// The number of neighbours on each side.
pub(super) const REACH: usize = 3;
/// The number of times that rows and columns are smoothed.
pub(super) const PASSES: usize = 2;
/// The difference at which a neighbour belongs to another surface, as a share of the volume.
pub(super) const TOLERANCE: f32 = 0.03;
/// The stiffness of the line: it keeps the line flat where few neighbours support a slope.
pub(super) const STIFFNESS: f32 = 0.1;
/// A value that belongs to no surface. It surrounds the readings.
const BEYOND: f32 = 9.0;
const TAPS: usize = 2 * REACH + 1;

/// The working memory for readings of one shape.
pub(super) struct SmoothScratch {
    /// The readings with [`REACH`] values [`BEYOND`] on both sides of each row.
    padded: Vec<f32>,
    along_rows: Vec<f32>,
    /// A row that lies above or below the readings.
    beyond: Vec<f32>,
}

impl SmoothScratch {
    pub(super) fn new(Size { width, height }: Size) -> Self {
        SmoothScratch {
            padded: vec![BEYOND; height * (width + 2 * REACH)],
            along_rows: vec![0.0; height * width],
            beyond: vec![BEYOND; width],
        }
    }
}

/// Smooths `readings`, rows of `width` without NaN.
pub(super) fn smooth(readings: &mut [f32], width: usize, scratch: &mut SmoothScratch) {
    let SmoothScratch {
        padded,
        along_rows,
        beyond,
    } = scratch;
    let height = readings.len() / width;
    for _ in 0..PASSES {
        (along_rows.par_chunks_exact_mut(width))
            .zip(padded.par_chunks_exact_mut(width + 2 * REACH))
            .zip(readings.par_chunks_exact(width))
            .for_each(|((to, padded), row)| {
                padded[REACH..REACH + width].copy_from_slice(row);
                let padded = &*padded;
                wide!(fit(std::array::from_fn(|k| &padded[k..k + width]), to));
            });
        let row = |y: usize| match (REACH..height + REACH).contains(&y) {
            true => &along_rows[(y - REACH) * width..][..width],
            false => &beyond[..],
        };
        (readings.par_chunks_exact_mut(width))
            .enumerate()
            .for_each(|(y, to)| wide!(fit(std::array::from_fn(|k| row(y + k)), to)));
    }
}

/// Fits a line through the values of `taps` at each place and writes its value in the middle tap to `to`.
///
/// The weights are Tukey's biweight of the difference from the middle tap.
#[inline(always)]
fn fit(taps: [&[f32]; TAPS], to: &mut [f32]) {
    let taps = taps.map(|tap| &tap[..to.len()]);
    for (x, to) in to.iter_mut().enumerate() {
        let middle = taps[REACH][x];
        // Moments of the weights and of the differences over the steps from the middle.
        let (mut w, mut wk, mut wkk, mut we, mut wke) = (0.0f32, 0.0f32, STIFFNESS, 0.0f32, 0.0f32);
        for (k, tap) in taps.iter().enumerate() {
            let step = k as f32 - REACH as f32;
            let difference = tap[x] - middle;
            let share = difference * (1.0 / TOLERANCE);
            let near = (1.0 - share * share).at_least(0.0);
            let weight = near * near;
            w += weight;
            wk += weight * step;
            wkk += weight * (step * step);
            we += weight * difference;
            wke += weight * step * difference;
        }
        *to = middle + (wkk * we - wk * wke) / (w * wkk - wk * wk);
    }
}
