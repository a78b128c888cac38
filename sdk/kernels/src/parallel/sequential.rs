//! What Phasefront uses of rayon, on the calling thread: iterators of the standard library under rayon's names.

/// Runs `first`, then `second`.
pub fn join<A, B>(first: impl FnOnce() -> A, second: impl FnOnce() -> B) -> (A, B) {
    (first(), second())
}

/// Returns 1.
pub fn current_num_threads() -> usize {
    1
}

/// Returns the index of the only thread.
pub fn current_thread_index() -> Option<usize> {
    Some(0)
}

/// Runs `work` on the only thread.
pub fn broadcast<R>(work: impl FnOnce(()) -> R) -> Vec<R> {
    vec![work(())]
}

/// The traits of `rayon::prelude` that are used.
pub mod prelude {
    pub use super::ParallelIterator as IndexedParallelIterator;
    pub use super::{IntoParallelIterator, ParallelIterator, ParallelSlice};
}

/// What rayon's iterators have and those of the standard library lack.
pub trait ParallelIterator: Iterator + Sized {
    /// Calls `each` with every item and a value that `init` makes once.
    fn for_each_init<T>(self, init: impl FnOnce() -> T, mut each: impl FnMut(&mut T, Self::Item)) {
        let mut value = init();
        self.for_each(|item| each(&mut value, item));
    }

    /// Combines all items, or returns `None` if there is none.
    fn reduce_with(self, combine: impl FnMut(Self::Item, Self::Item) -> Self::Item) -> Option<Self::Item> {
        self.reduce(combine)
    }

    /// Returns the iterator: there are no parts to divide.
    fn with_min_len(self, _least: usize) -> Self {
        self
    }

    /// Returns the iterator: there are no parts to divide.
    fn with_max_len(self, _most: usize) -> Self {
        self
    }
}

impl<I: Iterator> ParallelIterator for I {}

/// Collections and ranges.
pub trait IntoParallelIterator: IntoIterator + Sized {
    /// Returns the iterator of the standard library.
    fn into_par_iter(self) -> Self::IntoIter {
        self.into_iter()
    }
}

impl<I: IntoIterator> IntoParallelIterator for I {}

/// Slices and their parts of `size` items.
pub trait ParallelSlice<T> {
    /// As [`slice::iter`].
    fn par_iter(&self) -> std::slice::Iter<'_, T>;
    /// As [`slice::iter_mut`].
    fn par_iter_mut(&mut self) -> std::slice::IterMut<'_, T>;
    /// As [`slice::chunks`].
    fn par_chunks(&self, size: usize) -> std::slice::Chunks<'_, T>;
    /// As [`slice::chunks_mut`].
    fn par_chunks_mut(&mut self, size: usize) -> std::slice::ChunksMut<'_, T>;
    /// As [`slice::chunks_exact`].
    fn par_chunks_exact(&self, size: usize) -> std::slice::ChunksExact<'_, T>;
    /// As [`slice::chunks_exact_mut`].
    fn par_chunks_exact_mut(&mut self, size: usize) -> std::slice::ChunksExactMut<'_, T>;
}

impl<T> ParallelSlice<T> for [T] {
    fn par_iter(&self) -> std::slice::Iter<'_, T> {
        self.iter()
    }

    fn par_iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
        self.iter_mut()
    }

    fn par_chunks(&self, size: usize) -> std::slice::Chunks<'_, T> {
        self.chunks(size)
    }

    fn par_chunks_mut(&mut self, size: usize) -> std::slice::ChunksMut<'_, T> {
        self.chunks_mut(size)
    }

    fn par_chunks_exact(&self, size: usize) -> std::slice::ChunksExact<'_, T> {
        self.chunks_exact(size)
    }

    fn par_chunks_exact_mut(&mut self, size: usize) -> std::slice::ChunksExactMut<'_, T> {
        self.chunks_exact_mut(size)
    }
}
