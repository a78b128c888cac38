//! Threads that compute for a session. While they do, wgpu, tract and this crate log and trace, so handlers of the app
//! run on them. Such a handler may call any session, but a call that waited for one there might wait for ever.

use super::sync::thread_local;
use phasefront_core::runtime::error::{Error, Result};
use std::cell::Cell;

thread_local! {
    /// Work on sessions that this thread is in the midst of.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

/// Marks this thread as computing until it is dropped.
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

/// Whether this thread computes for a session.
pub(super) fn here() -> bool {
    DEPTH.with(Cell::get) > 0
}

/// # Errors
/// A thread that computes for a session.
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
