//! The CPU implementation of Phasefront, from camera frames to modulator levels.
//!
//! Applications depend on the crate `phasefront`, which has the stable API. This crate is public for the other crates
//! of the workspace (GPU, calibration, laboratory, command) and for its tests. Any release may change its items without
//! notice.
//!
//! # Map
//!
//! Each module depends only on modules above it in this table (`tests/layers.rs`).
//!
//! | | |
//! |---|---|
//! | [`parallel`] | loops on the threads of a pool, or on one thread |
//! | [`runtime`] | errors, cancellation, clock, stages, bounded file reading |
//! | [`optics`] | propagation, Fourier transforms, aperture, aberrations |
//! | [`display`] | the display, its modulator's response, its laser illumination, its correction |
//! | [`frame`] | colour images, depth planes, conversion, resampling |
//! | [`depth`] | units, hole filling, alignment, temporal smoothing, range, conditioning |
//! | [`method`] | from a frame to a complex field: networks, the plane sweep, both combined |
//! | [`focus`] | the focal stack of incoherent light that natural focus aims at |
//! | `depth_network` | depth from colour alone, by a network that the user supplies |
//! | [`encode`] | from a field to phases: double phase, its filters, corrections, brightness |
//! | [`pipeline`] | one frame through all stages |
//! | [`output`] | from levels to modulator images; the catalogue of modulators |
//! | [`view`] | refocused views, previews |

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod depth;
#[cfg(feature = "tract")]
pub mod depth_network;
pub mod display;
pub mod encode;
pub mod focus;
pub mod frame;
pub mod method;
pub mod optics;
pub mod output;
pub mod pipeline;
pub mod runtime;
pub mod view;

pub use phasefront_kernels::{Bounds, Size, parallel};
