//! Tests that need a GPU, or a driver in software, are skipped where neither is there, and say so. Where
//! `PHASEFRONT_REQUIRE_GPU` is set, they fail. In the tests of every crate (`#[path]`).

use std::fmt::Display;

/// What was opened; none, with a line that says why, where the test is to be skipped.
pub(crate) fn or_skip<T, E: Display>(opened: Result<T, E>) -> Option<T> {
    const HINT: &str = "Debian's mesa-vulkan-drivers is a driver in software";
    match opened {
        Ok(opened) => Some(opened),
        Err(why) if std::env::var_os("PHASEFRONT_REQUIRE_GPU").is_some() => {
            panic!("{why} ({HINT}), and PHASEFRONT_REQUIRE_GPU is set")
        }
        Err(why) => {
            println!("skipped: {why} ({HINT})");
            None
        }
    }
}
