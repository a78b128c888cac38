//! Helpers for sessions on any available GPU, including a software driver.

#[path = "../../../tests/driver.rs"]
mod driver;

use phasefront::SessionOptions;
use phasefront::session::Backend;
use phasefront_gpu::{Device, DeviceOptions};

/// Returns `options` for the tests on the GPU.
pub(crate) fn on_gpu(options: SessionOptions) -> SessionOptions {
    let open = |name| {
        let device = DeviceOptions { name, programs: None };
        Device::open(&device).map(|_| device)
    };
    let device = driver::opened(open(None).or_else(|_| open(Some(driver::software()))));
    let mut options = options;
    options.backend = Backend::Gpu;
    options.gpu.device = device;
    options
}
