//! What goes into a quality level and what comes out of it, on the CPU and on the GPU.

use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::frame::RgbdFrame;
use std::time::Duration;

/// A frame that is ready to become a hologram.
pub(in crate::session) struct FrameInput<'a> {
    /// None for a frame that comes from no camera. The GPU reads it itself.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code))]
    pub(in crate::session) camera: Option<&'a CameraFrame<'a>>,
    /// Its colour and depth at the hologram's resolution.
    pub(in crate::session) rgbd: &'a RgbdFrame,
    /// How long after the frame before, where that one counts.
    pub(in crate::session) elapsed: Option<Duration>,
}

/// Where levels go, (C, H, W).
pub(in crate::session) struct LevelsOut<'a> {
    pub(in crate::session) levels: &'a mut [u8],
    /// Of a display of over 8 bits.
    pub(in crate::session) words: Option<&'a mut [u16]>,
}

/// What became of a frame.
#[derive(Debug, Clone, Copy)]
pub(in crate::session) struct Encoded {
    pub(in crate::session) scale: f32,
    pub(in crate::session) method: Duration,
    pub(in crate::session) propagate: Duration,
    pub(in crate::session) encode: Duration,
}
