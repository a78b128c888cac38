//! The 256 test patterns of the double-phase calibration (Methods of the paper): in every cell of 2×2 pixels the top
//! right and bottom left ones stay at level 0 and the other two show level k, so that through the Fourier aperture
//! the cell's light is |1 + exp(iφₖ)|²/4.
//!
//! Every pattern carries what tells where it lies in a photograph and which one it is, whatever k: in each corner a
//! dark square in a bright frame (the one at the top left has a bright hole), and beside the top left one ten dark or
//! bright cells: one always dark, the eight bits of k (dark is 1, the highest first), and their parity. Dark is the
//! checkerboard of level 0 and one that turns by about π: [`DARK`] does from 0.8·2π to 1.5·2π, another must be given
//! for ranges beyond.

use ndarray::Array2;
use phasefront_io::{Error, Result};

/// How many patterns there are: one a level.
pub const PATTERNS: usize = 256;
/// The level that is dark beside 0, before anything is calibrated.
pub const DARK: u8 = 105;
/// Cells of the code: one dark, eight bits, parity.
pub const CELLS: usize = 10;
/// Pixels around marks and code whose light is mixed with theirs.
const GUARD: usize = 2;

/// The patterns of a modulator of one size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pattern {
    height: usize,
    width: usize,
    /// Side of a mark with its bright frame, pixels, a multiple of 8; the dark square has half of it.
    mark: usize,
    dark: u8,
}

impl Pattern {
    /// For a modulator of (`height`, `width`) pixels.
    ///
    /// # Errors
    /// A modulator too small to carry marks.
    pub fn new(height: usize, width: usize) -> Result<Self> {
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

    /// The same with `dark` for the level that is dark beside 0.
    pub fn with_dark(self, dark: u8) -> Self {
        Pattern { dark, ..self }
    }

    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// Side of a mark's dark square, pixels.
    pub fn square(&self) -> usize {
        self.mark / 2
    }

    /// The centres (x, y) of the marks: top left, top right, bottom left, bottom right.
    pub fn marks(&self) -> [[f64; 2]; 4] {
        let (near, w, h) = (self.mark as f64, self.width as f64, self.height as f64);
        [[near, near], [w - near, near], [near, h - near], [w - near, h - near]]
    }

    /// The centres (x, y) of the code's cells, and of the bright places before, between and after them.
    pub fn code(&self) -> ([[f64; 2]; CELLS], [[f64; 2]; CELLS + 1]) {
        let m = self.mark as f64;
        let at = |half_cells: usize| [1.5 * m + m / 4.0 * half_cells as f64, 0.75 * m];
        (
            std::array::from_fn(|i| at(2 * i + 2)),
            std::array::from_fn(|i| at(2 * i + 1)),
        )
    }

    /// Side of a cell, pixels.
    pub fn cell(&self) -> usize {
        self.mark / 4
    }

    /// Whether pixel (`x`, `y`) shows the pattern itself, away from marks and code.
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

    /// The level of pixel (`x`, `y`) in pattern `k`.
    pub fn level(&self, k: u8, y: usize, x: usize) -> u8 {
        let active = (x + y).is_multiple_of(2);
        let shown = match self.fixed(k, y, x) {
            None => k,
            Some(true) => self.dark,
            Some(false) => 0,
        };
        if active { shown } else { 0 }
    }

    /// Whether a pixel of a mark or of the code is dark; None elsewhere.
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
            // Cells of m/4 every m/2, the first m/2 after the strip's beginning.
            let along = x - inset - m + m / 8;
            let (cell, part) = (along / (m / 2), along % (m / 2));
            let inside = part < m / 4 && within(y, inset + m / 8, m / 4);
            let dark = inside && (1..=CELLS).contains(&cell) && bits(k)[cell - 1];
            return Some(dark);
        }
        None
    }

    /// Pattern `k`, levels (H, W).
    pub fn frame(&self, k: u8) -> Array2<u8> {
        Array2::from_shape_fn((self.height, self.width), |(y, x)| self.level(k, y, x))
    }
}

/// The code of pattern `k`: which cells are dark.
fn bits(k: u8) -> [bool; CELLS] {
    std::array::from_fn(|i| match i {
        0 => true,
        1..=8 => k >> (8 - i) & 1 == 1,
        _ => k.count_ones() % 2 == 1,
    })
}

/// The pattern that a code says, None where it is none.
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
            let pattern = Pattern::new(h, w).unwrap();
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
        let pattern = Pattern::new(96, 144).unwrap();
        for (y, x) in [(0, 0), (50, 70), (95, 143)] {
            assert!(pattern.measures(y, x));
            let expected = if (x + y) % 2 == 0 { 200 } else { 0 };
            assert_eq!(pattern.level(200, y, x), expected);
        }
        assert!(!pattern.measures(16, 16) && !pattern.measures(10, 60));
        assert!(Pattern::new(100, 100).is_err());
    }
}
