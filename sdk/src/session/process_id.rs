//! The process that created a session. A fork copies a session but not its threads, so the copy would wait for them
//! forever.

use phasefront_core::runtime::error::{Error, Result};

/// The ID of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ProcessId(u32);

impl ProcessId {
    /// Returns the current process.
    pub(super) fn current() -> Self {
        // Only Unix forks processes, and WebAssembly has no process IDs.
        ProcessId(if cfg!(unix) { std::process::id() } else { 0 })
    }

    /// Checks whether this is the current process.
    pub(super) fn is_current(self) -> bool {
        self == ProcessId::current()
    }

    /// # Errors
    /// Returns an error in another process.
    pub(super) fn check(self) -> Result<()> {
        if !self.is_current() {
            return Err(Error::Session(
                "it was made before this process was forked, and its threads stayed behind; make a new one after the fork"
                    .into(),
            ));
        }
        Ok(())
    }
}
