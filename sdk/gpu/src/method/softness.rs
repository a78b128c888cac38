//! Measures whether the edges of a frame's depth are soft: the counterpart of [`phasefront_core::depth::softness`].

use crate::Result;
use crate::device::{Device, Dispatch, copy_mapped};
use phasefront_core::Size;
use phasefront_core::depth::softness::{self, EDGE, LINES, ONE_STEP};

/// The columns of a workgroup.
const COLUMNS: usize = 64;

/// The measure for one frame size.
pub(crate) struct Softness {
    step: Dispatch,
    /// The number of sharp edges and of all edges.
    counts: wgpu::Buffer,
    readable: wgpu::Buffer,
}

impl Softness {
    /// Plans the measure of the depth in `surfaces`, (H, W) of red, green, blue and depth.
    pub(crate) fn new(device: &Device, surfaces: &wgpu::Buffer, size: Size) -> Result<Self> {
        let Size { width, height } = size;
        let (window, every) = softness::scale(size);
        let header = format!(
            "const HEIGHT: u32 = {height}u;
            const WIDTH: u32 = {width}u;
            const WINDOW: u32 = {window}u;
            const EVERY: u32 = {every}u;
            const LINES: u32 = {LINES}u;
            const EDGE: f32 = {EDGE:?};
            const ONE_STEP: f32 = {ONE_STEP:?};
            "
        );
        let program = device.program("softness", header + include_str!("softness.wgsl"), "measure");
        let counts = device.buffer("edges", 8)?;
        let arguments = [(0, surfaces.as_entire_binding()), (1, counts.as_entire_binding())];
        Ok(Softness {
            step: program.on(device, &arguments, [width.div_ceil(COLUMNS), height, 1])?,
            counts,
            readable: device.readable("edges", 8),
        })
    }

    /// Forgets the edges of the previous frame. Must be called before the pass of each frame.
    pub(crate) fn reset(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.counts, 0, None);
    }

    pub(crate) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.step.run(pass);
    }

    /// Copies the result after the pass, for [`Self::sharp_edges`].
    pub(crate) fn copy(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_buffer_to_buffer(&self.counts, 0, &self.readable, 0, 8);
    }

    /// Waits for `submission` and returns the share of the edges that are sharp.
    pub(crate) async fn sharp_edges(&self, device: &Device, submission: &wgpu::SubmissionIndex) -> Result<f32> {
        device.map(&self.readable, submission).await?;
        let mut counts = [0; 2];
        copy_mapped(&self.readable, bytemuck::cast_slice_mut(&mut counts))?;
        self.readable.unmap();
        Ok(softness::share(counts[0], counts[1]))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::device::testing::device;
    use ndarray::{Array2, Array3};
    use phasefront_core::frame::RgbdFrame;
    use pollster::block_on;

    #[test]
    fn edges_are_those_of_the_cpu() {
        let device = device();
        // The last size measures every second line.
        for (height, width) in [(1, 1), (30, 70), (120, 97), (333, 250), (640, 1001)] {
            let ramp = |at: usize, from: usize, over: usize| ((at as f32 - from as f32) / over as f32).clamp(0.0, 1.0);
            // Sharp and soft edges along rows and columns, a slope, and a crease.
            let depth = Array2::from_shape_fn((height, width), |(y, x)| match (5 * y / height, 3 * x / width) {
                (0, _) => 0.2 + 0.5 * f32::from(x > width / 2),
                (1, _) => 0.9 - 0.6 * ramp(x, width / 3, 17),
                (2, 0) => 1.2 * x as f32 / width as f32,
                (2, _) => 0.3 + 0.3 * x as f32 / width as f32,
                (_, 1) => 0.1 + 0.7 * ramp(y, 4 * height / 5, 9),
                _ => 0.3,
            });
            let surfaces: Vec<[f32; 4]> = depth.iter().map(|d| [0.5, 0.5, 0.5, *d]).collect();
            let rgb = Array3::from_elem((3, height, width), 0.5);
            let expected = softness::sharp_edges(&RgbdFrame::new(rgb, depth).unwrap());
            let buffer = device.buffer("surfaces", 16 * height * width).unwrap();
            let plan = (device.guarded(|| Softness::new(&device, &buffer, Size { width, height }))).unwrap();
            device.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&surfaces));
            // The counts of one frame must not add to the next one's.
            for _ in 0..2 {
                let mut encoder = device.inner.create_command_encoder(&Default::default());
                plan.reset(&mut encoder);
                plan.run(&mut encoder.begin_compute_pass(&Default::default()));
                plan.copy(&mut encoder);
                let submission = device.queue.submit([encoder.finish()]);
                let share = block_on(plan.sharp_edges(&device, &submission)).unwrap();
                assert!((share - expected).abs() < 0.01, "{height}×{width}: {share} {expected}");
            }
            assert!(height < 100 || (0.1..0.95).contains(&expected), "{expected}");
        }
    }
}
