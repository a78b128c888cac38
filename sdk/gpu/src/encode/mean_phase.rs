//! Finds the mean phase of a network's field on the GPU. The counterpart of
//! [`phasefront_core::method::mean_phase::remove_mean_phase`].

use crate::Result;
use crate::device::{Device, Dispatch};

/// Finds the mean phase of a field from the sums of the workgroups that computed it, as three complex f32: the factors
/// that remove the mean phase of each colour.
pub(crate) struct MeanPhase(Dispatch);

impl MeanPhase {
    /// Plans the stage for the sums of `parts` workgroups. It writes to `turn`, 24 bytes.
    pub(crate) fn new(device: &Device, partial: &wgpu::Buffer, parts: usize, turn: wgpu::Buffer) -> Result<Self> {
        let parts = device.constants("parts", bytemuck::cast_slice(&[parts as u32, 0, 0, 0]))?;
        let program = device.program("the mean phase", include_str!("mean_phase.wgsl").into(), "find");
        let arguments = [
            (0, parts.buffer.as_entire_binding()),
            (1, partial.as_entire_binding()),
            (2, turn.as_entire_binding()),
        ];
        Ok(MeanPhase(program.on(device, &arguments, [1, 1, 1])?))
    }

    pub(crate) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.0.run(pass);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::device::testing::{apart, device, field, read, run, upload};
    use num_complex::Complex32;
    use phasefront_core::method::mean_phase::remove_mean_phase;

    #[test]
    fn the_mean_phase_is_that_of_the_cpu() {
        let device = device();
        // Sums of parts, as the last layer writes them.
        for parts in [1, 7, 1000] {
            let mut sums = field(parts);
            let partial: Vec<Complex32> = (0..3 * parts).map(|i| sums[i % 3 * parts + i / 3]).collect();
            let buffer = upload(&device, &partial);
            let turn = device.buffer("the mean phase", 24).unwrap();
            let mean = (device.guarded(|| MeanPhase::new(&device, &buffer, parts, turn.clone()))).unwrap();
            run(&device, |pass| mean.run(pass));
            let turn = read(&device, &turn, 3);
            let expected: Vec<Complex32> = sums
                .chunks_exact(parts)
                .map(|plane| {
                    let sum: Complex32 = plane.iter().sum();
                    Complex32::from_polar(1.0, -sum.arg())
                })
                .collect();
            assert!(apart(&turn, &expected) < 1e-4, "{turn:?} {expected:?}");
            remove_mean_phase(&mut sums, 3);
        }
        // A dark field has no phase and is left unchanged.
        let buffer = upload(&device, &[Complex32::ZERO; 3]);
        let turn = device.buffer("the mean phase", 24).unwrap();
        let mean = (device.guarded(|| MeanPhase::new(&device, &buffer, 1, turn.clone()))).unwrap();
        run(&device, |pass| mean.run(pass));
        assert_eq!(read(&device, &turn, 3), [Complex32::ONE; 3]);
    }
}
