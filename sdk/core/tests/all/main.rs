//! The tests of this crate in one program, which links once. Those that count memory or threads, or install a handler
//! for the whole process, are programs of their own beside it.
#![allow(clippy::unwrap_used)]

#[path = "../../../../tests/network_models.rs"]
mod network_models;
#[path = "../../../../tests/reference.rs"]
mod reference;

mod encode;
mod network;
mod optics;
mod sweep;
