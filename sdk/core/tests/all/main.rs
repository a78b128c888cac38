//! The tests of this crate in one program, which links only once. Tests that count memory or threads, or install a
//! handler for the whole process, are separate programs.
#![allow(clippy::unwrap_used)]

#[path = "../../../../tests/network_models.rs"]
mod network_models;
#[path = "../../../../tests/reference.rs"]
mod reference;

mod encode;
mod lens;
mod natural;
mod network;
mod optics;
mod own_networks;
mod sweep;
