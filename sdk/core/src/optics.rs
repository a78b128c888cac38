//! The optics on complex planes: propagation by the angular spectrum method, the aperture in the
//! Fourier plane, and the correction of aberrations there.
//!
//! A plane is a row-major slice of [`num_complex::Complex32`], (H, W). Distances are signed,
//! positive toward the viewer. The carrier exp(i2πs/λ) is left out of every field (see
//! [`asm`]); [`asm::carrier`] gives it back. Turning a field into phases is `encode`'s work.

pub mod aperture;
pub mod asm;
pub mod fft;
pub mod reference;
pub mod sub_hologram;
pub mod zernike;
