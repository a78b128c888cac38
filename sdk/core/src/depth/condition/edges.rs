//! Finds the readings at edges, and those among them whose depth is a mixture of two surfaces.
//!
//! At an edge, the 3×3 readings differ by more than [`EDGE`], and no plane explains the 5×5 readings around one of
//! them: a steep slope is no edge.

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

/// Finds the kinds of the readings `depth`, rows of `width` without NaN. `bent` is working memory.
pub(super) fn find(depth: &[f32], width: usize, bent: &mut [bool], kinds: &mut [Kind]) {
    bent.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
        find_steep(depth, width, y, row);
        for (x, bent) in row.iter_mut().enumerate() {
            *bent = *bent && is_bent(depth, width, y, x);
        }
    });
    let bent = &*bent;
    let height = depth.len() / width;
    kinds.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
        row.fill(Kind::Inside);
        for near in y.saturating_sub(1)..(y + 2).min(height) {
            for (x, _) in bent[near * width..][..width]
                .iter()
                .enumerate()
                .filter(|(_, bent)| **bent)
            {
                row[x.saturating_sub(1)..(x + 2).min(width)].fill(Kind::Edge);
            }
        }
        for (x, kind) in row.iter_mut().enumerate().filter(|(_, kind)| **kind == Kind::Edge) {
            let (least, most) = range(depth, width, y, x);
            let value = depth[y * width + x];
            let margin = (MIXED * (most - least)).max(MIXED_BY);
            if most - least <= EDGE {
                *kind = Kind::Inside;
            } else if value - least >= margin && most - value >= margin {
                *kind = Kind::Mixed;
            }
        }
    });
}

/// Finds the readings of row `y` whose 3×3 neighbours differ by more than [`EDGE`].
fn find_steep(depth: &[f32], width: usize, y: usize, steep: &mut [bool]) {
    let height = depth.len() / width;
    let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| &depth[y * width..][..width]);
    for x in [0, width - 1] {
        let (least, most) = range(depth, width, y, x);
        steep[x] = most - least > EDGE;
    }
    if width < 3 {
        return;
    }
    let around: [&[f32]; 9] = std::array::from_fn(|k| &rows[k / 3][k % 3..][..width - 2]);
    for (x, steep) in steep[1..width - 1].iter_mut().enumerate() {
        let (mut least, mut most) = (around[4][x], around[4][x]);
        for values in around {
            least = if values[x] < least { values[x] } else { least };
            most = if values[x] > most { values[x] } else { most };
        }
        *steep = most - least > EDGE;
    }
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

/// Returns whether no plane explains the 5×5 readings around (`y`, `x`). Readings beyond the border repeat.
fn is_bent(depth: &[f32], width: usize, y: usize, x: usize) -> bool {
    let height = depth.len() / width;
    let middle = depth[y * width + x];
    let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
    let (mut sum, mut squares, mut slope_x, mut slope_y) = (0.0, 0.0, 0.0, 0.0);
    for dy in 0..5 {
        let row = (y + dy).saturating_sub(2).min(height - 1) * width;
        for dx in 0..5 {
            let v = depth[row + (x + dx).saturating_sub(2).min(width - 1)] - middle;
            least = v.min(least);
            most = v.max(most);
            sum += v;
            squares += v * v;
            slope_x += v * (dx as f32 - 2.0);
            slope_y += v * (dy as f32 - 2.0);
        }
    }
    // The variance that remains after the best plane, whose slopes are slope_x/50 and slope_y/50.
    let variance = squares / 25.0 - (sum / 25.0) * (sum / 25.0) - (slope_x * slope_x + slope_y * slope_y) / 1250.0;
    let unexplained = UNEXPLAINED * (most - least);
    variance > unexplained * unexplained
}
