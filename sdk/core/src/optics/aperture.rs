//! The circular aperture in the Fourier plane, Eq. 8–9: it lets the first diffraction order pass
//! and turns a double-phase pattern back into a complex field.

use super::fft::{ConvolveScratch, Fft2};
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;

/// Whether the aperture passes the frequency (`fx`, `fy`), in cycles a pixel: fx² + fy² ≤ (radius/2)².
///
/// `radius` 1 reaches the Nyquist frequency ½, which is the paper's r of half the image
/// resolution. The circle is round in frequency, so for a frame that is not square it is an
/// ellipse in DFT bins, as a round hole in the Fourier plane is.
pub fn passes(fx: f64, fy: f64, radius: f64) -> bool {
    fx * fx + fy * fy <= 0.25 * radius * radius
}

/// A round hole in the Fourier plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Opening {
    /// 1 reaches the Nyquist frequency.
    pub radius: f64,
    /// How far its centre lies beside the optical axis along x, of the Nyquist frequency; 0 for one that is adjusted.
    pub shift: f64,
}

impl Opening {
    /// One of `radius` on the axis.
    pub fn centred(radius: f64) -> Self {
        Opening { radius, shift: 0.0 }
    }

    /// What passes it of column `kx` of a spectrum of (H', W') = `shape` that is stored column by column.
    pub(crate) fn stop(self, kx: usize, (height, width): (usize, usize), column: &mut [Complex32]) {
        let signed = if 2 * kx > width {
            kx as f64 - width as f64
        } else {
            kx as f64
        };
        let fx = signed / width as f64 - 0.5 * self.shift;
        // Rows pass up to one frequency.
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

/// A plan for one shape and opening. Immutable; shared between threads.
pub struct Aperture {
    fft: Fft2,
    opening: Opening,
}

impl Aperture {
    /// Plans the filtering of (`height`, `width`) planes, periodic as in Eq. 8, by `opening`.
    ///
    /// # Errors
    /// A radius that is not positive, or an empty plane.
    pub fn new(height: usize, width: usize, opening: Opening) -> Result<Self> {
        opening.check()?;
        if height == 0 || width == 0 {
            return Err(Error::Setting(format!(
                "a plane of {width}×{height} is empty; each side must be at least 1"
            )));
        }
        Ok(Aperture {
            fft: Fft2::new(height, width, height, width),
            opening,
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
        let shape = self.fft.padded_shape();
        let scale = 1.0 / (shape.0 * shape.1) as f32;
        self.fft.convolve(
            plane,
            |kx, column| {
                self.opening.stop(kx, shape, column);
                column.iter_mut().for_each(|value| *value *= scale);
            },
            scratch,
        );
    }
}
