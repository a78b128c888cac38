//! The swept wave of a frame as the encoder reads it: pixels of 16 bits, and the rows that have changed.

use super::standing::Changes;
use super::tile;
use num_complex::Complex32;
use phasefront_kernels::fir::Pixel;
use phasefront_kernels::wide;
use std::ops::Range;

/// The swept wave of a frame. Its values are those of the field that [`SweepPlan::field`](super::SweepPlan::field)
/// writes, without the mean phase of each colour.
#[derive(Clone, Copy)]
pub(crate) struct Wave<'a> {
    /// The pixels, (C, H, W).
    pub(super) pixels: &'a [Pixel],
    /// The number of pixels of a colour.
    pub(super) size: usize,
    /// The factor that removes the mean phase of each colour.
    pub(crate) turns: [Complex32; 3],
    /// `None` if the sweep keeps nothing from frame to frame.
    pub(crate) changed: Option<ChangedRows<'a>>,
}

/// The pixels of a colour of a [`Wave`].
#[derive(Clone, Copy)]
pub(crate) struct WavePlane<'a> {
    pixels: &'a [Pixel],
    turn: Complex32,
}

impl<'a> Wave<'a> {
    /// Returns the number of values.
    pub(crate) fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Returns value `at` of (C, H, W).
    #[inline(always)]
    pub(crate) fn value(&self, at: usize) -> Complex32 {
        tile::value(self.pixels[at]) * self.turns[at / self.size]
    }

    pub(crate) fn plane(&self, colour: usize) -> WavePlane<'a> {
        WavePlane {
            pixels: &self.pixels[colour * self.size..][..self.size],
            turn: self.turns[colour],
        }
    }
}

impl WavePlane<'_> {
    /// Writes the values from `from` on into `to`.
    pub(crate) fn write(self, from: usize, to: &mut [Complex32]) {
        let pixels = &self.pixels[from..][..to.len()];
        wide!(for (to, pixel) in to.iter_mut().zip(pixels) {
            *to = tile::value(*pixel) * self.turn;
        });
    }
}

/// The rows in which a wave differs from the wave before, apart from the factor of its mean phase.
#[derive(Clone, Copy)]
pub(crate) struct ChangedRows<'a> {
    pub(super) changes: &'a Changes,
    /// How many rows beside a changed block differ.
    pub(super) reach: usize,
    /// The number of waves so far. The wave before has the number before.
    pub(crate) number: u64,
}

impl ChangedRows<'_> {
    /// Returns whether one of the rows differs. They may go beyond the frame.
    pub(crate) fn any(&self, rows: Range<usize>) -> bool {
        self.changes
            .any(rows.start.saturating_sub(self.reach)..rows.end.saturating_add(self.reach))
    }
}
