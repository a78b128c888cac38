//! The 256 test patterns of the double-phase calibration (Methods of the paper). In every cell of 2×2 pixels the top
//! right and bottom left pixels stay at level 0 and the other two have level k. Through the Fourier aperture the cell's
//! light is then |1 + exp(iφₖ)|²/4.
//!
//! Every pattern contains marks that locate it in a photograph and a code that identifies it, whatever k is. Each
//! corner has a dark square in a bright frame, and the one at the top left has a bright hole. Beside the top left mark
//! are ten dark or bright cells: one that is always dark, the eight bits of k (dark is 1, the highest bit first), and
//! their parity. Dark areas are a checkerboard of level 0 and a level with a phase of about π. [`DARK`] is suitable for
//! ranges from 0.8·2π to 1.5·2π. Other ranges need another dark level.

use ndarray::Array2;
use phasefront::Size;
use phasefront_io::{Error, Result};

/// The number of patterns, one per level.
pub const PATTERNS: usize = 256;
/// The level that is dark beside level 0 on an uncalibrated display.
pub const DARK: u8 = 105;
/// The number of cells of the code: one dark cell, eight bits, and a parity bit.
pub const CELLS: usize = 10;
/// The width, in pixels, of the border around marks and code where their light mixes with the pattern's.
const GUARD: usize = 2;

/// The patterns for a modulator of one size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pattern {
    height: usize,
    width: usize,
    /// The side of a mark with its bright frame, in pixels, a multiple of 8. The dark square has half this side.
    mark: usize,
    dark: u8,
}

impl Pattern {
    /// Creates the patterns for a modulator of `size`.
    ///
    /// # Errors
    /// Returns an error if the modulator is too small for marks.
    pub fn new(size: Size) -> Result<Self> {
        let Size { width, height } = size;
        let mark = (height.min(width) / 10 / 8 * 8).clamp(16, 128);
        if width < 9 * mark || height < 4 * mark {
            return Err(Error::Input(format!(
                "a modulator of {width}×{height} pixels has no room for marks; at least 144×64 are needed, and it must not be upright"
            )));
        }
        Ok(Pattern {
            height,
            width,
            mark,
            dark: DARK,
        })
    }

    /// Returns the patterns with `dark` as the level that is dark beside level 0.
    pub fn with_dark(self, dark: u8) -> Self {
        Pattern { dark, ..self }
    }

    /// Returns the size in pixels.
    pub fn size(&self) -> Size {
        Size {
            width: self.width,
            height: self.height,
        }
    }

    /// Returns the side of a mark's dark square, in pixels.
    pub fn square(&self) -> usize {
        self.mark / 2
    }

    /// Returns the centres (x, y) of the marks: top left, top right, bottom left, bottom right.
    pub fn marks(&self) -> [[f64; 2]; 4] {
        let (near, w, h) = (self.mark as f64, self.width as f64, self.height as f64);
        [[near, near], [w - near, near], [near, h - near], [w - near, h - near]]
    }

    /// Returns the centres (x, y) of the code's cells, and of the bright places before, between and after them.
    pub fn code(&self) -> ([[f64; 2]; CELLS], [[f64; 2]; CELLS + 1]) {
        let m = self.mark as f64;
        let at = |half_cells: usize| [1.5 * m + m / 4.0 * half_cells as f64, 0.75 * m];
        (
            std::array::from_fn(|i| at(2 * i + 2)),
            std::array::from_fn(|i| at(2 * i + 1)),
        )
    }

    /// Returns the side of a cell of the code, in pixels.
    pub fn cell(&self) -> usize {
        self.mark / 4
    }

    /// Checks whether pixel (`x`, `y`) belongs to the pattern itself, away from marks and code.
    pub fn measures(&self, y: usize, x: usize) -> bool {
        let inset = self.mark / 2;
        let beyond = |n: usize, from: usize, to: usize| n + GUARD < from || n >= to + GUARD;
        let outside = |top: usize, left: usize, height: usize, width: usize| {
            beyond(y, top, top + height) || beyond(x, left, left + width)
        };
        let (bottom, right) = (self.height - inset - self.mark, self.width - inset - self.mark);
        [(inset, inset), (inset, right), (bottom, inset), (bottom, right)]
            .into_iter()
            .all(|(top, left)| outside(top, left, self.mark, self.mark))
            && outside(inset, inset + self.mark, self.mark / 2, 11 * self.mark / 2)
    }

    /// Returns the level of pixel (`x`, `y`) in pattern `k`.
    pub fn level(&self, k: u8, y: usize, x: usize) -> u8 {
        let active = (x + y).is_multiple_of(2);
        let shown = match self.fixed(k, y, x) {
            None => k,
            Some(true) => self.dark,
            Some(false) => 0,
        };
        if active { shown } else { 0 }
    }

    /// Returns whether a pixel of a mark or of the code is dark, or `None` elsewhere.
    fn fixed(&self, k: u8, y: usize, x: usize) -> Option<bool> {
        let (m, inset) = (self.mark, self.mark / 2);
        let within = |n: usize, from: usize, length: usize| (from..from + length).contains(&n);
        let (bottom, right) = (self.height - inset - m, self.width - inset - m);
        for (corner, (top, left)) in [(inset, inset), (inset, right), (bottom, inset), (bottom, right)]
            .into_iter()
            .enumerate()
        {
            if within(y, top, m) && within(x, left, m) {
                let square =
                    |side: usize| within(y, top + (m - side) / 2, side) && within(x, left + (m - side) / 2, side);
                return Some(square(m / 2) && !(corner == 0 && square(m / 4)));
            }
        }
        if within(y, inset, m / 2) && within(x, inset + m, 11 * m / 2) {
            // Cells are m/4 wide, with a period of m/2. The first begins m/2 after the start of the strip.
            let along = x - inset - m + m / 8;
            let (cell, part) = (along / (m / 2), along % (m / 2));
            let inside = part < m / 4 && within(y, inset + m / 8, m / 4);
            let dark = inside && (1..=CELLS).contains(&cell) && bits(k)[cell - 1];
            return Some(dark);
        }
        None
    }

    /// Returns the levels of pattern `k`, (H, W).
    pub fn frame(&self, k: u8) -> Array2<u8> {
        Array2::from_shape_fn((self.height, self.width), |(y, x)| self.level(k, y, x))
    }
}

/// Returns which cells of the code of pattern `k` are dark.
fn bits(k: u8) -> [bool; CELLS] {
    std::array::from_fn(|i| match i {
        0 => true,
        1..=8 => k >> (8 - i) & 1 == 1,
        _ => k.count_ones() % 2 == 1,
    })
}

/// Decodes a pattern number. Returns `None` if the code is invalid.
pub fn decode(dark: [bool; CELLS]) -> Option<u8> {
    let k = (dark[1..9].iter()).fold(0, |k, bit| k << 1 | u8::from(*bit));
    (bits(k) == dark).then_some(k)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn codes_stand_where_they_are_looked_for() {
        for (h, w) in [(64, 144), (96, 161), (1080, 1920)] {
            let pattern = Pattern::new(Size { width: w, height: h }).unwrap();
            let (cells, between) = pattern.code();
            for k in [0, 1, 77, 255] {
                let is_dark = |[x, y]: [f64; 2]| {
                    let (x, y) = (x as usize, y as usize);
                    (0..2).any(|d| pattern.level(k, y, x + d) == DARK) && !pattern.measures(y, x)
                };
                assert_eq!(decode(cells.map(is_dark)), Some(k), "{w}×{h}");
                assert!(!between.into_iter().any(is_dark));
                let marks = pattern.marks().map(is_dark);
                assert_eq!(marks, [false, true, true, true]);
            }
        }
        assert_eq!(decode([false; CELLS]), None);
    }

    #[test]
    fn cells_hold_two_pixels_at_nought() {
        let pattern = Pattern::new(Size { width: 144, height: 96 }).unwrap();
        for (y, x) in [(0, 0), (50, 70), (95, 143)] {
            assert!(pattern.measures(y, x));
            let expected = if (x + y) % 2 == 0 { 200 } else { 0 };
            assert_eq!(pattern.level(200, y, x), expected);
        }
        assert!(!pattern.measures(16, 16) && !pattern.measures(10, 60));
        assert!(
            Pattern::new(Size {
                width: 100,
                height: 100
            })
            .is_err()
        );
    }
}
