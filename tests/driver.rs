//! What the tests of the GPU need: a GPU, or a driver in software. In the tests of every crate (`#[path]`).

use std::fmt::Display;

/// What was opened on a GPU. The test fails where there is none, and says what to install.
#[track_caller]
pub(crate) fn opened<T, E: Display>(result: Result<T, E>) -> T {
    result.unwrap_or_else(|why| {
        panic!("{why}: the tests need a GPU with its driver, or a driver in software: apt-get install mesa-vulkan-drivers libvulkan1")
    })
}
