//! The input of a quality level, for the CPU and the GPU.

use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::depth::stream::DepthStream;
use phasefront_core::frame::Past;
use phasefront_core::frame::RgbdFrame;

/// A frame that is ready to become a hologram.
pub(in crate::session) struct FrameInput<'a> {
    /// The camera's frame, which the GPU reads directly; `None` for a frame that comes from no camera.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code))]
    pub(in crate::session) camera: Option<&'a CameraFrame<'a>>,
    /// Colour and depth at the hologram's resolution. The depth of pixels may be undecided.
    pub(in crate::session) frame: &'a mut RgbdFrame,
    /// The stream that read the depth, if the depth of pixels is undecided: a GPU decides it.
    pub(in crate::session) undecided: Option<&'a mut DepthStream>,
    /// The past, if the frame follows another.
    pub(in crate::session) past: Option<Past>,
}

impl FrameInput<'_> {
    /// Returns colour and depth, which is decided now unless it was before.
    pub(in crate::session) fn rgbd(&mut self) -> &RgbdFrame {
        if let Some(stream) = self.undecided.take() {
            let (rgb, depth) = self.frame.planes_mut();
            stream.decide(rgb, depth);
        }
        self.frame
    }
}
