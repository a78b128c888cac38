//! Computes the scale of a frame with smoothed brightness on the GPU. The counterpart of `brightness.rs` in the core.

use super::Result;
use super::device::{Constants, Device, Dispatch};
use phasefront_core::encode::brightness::{BINS, LEAST, MOST, STEP, looked_at, share};
use phasefront_core::frame::Past;

/// The threads of a workgroup, as in the program.
const THREADS: usize = 256;
/// The largest number of workgroups that count.
const MOST_GROUPS: usize = 1024;

/// Computes the scale of (3, H, W) fields in one buffer.
pub(super) struct Smoother {
    past: Constants,
    bins: wgpu::Buffer,
    steps: [Dispatch; 2],
}

impl Smoother {
    /// Plans the stage. It writes the bits of the scale's square to `found`, one u32.
    pub(super) fn new(device: &Device, field: &wgpu::Buffer, len: usize, found: &wgpu::Buffer) -> Result<Self> {
        let (count, over) = looked_at(len);
        let groups = count.div_ceil(THREADS).min(MOST_GROUPS);
        let source = format!(
            "const COUNT: u32 = {count}u;
            const OVER: u32 = {over}u;
            const GROUPS: u32 = {groups}u;
            const STEP: u32 = {STEP}u;
            const BINS: u32 = {BINS}u;
            const MOST: f32 = {MOST:?};
            const LEAST: f32 = {LEAST:?};
            "
        ) + include_str!("brightness.wgsl");
        let past = device.constants("the past", bytemuck::cast_slice(&alone()))?;
        let bins = device.buffer("a histogram", 4 * BINS)?;
        let counted = [(1, field.as_entire_binding()), (2, bins.as_entire_binding())];
        let settled = [
            (0, past.buffer.as_entire_binding()),
            (3, bins.as_entire_binding()),
            (4, found.as_entire_binding()),
        ];
        let steps = [
            device
                .program("a histogram", source.clone(), "count")
                .on(device, &counted, [groups, 1, 1])?,
            device
                .program("the scale", source, "settle")
                .on(device, &settled, [1, 1, 1])?,
        ];
        Ok(Smoother { past, bins, steps })
    }

    /// Sets the previous scale for the next submitted frame.
    pub(super) fn set_past(&self, device: &Device, past: Option<Past>) {
        let words = past.map_or(alone(), |past| [past.scale, share(past), 0.0, 0.0]);
        device
            .queue
            .write_buffer(&self.past.buffer, 0, bytemuck::cast_slice(&words));
    }

    /// Clears the histogram. Must be called before the pass of each frame.
    pub(super) fn reset(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.bins, 0, None);
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.steps.iter().for_each(|step| step.run(pass));
    }
}

/// Returns the past of a frame without a predecessor: a full step from 0 to the frame's own percentile.
fn alone() -> [f32; 4] {
    [0.0, 1.0, 0.0, 0.0]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::testing::{device, field, run, upload};
    use super::*;
    use num_complex::Complex32;
    use phasefront_core::encode::brightness::Percentile;

    #[test]
    fn the_scale_is_that_of_the_cpu() {
        let device = device();
        let bright = |value: &mut Complex32| *value *= 9.0;
        for size in [1, 61 * 47, 384 * 384, 960 * 540] {
            for (factor, spikes) in [(1.0, 0), (0.01, 0), (0.7, 3), (0.7, size / 5), (9.0, 0)] {
                let mut given = field(size);
                given.iter_mut().for_each(|value| *value *= factor);
                given.iter_mut().step_by(STEP).take(spikes).for_each(bright);
                let buffer = upload(&device, &given);
                let found = device.buffer("the scale", 4).unwrap();
                let smoother = device
                    .guarded(|| Smoother::new(&device, &buffer, given.len(), &found))
                    .unwrap();
                for past in [
                    None,
                    Some(Past {
                        scale: 0.5,
                        elapsed: std::time::Duration::from_millis(30),
                    }),
                ] {
                    smoother.set_past(&device, past);
                    let mut encoder = device.inner.create_command_encoder(&Default::default());
                    smoother.reset(&mut encoder);
                    device.queue.submit([encoder.finish()]);
                    run(&device, |pass| smoother.run(pass));
                    let bytes = device.read(&found, 4).unwrap();
                    let square = f32::from_le_bytes(bytes.try_into().unwrap());
                    let expected = Percentile::default().scale(&given, past);
                    // A value on the bound between two bins may be counted in either.
                    let bin = MOST / BINS as f32 * past.map_or(1.0, share);
                    let apart = (square.sqrt() - expected).abs();
                    assert!(
                        apart < 1.01 * bin,
                        "{size} {factor} {spikes} {past:?}: {} {expected}",
                        square.sqrt()
                    );
                }
            }
        }
    }
}
