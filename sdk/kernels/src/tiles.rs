//! A plane of square tiles. Threads fill it one row of tiles at a time, while the tiles are stored column by column. A
//! transform of columns after one of rows thus accesses contiguous memory in a single buffer.
#![allow(unsafe_code)]

use crate::parallel::prelude::*;
use std::marker::PhantomData;
use std::ops::Range;

/// The side of a tile.
pub const TILE: usize = 16;
/// The number of values of a tile.
pub const TILE_VALUES: usize = TILE * TILE;

/// Exclusive access to some rows of tiles of a plane.
pub struct TileRows<'a, T> {
    first: *mut T,
    rows: usize,
    own: Range<usize>,
    columns: usize,
    plane: PhantomData<&'a mut [T]>,
}

impl<T> TileRows<'_, T> {
    /// Returns the range of these rows of tiles.
    pub fn rows(&self) -> Range<usize> {
        self.own.clone()
    }

    /// Returns the tile in `column` and `row`.
    ///
    /// # Panics
    /// Panics if the row or the column is not in this part.
    pub fn tile(&mut self, row: usize, column: usize) -> &mut [T] {
        assert!(self.own.contains(&row) && column < self.columns);
        let at = (column * self.rows + row) * TILE_VALUES;
        // SAFETY: the plane has columns · rows tiles, so these values are inside it. Only this part has the row, and
        // `self` is borrowed as long as the tile.
        unsafe { std::slice::from_raw_parts_mut(self.first.add(at), TILE_VALUES) }
    }
}

/// Divides the rows of tiles of `plane`, whose tiles have the `shape` (rows, columns), into as many parts as `work` has
/// pieces of `piece` values, and calls `then` with each part and its piece. Tiles are stored column by column: the tile
/// in row `r` and column `c` is at c·rows + r.
///
/// # Panics
/// Panics if `plane` does not have rows·columns tiles.
pub fn each_tile_rows<T: Send, W: Send>(
    plane: &mut [T],
    shape: (usize, usize),
    work: &mut [W],
    piece: usize,
    then: impl Fn(TileRows<'_, T>, &mut [W]) + Sync,
) {
    let (rows, columns) = shape;
    assert_eq!(plane.len(), rows * columns * TILE_VALUES, "tiles");
    /// The plane's start, for threads that access different tiles.
    struct Start<T>(*mut T);
    // SAFETY: each part creates references only to its own rows of tiles, and T is `Send`.
    unsafe impl<T: Send> Sync for Start<T> {}
    let start = Start(plane.as_mut_ptr());
    let start = &start;
    let parts = work.len().div_ceil(piece.max(1)).max(1);
    let part_rows = rows.div_ceil(parts);
    work.par_chunks_mut(piece).enumerate().for_each(|(part, work)| {
        let own = (part * part_rows).min(rows)..((part + 1) * part_rows).min(rows);
        let tiles = TileRows {
            first: start.0,
            rows,
            own,
            columns,
            plane: PhantomData,
        };
        then(tiles, work);
    });
}
