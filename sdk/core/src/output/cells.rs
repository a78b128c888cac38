//! Moving-mirror modulators whose pixels are memory cells. A level is a pattern of bits in the 2×2 cells below a pixel.
//! A frame of 24 bits carries 24 patterns, displayed one after another.
//!
//! Plane n of a frame is bit n mod 8 of red (n < 8), green (n < 16) or blue.

use super::{check_rows, flip};
use crate::Size;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};

/// The number of planes in a frame.
const PLANES: usize = 24;

/// The mapping from a level to the bits of its pixel's cells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cells {
    memory: Vec<u8>,
    layout: [[u8; 2]; 2],
}

impl Cells {
    /// Creates a mapping. `memory` gives the number that the cells hold for each level. `layout` gives the bit of that
    /// number for each cell, by rows from the top.
    ///
    /// # Errors
    /// Returns an error if the number of levels is not 2, 4, 8 or 16, the numbers are not 0, 1, 2, … each once, or a
    /// bit is above 3 or repeated.
    pub fn new(memory: &[u8], layout: [[u8; 2]; 2]) -> Result<Self> {
        let refuse = |what: &str| Err(Error::Setting(format!("a modulator's cells: {what}")));
        let once = |values: &[u8]| {
            let mut sorted = values.to_vec();
            sorted.sort_unstable();
            sorted.iter().enumerate().all(|(n, value)| n == usize::from(*value))
        };
        if ![2, 4, 8, 16].contains(&memory.len()) || !once(memory) {
            return refuse("memory must hold each number from 0 on once, for 2, 4, 8 or 16 levels");
        }
        if !once(layout.as_flattened()) {
            return refuse("layout must hold the bits 0, 1, 2 and 3 once each");
        }
        Ok(Cells {
            memory: memory.to_vec(),
            layout,
        })
    }

    /// Returns the number of levels of a pixel.
    pub fn levels(&self) -> usize {
        self.memory.len()
    }

    /// Returns whether each cell is set for `level`.
    fn bits(&self, level: usize) -> [[bool; 2]; 2] {
        let memory = self.memory[level];
        self.layout.map(|row| row.map(|bit| (memory >> bit) & 1 == 1))
    }
}

/// A plan for frames of (H, W) pixels. It is immutable and can be shared between threads.
#[derive(Debug, Clone)]
pub struct BitPlanes {
    levels: usize,
    size: Size,
    flip_x: bool,
    flip_y: bool,
    /// The four cells' bits of each level in the frame's order: upper left, upper right, lower left, lower right. Each
    /// is the lowest bit of a byte.
    spread: [u32; 16],
    /// The cells' bits of two levels in neighbouring planes. The later level is the upper four bits of the index and
    /// the second bit of each byte. Two levels share a lookup because lookups take most of the time.
    pairs: Box<[u32; 256]>,
}

impl BitPlanes {
    /// Plans frames of 2·H×2·W cells for `size`. The flips apply to both cells and pixels.
    pub fn new(cells: &Cells, size: Size, flip_x: bool, flip_y: bool) -> Self {
        let spread: [u32; 16] = std::array::from_fn(|level| {
            // Ignores bits above those of a level.
            let bits = cells.bits(level % cells.levels());
            let cell = |n: usize| bits[flip(n / 2, 2, flip_y)][flip(n % 2, 2, flip_x)];
            (0..4).fold(0, |all, n| all | u32::from(cell(n)) << (8 * n))
        });
        BitPlanes {
            levels: cells.levels(),
            size,
            flip_x,
            flip_y,
            pairs: Box::new(std::array::from_fn(|pair| spread[pair % 16] | spread[pair / 16] << 1)),
            spread,
        }
    }

    /// Returns the size of a frame, which has two cells for each pixel along each axis.
    pub fn frame_size(&self) -> Size {
        Size {
            width: 2 * self.size.width,
            height: 2 * self.size.height,
        }
    }

    /// Returns the number of bytes of a frame, with red, green and blue for each cell.
    pub fn frame_bytes(&self) -> usize {
        12 * self.size.height * self.size.width
    }

    /// Packs `maps` of levels, (H, W) each, into `frame`. The maps are displayed one after another for equal times:
    /// with N maps, plane n displays map ⌊n·N/24⌋. Three maps therefore fill red, green and blue, and a single map
    /// fills the whole frame. The rows of `frame` begin `row_stride` bytes apart. Allocates nothing.
    ///
    /// # Errors
    /// Returns an error if the number of maps does not divide 24 or `frame` cannot hold the frame.
    ///
    /// # Panics
    /// Panics if a map does not have the planned length.
    pub fn pack(&self, maps: &[&[u8]], frame: &mut [u8], row_stride: usize) -> Result<()> {
        let Size { width, height } = self.size;
        let count = maps.len();
        if count == 0 || !PLANES.is_multiple_of(count) {
            return Err(Error::Setting(format!(
                "{count} maps; a frame of {PLANES} planes holds 1, 2, 3, 4, 6, 8, 12 or 24"
            )));
        }
        assert!(maps.iter().all(|map| map.len() == height * width));
        let len = check_rows(frame.len(), row_stride, (2 * height, 6 * width))?;
        let frame = &mut frame[..len];
        frame.par_chunks_mut(2 * row_stride).enumerate().for_each(|(y, rows)| {
            let y = flip(y, height, self.flip_y);
            let planes: [&[u8]; PLANES] = std::array::from_fn(|n| &maps[n * count / PLANES][y * width..][..width]);
            let (upper, lower) = rows.split_at_mut(row_stride);
            self.pack_row(&planes, &mut upper[..6 * width], lower);
        });
        Ok(())
    }

    /// Packs one row of pixels into two rows of a frame.
    fn pack_row(&self, planes: &[&[u8]; PLANES], upper: &mut [u8], lower: &mut [u8]) {
        const RUN: usize = 64;
        let width = planes[0].len();
        for first in (0..width).step_by(RUN) {
            let count = RUN.min(width - first);
            let at = if self.flip_x { width - first - count } else { first };
            let mut cells = [[0; RUN]; 3];
            for (n, [one, other]) in planes.as_chunks::<2>().0.iter().enumerate() {
                let levels = one[at..at + count].iter().zip(&other[at..at + count]);
                for (cells, (one, other)) in cells[n / 4].iter_mut().zip(levels) {
                    *cells |= self.pairs[usize::from((one & 15) | (other << 4))] << (2 * (n % 4));
                }
            }
            let upper = upper[6 * first..][..6 * count].as_chunks_mut::<6>().0;
            let lower = lower[6 * first..][..6 * count].as_chunks_mut::<6>().0;
            for (x, (upper, lower)) in upper.iter_mut().zip(lower).enumerate() {
                let x = flip(x, count, self.flip_x);
                for (colour, cells) in cells.iter().enumerate() {
                    let [upper_left, upper_right, lower_left, lower_right] = cells[x].to_le_bytes();
                    (upper[colour], upper[3 + colour]) = (upper_left, upper_right);
                    (lower[colour], lower[3 + colour]) = (lower_left, lower_right);
                }
            }
        }
    }

    /// Reads the levels of plane `plane` of `frame` into `levels`, (H, W). This is the inverse of [`Self::pack`].
    ///
    /// # Errors
    /// Returns an error if the frame has no such plane or the cells match no level.
    ///
    /// # Panics
    /// Panics if `frame` or `levels` does not have the planned length.
    pub fn unpack(&self, frame: &[u8], plane: usize, levels: &mut [u8]) -> Result<()> {
        let Size { width, height } = self.size;
        assert!(frame.len() == self.frame_bytes() && levels.len() == height * width);
        if plane >= PLANES {
            return Err(Error::Setting(format!(
                "there is no plane {plane}; a frame has {PLANES}"
            )));
        }
        let (colour, bit) = (plane / 8, plane % 8);
        for (at, level) in levels.iter_mut().enumerate() {
            let (y, x) = (at / width, at % width);
            let (row, column) = (flip(y, height, self.flip_y), flip(x, width, self.flip_x));
            let cell = |n: usize| {
                let at = (2 * row + n / 2) * 2 * width + 2 * column + n % 2;
                u32::from((frame[3 * at + colour] >> bit) & 1) << (8 * n)
            };
            let bits = (0..4).fold(0, |all, n| all | cell(n));
            let found = (0..self.levels).find(|level| self.spread[*level] == bits);
            *level = found
                .ok_or_else(|| Error::Setting(format!("the cells of pixel {x}, {y} are those of no level")))?
                as u8;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const MEMORY: [u8; 16] = [3, 2, 1, 7, 0, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12];

    /// Returns levels that differ between maps, rows and columns.
    fn map(n: usize, Size { width, height }: Size) -> Vec<u8> {
        (0..height * width)
            .map(|at| ((at / width * 5 + at % width * 3 + n * 7) % 16) as u8)
            .collect()
    }

    #[test]
    fn frames_are_those_of_the_naive_rule_and_are_read_back() {
        for (layout, flip_x, flip_y) in [
            ([[2, 3], [0, 1]], false, false),
            ([[1, 3], [0, 2]], true, false),
            ([[1, 3], [0, 2]], true, true),
        ] {
            let (cells, size) = (Cells::new(&MEMORY, layout).unwrap(), Size { width: 7, height: 5 });
            let plan = BitPlanes::new(&cells, size, flip_x, flip_y);
            for count in [1, 2, 3, 8, 24] {
                let maps: Vec<Vec<u8>> = (0..count).map(|n| map(n, size)).collect();
                let maps: Vec<&[u8]> = maps.iter().map(Vec::as_slice).collect();
                let mut frame = vec![0; plan.frame_bytes()];
                plan.pack(&maps, &mut frame, 6 * 7).unwrap();
                for plane in 0..24 {
                    let shown = maps[plane * count / 24];
                    for (at, value) in frame.chunks(3).enumerate() {
                        let (row, column) = (flip(at / 14, 10, flip_y), flip(at % 14, 14, flip_x));
                        let memory = MEMORY[usize::from(shown[row / 2 * 7 + column / 2])];
                        let bit = (memory >> layout[row % 2][column % 2]) & 1;
                        assert_eq!((value[plane / 8] >> (plane % 8)) & 1, bit, "{count} {plane} {at}");
                    }
                    let mut levels = vec![99; 35];
                    plan.unpack(&frame, plane, &mut levels).unwrap();
                    assert_eq!(levels, shown);
                }
            }
            assert!(
                plan.pack(&[map(0, size).as_slice(); 5], &mut vec![0; plan.frame_bytes()], 6 * 7)
                    .is_err()
            );
            assert!(plan.unpack(&vec![0; plan.frame_bytes()], 24, &mut [0; 35]).is_err());
        }
    }

    #[test]
    fn cells_that_cannot_be_are_refused() {
        let good = [[2, 3], [0, 1]];
        for (memory, layout) in [
            (&MEMORY[..15], good),
            (&[0, 0], good),
            (&[0, 2], good),
            (&MEMORY[..], [[0, 1], [2, 2]]),
            (&MEMORY[..], [[0, 1], [2, 4]]),
        ] {
            assert!(Cells::new(memory, layout).is_err(), "{memory:?} {layout:?}");
        }
    }
}
