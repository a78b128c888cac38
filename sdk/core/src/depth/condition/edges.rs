//! Finds the readings at edges, and those among them whose depth is a mixture of two surfaces.
//!
//! At an edge, the 3×3 readings differ by more than [`EDGE`], and no plane explains the 5×5 readings around one of
//! them: a steep slope is no edge.

use super::lanes::{LANES, Lanes, any, lanes, strides};
use phasefront_kernels::wide;
use rayon::prelude::*;

/// The least difference of depth at an edge, as a share of the volume.
pub(super) const EDGE: f32 = 0.03;
/// The least share of the 5×5 readings' range that the standard deviation from their best plane reaches at an edge.
pub(super) const UNEXPLAINED: f32 = 0.09;
/// The least share of the 3×3 readings' range between a mixed reading and the nearest and the farthest of them.
pub(super) const MIXED: f32 = 0.06;
/// The least difference to them, as a share of the volume.
pub(super) const MIXED_BY: f32 = 0.015;

/// The kind of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// On a surface: its display pixels are interpolated.
    Inside,
    /// At an edge, on a surface.
    Edge,
    /// At an edge, without a reading of its own: filled.
    Filled,
    /// At an edge, with a depth between two surfaces.
    Mixed,
}

impl Kind {
    /// Returns whether the reading lies at an edge.
    #[inline(always)]
    pub(super) fn is_at_edge(&self) -> bool {
        *self != Kind::Inside
    }
}

/// Finds the kinds of the readings `depth`, rows of `width` without NaN. `bent` is working memory.
pub(super) fn find(depth: &[f32], width: usize, bent: &mut [bool], kinds: &mut [Kind]) {
    (bent.par_chunks_exact_mut(width))
        .enumerate()
        .for_each(|(y, row)| wide!(find_bent(depth, width, y, row)));
    let bent = &*bent;
    kinds.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
        wide!(find_near(bent, width, y, row));
        for stride in strides(width) {
            if any(&row[stride.clone()], Kind::is_at_edge) {
                for (kind, x) in row[stride.clone()]
                    .iter_mut()
                    .zip(stride)
                    .filter(|(kind, _)| kind.is_at_edge())
                {
                    *kind = kind_at_edge(depth, width, y, x);
                }
            }
        }
    });
}

/// Finds the readings of row `y` whose 3×3 neighbours differ by more than [`EDGE`] and that no plane explains.
#[inline(always)]
fn find_bent(depth: &[f32], width: usize, y: usize, bent: &mut [bool]) {
    for x in [0, width - 1] {
        let (least, most) = range(depth, width, y, x);
        bent[x] = most - least > EDGE;
    }
    if width > 2 {
        let around = around(depth, width, y);
        for (x, bent) in bent[1..width - 1].iter_mut().enumerate() {
            let (mut least, mut most) = (around[4][x], around[4][x]);
            for values in around {
                least = if values[x] < least { values[x] } else { least };
                most = if values[x] > most { values[x] } else { most };
            }
            *bent = most - least > EDGE;
        }
    }
    for (i, bent) in bent.chunks_mut(LANES).enumerate() {
        if any(bent, |steep| *steep) {
            let are_bent = are_bent(depth, width, y, i * LANES);
            bent.iter_mut().zip(are_bent).for_each(|(bent, is)| *bent &= is);
        }
    }
}

/// Marks the readings of row `y` with a bent one among the 3×3 around them.
#[inline(always)]
fn find_near(bent: &[bool], width: usize, y: usize, kinds: &mut [Kind]) {
    let height = bent.len() / width;
    let kind = |is_near: bool| if is_near { Kind::Edge } else { Kind::Inside };
    for x in [0, width - 1] {
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let mut rows = y.saturating_sub(1)..(y + 2).min(height);
        kinds[x] = kind(rows.any(|y| bent[y * width..][columns.clone()].contains(&true)));
    }
    if width > 2 {
        let around = around(bent, width, y);
        for (x, to) in kinds[1..width - 1].iter_mut().enumerate() {
            *to = kind(around.iter().fold(false, |any, bent| any | bent[x]));
        }
    }
}

/// Returns the kind of the reading (`y`, `x`), which lies near a bent one.
fn kind_at_edge(depth: &[f32], width: usize, y: usize, x: usize) -> Kind {
    let (least, most) = range(depth, width, y, x);
    let value = depth[y * width + x];
    let margin = (MIXED * (most - least)).max(MIXED_BY);
    if most - least <= EDGE {
        Kind::Inside
    } else if value - least >= margin && most - value >= margin {
        Kind::Mixed
    } else {
        Kind::Edge
    }
}

/// Returns the 3×3 neighbours of all `values` of row `y` but the first and the last. Rows beyond the border repeat.
#[inline(always)]
fn around<T>(values: &[T], width: usize, y: usize) -> [&[T]; 9] {
    let last = values.len() / width - 1;
    let rows = [y.saturating_sub(1), y, (y + 1).min(last)].map(|y| &values[y * width..][..width]);
    std::array::from_fn(|k| &rows[k / 3][k % 3..][..width - 2])
}

/// Returns the least and the most of the 3×3 readings around (`y`, `x`).
fn range(depth: &[f32], width: usize, y: usize, x: usize) -> (f32, f32) {
    let height = depth.len() / width;
    let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
    for y in y.saturating_sub(1)..(y + 2).min(height) {
        for value in &depth[y * width + x.saturating_sub(1)..y * width + (x + 2).min(width)] {
            least = value.min(least);
            most = value.max(most);
        }
    }
    (least, most)
}

/// Returns whether no plane explains the 5×5 readings around each of those of row `y` from `x` on. Readings beyond the
/// border repeat.
#[inline(always)]
fn are_bent(depth: &[f32], width: usize, y: usize, x: usize) -> [bool; LANES] {
    let height = depth.len() / width;
    let row = |dy: usize| &depth[(y + dy).saturating_sub(2).min(height - 1) * width..][..width];
    let values = |row: &[f32], dx: usize| -> Lanes {
        match (x + dx).checked_sub(2).and_then(|from| row.get(from..from + LANES)) {
            Some(values) => lanes(|i| values[i]),
            None => lanes(|i| row[(x + dx + i).saturating_sub(2).min(width - 1)]),
        }
    };
    let middle = values(row(2), 2);
    let (mut least, mut most) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    let [mut sum, mut squares, mut slope_x, mut slope_y] = [[0.0; LANES]; 4];
    for dy in 0..5 {
        for dx in 0..5 {
            let (values, step_x, step_y) = (values(row(dy), dx), dx as f32 - 2.0, dy as f32 - 2.0);
            let v: Lanes = lanes(|i| values[i] - middle[i]);
            least = lanes(|i| v[i].min(least[i]));
            most = lanes(|i| v[i].max(most[i]));
            sum = lanes(|i| sum[i] + v[i]);
            squares = lanes(|i| squares[i] + v[i] * v[i]);
            slope_x = lanes(|i| slope_x[i] + v[i] * step_x);
            slope_y = lanes(|i| slope_y[i] + v[i] * step_y);
        }
    }
    std::array::from_fn(|i| {
        // The variance that remains after the best plane, whose slopes are slope_x/50 and slope_y/50.
        let slopes = slope_x[i] * slope_x[i] + slope_y[i] * slope_y[i];
        let variance = squares[i] / 25.0 - (sum[i] / 25.0) * (sum[i] / 25.0) - slopes / 1250.0;
        let unexplained = UNEXPLAINED * (most[i] - least[i]);
        variance > unexplained * unexplained
    })
}
