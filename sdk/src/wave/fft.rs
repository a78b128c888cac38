//! A filter in the Fourier domain of a zero-padded plane, as three row-wise passes.
//!
//! A plane is transformed along its rows, transposed block by block into the columns' buffer,
//! transformed along its columns, filtered, and brought back the same way. Rows and columns
//! that hold only padding are never transformed, and each pass is one sweep through memory.
//!
//! The 1D transforms are rustfft's: any length, mixed radix. Transforms here are unnormalized;
//! a filter carries the 1/(H·W).

use num_complex::Complex32;
use phasefront_kernels::{TILE, TILE_VALUES, each_tile_rows, wide};
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Columns gathered at a time: one cache line of complex numbers.
const BLOCK: usize = 8;

/// Parts of a pass for each thread, so that a delayed thread leaves the others work to take.
const PARTS_PER_THREAD: usize = 4;

/// A length of at least `n` that transforms fast: of all 2^a·3^b·5^c·7^d the one that costs the least. Powers of two are
/// so much faster than others that a few more values are worth it.
pub fn fast_size(n: usize) -> usize {
    // What rustfft takes for a value and a prime factor, measured, in units of a factor 2; the constant is what the
    // rest of a pass takes.
    const THREE: f64 = 2.2;
    const FIVE: f64 = 4.6;
    const SEVEN: f64 = 4.8;
    const PASS: f64 = 20.0;
    let limit = n.next_power_of_two();
    // The powers of `factor` with what they cost.
    let powers = |factor: usize, cost: f64| {
        let powers = (0..).map(move |k| (factor.pow(k), cost * f64::from(k)));
        powers.take_while(move |(power, _)| *power <= limit)
    };
    let mut best = (f64::INFINITY, n);
    for (three, cost_three) in powers(3, THREE) {
        for (five, cost_five) in powers(5, FIVE) {
            if three * five > limit {
                break;
            }
            for (seven, cost_seven) in powers(7, SEVEN) {
                let odd = three * five * seven;
                let two = n.div_ceil(odd).next_power_of_two();
                let units = f64::from(two.ilog2()) + cost_three + cost_five + cost_seven + PASS;
                let size = two * odd;
                let cost = size as f64 * units;
                if cost < best.0 {
                    best = (cost, size);
                }
            }
        }
    }
    best.1
}

/// The transforms of an (H, W) frame inside a padded (H', W') plane. Immutable; share it freely.
pub struct Fft2 {
    height: usize,
    width: usize,
    padded_height: usize,
    padded_width: usize,
    row: [Arc<dyn Fft<f32>>; 2],
    column: [Arc<dyn Fft<f32>>; 2],
}

/// The working memory of an [`Fft2`] for one call at a time.
pub struct Scratch {
    /// (H, W'): the rows.
    pub rows: Vec<Complex32>,
    /// (W', H'): the columns, each contiguous.
    pub columns: Vec<Complex32>,
    /// The 1D transforms' own.
    pub work: Work,
}

/// What the 1D transforms work in: one piece for each part of a pass.
pub struct Work {
    buffer: Vec<Complex32>,
    piece: usize,
    parts: usize,
}

/// The working memory of [`Fft2::convolve`] for one call at a time.
pub struct ConvolveScratch {
    /// The tiles of the row spectra.
    tiles: Vec<Complex32>,
    /// A row of tiles, or a column of them, and the 1D transforms' own, for each part of a pass.
    work: Vec<Complex32>,
    piece: usize,
}

/// Parts of a pass on the current thread pool.
fn parts() -> usize {
    match rayon::current_num_threads() {
        1 => 1,
        threads => threads * PARTS_PER_THREAD,
    }
}

impl Fft2 {
    /// Plans the transforms of a (`height`, `width`) frame in a plane of (`padded_height`,
    /// `padded_width`), the frame at its top left.
    pub fn new(height: usize, width: usize, padded_height: usize, padded_width: usize) -> Self {
        assert!(0 < height && height <= padded_height && 0 < width && width <= padded_width);
        let mut planner = FftPlanner::new();
        Fft2 {
            height,
            width,
            padded_height,
            padded_width,
            row: [
                planner.plan_fft_forward(padded_width),
                planner.plan_fft_inverse(padded_width),
            ],
            column: [
                planner.plan_fft_forward(padded_height),
                planner.plan_fft_inverse(padded_height),
            ],
        }
    }

    /// (H', W').
    pub fn padded_shape(&self) -> (usize, usize) {
        (self.padded_height, self.padded_width)
    }

    /// Working memory for the current thread pool.
    pub fn scratch(&self) -> Scratch {
        let zero = Complex32::new(0.0, 0.0);
        Scratch {
            rows: vec![zero; self.height * self.padded_width],
            columns: vec![zero; self.padded_width * self.padded_height],
            work: self.work(),
        }
    }

    /// Memory for the 1D transforms alone, for the current thread pool.
    pub fn work(&self) -> Work {
        let (piece, parts) = (self.work_values(), parts());
        Work {
            buffer: vec![Complex32::new(0.0, 0.0); piece * parts],
            piece,
            parts,
        }
    }

    /// What one 1D transform works in.
    fn work_values(&self) -> usize {
        (self.row.iter().chain(&self.column))
            .map(|fft| fft.get_inplace_scratch_len())
            .max()
            .unwrap_or(0)
            .max(1)
    }

    /// Working memory of [`Self::convolve`], for the current thread pool.
    pub fn convolve_scratch(&self) -> ConvolveScratch {
        let zero = Complex32::new(0.0, 0.0);
        let (rows, columns) = self.tiles();
        let piece = TILE * self.padded_width.max(self.padded_height) + self.work_values();
        ConvolveScratch {
            tiles: vec![zero; rows * columns * TILE_VALUES],
            work: vec![zero; piece * parts()],
            piece,
        }
    }

    /// Rows and columns of tiles that the frame's rows of the padded plane take.
    fn tiles(&self) -> (usize, usize) {
        (self.height.div_ceil(TILE), self.padded_width.div_ceil(TILE))
    }

    /// Replaces `plane`, (H, W), by itself filtered: padded with zeros, transformed, each column of
    /// the spectrum handed to `filter` with its index 0..W', transformed back, cropped.
    ///
    /// Tiles of the row spectra lie column by column, so that all passes read and write memory in long runs.
    pub fn convolve<F>(&self, plane: &mut [Complex32], filter: F, scratch: &mut ConvolveScratch)
    where
        F: Fn(usize, &mut [Complex32]) + Sync,
    {
        let (height, width) = (self.height, self.width);
        let (padded_height, padded_width) = (self.padded_height, self.padded_width);
        assert_eq!(plane.len(), height * width);
        let zero = Complex32::new(0.0, 0.0);
        let ConvolveScratch { tiles, work, piece } = scratch;
        let shape @ (tile_rows, tile_columns) = self.tiles();
        let parts = work.len() / *piece;
        let [forward, inverse] = &self.row;
        each_tile_rows(tiles, shape, work, *piece, |mut tiles, work| {
            let (rows, work) = work.split_at_mut(TILE * padded_width);
            for tile_row in tiles.rows() {
                let there = &plane[tile_row * TILE * width..];
                let sources = there.chunks_exact(width).take(TILE);
                for (row, source) in rows.chunks_exact_mut(padded_width).zip(sources) {
                    row[..width].copy_from_slice(source);
                    row[width..].fill(zero);
                    forward.process_with_scratch(row, work);
                }
                wide(|| {
                    for column in 0..tile_columns {
                        let tile = tiles.tile(tile_row, column);
                        turn(rows, padded_width, column * TILE, tile);
                    }
                });
            }
        });
        let column_values = tile_rows * TILE_VALUES;
        let part_columns = tile_columns.div_ceil(parts);
        let [column_forward, column_inverse] = &self.column;
        tiles
            .par_chunks_mut(part_columns * column_values)
            .zip(work.par_chunks_exact_mut(*piece))
            .enumerate()
            .for_each(|(part, (tiles, work))| {
                let (columns, work) = work.split_at_mut(TILE * padded_height);
                for (i, tiles) in tiles.chunks_exact_mut(column_values).enumerate() {
                    let first = (part * part_columns + i) * TILE;
                    for (k, column) in columns.chunks_exact_mut(padded_height).enumerate() {
                        if first + k >= padded_width {
                            break;
                        }
                        let (frame, padding) = column.split_at_mut(height);
                        let tiles = tiles.chunks_exact(TILE_VALUES);
                        for (run, tile) in frame.chunks_mut(TILE).zip(tiles) {
                            run.copy_from_slice(&tile[k * TILE..][..run.len()]);
                        }
                        padding.fill(zero);
                        column_forward.process_with_scratch(column, work);
                        wide(|| filter(first + k, column));
                        column_inverse.process_with_scratch(column, work);
                    }
                    wide(|| {
                        for (tile_row, tile) in tiles.chunks_exact_mut(TILE_VALUES).enumerate() {
                            turn(columns, padded_height, tile_row * TILE, tile);
                        }
                    });
                }
            });
        let tiles = &*tiles;
        let part_rows = tile_rows.div_ceil(parts);
        plane
            .par_chunks_mut(part_rows * TILE * width)
            .zip(work.par_chunks_exact_mut(*piece))
            .enumerate()
            .for_each(|(part, (plane, work))| {
                let (rows, work) = work.split_at_mut(TILE * padded_width);
                for (i, plane) in plane.chunks_mut(TILE * width).enumerate() {
                    let tile_row = part * part_rows + i;
                    for (k, out) in plane.chunks_exact_mut(width).enumerate() {
                        let row = &mut rows[k * padded_width..][..padded_width];
                        for (column, run) in row.chunks_mut(TILE).enumerate() {
                            let at = (column * tile_rows + tile_row) * TILE_VALUES + k * TILE;
                            run.copy_from_slice(&tiles[at..][..run.len()]);
                        }
                        inverse.process_with_scratch(row, work);
                        out.copy_from_slice(&row[..width]);
                    }
                }
            });
    }

    /// The frame's part of `rows`, (H, W'), into `plane`, (H, W).
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
                for (row, source) in rows
                    .chunks_exact_mut(padded_width)
                    .zip(plane.chunks_exact(width))
                {
                    row[..width].copy_from_slice(source);
                    row[width..].fill(Complex32::new(0.0, 0.0));
                    fft.process_with_scratch(row, work);
                }
            });
    }

    /// From transformed `rows`, (H, W'), to filtered `columns`, (W', H'): each is gathered, padded,
    /// transformed, handed to `filter`, and transformed back.
    pub fn columns<F>(
        &self,
        rows: &[Complex32],
        columns: &mut [Complex32],
        filter: F,
        work: &mut Work,
    ) where
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

    /// From transformed `rows`, (H, W'), to the spectrum's `columns`, (W', H'), each handed to `then`
    /// with its index and the transform's scratch.
    pub fn spectrum<F>(
        &self,
        rows: &[Complex32],
        columns: &mut [Complex32],
        then: F,
        work: &mut Work,
    ) where
        F: Fn(usize, &mut [Complex32], &mut [Complex32]) + Sync,
    {
        let (height, padded_height, padded_width) =
            (self.height, self.padded_height, self.padded_width);
        let per_part = self
            .padded_width
            .div_ceil(work.parts)
            .next_multiple_of(BLOCK);
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

    /// Hands each of the spectrum's `columns`, (W', H'), to `filter` and transforms it back.
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

    /// From `columns`, (W', H'), back to `rows`, (H, W'), each transformed back; the first W values of a row
    /// are the frame's.
    pub fn rows_inverse(&self, columns: &[Complex32], rows: &mut [Complex32], work: &mut Work) {
        let inverse = &self.row[1];
        self.rows_from(columns, rows, work, |_, row, work| {
            inverse.process_with_scratch(row, work);
        });
    }

    /// [`Self::rows_inverse`], `change` and [`Self::rows_forward`] in one sweep: for a periodic plane whose
    /// field is changed in space between two filters. Rows that `touched` says no to stay in the
    /// frequency domain, which saves both their transforms.
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
                // There and back, unnormalized, is a factor of the length.
                row.iter_mut().for_each(|value| *value *= scale);
            }
        });
    }

    /// Gathers `rows`, (H, W'), from `columns`, (W', H'), and hands each to `then` with its index and the
    /// transform's scratch.
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

/// Fills a tile with columns `first..` of rows of `stride` values, transposed; where the rows end early, what is left
/// of the tile means nothing.
#[inline(always)]
fn turn(rows: &[Complex32], stride: usize, first: usize, tile: &mut [Complex32]) {
    let count = TILE.min(stride - first);
    for (j, row) in rows.chunks_exact(stride).take(TILE).enumerate() {
        match row[first..].first_chunk::<TILE>() {
            Some(row) => {
                for (i, value) in row.iter().enumerate() {
                    tile[i * TILE + j] = *value;
                }
            }
            None => {
                for (i, value) in row[first..first + count].iter().enumerate() {
                    tile[i * TILE + j] = *value;
                }
            }
        }
    }
}

/// Transposes a strip: `to[i][j] = from[j][first + i]` for j < `count`, rows of `to_stride` and
/// `from_stride` values.
fn gather(
    from: &[Complex32],
    from_stride: usize,
    first: usize,
    to: &mut [Complex32],
    to_stride: usize,
    count: usize,
) {
    let lanes = to.len() / to_stride;
    if lanes == BLOCK {
        for (j, line) in from.chunks_exact(from_stride).take(count).enumerate() {
            let line: &[Complex32; BLOCK] = line[first..first + BLOCK]
                .try_into()
                .expect("a slice of BLOCK values");
            for (i, value) in line.iter().enumerate() {
                to[i * to_stride + j] = *value;
            }
        }
    } else {
        for (j, line) in from.chunks_exact(from_stride).take(count).enumerate() {
            for (i, value) in line[first..first + lanes].iter().enumerate() {
                to[i * to_stride + j] = *value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_sizes_are_smooth_and_little_larger() {
        for n in 1..3000 {
            let size = fast_size(n);
            let mut rest = size;
            for p in [2, 3, 5, 7] {
                while rest.is_multiple_of(p) {
                    rest /= p;
                }
            }
            assert!(rest == 1 && size >= n, "{n}: {size}");
            assert!(n < 64 || size <= n + n / 7, "{n}: {size}");
        }
        assert_eq!((fast_size(1950), fast_size(1110)), (2048, 1152));
    }

    #[test]
    fn an_all_pass_filter_returns_the_plane() {
        for (h, w, hp, wp) in [
            (1, 1, 1, 1),
            (3, 5, 4, 8),
            (17, 9, 17, 9),
            (61, 47, 75, 64),
            (33, 90, 40, 100),
        ] {
            let fft = Fft2::new(h, w, hp, wp);
            let plane: Vec<_> = (0..h * w)
                .map(|i| Complex32::new((i as f32 * 0.7).sin(), (i as f32 * 0.3).cos()))
                .collect();
            let mut out = plane.clone();
            let scale = 1.0 / (hp * wp) as f32;
            fft.convolve(
                &mut out,
                |_, column| column.iter_mut().for_each(|v| *v *= scale),
                &mut fft.convolve_scratch(),
            );
            for (a, b) in plane.iter().zip(&out) {
                assert!((a - b).norm() < 1e-5, "{h}×{w}: {a} {b}");
            }
        }
    }
}
