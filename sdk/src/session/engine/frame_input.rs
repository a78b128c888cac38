//! The input of a quality level, for the CPU and the GPU.

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
