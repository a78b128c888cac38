//! The phasors that steps correct, and the pixels that did not change since the previous frame, whose steps start from
//! the phasors found there: the counterpart of `still.rs` beside [`phasefront_core::encode::midpoint`].

use super::shared::Shared;
use super::{COLUMNS, LevelsBuffers};
use crate::Result;
use crate::device::{Constants, Device, Dispatch};
use phasefront_core::Size;
use phasefront_core::encode::midpoint::STILL;
use phasefront_core::frame::Past;

/// The program text, to be appended to local.wgsl.
pub(super) const SOURCE: &str = include_str!("still.wgsl");

/// The memory for one frame and the previous one.
pub(super) struct Still {
    size: Size,
    /// L·e, (3, H, W).
    pub(super) phasors: wgpu::Buffer,
    /// The wanted field of the previous frame, (3, H, W).
    pub(super) kept: wgpu::Buffer,
    pub(super) bound: Constants,
}

impl Still {
    pub(super) fn new(device: &Device, size: Size) -> Result<Self> {
        let room = |what| device.buffer(what, 24 * size.pixels());
        Ok(Still {
            size,
            phasors: room("the displayed wave")?,
            kept: room("the wanted field of the frame before")?,
            bound: device.constants("what stands still", bytemuck::cast_slice(&[-1.0f32; 4]))?,
        })
    }

    /// Sets the previous frame of the next submission. No pixel starts from a dark one.
    pub(super) fn set_past(&self, device: &Device, past: Option<Past>) {
        let lit = past.filter(|past| past.scale > 0.0);
        let bound = lit.map_or(-1.0, |past| (STILL * past.scale).powi(2));
        (device.queue).write_buffer(&self.bound.buffer, 0, bytemuck::cast_slice(&[bound; 4]));
    }

    /// Binds the program `source`, which writes the levels of the phasors, to each of `buffers`.
    pub(super) fn arrive(
        &self,
        device: &Device,
        shared: &Shared<'_>,
        source: String,
        buffers: &[LevelsBuffers],
    ) -> Result<Vec<Dispatch>> {
        let program = device.program("levels after the steps", source, "arrive");
        let mut arguments = shared.arguments(&[0, 8]);
        arguments.push((16, self.phasors.as_entire_binding()));
        let grid = [self.size.width.div_ceil(COLUMNS), self.size.height, 1];
        shared.levels_program(device, &program, &arguments, grid, buffers)
    }
}
