//! Filling of holes from their rims: a hole takes the depth of the surface with its colour. It first waits until a
//! neighbour of that colour is filled.

use super::colour::Moments;
use crate::depth::fill_from_nearest;
use crate::parallel::prelude::*;

/// The number of neighbours on each side that fill a reading.
pub(super) const REACH: usize = 2;
/// The distance, in readings, and the difference of amplitudes at which a neighbour's weight is a quarter.
pub(super) const NEAR: f32 = 2.0;
pub(super) const ALIKE: f32 = 0.1;
/// The number of passes. Holes that remain take their nearest reading.
pub(super) const PASSES: usize = 10;
/// The number of passes in which a hole waits for a neighbour with nearly its colour.
pub(super) const ALIKE_PASSES: usize = 5;
/// The largest depth difference within one surface, as a share of the volume.
pub(super) const TOLERANCE: f32 = 0.03;
const SIDE: usize = 2 * REACH + 1;

/// The working memory for readings of one shape.
pub(super) struct FillScratch {
    holes: Vec<u32>,
    filled: Vec<f32>,
    /// The readings from which the remaining holes are filled.
    front: Vec<u32>,
}

impl FillScratch {
    pub(super) fn new(readings: usize) -> Self {
        FillScratch {
            holes: Vec::with_capacity(readings),
            filled: vec![0.0; readings],
            front: Vec::with_capacity(readings),
        }
    }
}

/// Fills the NaN of `depth`, rows of `width`, where `colours` are known around them. `depth` must contain a reading.
pub(super) fn fill(depth: &mut [f32], width: usize, colours: &[Moments], scratch: &mut FillScratch) {
    let FillScratch { holes, filled, front } = scratch;
    holes.clear();
    holes.extend((0..depth.len() as u32).filter(|i| depth[*i as usize].is_nan()));
    for pass in 0..PASSES {
        if holes.is_empty() {
            return;
        }
        let filled = &mut filled[..holes.len()];
        (filled.par_iter_mut().with_min_len(256))
            .zip(&*holes)
            .for_each(|(value, i)| {
                let mut rim = Rim::around(*i as usize, depth, width, colours, |_| true);
                let (sum, weights) = surface(rim.votes());
                *value = if rim.alike || pass >= ALIKE_PASSES {
                    sum / weights
                } else {
                    f32::NAN
                };
            });
        for (value, i) in filled.iter().zip(&*holes) {
            depth[*i as usize] = *value;
        }
        holes.retain(|i| depth[*i as usize].is_nan());
    }
    if !holes.is_empty() {
        fill_from_nearest(depth, width, front, holes);
    }
}

/// The readings around a reading, each with its depth and its weight.
pub(super) struct Rim {
    votes: [(f32, f32); SIDE * SIDE],
    count: usize,
    /// Whether one of them has nearly the colour of the reading.
    alike: bool,
}

impl Rim {
    /// Collects the readings around reading `i` that are `wanted`, without holes.
    pub(super) fn around(
        i: usize,
        depth: &[f32],
        width: usize,
        colours: &[Moments],
        wanted: impl Fn(usize) -> bool,
    ) -> Self {
        let (x, y, height) = (i % width, i / width, depth.len() / width);
        let mut rim = Rim {
            votes: [(0.0, 0.0); SIDE * SIDE],
            count: 0,
            alike: false,
        };
        let own = colours[i].mean();
        for row in y.saturating_sub(REACH)..(y + REACH + 1).min(height) {
            for column in x.saturating_sub(REACH)..(x + REACH + 1).min(width) {
                let at = row * width + column;
                if !depth[at].is_nan() && wanted(at) {
                    let distance = row.abs_diff(y).pow(2) + column.abs_diff(x).pow(2);
                    let near = 1.0 + distance as f32 / (NEAR * NEAR);
                    let alike = 1.0 + apart(own, colours[at].mean()) / (ALIKE * ALIKE);
                    rim.alike |= alike <= 2.0;
                    rim.votes[rim.count] = (depth[at], 1.0 / (near * near * alike * alike));
                    rim.count += 1;
                }
            }
        }
        rim
    }

    pub(super) fn votes(&mut self) -> &mut [(f32, f32)] {
        &mut self.votes[..self.count]
    }
}

/// Returns the squared distance between two colours.
fn apart(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [r, g, b] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    r * r + g * g + b * b
}

/// Returns the weighted sum and the weights of the `votes`, each a depth and a weight, that agree with their weighted
/// median: zeros without votes.
pub(super) fn surface(votes: &mut [(f32, f32)]) -> (f32, f32) {
    votes.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = votes.iter().map(|v| v.1).sum::<f32>() / 2.0;
    let mut sum = 0.0;
    let median = votes.iter().find(|vote| {
        sum += vote.1;
        sum >= half
    });
    let Some(&(median, _)) = median else {
        return (0.0, 0.0);
    };
    let agreeing = votes.iter().filter(|vote| (vote.0 - median).abs() <= TOLERANCE);
    agreeing.fold((0.0, 0.0), |(sum, weights), (v, w)| (sum + w * v, weights + w))
}
