//! Working memory for each thread of a pool, made beforehand.

use std::sync::{Mutex, PoisonError};

/// One piece of memory for each thread.
pub(super) struct Workers<T>(Vec<Mutex<T>>);

impl<T> Workers<T> {
    /// For the current pool.
    pub(super) fn new(make: impl Fn() -> T) -> Self {
        Workers(
            (0..rayon::current_num_threads().max(1))
                .map(|_| Mutex::new(make()))
                .collect(),
        )
    }

    /// Lends this thread its piece. A thread of a larger pool than the one planned for waits for another's.
    pub(super) fn with(&self, run: impl FnOnce(&mut T)) {
        let own = rayon::current_thread_index().unwrap_or(0) % self.0.len();
        run(&mut self.0[own].lock().unwrap_or_else(PoisonError::into_inner));
    }
}
