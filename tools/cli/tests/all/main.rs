//! The tests of this crate in one program, which links once. Tests that count memory or threads, or install a
//! process-wide handler, are separate programs beside it.
#![allow(clippy::unwrap_used)]

#[path = "../../../../tests/depth_models.rs"]
mod depth_models;
#[path = "../../../../tests/driver.rs"]
mod driver;
#[path = "../../../../tests/folder.rs"]
mod folder;
#[path = "../ldi/mod.rs"]
mod ldi;
#[path = "../../../../tests/reference.rs"]
mod reference;
#[path = "../../../../tests/skip.rs"]
mod skip;

mod archives;
mod calibrate_command;
mod capture;
mod colours;
mod command;
mod depth_files;
mod devices;
mod diagnose;
mod doctor;
mod encode;
mod films;
mod focus;
mod fourier;
mod guides;
mod inputs;
mod kernels;
mod limits;
mod misuse;
mod one_laser;
mod outputs;
mod pattern;
mod phase_maps;
mod photos;
mod recordings;
mod shell;
mod show;
mod stills;
mod video;
mod view;
