//! Cancellation of a frame during its computation. Long loops check for it once per row, tile or plane. The results of
//! a cancelled frame are incomplete and must be discarded.

use crate::runtime::error::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A cancellation flag shared by the code that computes a frame and the code that may cancel it.
#[derive(Debug, Clone, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Requests cancellation of the frame.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Clears the request for a new frame.
    pub fn clear(&self) {
        self.0.store(false, Ordering::Relaxed);
    }

    /// Returns whether cancellation was requested.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// # Errors
    /// Returns an error if cancellation was requested.
    pub fn check(&self) -> Result<()> {
        if self.requested() {
            return Err(Error::Session(
                "the frame was given up: the session was reset or closed while it was computed".into(),
            ));
        }
        Ok(())
    }
}
