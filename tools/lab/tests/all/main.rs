//! The tests of this crate in one program, which links once. Tests that count memory or threads, or install a
//! process-wide handler, are separate programs beside it.
#![allow(clippy::unwrap_used)]

#[path = "../../../../tests/driver.rs"]
mod driver;
#[path = "../../../../tests/folder.rs"]
mod folder;
#[path = "../../../../tests/reference.rs"]
mod reference;
#[path = "../../../../tests/skip.rs"]
mod skip;

mod command;
mod corrected;
mod enlarged;
mod evaluate;
mod models;
mod networks;
mod occlusion;
mod peel;
mod point_based;
mod seeds;
mod sensor;
mod sm_lbm;
mod study;
mod sweep;
