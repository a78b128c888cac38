//! The colours of readings: sums over the display pixels that each reading covers.

use super::axis::AxisMap;
use super::lanes::{any, strides};
use crate::parallel::prelude::*;
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
            // The columns that were found last, and one past the last column that the wanted readings so far reach.
            let (mut found, mut end) = (0..0, 0);
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
                    if found.end != at {
                        sum(rgb, x, std::mem::replace(&mut found, at..at), y.pixels[row], to);
                    }
                    found.end = at + 1;
                }
            }
            sum(rgb, x, found, y.pixels[row], to);
        }
    });
}

/// Sums the colours of the readings `columns` of a row that covers `lines` of pixels, the first and one past the last.
/// It reads each line through all of these readings, in the order of memory.
#[inline(always)]
fn sum(rgb: &[f32], x: &AxisMap, columns: Range<usize>, lines: (u32, u32), to: &mut [Moments]) {
    let (size, width) = (rgb.len() / 3, x.cell.len());
    for column in columns.clone() {
        let (first, end) = x.pixels[column];
        to[column] = Moments {
            count: ((end - first) * (lines.1 - lines.0)) as f32,
            ..Moments::default()
        };
    }
    for line in lines.0 as usize..lines.1 as usize {
        for column in columns.clone() {
            let (first, end) = x.pixels[column];
            let (at, count) = (line * width + first as usize, (end - first) as usize);
            let [red, green, blue] = [at, size + at, 2 * size + at].map(|at| &rgb[at..at + count]);
            let mut moments = to[column];
            for ((red, green), blue) in red.iter().zip(green).zip(blue) {
                moments.sums[0] += red;
                moments.sums[1] += green;
                moments.sums[2] += blue;
                moments.squares += red * red + green * green + blue * blue;
            }
            to[column] = moments;
        }
    }
}
