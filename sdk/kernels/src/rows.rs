//! The input and output rows of a chain.

use crate::OUTPUTS;
use std::ops::Range;

/// Provides the input rows of a chain and receives its output rows while it runs. Neither needs to be stored as planes.
/// Output goes to `PLANES` planes of one size, which are cut into bands of rows; each band is passed to one thread.
pub trait Rows<const PLANES: usize>: Sync {
    /// A value of the output planes.
    type Value: Send;

    /// Fills `into`, one run of `into.len() / inputs` pixels for each of the frame's input planes, with `row` from
    /// column `from` on.
    ///
    /// Called twice for each row that a band needs, and more often for the last row of a frame whose rows are paired.
    /// If strips are as wide as the frame, a row is read for the last time before the row above it is written, so that
    /// the output may replace the input.
    fn read(&self, row: usize, from: usize, band: &Band<'_, Self::Value, PLANES>, into: &mut [f32]);

    /// Receives the values of `row` from column `from` on, one run of pixels for each output. It may modify them in
    /// place.
    fn write(&self, row: usize, from: usize, values: [&mut [f32]; OUTPUTS], band: &mut Band<'_, Self::Value, PLANES>);

    /// Returns the rectangle of `rows` and `columns` of pixels that the run computes, or `None` if it computes none of
    /// them. Other pixels keep what the output planes hold. The result of a pixel does not depend on it.
    fn needed(&self, rows: Range<usize>, columns: Range<usize>) -> Option<[Range<usize>; 2]> {
        Some([rows, columns])
    }

    /// Checks whether the run is cancelled. Called before each row of a strip; the remaining rows are then skipped.
    fn given_up(&self) -> bool {
        false
    }
}

/// Some rows of the planes that a chain writes to.
pub struct Band<'a, T, const PLANES: usize> {
    pub(crate) top: usize,
    pub(crate) width: usize,
    pub(crate) planes: [&'a mut [T]; PLANES],
}

impl<T, const PLANES: usize> Band<'_, T, PLANES> {
    /// Returns the rows of the frame in this band.
    pub fn rows(&self) -> Range<usize> {
        self.top..self.top + self.planes[0].len() / self.width
    }

    /// Returns `count` pixels of `row` of one plane, from column `from` on.
    ///
    /// # Panics
    /// Panics if the row is not in this band.
    pub fn row(&self, plane: usize, row: usize, from: usize, count: usize) -> &[T] {
        &self.planes[plane][(row - self.top) * self.width + from..][..count]
    }

    /// Returns `count` pixels of `row` of every plane, from column `from` on, for writing.
    ///
    /// # Panics
    /// Panics if the row is not in this band.
    pub fn rows_mut(&mut self, row: usize, from: usize, count: usize) -> [&mut [T]; PLANES] {
        let at = (row - self.top) * self.width + from;
        self.planes.each_mut().map(|plane| &mut plane[at..at + count])
    }
}

/// Returns the first `count` values of `memory`, which grows if it is shorter.
pub(crate) fn grown(memory: &mut Vec<f32>, count: usize) -> &mut [f32] {
    if memory.len() < count {
        memory.resize(count, 0.0);
    }
    &mut memory[..count]
}
