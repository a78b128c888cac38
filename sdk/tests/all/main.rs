//! Collects the tests of this crate in one program, which links only once. Tests that count memory or threads, or
//! install a handler for the whole process, are separate programs.
#![allow(clippy::unwrap_used)]

#[path = "../camera/mod.rs"]
mod camera;
#[cfg(feature = "tract")]
#[path = "../../../tests/depth_models.rs"]
mod depth_models;
#[path = "../../../tests/network_models.rs"]
mod network_models;
#[path = "../on_gpu/mod.rs"]
mod on_gpu;

mod camera_formats;
mod colours;
mod debug;
#[cfg(feature = "tract")]
mod depth_network;
mod determinism;
mod enlarged;
mod field;
#[cfg(feature = "gpu")]
mod gpu_session;
mod one_colour;
mod session;
mod session_layers;
mod standing;
