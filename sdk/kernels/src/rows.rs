//! Where a chain reads its rows and writes them.

use crate::OUTPUTS;

/// What a chain reads and where its rows go, row by row, while it runs: neither needs to lie in memory as planes of
/// their own. Rows are written to `PLANES` planes of one size, which are cut into bands of rows; a band is handed to
/// one thread.
pub trait Rows<const PLANES: usize>: Sync {
    /// A value of the planes that are written.
    type Value: Send;

    /// Fills `into`, one run of `into.len() / inputs` pixels for each of the frame's input planes, with `row` from
    /// column `from` on.
    ///
    /// Called twice for each row that a band needs, and more often for the last of a frame whose rows are paired. Where
    /// strips are as wide as the frame, a row is read for the last time before the row above it is written, so that
    /// what is written may replace what is read.
    fn read(&self, row: usize, from: usize, band: &Band<'_, Self::Value, PLANES>, into: &mut [f32]);

    /// Takes the values of `row` from column `from` on, one run of pixels for each output; they may be worked on there.
    fn write(&self, row: usize, from: usize, values: [&mut [f32]; OUTPUTS], band: &mut Band<'_, Self::Value, PLANES>);

    /// Whether nobody wants the rest any more. Asked before each row of a strip; what follows is then left out.
    fn given_up(&self) -> bool {
        false
    }
}

/// Some rows of the planes that a chain's rows are written to.
pub struct Band<'a, T, const PLANES: usize> {
    pub(crate) top: usize,
    pub(crate) width: usize,
    pub(crate) planes: [&'a mut [T]; PLANES],
}

impl<T, const PLANES: usize> Band<'_, T, PLANES> {
    /// The rows of the frame that lie in this band.
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.top..self.top + self.planes[0].len() / self.width
    }

    /// `count` pixels of `row` of one plane, from column `from` on.
    ///
    /// # Panics
    /// If the row does not lie in this band.
    pub fn row(&self, plane: usize, row: usize, from: usize, count: usize) -> &[T] {
        &self.planes[plane][(row - self.top) * self.width + from..][..count]
    }

    /// The same of every plane, to be written.
    ///
    /// # Panics
    /// If the row does not lie in this band.
    pub fn rows_mut(&mut self, row: usize, from: usize, count: usize) -> [&mut [T]; PLANES] {
        let at = (row - self.top) * self.width + from;
        self.planes.each_mut().map(|plane| &mut plane[at..at + count])
    }
}

/// The first `count` values of `memory`, which grows where it has fewer.
pub(crate) fn grown(memory: &mut Vec<f32>, count: usize) -> &mut [f32] {
    if memory.len() < count {
        memory.resize(count, 0.0);
    }
    &mut memory[..count]
}
