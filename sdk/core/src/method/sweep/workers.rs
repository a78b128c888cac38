//! Preallocated working memory for each thread of a pool.

use crate::parallel;
use std::sync::{Mutex, PoisonError};

/// One piece of memory for each thread.
pub(super) struct Workers<T>(Vec<Mutex<T>>);

impl<T> Workers<T> {
    /// Creates working memory for the current pool.
    pub(super) fn new(make: impl Fn() -> T) -> Self {
        Workers(
            (0..parallel::current_num_threads().max(1))
                .map(|_| Mutex::new(make()))
                .collect(),
        )
    }

    /// Lends this thread its piece. If the pool is larger than planned, a thread may have to wait for another's piece.
    pub(super) fn with(&self, run: impl FnOnce(&mut T)) {
        let own = parallel::current_thread_index().unwrap_or(0) % self.0.len();
        run(&mut self.0[own].lock().unwrap_or_else(PoisonError::into_inner));
    }
}
