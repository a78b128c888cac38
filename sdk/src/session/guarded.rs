//! Locks and calls that outlive a panic.

use super::sync::{Mutex, MutexGuard};
use phasefront_core::runtime::caught::caught;
use phasefront_core::runtime::error::{Error, Result};
use std::sync::PoisonError;

/// Locks `mutex` even after a panic: the data behind these locks is consistent between any two statements.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `process` and converts a panic to an error. Also returns whether it panicked.
pub(super) fn guarded<O>(process: impl FnOnce() -> Result<O>) -> (Result<O>, bool) {
    match caught(process) {
        Ok(result) => (result, false),
        Err(message) => (Err(Error::Internal(message)), true),
    }
}
