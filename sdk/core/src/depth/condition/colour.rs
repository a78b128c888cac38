//! The colours of readings: sums over the display pixels that each reading covers.

use super::axis::AxisMap;
use rayon::prelude::*;

/// The number of pixels, their sums of red, green and blue, and the sum of all squares.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Moments {
    pub(super) count: f32,
    pub(super) sums: [f32; 3],
    pub(super) squares: f32,
}

impl Moments {
    pub(super) fn mean(&self) -> [f32; 3] {
        self.sums.map(|sum| sum / self.count)
    }

    pub(super) fn add(&mut self, other: &Moments) {
        self.count += other.count;
        self.squares += other.squares;
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, v)| *sum += v);
    }
}

/// Sums the colours of the readings within `reach` of a reading that is `wanted`. `rgb` is (3, H, W).
pub(super) fn colours(
    rgb: &[f32],
    (x, y): (&AxisMap, &AxisMap),
    reach: usize,
    wanted: impl Fn(usize) -> bool + Sync,
    to: &mut [Moments],
) {
    let (w, h) = (x.pixels.len(), y.pixels.len());
    let (width, size) = (x.cell.len(), x.cell.len() * y.cell.len());
    to.par_chunks_exact_mut(w).enumerate().for_each(|(row, to)| {
        let (top, bottom) = y.pixels[row];
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(h);
        let in_column = |column: usize| rows.clone().any(|y| wanted(y * w + column));
        // One past the last column that the wanted readings so far reach.
        let mut end = 0;
        for column in 0..reach.min(w) {
            end = if in_column(column) { column + reach + 1 } else { end };
        }
        for (at, to) in to.iter_mut().enumerate() {
            if at + reach < w && in_column(at + reach) {
                end = at + 2 * reach + 1;
            }
            if at >= end {
                continue;
            }
            let (left, right) = x.pixels[at];
            let mut moments = Moments::default();
            for line in top..bottom {
                for i in line as usize * width + left as usize..line as usize * width + right as usize {
                    let pixel = [rgb[i], rgb[size + i], rgb[2 * size + i]];
                    moments.count += 1.0;
                    moments.sums.iter_mut().zip(pixel).for_each(|(sum, v)| *sum += v);
                    moments.squares += pixel[0] * pixel[0] + pixel[1] * pixel[1] + pixel[2] * pixel[2];
                }
            }
            *to = moments;
        }
    });
}
