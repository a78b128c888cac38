//! What goes into a quality level and what comes out of it, on the CPU and on the GPU.

use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::frame::RgbdFrame;
use std::time::Duration;

/// A frame that is ready to become a hologram.
pub(super) struct FrameInput<'a> {
    /// None for a frame that comes from no camera. The GPU reads it itself.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code))]
    pub(super) camera: Option<&'a CameraFrame<'a>>,
    /// Its colour and depth at the hologram's resolution.
    pub(super) rgbd: &'a RgbdFrame,
    /// How long after the frame before, where that one counts.
    pub(super) elapsed: Option<Duration>,
}

/// Where levels go, (C, H, W).
pub(super) struct LevelsOut<'a> {
    pub(super) levels: &'a mut [u8],
    /// Of a display of over 8 bits.
    pub(super) words: Option<&'a mut [u16]>,
}

/// What became of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Encoded {
    pub(super) scale: f32,
    pub(super) method: Duration,
    pub(super) propagate: Duration,
    pub(super) encode: Duration,
}
