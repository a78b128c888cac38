//! The GPU that tests need, real or as a software driver. The tests of every crate include this file (`#[path]`).

use std::fmt::Display;

/// Returns the value opened on a GPU. If there is no GPU, the test fails and says what to install.
#[track_caller]
pub(crate) fn opened<T, E: Display>(result: Result<T, E>) -> T {
    result.unwrap_or_else(|why| {
        panic!("{why}: the tests need a GPU with its driver, or a driver in software: apt-get install mesa-vulkan-drivers libvulkan1")
    })
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
