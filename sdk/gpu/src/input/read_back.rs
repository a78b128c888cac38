//! Reads frames back to the CPU, as the GPU has converted and conditioned them.

use crate::Result;
use crate::device::{Device, copy_mapped};
use phasefront_core::Size;
use phasefront_core::frame::RgbdFrame;

/// The memory for one frame at a time.
pub(crate) struct ReadBack {
    readable: wgpu::Buffer,
    surfaces: Vec<[f32; 4]>,
    frame: RgbdFrame,
}

impl ReadBack {
    /// Plans for frames of `size`.
    pub(crate) fn new(device: &Device, size: Size) -> Self {
        ReadBack {
            readable: device.readable("the frame on the CPU", 16 * size.pixels()),
            surfaces: vec![[0.0; 4]; size.pixels()],
            frame: RgbdFrame::black(3, size),
        }
    }

    /// Copies `surfaces`, (H, W) of red, green, blue and depth, for [`Self::frame`].
    pub(crate) fn copy(&self, encoder: &mut wgpu::CommandEncoder, surfaces: &wgpu::Buffer) {
        encoder.copy_buffer_to_buffer(surfaces, 0, &self.readable, 0, self.readable.size());
    }

    /// Waits for `submission` and returns the frame that it copied.
    pub(crate) async fn frame(&mut self, device: &Device, submission: &wgpu::SubmissionIndex) -> Result<&RgbdFrame> {
        device.map(&self.readable, submission).await?;
        copy_mapped(&self.readable, bytemuck::cast_slice_mut(&mut self.surfaces))?;
        self.readable.unmap();
        let (rgb, depth) = self.frame.planes_mut();
        let area = depth.len();
        for (at, (depth, [red, green, blue, distance])) in depth.iter_mut().zip(&self.surfaces).enumerate() {
            *depth = *distance;
            for (colour, value) in [red, green, blue].into_iter().enumerate() {
                rgb[colour * area + at] = *value;
            }
        }
        Ok(&self.frame)
    }
}
