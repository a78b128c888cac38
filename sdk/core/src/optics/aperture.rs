//! The circular aperture in the Fourier plane, Eq. 8–9. It passes the first diffraction order and turns a double-phase
//! pattern back into a complex field.

use super::fft::{ConvolveScratch, Fft2};
use crate::Size;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;

/// Returns whether the aperture passes the frequency (`fx`, `fy`), in cycles per pixel: fx² + fy² ≤ (radius/2)².
///
/// A `radius` of 1 reaches the Nyquist frequency ½, the paper's r of half the image resolution. The aperture is a
/// circle in frequency, like a round hole in the Fourier plane, and therefore an ellipse in DFT bins if the frame is
/// not square.
pub fn passes(fx: f64, fy: f64, radius: f64) -> bool {
    fx * fx + fy * fy <= 0.25 * radius * radius
}

/// A round aperture in the Fourier plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Opening {
    /// The radius; 1 reaches the Nyquist frequency.
    pub radius: f64,
    /// The shift of its centre from the optical axis along x, as a share of the Nyquist frequency; 0 if the aperture is
    /// adjusted.
    pub shift: f64,
}

impl Opening {
    /// Creates an aperture of `radius` on the axis.
    pub fn centred(radius: f64) -> Self {
        Opening { radius, shift: 0.0 }
    }

    /// Zeroes the blocked frequencies of column `kx` of a spectrum of that size that is stored column by
    /// column.
    pub(crate) fn stop(self, kx: usize, Size { width, height }: Size, column: &mut [Complex32]) {
        let signed = if 2 * kx > width {
            kx as f64 - width as f64
        } else {
            kx as f64
        };
        let fx = signed / width as f64 - 0.5 * self.shift;
        // The passing rows are those up to one frequency.
        let passing = (0..=height / 2).take_while(|ky| passes(fx, *ky as f64 / height as f64, self.radius));
        let passing = passing.count();
        let negative = (height + 1 - passing).clamp(passing, height);
        column[passing..negative].fill(Complex32::ZERO);
    }

    fn check(self) -> Result<()> {
        if self.radius > 0.0 && self.radius.is_finite() && self.shift.is_finite() {
            return Ok(());
        }
        Err(Error::Setting(format!(
            "an aperture of radius {} shifted by {} passes nothing; the radius must be above 0 (1 is the whole first order)",
            self.radius, self.shift
        )))
    }
}

/// A plan for one shape and opening. It is immutable and can be shared between threads.
pub struct Aperture {
    fft: Fft2,
    opening: Opening,
}

impl Aperture {
    /// Plans the filtering of planes of `size`, periodic as in Eq. 8, by `opening`.
    ///
    /// # Errors
    /// Returns an error if the radius is not positive or the plane is empty.
    pub fn new(size: Size, opening: Opening) -> Result<Self> {
        let Size { width, height } = size;
        opening.check()?;
        if height == 0 || width == 0 {
            return Err(Error::Setting(format!(
                "a plane of {width}×{height} is empty; each side must be at least 1"
            )));
        }
        Ok(Aperture {
            fft: Fft2::new(size, size),
            opening,
        })
    }

    /// Allocates working memory for one call at a time.
    pub fn scratch(&self) -> ConvolveScratch {
        self.fft.convolve_scratch()
    }

    /// Replaces `plane`, (H, W), by F⁻¹(F(plane)·M). Does not allocate.
    ///
    /// # Panics
    /// Panics if `plane` does not have H·W values or `scratch` belongs to another plan.
    pub fn filter(&self, plane: &mut [Complex32], scratch: &mut ConvolveScratch) {
        let size = self.fft.padded_size();
        let scale = 1.0 / (size.height * size.width) as f32;
        self.fft.convolve(
            plane,
            |kx, column| {
                self.opening.stop(kx, size, column);
                column.iter_mut().for_each(|value| *value *= scale);
            },
            scratch,
        );
    }
}
