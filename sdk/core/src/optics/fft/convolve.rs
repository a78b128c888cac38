//! Filtering in three sweeps through memory: rows forward, columns forward and inverse, rows inverse.
//!
//! Between the sweeps, the row spectra lie in tiles, column by column, so that all sweeps read and write memory in long
//! runs.

use super::{Fft2, parts};
use crate::parallel::prelude::*;
use num_complex::Complex32;
use phasefront_kernels::{TILE, TILE_VALUES, each_tile_rows, wide};

/// The working memory of [`Fft2::convolve`] for one call at a time.
pub struct ConvolveScratch {
    /// The tiles of the row spectra.
    tiles: Vec<Complex32>,
    /// For each part of a pass, a row or a column of tiles and the scratch of the 1D transforms.
    work: Vec<Complex32>,
    piece: usize,
}

impl Fft2 {
    /// Allocates working memory of [`Self::convolve`], sized for the current thread pool.
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

    /// Returns the number of rows and columns of tiles for the frame's rows of the padded plane.
    fn tiles(&self) -> (usize, usize) {
        (self.height.div_ceil(TILE), self.padded_width.div_ceil(TILE))
    }

    /// Filters `plane`, (H, W), in place. It is padded with zeros and transformed, each column of the spectrum is
    /// passed to `filter` with its index 0..W', and the result is transformed back and cropped.
    pub fn convolve<F>(&self, plane: &mut [Complex32], filter: F, scratch: &mut ConvolveScratch)
    where
        F: Fn(usize, &mut [Complex32]) + Sync,
    {
        assert_eq!(plane.len(), self.height * self.width);
        self.rows_to_tiles(plane, scratch);
        self.filter_tiles(filter, scratch);
        self.tiles_to_rows(plane, scratch);
    }

    /// Pads each row of `plane` and transforms it. Each part consists of rows of tiles.
    fn rows_to_tiles(&self, plane: &[Complex32], scratch: &mut ConvolveScratch) {
        let (width, padded_width) = (self.width, self.padded_width);
        let shape = self.tiles();
        let ConvolveScratch { tiles, work, piece } = scratch;
        let forward = &self.row[0];
        each_tile_rows(tiles, shape, work, *piece, |mut tiles, work| {
            let (rows, work) = work.split_at_mut(TILE * padded_width);
            for tile_row in tiles.rows() {
                let there = &plane[tile_row * TILE * width..];
                let sources = there.chunks_exact(width).take(TILE);
                for (row, source) in rows.chunks_exact_mut(padded_width).zip(sources) {
                    row[..width].copy_from_slice(source);
                    row[width..].fill(Complex32::ZERO);
                    forward.process_with_scratch(row, work);
                }
                wide!({
                    for column in 0..shape.1 {
                        let tile = tiles.tile(tile_row, column);
                        turn(rows, padded_width, column * TILE, tile);
                    }
                });
            }
        });
    }

    /// Pads each column of the tiles, transforms it, passes it to `filter`, and transforms it back. Each part consists
    /// of columns of tiles.
    fn filter_tiles<F>(&self, filter: F, scratch: &mut ConvolveScratch)
    where
        F: Fn(usize, &mut [Complex32]) + Sync,
    {
        let (height, padded_height) = (self.height, self.padded_height);
        let padded_width = self.padded_width;
        let ConvolveScratch { tiles, work, piece } = scratch;
        let (tile_rows, tile_columns) = self.tiles();
        let column_values = tile_rows * TILE_VALUES;
        let part_columns = tile_columns.div_ceil(work.len() / *piece);
        let [forward, inverse] = &self.column;
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
                        wide!(for (run, tile) in frame.chunks_mut(TILE).zip(tiles.clone()) {
                            copy_run(&tile[k * TILE..], run);
                        });
                        padding.fill(Complex32::ZERO);
                        forward.process_with_scratch(column, work);
                        filter(first + k, column);
                        inverse.process_with_scratch(column, work);
                    }
                    wide!({
                        for (tile_row, tile) in tiles.chunks_exact_mut(TILE_VALUES).enumerate() {
                            turn(columns, padded_height, tile_row * TILE, tile);
                        }
                    });
                }
            });
    }

    /// Transforms each row of the tiles back and crops it into `plane`. Each part consists of rows of tiles.
    fn tiles_to_rows(&self, plane: &mut [Complex32], scratch: &mut ConvolveScratch) {
        let (width, padded_width) = (self.width, self.padded_width);
        let ConvolveScratch { tiles, work, piece } = scratch;
        let tiles = &*tiles;
        let tile_rows = self.tiles().0;
        let part_rows = tile_rows.div_ceil(work.len() / *piece);
        let inverse = &self.row[1];
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
                        let tiles = tiles.chunks_exact(TILE_VALUES).skip(tile_row);
                        let tiles = tiles.step_by(tile_rows);
                        wide!(for (run, tile) in row.chunks_mut(TILE).zip(tiles.clone()) {
                            copy_run(&tile[k * TILE..], run);
                        });
                        inverse.process_with_scratch(row, work);
                        out.copy_from_slice(&row[..width]);
                    }
                }
            });
    }
}

/// Copies the first values of `from`. A whole run of a tile is copied without a call.
#[inline(always)]
fn copy_run(from: &[Complex32], to: &mut [Complex32]) {
    match (from.first_chunk::<TILE>(), to.first_chunk_mut::<TILE>()) {
        (Some(from), Some(to)) => *to = *from,
        _ => to.copy_from_slice(&from[..to.len()]),
    }
}

/// Fills a tile with the columns from `first` on of rows of `stride` values, transposed. If the rows end early, the
/// rest of the tile is undefined.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Size;

    #[test]
    fn an_all_pass_filter_returns_the_plane() {
        for (h, w, hp, wp) in [
            (1, 1, 1, 1),
            (3, 5, 4, 8),
            (17, 9, 17, 9),
            (61, 47, 75, 64),
            (33, 90, 40, 100),
        ] {
            let fft = Fft2::new(Size { width: w, height: h }, Size { width: wp, height: hp });
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
