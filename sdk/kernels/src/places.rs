//! A chain's places: the pixels of a frame, or its squares of two by two pixels if the chain runs at half the
//! resolution.
//!
//! A square's pixels are channels of its place in the order upper left, upper right, lower left, lower right. The same
//! holds for the outputs (SpaceToDepth and DepthToSpace of ONNX). If a side is odd, its last row or column is repeated.

use crate::OUTPUTS;
use crate::Size;
use crate::rows::{Band, Rows, grown};
use std::ops::Range;

/// The places of a frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Places {
    /// The pixels along each side of a place, 1 or 2.
    pub(crate) side: usize,
    /// The size of the frame.
    pub(crate) frame: Size,
}

impl Places {
    /// Returns the size of the frame in places.
    pub(crate) fn size(&self) -> Size {
        Size {
            width: self.frame.width.div_ceil(self.side),
            height: self.frame.height.div_ceil(self.side),
        }
    }

    /// Returns the rows or columns of the places that hold these rows or columns of pixels.
    pub(crate) fn of(&self, pixels: Range<usize>) -> Range<usize> {
        pixels.start / self.side..pixels.end.div_ceil(self.side)
    }

    /// Returns the columns of pixels of these columns of places.
    pub(crate) fn pixels(&self, places: Range<usize>) -> Range<usize> {
        self.side * places.start..(self.side * places.end).min(self.frame.width)
    }

    /// Fills `into`, a run of `count` places for each of the chain's channels, with the places of `row` from `from` on.
    pub(crate) fn read<R: Rows<PLANES>, const PLANES: usize>(
        &self,
        rows: &R,
        (row, from, count): (usize, usize, usize),
        band: &Band<'_, R::Value, PLANES>,
        pixels: &mut Vec<f32>,
        into: &mut [f32],
    ) {
        if self.side == 1 {
            return rows.read(row, from, band, into);
        }
        let columns = self.pixels(from..from + count);
        let (left, width) = (columns.start, columns.len());
        let row_values = into.len() / 2;
        let pixels = grown(pixels, row_values / (2 * count) * width);
        for (lower, into) in into.chunks_exact_mut(row_values).enumerate() {
            rows.read((2 * row + lower).min(self.frame.height - 1), left, band, pixels);
            let (even, odd) = into.split_at_mut(row_values / 2);
            let places = even.chunks_exact_mut(count).zip(odd.chunks_exact_mut(count));
            for (pixels, (even, odd)) in pixels.chunks_exact(width).zip(places) {
                let (pairs, rest) = pixels.as_chunks::<2>();
                for ((even, odd), pair) in even.iter_mut().zip(&mut *odd).zip(pairs) {
                    [*even, *odd] = *pair;
                }
                if let [last] = rest {
                    (even[count - 1], odd[count - 1]) = (*last, *last);
                }
            }
        }
    }

    /// Passes `values`, a run of `count` places for each of the chain's outputs, to `rows`.
    pub(crate) fn write<R: Rows<PLANES>, const PLANES: usize>(
        &self,
        rows: &R,
        (row, from, count): (usize, usize, usize),
        band: &mut Band<'_, R::Value, PLANES>,
        pixels: &mut Vec<f32>,
        values: &mut [f32],
    ) {
        if self.side == 1 {
            return rows.write(row, from, runs(values, count), band);
        }
        let columns = self.pixels(from..from + count);
        let (left, width) = (columns.start, columns.len());
        let pixels = grown(pixels, OUTPUTS * width);
        for (lower, values) in values.chunks_exact(2 * OUTPUTS * count).enumerate() {
            let row = 2 * row + lower;
            if row == self.frame.height {
                break;
            }
            let (even, odd) = values.split_at(OUTPUTS * count);
            let places = even.chunks_exact(count).zip(odd.chunks_exact(count));
            for (pixels, (even, odd)) in pixels.chunks_exact_mut(width).zip(places) {
                let (pairs, rest) = pixels.as_chunks_mut::<2>();
                for (pair, (even, odd)) in pairs.iter_mut().zip(even.iter().zip(odd)) {
                    *pair = [*even, *odd];
                }
                if let [last] = rest {
                    *last = even[count - 1];
                }
            }
            rows.write(row, left, runs(pixels, width), band);
        }
    }
}

/// Returns the runs of `count` values of each output.
pub(crate) fn runs(values: &mut [f32], count: usize) -> [&mut [f32]; OUTPUTS] {
    let mut runs = values.chunks_exact_mut(count);
    std::array::from_fn(|_| runs.next().unwrap_or_default())
}
