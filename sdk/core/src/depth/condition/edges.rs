//! Finds the readings at edges, and those among them whose depth is a mixture of two surfaces.
//!
//! At an edge, the 3×3 readings differ by more than [`EDGE`], and no plane explains the 5×5 readings around one of
//! them: a steep slope is no edge.
//!
//! Some sensors never mix surfaces, and a reading between two others is then a surface of its own. Their edges are
//! single steps, while an edge of mixed readings rarely lies just between two of them.

use super::lanes::{LANES, Lanes, any, lanes, strides};
use crate::Bounds;
use crate::parallel::prelude::*;
use phasefront_kernels::wide;

/// The least difference of depth at an edge, as a share of the volume.
pub(super) const EDGE: f32 = 0.03;
/// The least share of the 5×5 readings' range that the standard deviation from their best plane reaches at an edge.
pub(super) const UNEXPLAINED: f32 = 0.09;
/// The least share of the 3×3 readings' range between a mixed reading and the nearest and the farthest of them.
pub(super) const MIXED: f32 = 0.06;
/// The least difference to them, as a share of the volume.
pub(super) const MIXED_BY: f32 = 0.015;

/// The least change over three steps from reading to reading that counts as an edge between two surfaces, and the share
/// of it below which the steps on both sides of a single step remain.
pub(super) const WHOLE: f32 = 0.1;
pub(super) const BESIDE: f32 = 0.1;
/// The share of single steps from which on no reading is mixed, and the distance from it within which a video stays as
/// it was.
pub(super) const SINGLE: f32 = 0.4;
const HYSTERESIS: f32 = 0.05;

/// The kind of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
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

/// Returns whether readings of `depth`, rows of `width` without NaN, mix surfaces. `did` says it of the previous frame.
pub(super) fn mixes(depth: &[f32], width: usize, did: Option<bool>) -> bool {
    let height = depth.len() / width;
    let of_row = |y: usize| {
        let below = if y + 3 < height { width } else { 0 };
        let along_row = wide!(single_steps(&depth[y * width..], 1, width.saturating_sub(3)));
        let along_columns = wide!(single_steps(&depth[y * width..], width, below));
        (along_row.0 + along_columns.0, along_row.1 + along_columns.1)
    };
    let rows = (0..height).into_par_iter().map(of_row);
    let (single, all) = rows.reduce_with(|a, b| (a.0 + b.0, a.1 + b.1)).unwrap_or_default();
    let bound = match did {
        Some(true) => SINGLE + HYSTERESIS,
        Some(false) => SINGLE - HYSTERESIS,
        None => SINGLE,
    };
    all == 0 || (single as f32) < bound * all as f32
}

/// Returns the number of single steps and of all edges among the first `count` of the `values`, of which successive
/// ones of a line are `step` apart.
#[inline(always)]
fn single_steps(values: &[f32], step: usize, count: usize) -> (u32, u32) {
    if count == 0 {
        return (0, 0);
    }
    let [a, b, c, d]: [&[f32]; 4] = std::array::from_fn(|k| &values[k * step..][..count]);
    let (mut single, mut all) = (0, 0);
    for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
        let (before, middle, after) = ((b - a).abs(), (c - b).abs(), (d - c).abs());
        let whole = (d - a).abs();
        let is_edge = (whole > WHOLE) & (middle >= before) & (middle >= after);
        let is_single = is_edge & (before < BESIDE * whole) & (after < BESIDE * whole);
        all += u32::from(is_edge);
        single += u32::from(is_single);
    }
    (single, all)
}

/// Finds the kinds of the readings `depth`, rows of `width` without NaN. Unless `mixes`, none is mixed. `bent` is
/// working memory.
pub(super) fn find(depth: &[f32], width: usize, mixes: bool, bent: &mut [bool], kinds: &mut [Kind]) {
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
                    *kind = kind_at_edge(depth, width, (y, x), mixes);
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
fn kind_at_edge(depth: &[f32], width: usize, (y, x): (usize, usize), mixes: bool) -> Kind {
    let (least, most) = range(depth, width, y, x);
    let value = depth[y * width + x];
    let margin = (MIXED * (most - least)).at_least(MIXED_BY);
    if most - least <= EDGE {
        Kind::Inside
    } else if mixes && value - least >= margin && most - value >= margin {
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
            least = value.at_most(least);
            most = value.at_least(most);
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
            least = lanes(|i| v[i].at_most(least[i]));
            most = lanes(|i| v[i].at_least(most[i]));
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
