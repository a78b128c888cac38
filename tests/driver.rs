//! The GPU that tests need, real or as a software driver. The tests of every crate include this file (`#[path]`).

use std::fmt::Display;

/// Returns the value opened on a GPU. If there is no GPU, the test fails and says what to install.
#[track_caller]
pub(crate) fn opened<T, E: Display>(result: Result<T, E>) -> T {
    result.unwrap_or_else(|why| {
        panic!("{why}: the tests need a GPU with its driver, or a driver in software: apt-get install mesa-vulkan-drivers libvulkan1")
    })
}
