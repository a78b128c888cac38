//! The test pattern of a link: a rule for the level of each pixel.
//!
//! From left to right, there are a strip of mid-grey with a white square in its upper corner, eight bands, and three
//! columns:
//!
//! | place | what it holds |
//! |---|---|
//! | band 0 | columns of one pixel, of the levels 64 and 192 |
//! | bands 1 and 7 | a ruler: cells of these levels in an irregular order, of which no two parts are alike |
//! | bands 2 to 5 | ramps of 256 steps: grey, red, green, blue |
//! | band 6 | columns of one pixel, of two colours with the same blue |
//! | column 0 | rows of one pixel, of the levels 64 and 192 |
//! | column 1 | a ruler from top to bottom |
//! | column 2 | rows of one pixel, of the two colours |
//!
//! Fine lines avoid black and white, so that a sharpened line is not clipped back to what it was.

use phasefront::Size;
use phasefront_io::hologram::packed::{Image, Kind};
use std::ops::Range;

/// The levels of fine lines and rulers.
pub(super) const LOW: u8 = 64;
pub(super) const HIGH: u8 = 192;
/// The level of the strip at the left.
const MIDDLE: u8 = 128;
const BANDS: usize = 8;
/// The pixels at each end of a ramp that repeat its first and last step, away from its neighbours.
const END: usize = 4;
pub(super) const STEPS: usize = 256;

/// What a part of the pattern holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// One-pixel columns.
    Columns,
    /// The upper (0) or the lower ruler along x.
    RulerX(usize),
    /// The ramp of grey (0), red, green or blue.
    Ramp(usize),
    /// One-pixel columns of two colours.
    ColourColumns,
    /// One-pixel rows.
    Rows,
    /// The ruler along y.
    RulerY,
    /// One-pixel rows of two colours.
    ColourRows,
}

/// The pattern of a size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) size: Size,
}

impl Layout {
    /// Where the bands begin.
    fn left(self) -> usize {
        self.size.width / 16
    }

    /// Where the bands end and the three columns begin.
    fn split(self) -> usize {
        self.size.width * 3 / 4
    }

    /// Returns the rows and columns of `part`.
    pub(super) fn area(self, part: Part) -> (Range<usize>, Range<usize>) {
        let band = |n: usize| {
            let row = |n: usize| (n * self.size.height).div_ceil(BANDS);
            (row(n)..row(n + 1), self.left()..self.split())
        };
        let column = |n: usize| {
            let x = |n: usize| self.split() + (n * (self.size.width - self.split())).div_ceil(3);
            (0..self.size.height, x(n)..x(n + 1))
        };
        match part {
            Part::Columns => band(0),
            Part::RulerX(n) => band([1, 7][n]),
            Part::Ramp(colour) => band(2 + colour),
            Part::ColourColumns => band(6),
            Part::Rows => column(0),
            Part::RulerY => column(1),
            Part::ColourRows => column(2),
        }
    }

    fn part(self, y: usize, x: usize) -> Option<Part> {
        if x < self.left() {
            return None;
        }
        Some(if x < self.split() {
            match y * BANDS / self.size.height {
                0 => Part::Columns,
                1 => Part::RulerX(0),
                7 => Part::RulerX(1),
                6 => Part::ColourColumns,
                band => Part::Ramp(band - 2),
            }
        } else {
            match (x - self.split()) * 3 / (self.size.width - self.split()) {
                0 => Part::Rows,
                1 => Part::RulerY,
                _ => Part::ColourRows,
            }
        })
    }

    /// Returns the step of the ramps in column `x`.
    pub(super) fn step(self, x: usize) -> u8 {
        let along = (x - self.left()).saturating_sub(END) * STEPS / (self.split() - self.left() - 2 * END);
        along.min(STEPS - 1) as u8
    }

    /// Returns the length of a cell of the ruler along an axis of `length` pixels.
    pub(super) fn cell(length: usize) -> usize {
        (length / 160).max(6)
    }

    /// Returns the level of the ruler at place `at` of an axis of `length` pixels.
    pub(super) fn ruler(length: usize, at: usize) -> u8 {
        // A cell's level is a bit of a scrambled number (Fibonacci hashing), so that no shift of the ruler fits it.
        let number = (at / Self::cell(length)) as u32;
        let scrambled = number.wrapping_add(1).wrapping_mul(0x9E37_79B1);
        let scrambled = (scrambled ^ (scrambled >> 15)).wrapping_mul(0x85EB_CA77);
        if scrambled >> 31 == 0 { LOW } else { HIGH }
    }

    /// Returns the colour of a pixel.
    pub(super) fn pixel(self, y: usize, x: usize) -> [u8; 3] {
        let line = |at: usize| if at.is_multiple_of(2) { [LOW; 3] } else { [HIGH; 3] };
        let colour = |at: usize| {
            if at.is_multiple_of(2) {
                [HIGH, LOW, MIDDLE]
            } else {
                [LOW, HIGH, MIDDLE]
            }
        };
        match self.part(y, x) {
            None if y * BANDS < self.size.height => [255; 3],
            None => [MIDDLE; 3],
            Some(Part::Columns) => line(x),
            Some(Part::Rows) => line(y),
            Some(Part::ColourColumns) => colour(x),
            Some(Part::ColourRows) => colour(y),
            Some(Part::RulerX(_)) => [Self::ruler(self.size.width, x); 3],
            Some(Part::RulerY) => [Self::ruler(self.size.height, y); 3],
            Some(Part::Ramp(0)) => [self.step(x); 3],
            Some(Part::Ramp(colour)) => std::array::from_fn(|c| if c + 1 == colour { self.step(x) } else { 0 }),
        }
    }
}

/// Makes the pattern of a size.
pub fn pattern(size: Size) -> Image {
    let layout = Layout { size };
    let places = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (y, x)));
    Image {
        size,
        bytes: places.flat_map(|(y, x)| layout.pixel(y, x)).collect(),
        kind: Kind::Rgb,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each part holds what its area says, and the areas cover all columns right of the strip.
    #[test]
    fn parts_and_areas_agree() {
        for size in [
            Size { width: 512, height: 96 },
            Size {
                width: 1921,
                height: 1083,
            },
        ] {
            let layout = Layout { size };
            let parts = [
                Part::Columns,
                Part::RulerX(0),
                Part::RulerX(1),
                Part::ColourColumns,
                Part::Rows,
                Part::RulerY,
                Part::ColourRows,
            ];
            let mut covered = 0;
            for part in parts.into_iter().chain((0..4).map(Part::Ramp)) {
                let (rows, columns) = layout.area(part);
                covered += rows.len() * columns.len();
                for y in rows {
                    assert!(columns.clone().all(|x| layout.part(y, x) == Some(part)), "{part:?} {y}");
                }
            }
            assert_eq!(covered, size.height * (size.width - layout.left()));
            assert_eq!((layout.step(layout.left()), layout.step(layout.split() - 1)), (0, 255));
        }
    }
}
