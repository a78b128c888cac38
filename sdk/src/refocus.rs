//! What an eye focused at z would see: |ASM(H, z − offset)|, for one z or a focal stack.
//!
//! A hologram that stands at z = offset is taken to the plane z, positive toward the viewer. A
//! phase-only hologram passes the Fourier aperture on its way, as its light does.

use crate::display::Display;
use crate::error::{Error, Result};
use crate::slm::Response;
use crate::wave::aperture::{Aperture, Opening};
use crate::wave::asm::{self, Padding, Transfer};
use crate::wave::fft::{Fft2, Scratch};
use num_complex::Complex32;
use rayon::prelude::*;

/// A plan for one shape, display and range of z. Immutable; shared between threads.
pub struct Refocus {
    display: Display,
    fft: Fft2,
    aperture: Option<Opening>,
    reach_m: f64,
}

/// One colour of a hologram in the Fourier domain, ready to be looked at from any z.
pub struct Spectrum {
    /// (W', H'), each column contiguous.
    columns: Vec<Complex32>,
    wavelength_m: f64,
}

impl Refocus {
    /// Plans views of a (`height`, `width`) hologram that stands at `display.offset_m()`, from every z
    /// of `z_m`, metres. `aperture` is the one in the Fourier plane, `None` for a complex hologram,
    /// which needs none.
    ///
    /// # Errors
    /// No z, or one that [`asm::padded_shape`] refuses.
    pub fn new(height: usize, width: usize, display: &Display, z_m: &[f64], aperture: Option<Opening>) -> Result<Self> {
        if z_m.is_empty() {
            return Err(Error::Plan("no z to refocus at; give at least one".into()));
        }
        if let Some(z) = z_m.iter().find(|z| !z.is_finite()) {
            return Err(Error::Plan(format!("cannot refocus at z = {z} m; it must be finite")));
        }
        if let Some(opening) = aperture {
            Aperture::new(1, 1, opening)?;
        }
        let reach_m = z_m.iter().map(|z| (z - display.offset_m()).abs()).fold(0.0, f64::max);
        let (pitch_m, longest_m) = (display.pitch_m(), display.longest_wavelength_m());
        let padded = asm::padded_shape(height, width, pitch_m, longest_m, reach_m, Padding::Reach)?;
        Ok(Refocus {
            display: display.clone(),
            fft: Fft2::new(height, width, padded.0, padded.1),
            aperture,
            reach_m,
        })
    }

    /// Working memory for one call at a time.
    pub fn scratch(&self) -> Scratch {
        self.fft.scratch()
    }

    /// The spectrum of `plane`, (H, W), one colour (0 red, 1 green, 2 blue, or 0 of one laser) of a hologram.
    ///
    /// # Panics
    /// If `plane` has not H·W values or the display has no such colour.
    pub fn spectrum(&self, plane: &[Complex32], colour: usize, scratch: &mut Scratch) -> Spectrum {
        let shape = self.fft.padded_shape();
        let mut columns = vec![Complex32::ZERO; shape.0 * shape.1];
        self.fft.rows_forward(plane, &mut scratch.rows, &mut scratch.work);
        self.fft.spectrum(
            &scratch.rows,
            &mut columns,
            |kx, column, _| {
                if let Some(opening) = self.aperture {
                    opening.stop(kx, shape, column);
                }
            },
            &mut scratch.work,
        );
        Spectrum {
            columns,
            wavelength_m: self.display.wavelengths_m()[colour],
        }
    }

    /// The field at `z_m` from its spectrum, into `plane`, (H, W).
    ///
    /// # Errors
    /// A z farther from the hologram than those planned for.
    ///
    /// # Panics
    /// If `plane` has not H·W values or `spectrum` or `scratch` is another plan's.
    pub fn field(&self, spectrum: &Spectrum, z_m: f64, plane: &mut [Complex32], scratch: &mut Scratch) -> Result<()> {
        let distance_m = z_m - self.display.offset_m();
        if distance_m.is_nan() || distance_m.abs() > self.reach_m * (1.0 + 1e-9) {
            return Err(Error::Plan(format!(
                "z = {} mm is {} mm from the hologram; the plan reaches {} mm",
                z_m * 1e3,
                distance_m.abs() * 1e3,
                self.reach_m * 1e3
            )));
        }
        let (padded_height, padded_width) = self.fft.padded_shape();
        let transfer = Transfer::new(
            (padded_height, padded_width),
            self.display.pitch_m(),
            spectrum.wavelength_m,
            distance_m,
            |_, _| true,
        );
        scratch
            .columns
            .par_chunks_exact_mut(padded_height)
            .zip(spectrum.columns.par_chunks_exact(padded_height))
            .for_each(|(to, from)| to.copy_from_slice(from));
        self.fft.columns_inverse(
            &mut scratch.columns,
            |x, column| transfer.apply(x, column),
            &mut scratch.work,
        );
        self.fft
            .rows_inverse(&scratch.columns, &mut scratch.rows, &mut scratch.work);
        self.fft.crop(&scratch.rows, plane);
        Ok(())
    }

    /// The amplitudes |ASM(H, z − offset)| of a whole `hologram`, (C, H, W), for each z: stacks of
    /// (C, H, W), in the order of `z_m`.
    ///
    /// # Errors
    /// As [`Self::field`].
    pub fn focal_stack(&self, hologram: &[Complex32], z_m: &[f64]) -> Result<Vec<Vec<f32>>> {
        let colours = self.display.colours();
        let size = hologram.len() / colours;
        let mut scratch = self.scratch();
        let mut plane = vec![Complex32::ZERO; size];
        let mut stack = vec![vec![0.0; colours * size]; z_m.len()];
        for (colour, source) in hologram.chunks_exact(size).enumerate() {
            let spectrum = self.spectrum(source, colour, &mut scratch);
            for (view, &z) in stack.iter_mut().zip(z_m) {
                self.field(&spectrum, z, &mut plane, &mut scratch)?;
                for (amplitude, value) in view[colour * size..].iter_mut().zip(&plane) {
                    *amplitude = value.norm();
                }
            }
        }
        Ok(stack)
    }
}

/// The field right behind a modulator that shows `levels`, (C, H, W): `scale`·exp(iφ) for each. Through the
/// Fourier aperture it becomes the field that was encoded at that scale.
///
/// # Panics
/// If the lengths differ, or `response` is made for another shape.
pub fn phase_only_field(levels: &[u8], response: &Response, scale: f32, field: &mut [Complex32]) {
    assert_eq!(levels.len(), field.len());
    if let Response::PerPixel(table) = response {
        let pairs = field.par_iter_mut().zip(levels).enumerate();
        pairs.for_each(|(at, (value, level))| {
            *value = Complex32::from_polar(scale, table.phase(*level, at));
        });
        return;
    }
    let shown: [Complex32; 256] = std::array::from_fn(|l| Complex32::from_polar(scale, response.phase(l as u8, 0)));
    for (value, level) in field.iter_mut().zip(levels) {
        *value = shown[*level as usize];
    }
}
