//! Optics on complex planes: propagation by the angular spectrum method, the aperture in the Fourier plane, and the
//! correction of aberrations in that plane. [`metrics`] compares amplitudes.
//!
//! A plane is a row-major slice of [`num_complex::Complex32`], (H, W). Distances are signed, positive toward the
//! viewer. Every field leaves out the carrier exp(i2πs/λ) (see [`asm`]); [`asm::carrier`] returns it. The module
//! `encode` converts fields to phases.

pub mod aperture;
pub mod asm;
pub mod fft;
pub mod metrics;
pub mod reference;
pub mod sub_hologram;
pub mod zernike;
pub mod zoom;
