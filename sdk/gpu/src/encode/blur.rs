//! Applies a Gaussian in two dispatches, for blurs too wide for the double-phase dispatch.

use super::COLUMNS;
use crate::Result;
use crate::device::{Constants, Device, Dispatch};
use phasefront_core::Size;

/// A Gaussian on fields of one size.
pub(super) struct Blur<'a> {
    pub(super) device: &'a Device,
    /// The width, the height and the plane size.
    pub(super) frame: &'a Constants,
    /// The centre tap and the taps on one side.
    pub(super) taps: &'a [f32],
    pub(super) size: Size,
}

impl Blur<'_> {
    /// Blurs along x, removing the mean phase if `turn` is given, and then along y back into `field`.
    pub(super) fn steps(&self, field: &wgpu::Buffer, turn: Option<&wgpu::Buffer>) -> Result<[Dispatch; 2]> {
        let Size { width, height } = self.size;
        let room = (self.device).buffer("the blurred field", 24 * height * width)?;
        Ok([
            self.step((1, 0), field, &room, turn)?,
            self.step((0, 1), &room, field, None)?,
        ])
    }

    fn step(
        &self,
        along: (i32, i32),
        from: &wgpu::Buffer,
        to: &wgpu::Buffer,
        turn: Option<&wgpu::Buffer>,
    ) -> Result<Dispatch> {
        let device = self.device;
        let mut taps = self.taps.to_vec();
        taps.resize(32, 0.0);
        let taps = device.constants("taps", bytemuck::cast_slice(&taps))?;
        let header = format!(
            "const HALF: i32 = {};\nconst TURN: bool = {};\nconst ALONG: vec2i = vec2i({}, {});\n",
            self.taps.len() - 1,
            turn.is_some(),
            along.0,
            along.1
        );
        let program = device.program("blur", header + include_str!("blur.wgsl"), "blur");
        let arguments = [
            (0, self.frame.buffer.as_entire_binding()),
            (1, taps.buffer.as_entire_binding()),
            (2, from.as_entire_binding()),
            (3, to.as_entire_binding()),
            (4, turn.unwrap_or(from).as_entire_binding()),
        ];
        program.on(
            device,
            &arguments,
            [self.size.width.div_ceil(COLUMNS), self.size.height, 3],
        )
    }
}
