//! The process that a session was made in. A fork copies a session but not its threads, so that its copy would wait for
//! them for ever.

use crate::error::{Error, Result};

/// A process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Home(u32);

impl Home {
    /// The one that runs.
    pub(super) fn here() -> Self {
        Home(match cfg!(unix) {
            true => std::process::id(),
            // Processes are not forked.
            false => 0,
        })
    }

    /// Whether this is still the process.
    pub(super) fn is_here(self) -> bool {
        self == Home::here()
    }

    /// # Errors
    /// Another process.
    pub(super) fn check(self) -> Result<()> {
        match self.is_here() {
            true => Ok(()),
            false => Err(Error::Session(
                "it was made before this process was forked, and its threads stayed behind; make a new one after the fork"
                    .into(),
            )),
        }
    }
}
