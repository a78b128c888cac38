//! The process that a session was made in. A fork copies a session but not its threads, so that its copy would wait for
//! them for ever.

use phasefront_core::runtime::error::{Error, Result};

/// A process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ProcessId(u32);

impl ProcessId {
    /// The one that runs.
    pub(super) fn current() -> Self {
        // Only Unix forks processes, and WebAssembly has no ids.
        ProcessId(if cfg!(unix) { std::process::id() } else { 0 })
    }

    /// Whether this is still the process.
    pub(super) fn is_current(self) -> bool {
        self == ProcessId::current()
    }

    /// # Errors
    /// Another process.
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
