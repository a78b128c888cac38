//! Giving a frame up while it is computed. Long loops ask once a row, tile or plane; what they leave undone is
//! rubbish, which whoever gave the frame up throws away.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Shared by those who compute a frame and those who may give it up.
#[derive(Debug, Clone, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Asks whoever computes the frame to give it up.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// A new frame begins.
    pub fn clear(&self) {
        self.0.store(false, Ordering::Relaxed);
    }

    /// Whether the frame is to be given up.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
