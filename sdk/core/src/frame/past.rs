//! The past of a frame.

use std::time::Duration;

/// What counts of the frame before: a frame that has a past follows another in a video.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Past {
    /// The scale of the previous frame: the amplitude that full light stands for.
    pub scale: f32,
    /// The time since the previous frame.
    pub elapsed: Duration,
}
