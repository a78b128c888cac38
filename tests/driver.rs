//! The GPU that tests need, real or as a software driver. The tests of every crate include this file (`#[path]`).

use std::fmt::Display;
use std::sync::{Arc, OnceLock};

/// Returns the value opened on a GPU. If there is no GPU, the test fails and says what to install.
#[track_caller]
pub(crate) fn opened<T, E: Display>(result: Result<T, E>) -> T {
    result.unwrap_or_else(|why| {
        panic!("{why}: the tests need a GPU with its driver, or a driver in software: apt-get install mesa-vulkan-drivers libvulkan1")
    })
}

/// Two devices for the tests of a program. A software driver compiles the programs of a device on one thread.
#[allow(dead_code)] // Not all programs hold devices.
pub(crate) struct Devices<T>([OnceLock<Arc<T>>; 2]);

#[allow(dead_code)]
impl<T> Devices<T> {
    pub(crate) const fn new() -> Self {
        Devices([const { OnceLock::new() }; 2])
    }

    /// Returns the device that fewer tests hold, or fails as [`opened`] does. A test takes it once and passes it on:
    /// buffers of one device are unknown to the other.
    pub(crate) fn device<E: Display>(&self, open: impl Fn() -> Result<T, E>) -> Arc<T> {
        let [first, second] = &self.0;
        let held = |device: &OnceLock<Arc<T>>| device.get().map_or(0, Arc::strong_count);
        let device = if held(second) < held(first) { second } else { first };
        device.get_or_init(|| Arc::new(opened(open()))).clone()
    }
}

/// Returns a part of the name of the software driver that the tests open: SwiftShader if Vulkan's loader has it alone
/// (`VK_DRIVER_FILES`), else Mesa's llvmpipe.
#[allow(dead_code)] // Some tests take any GPU.
pub(crate) fn software() -> String {
    let files = std::env::var("VK_DRIVER_FILES").unwrap_or_default();
    let name = if files.contains("swiftshader") {
        "SwiftShader"
    } else {
        "llvmpipe"
    };
    name.into()
}
