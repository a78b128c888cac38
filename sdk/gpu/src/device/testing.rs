//! Functions shared by the tests of the stages.
#![allow(clippy::unwrap_used)]

#[path = "../../../../tests/driver.rs"]
mod driver;
#[path = "../../../../tests/skip.rs"]
pub(crate) mod skip;

use super::{Device, DeviceOptions};
pub(crate) use driver::opened;
use num_complex::Complex32;
use std::sync::Arc;

/// Returns a device that other tests may hold too: of a GPU or of a software driver.
pub(crate) fn device() -> Arc<Device> {
    static DEVICES: driver::Devices<Device> = driver::Devices::new();
    DEVICES.device(|| Device::open(&DeviceOptions::default()).or_else(|_| Device::open(&software())))
}

pub(crate) fn software() -> DeviceOptions {
    DeviceOptions {
        name: Some(driver::software()),
        programs: None,
    }
}

pub(crate) fn upload(device: &Device, field: &[Complex32]) -> wgpu::Buffer {
    let buffer = device.buffer("field", size_of_val(field)).unwrap();
    device.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(field));
    buffer
}

pub(crate) fn read(device: &Device, buffer: &wgpu::Buffer, count: usize) -> Vec<Complex32> {
    bytemuck::pod_collect_to_vec(&device.read(buffer, 8 * count).unwrap())
}

pub(crate) fn run(device: &Device, work: impl Fn(&mut wgpu::ComputePass<'_>)) {
    let mut encoder = device.inner.create_command_encoder(&Default::default());
    work(&mut encoder.begin_compute_pass(&Default::default()));
    device.queue.submit([encoder.finish()]);
    device.check().unwrap();
}

/// Creates three planes of a smooth field with noise.
pub(crate) fn field(size: usize) -> Vec<Complex32> {
    (0..3 * size)
        .map(|i| {
            let t = i as f32;
            Complex32::from_polar(0.6 + 0.4 * (t * 0.37).sin(), t * 0.011 + (t * 1.7).cos())
        })
        .collect()
}

/// Returns the largest difference relative to the largest amplitude of `b`.
pub(crate) fn apart(a: &[Complex32], b: &[Complex32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let most = b.iter().map(|v| v.norm()).fold(0.0, f32::max);
    let worst = |worst: f32, d: f32| if d > worst || d.is_nan() { d } else { worst };
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, worst) / most
}
