//! Tracks which threads compute for a session. During the computation wgpu, tract and this crate log and trace, so the
//! app's log handlers run on these threads. A handler may call any session, but a call that waits for a session could
//! deadlock.

use super::sync::thread_local;
use phasefront_core::runtime::error::{Error, Result};
use std::cell::Cell;

thread_local! {
    /// The number of nested session computations on this thread.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

/// Marks this thread as computing until the value is dropped.
pub(super) struct Computing(());

impl Computing {
    pub(super) fn begin() -> Self {
        DEPTH.with(|depth| depth.set(depth.get() + 1));
        Computing(())
    }
}

impl Drop for Computing {
    fn drop(&mut self) {
        DEPTH.with(|depth| depth.set(depth.get() - 1));
    }
}

/// Checks whether this thread computes for a session.
pub(super) fn here() -> bool {
    DEPTH.with(Cell::get) > 0
}

/// # Errors
/// Returns an error if this thread computes for a session.
pub(super) fn check() -> Result<()> {
    if here() {
        return Err(Error::Session(
            "it was called by a handler of logs or traces while a session computes on this thread; call it from another \
             thread, or afterwards"
                .into(),
        ));
    }
    Ok(())
}
