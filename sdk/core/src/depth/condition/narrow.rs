//! Narrowing of near surfaces that are too wide: each reading close enough to an edge of a surface behind takes the
//! nearest depth of that surface.

use crate::parallel::prelude::*;

/// The least difference of depth between two surfaces, as a share of the volume.
pub(super) const EDGE: f32 = 0.05;

/// Narrows the near surfaces of `depth`, rows of `width` with NaN for holes, by `growth` readings on every side and
/// writes the result to `to`.
///
/// A reading that is not behind anything but close to a hole becomes a hole, since the hole may hide what is behind.
pub(super) fn narrow(depth: &[f32], width: usize, growth: usize, to: &mut [f32]) {
    if growth == 0 {
        return to.copy_from_slice(depth);
    }
    let height = depth.len() / width;
    to.par_chunks_exact_mut(width).enumerate().for_each(|(y, to)| {
        let rows = y.saturating_sub(growth)..(y + growth + 1).min(height);
        for (x, to) in to.iter_mut().enumerate() {
            let own = depth[y * width + x];
            let (mut nearest, mut hole) = (None, false);
            for row in rows.clone() {
                for column in x.saturating_sub(growth)..(x + growth + 1).min(width) {
                    let value = depth[row * width + column];
                    hole |= value.is_nan();
                    let distance = row.abs_diff(y).pow(2) + column.abs_diff(x).pow(2);
                    if value - own > EDGE && nearest.is_none_or(|(least, _)| distance < least) {
                        nearest = Some((distance, value));
                    }
                }
            }
            *to = match nearest {
                Some((_, value)) => value,
                None if hole => f32::NAN,
                None => own,
            };
        }
    });
}
