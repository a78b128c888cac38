//! The input and output of a quality level, for the CPU and the GPU.

use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::frame::RgbdFrame;
use std::time::Duration;

/// A frame that is ready to become a hologram.
pub(in crate::session) struct FrameInput<'a> {
    /// The camera's frame, which the GPU reads directly; `None` for a frame that comes from no camera.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code))]
    pub(in crate::session) camera: Option<&'a CameraFrame<'a>>,
    /// Colour and depth at the hologram's resolution.
    pub(in crate::session) rgbd: &'a RgbdFrame,
    /// The time since the previous frame; `None` if the past does not count.
    pub(in crate::session) elapsed: Option<Duration>,
}

/// The buffers for the levels, (C, H, W).
pub(in crate::session) struct LevelsOut<'a> {
    pub(in crate::session) levels: &'a mut [u8],
    /// The levels of a display with more than 8 bits.
    pub(in crate::session) words: Option<&'a mut [u16]>,
}

/// The scale and stage times of an encoded frame.
#[derive(Debug, Clone, Copy)]
pub(in crate::session) struct Encoded {
    pub(in crate::session) scale: f32,
    pub(in crate::session) method: Duration,
    pub(in crate::session) propagate: Duration,
    pub(in crate::session) encode: Duration,
}
