//! The circular aperture in the Fourier plane, Eq. 8–9: it lets the first diffraction order pass
//! and turns a double-phase pattern back into a complex field.

use super::fft::{ConvolveScratch, Fft2};
use crate::error::{Error, Result};
use num_complex::Complex32;

/// The radius of the aperture that holograms are made for and looked at through: the whole first order, as in the
/// paper.
pub const RADIUS: f64 = 1.0;

/// Whether the aperture passes the frequency (`fx`, `fy`), in cycles a pixel: fx² + fy² ≤ (radius/2)².
///
/// `radius` 1 reaches the Nyquist frequency ½, which is the paper's r of half the image
/// resolution. The circle is round in frequency, so for a frame that is not square it is an
/// ellipse in DFT bins, as a round hole in the Fourier plane is.
pub fn passes(fx: f64, fy: f64, radius: f64) -> bool {
    fx * fx + fy * fy <= 0.25 * radius * radius
}

/// A plan for one shape and radius. Immutable; shared between threads.
pub struct Aperture {
    fft: Fft2,
    radius: f64,
}

impl Aperture {
    /// Plans the filtering of (`height`, `width`) planes, periodic as in Eq. 8, by an aperture of
    /// `radius` (1: the whole first order).
    ///
    /// # Errors
    /// A radius that is not positive, or an empty plane.
    pub fn new(height: usize, width: usize, radius: f64) -> Result<Self> {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::Plan(format!(
                "an aperture of radius {radius} passes nothing; it must be above 0 (1 is the whole first order)"
            )));
        }
        if height == 0 || width == 0 {
            return Err(Error::Plan(format!(
                "a plane of {width}×{height} is empty; each side must be at least 1"
            )));
        }
        Ok(Aperture {
            fft: Fft2::new(height, width, height, width),
            radius,
        })
    }

    /// Working memory for one call at a time.
    pub fn scratch(&self) -> ConvolveScratch {
        self.fft.convolve_scratch()
    }

    /// Replaces `plane`, (H, W), by F⁻¹(F(plane)·M). Allocates nothing.
    ///
    /// # Panics
    /// If `plane` has not H·W values or `scratch` is another plan's.
    pub fn filter(&self, plane: &mut [Complex32], scratch: &mut ConvolveScratch) {
        let (height, width) = self.fft.padded_shape();
        let scale = 1.0 / (height * width) as f32;
        self.fft.convolve(
            plane,
            |kx, column| {
                let fx = kx.min(width - kx) as f64 / width as f64;
                for (ky, value) in column.iter_mut().enumerate() {
                    let fy = ky.min(height - ky) as f64 / height as f64;
                    *value *= if passes(fx, fy, self.radius) { scale } else { 0.0 };
                }
            },
            scratch,
        );
    }
}
