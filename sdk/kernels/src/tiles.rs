//! A plane cut into square tiles that threads fill a row of tiles at a time, while the tiles lie in memory column by
//! column: so that a transform of columns after one of rows reads and writes whole pieces of memory, in one buffer.
#![allow(unsafe_code)]

use rayon::prelude::*;
use std::marker::PhantomData;
use std::ops::Range;

/// Side of a tile.
pub const TILE: usize = 16;
/// Values of a tile.
pub const TILE_VALUES: usize = TILE * TILE;

/// Some rows of tiles of a plane: no one else has these.
pub struct TileRows<'a, T> {
    first: *mut T,
    rows: usize,
    own: Range<usize>,
    columns: usize,
    plane: PhantomData<&'a mut [T]>,
}

impl<T> TileRows<'_, T> {
    /// Which rows of tiles these are.
    pub fn rows(&self) -> Range<usize> {
        self.own.clone()
    }

    /// The tile in `column` and `row`.
    ///
    /// # Panics
    /// For a row or column that is not among these.
    pub fn tile(&mut self, row: usize, column: usize) -> &mut [T] {
        assert!(self.own.contains(&row) && column < self.columns);
        let at = (column * self.rows + row) * TILE_VALUES;
        // SAFETY: the plane has columns · rows tiles, so these values lie in it; the row is of this part alone, and
        // `self` is borrowed as long as the tile.
        unsafe { std::slice::from_raw_parts_mut(self.first.add(at), TILE_VALUES) }
    }
}

/// Hands all rows of tiles of `plane` to `then`, in as many parts as `work` has pieces of `piece` values, each with
/// one of them. Tiles lie column by column: the tile in row `r` and column `c` at c·rows + r.
///
/// # Panics
/// If `plane` has not rows·columns tiles.
pub fn each_tile_rows<T: Send, W: Send>(
    plane: &mut [T],
    (rows, columns): (usize, usize),
    work: &mut [W],
    piece: usize,
    then: impl Fn(TileRows<'_, T>, &mut [W]) + Sync,
) {
    assert_eq!(plane.len(), rows * columns * TILE_VALUES, "tiles");
    /// The plane's start, for threads that take different tiles.
    struct Start<T>(*mut T);
    // SAFETY: each part makes references to its own rows of tiles alone, and T may be sent.
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
