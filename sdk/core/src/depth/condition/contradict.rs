//! Contradicted readings: a reading near an edge whose colour is that of another surface takes the depth of that
//! surface. Sensors read such depths beside edges, where they are off by a reading.
//!
//! The colour of a single pixel says too little, and a reading of many pixels at an edge has the colours of both
//! surfaces.

use super::colour::Moments;
use super::edges::Kind;
use super::fill::{REACH, Rim, TOLERANCE, surface};
use crate::Size;
use crate::frame::Crop;
use crate::parallel::prelude::*;

/// The weight of the reading itself among those of its surface.
pub(super) const OWN: f32 = 0.5;

/// The largest number of pixels of a reading whose colour tells its surface.
const MOST_PIXELS: f64 = 5.0;

/// Returns whether readings of the part `crop` for a display of the size `out` have a few pixels each.
pub(super) fn applies(crop: Crop, out: Size) -> bool {
    let pixels = pixels(crop, out);
    pixels > 1.0 && pixels <= MOST_PIXELS
}

/// Returns the number of pixels of a reading of the part `crop` for a display of the size `out`.
pub(super) fn pixels(crop: Crop, out: Size) -> f64 {
    (out.height * out.width) as f64 / (crop.height * crop.width)
}

/// Writes `depth`, rows of `width` without NaN, to `to` with its contradicted readings replaced, and makes them
/// `filled`. The `colours` within twice [`REACH`] of edges are known.
pub(super) fn replace(
    depth: &[f32],
    width: usize,
    (kinds, colours): (&[Kind], &[Moments]),
    to: &mut [f32],
    filled: &mut [bool],
) {
    let height = depth.len() / width;
    let rows = to.par_chunks_exact_mut(width).zip(filled.par_chunks_exact_mut(width));
    rows.enumerate().for_each(|(y, (to, filled))| {
        let near = y.saturating_sub(REACH)..(y + REACH + 1).min(height);
        for (x, (to, filled)) in to.iter_mut().zip(filled).enumerate() {
            let i = y * width + x;
            *to = depth[i];
            let columns = x.saturating_sub(REACH)..(x + REACH + 1).min(width);
            let row = |y: usize| &kinds[y * width..][columns.clone()];
            let is_near_edge = || near.clone().any(|y| row(y).iter().any(|kind| *kind != Kind::Inside));
            if kinds[i] != Kind::Mixed
                && is_near_edge()
                && let Some(value) = contradiction(i, depth, width, (kinds, colours))
            {
                (*to, *filled) = (value, true);
            }
        }
    });
}

/// Returns the depth of the surface around reading `i` that has its colour, if that is not its own.
fn contradiction(i: usize, depth: &[f32], width: usize, (kinds, colours): (&[Kind], &[Moments])) -> Option<f32> {
    let mut rim = Rim::around(i, depth, width, colours, |at| kinds[at] != Kind::Mixed);
    // The weight of the reading itself is 1.
    let mut own = OWN - 1.0;
    for vote in rim.votes() {
        if (vote.0 - depth[i]).abs() <= TOLERANCE {
            own += vote.1;
            vote.1 = 0.0;
        }
    }
    let (sum, weights) = surface(rim.votes());
    (weights > own).then(|| sum / weights)
}
