//! The separate passes of a transform: rows, their blockwise transposition into columns, columns, and the inverse.

use super::{Fft2, parts};
use crate::parallel::prelude::*;
use num_complex::Complex32;

/// The number of columns gathered at a time: one cache line of complex numbers.
const BLOCK: usize = 8;

/// The number of rows of which all columns of a block are gathered before the next ones, so that their cache lines stay
/// in the first-level cache.
const GROUP: usize = 256;

/// The working memory of an [`Fft2`] for one call at a time.
pub struct Scratch {
    /// The rows, (H, W').
    pub rows: Vec<Complex32>,
    /// The columns, (W', H'), each contiguous.
    pub columns: Vec<Complex32>,
    /// The scratch of the 1D transforms.
    pub work: Work,
}

/// The scratch of the 1D transforms: one piece for each part of a pass.
pub struct Work {
    buffer: Vec<Complex32>,
    piece: usize,
    parts: usize,
}

impl Fft2 {
    /// Allocates working memory, sized for the current thread pool.
    pub fn scratch(&self) -> Scratch {
        let zero = Complex32::new(0.0, 0.0);
        Scratch {
            rows: vec![zero; self.height * self.padded_width],
            columns: vec![zero; self.padded_width * self.padded_height],
            work: self.work(),
        }
    }

    /// Allocates only the scratch of the 1D transforms, sized for the current thread pool.
    pub fn work(&self) -> Work {
        let (piece, parts) = (self.work_values(), parts());
        Work {
            buffer: vec![Complex32::new(0.0, 0.0); piece * parts],
            piece,
            parts,
        }
    }

    /// Copies the frame's part of `rows`, (H, W'), to `plane`, (H, W).
    pub fn crop(&self, rows: &[Complex32], plane: &mut [Complex32]) {
        let width = self.width;
        plane
            .par_chunks_exact_mut(width)
            .zip(rows.par_chunks_exact(self.padded_width))
            .for_each(|(out, row)| out.copy_from_slice(&row[..width]));
    }

    /// Pads the rows of `plane`, (H, W), and transforms them into `rows`, (H, W').
    pub fn rows_forward(&self, plane: &[Complex32], rows: &mut [Complex32], work: &mut Work) {
        let (width, padded_width) = (self.width, self.padded_width);
        let per_part = self.height.div_ceil(work.parts);
        let fft = &self.row[0];
        rows.par_chunks_mut(per_part * padded_width)
            .zip(plane.par_chunks(per_part * width))
            .zip(work.buffer.par_chunks_mut(work.piece))
            .for_each(|((rows, plane), work)| {
                for (row, source) in rows.chunks_exact_mut(padded_width).zip(plane.chunks_exact(width)) {
                    row[..width].copy_from_slice(source);
                    row[width..].fill(Complex32::new(0.0, 0.0));
                    fft.process_with_scratch(row, work);
                }
            });
    }

    /// Filters transformed `rows`, (H, W'), into `columns`, (W', H'). Each column is gathered, padded, transformed,
    /// passed to `filter`, and transformed back.
    pub fn columns<F>(&self, rows: &[Complex32], columns: &mut [Complex32], filter: F, work: &mut Work)
    where
        F: Fn(usize, &mut [Complex32]) + Sync,
    {
        let inverse = &self.column[1];
        self.spectrum(
            rows,
            columns,
            |x, column, work| {
                filter(x, column);
                inverse.process_with_scratch(column, work);
            },
            work,
        );
    }

    /// Transforms `rows`, (H, W'), which are already transformed along x, into the spectrum's `columns`, (W', H'). Each
    /// column is passed to `then` with its index and the transform's scratch.
    pub fn spectrum<F>(&self, rows: &[Complex32], columns: &mut [Complex32], then: F, work: &mut Work)
    where
        F: Fn(usize, &mut [Complex32], &mut [Complex32]) + Sync,
    {
        let (height, padded_height, padded_width) = (self.height, self.padded_height, self.padded_width);
        let per_part = self.padded_width.div_ceil(work.parts).next_multiple_of(BLOCK);
        let forward = &self.column[0];
        columns
            .par_chunks_mut(per_part * padded_height)
            .zip(work.buffer.par_chunks_mut(work.piece))
            .enumerate()
            .for_each(|(part, (columns, work))| {
                for (block, columns) in columns.chunks_mut(BLOCK * padded_height).enumerate() {
                    let x0 = part * per_part + block * BLOCK;
                    gather(rows, padded_width, x0, columns, padded_height, height);
                    for (i, column) in columns.chunks_exact_mut(padded_height).enumerate() {
                        column[height..].fill(Complex32::new(0.0, 0.0));
                        forward.process_with_scratch(column, work);
                        then(x0 + i, column, work);
                    }
                }
            });
    }

    /// Passes each of the spectrum's `columns`, (W', H'), to `filter` and transforms it back.
    pub fn columns_inverse<F>(&self, columns: &mut [Complex32], filter: F, work: &mut Work)
    where
        F: Fn(usize, &mut [Complex32]) + Sync,
    {
        let padded_height = self.padded_height;
        let per_part = self.padded_width.div_ceil(work.parts);
        let inverse = &self.column[1];
        columns
            .par_chunks_mut(per_part * padded_height)
            .zip(work.buffer.par_chunks_mut(work.piece))
            .enumerate()
            .for_each(|(part, (columns, work))| {
                for (i, column) in columns.chunks_exact_mut(padded_height).enumerate() {
                    filter(part * per_part + i, column);
                    inverse.process_with_scratch(column, work);
                }
            });
    }

    /// Transforms `columns`, (W', H'), back along x into `rows`, (H, W'). The first W values of a row belong to the
    /// frame.
    pub fn rows_inverse(&self, columns: &[Complex32], rows: &mut [Complex32], work: &mut Work) {
        let inverse = &self.row[1];
        self.rows_from(columns, rows, work, |_, row, work| {
            inverse.process_with_scratch(row, work);
        });
    }

    /// Combines [`Self::rows_inverse`], `change` and [`Self::rows_forward`] in one sweep, for a periodic plane whose
    /// field is changed in space between two filters. Rows for which `touched` returns false stay in the frequency
    /// domain, which saves both transforms.
    pub fn rows_there_and_back<T, F>(
        &self,
        columns: &[Complex32],
        rows: &mut [Complex32],
        work: &mut Work,
        touched: T,
        change: F,
    ) where
        T: Fn(usize) -> bool + Sync,
        F: Fn(usize, &mut [Complex32]) + Sync,
    {
        let [forward, inverse] = &self.row;
        let scale = self.padded_width as f32;
        self.rows_from(columns, rows, work, |y, row, work| {
            if touched(y) {
                inverse.process_with_scratch(row, work);
                change(y, row);
                forward.process_with_scratch(row, work);
            } else {
                // The forward and inverse transforms, both unnormalized, multiply by the length.
                row.iter_mut().for_each(|value| *value *= scale);
            }
        });
    }

    /// Gathers `rows`, (H, W'), from `columns`, (W', H'), and passes each to `then` with its index and the transform's
    /// scratch.
    fn rows_from<F>(&self, columns: &[Complex32], rows: &mut [Complex32], work: &mut Work, then: F)
    where
        F: Fn(usize, &mut [Complex32], &mut [Complex32]) + Sync,
    {
        let (padded_height, padded_width) = (self.padded_height, self.padded_width);
        let per_part = self.height.div_ceil(work.parts).next_multiple_of(BLOCK);
        rows.par_chunks_mut(per_part * padded_width)
            .zip(work.buffer.par_chunks_mut(work.piece))
            .enumerate()
            .for_each(|(part, (rows, work))| {
                for (block, rows) in rows.chunks_mut(BLOCK * padded_width).enumerate() {
                    let y0 = part * per_part + block * BLOCK;
                    gather(columns, padded_height, y0, rows, padded_width, padded_width);
                    for (i, row) in rows.chunks_exact_mut(padded_width).enumerate() {
                        then(y0 + i, row, work);
                    }
                }
            });
    }
}

/// Transposes a strip: `to[i][j] = from[j][first + i]` for j < `count`, with rows of `to_stride` and `from_stride`
/// values.
fn gather(from: &[Complex32], from_stride: usize, first: usize, to: &mut [Complex32], to_stride: usize, count: usize) {
    let groups = from[..count * from_stride].chunks(GROUP * from_stride);
    for (group, lines) in groups.enumerate() {
        for (i, to) in to.chunks_exact_mut(to_stride).enumerate() {
            let lines = lines.chunks_exact(from_stride);
            for (to, line) in to[group * GROUP..].iter_mut().zip(lines) {
                *to = line[first + i];
            }
        }
    }
}
