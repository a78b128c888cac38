//! The implementation of Phasefront on the CPU: everything between a camera's frame and a modulator's levels.
//!
//! Applications depend on the crate `phasefront`, which has the stable API. This crate is public for the other crates
//! of the workspace (GPU, calibration, laboratory, command) and its tests: its items change without notice, in any
//! release.
//!
//! # Map
//!
//! Modules depend on modules above them in this table only (`tests/layers.rs`).
//!
//! | | |
//! |---|---|
//! | [`runtime`] | errors, cancelling, clock, stages, bounded files |
//! | [`optics`] | propagation, Fourier transforms, aperture, aberrations |
//! | [`display`] | the display, its modulator's response, its lasers' light, its correction |
//! | [`frame`] | colour and depth images of cameras, conversion, resampling |
//! | [`depth`] | units, holes, alignment, temporal smoothing, range, refinement |
//! | [`method`] | from a frame to a complex field: networks, the plane sweep, both |
//! | [`encode`] | from a field to phases: double phase, its filters, corrections, brightness |
//! | [`pipeline`] | one frame through all stages |
//! | [`output`] | levels to the images that a modulator takes; the catalogue of modulators |
//! | [`view`] | refocused views, previews |

pub mod depth;
pub mod display;
pub mod encode;
pub mod frame;
pub mod method;
pub mod optics;
pub mod output;
pub mod pipeline;
pub mod runtime;
pub mod view;
