//! The colours of readings: sums over the display pixels that each reading covers.

use super::axis::AxisMap;
use super::lanes::{any, strides};
use rayon::prelude::*;
use std::ops::Range;

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

/// Sums the colours of the readings within `reach` of one whose value in `values` is `wanted`. `rgb` is (3, H, W).
pub(super) fn colours<T: Sync>(
    rgb: &[f32],
    (x, y): (&AxisMap, &AxisMap),
    reach: usize,
    (values, wanted): (&[T], impl Fn(&T) -> bool + Sync),
    to: &mut [Moments],
) {
    let (w, h) = (x.pixels.len(), y.pixels.len());
    to.par_chunks_exact_mut(w).enumerate().for_each(|(row, to)| {
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(h);
        let in_columns =
            |columns: Range<usize>| (rows.clone()).any(|y| any(&values[y * w..][columns.clone()], &wanted));
        for stride in strides(w) {
            let around = stride.start.saturating_sub(reach)..(stride.end + reach).min(w);
            if !in_columns(around.clone()) {
                continue;
            }
            // One past the last column that the wanted readings so far reach.
            let mut end = 0;
            for column in around.start..(stride.start + reach).min(w) {
                end = if in_columns(column..column + 1) {
                    column + reach + 1
                } else {
                    end
                };
            }
            for at in stride {
                if at + reach < w && in_columns(at + reach..at + reach + 1) {
                    end = at + 2 * reach + 1;
                }
                if at < end {
                    to[at] = sum(rgb, x.cell.len(), (x.pixels[at], y.pixels[row]));
                }
            }
        }
    });
}

/// Sums the colours of the pixels in `columns` and `rows`, each the first and one past the last.
#[inline(always)]
fn sum(rgb: &[f32], width: usize, (columns, rows): ((u32, u32), (u32, u32))) -> Moments {
    let size = rgb.len() / 3;
    let mut moments = Moments::default();
    for line in rows.0 as usize..rows.1 as usize {
        for i in line * width + columns.0 as usize..line * width + columns.1 as usize {
            let pixel = [rgb[i], rgb[size + i], rgb[2 * size + i]];
            moments.count += 1.0;
            moments.sums.iter_mut().zip(pixel).for_each(|(sum, v)| *sum += v);
            moments.squares += pixel[0] * pixel[0] + pixel[1] * pixel[1] + pixel[2] * pixel[2];
        }
    }
    moments
}
