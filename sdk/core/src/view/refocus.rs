//! The image for an eye focused at z: |ASM(H, z − offset)|, for one z or a focal stack.
//!
//! A hologram at z = offset is propagated to the plane z, positive toward the viewer. The field of a phase-only
//! hologram passes the Fourier aperture on the way, as its light does.

use crate::Size;
use crate::display::Display;
use crate::display::levels::Levels;
use crate::display::panel::PanelPlan;
use crate::display::response::Response;
use crate::display::target::Target;
use crate::optics::aperture::{Aperture, Opening};
use crate::optics::asm::{self, Padding, Transfer};
use crate::optics::fft::{Fft2, Scratch};
use crate::optics::zernike::Aberration;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use std::f32::consts::TAU;

/// A plan for one shape, display and range of z. It is immutable and can be shared between threads.
pub struct Refocus {
    display: Display,
    fft: Fft2,
    aperture: Option<Opening>,
    reach_m: f64,
}

/// One colour of a hologram in the Fourier domain, from which a field at any z can be computed.
pub struct Spectrum {
    /// (W', H'), with each column contiguous.
    columns: Vec<Complex32>,
    wavelength_m: f64,
}

impl Refocus {
    /// Plans views of a hologram of `size` at `display.offset_m()` from every z of `z_m`, in metres.
    /// `aperture` is the aperture in the Fourier plane. A complex hologram needs none: pass `None`.
    ///
    /// # Errors
    /// Returns an error if `z_m` is empty or [`asm::padded_size`] rejects one of its values.
    pub fn new(size: Size, display: &Display, z_m: &[f64], aperture: Option<Opening>) -> Result<Self> {
        if z_m.is_empty() {
            return Err(Error::Setting("no z to refocus at; give at least one".into()));
        }
        if let Some(z) = z_m.iter().find(|z| !z.is_finite()) {
            return Err(Error::Setting(format!(
                "cannot refocus at z = {z} m; it must be finite"
            )));
        }
        if let Some(opening) = aperture {
            Aperture::new(Size { width: 1, height: 1 }, opening)?;
        }
        let reach_m = z_m.iter().map(|z| (z - display.offset_m()).abs()).fold(0.0, f64::max);
        let (pitch_m, longest_m) = (display.pitch_m(), display.longest_wavelength_m());
        let padded = asm::padded_size(size, pitch_m, longest_m, reach_m, Padding::Reach)?;
        Ok(Refocus {
            display: display.clone(),
            fft: Fft2::new(size, padded),
            aperture,
            reach_m,
        })
    }

    /// Returns working memory for one call at a time.
    pub fn scratch(&self) -> Scratch {
        self.fft.scratch()
    }

    /// Returns the spectrum of `plane`, (H, W), which is one colour of a hologram: 0 red, 1 green, 2 blue, or 0 for one
    /// laser.
    ///
    /// # Panics
    /// Panics if `plane` does not have H·W values or the display does not have the colour.
    pub fn spectrum(&self, plane: &[Complex32], colour: usize, scratch: &mut Scratch) -> Spectrum {
        let size = self.fft.padded_size();
        let mut columns = vec![Complex32::ZERO; size.height * size.width];
        self.fft.rows_forward(plane, &mut scratch.rows, &mut scratch.work);
        self.fft.spectrum(
            &scratch.rows,
            &mut columns,
            |kx, column, _| {
                if let Some(opening) = self.aperture {
                    opening.stop(kx, size, column);
                }
            },
            &mut scratch.work,
        );
        Spectrum {
            columns,
            wavelength_m: self.display.wavelengths_m()[colour],
        }
    }

    /// Writes the field at `z_m`, computed from its spectrum, into `plane`, (H, W).
    ///
    /// # Errors
    /// Returns an error if `z_m` is farther from the hologram than planned.
    ///
    /// # Panics
    /// Panics if `plane` does not have H·W values, or if `spectrum` or `scratch` belongs to another plan.
    pub fn field(&self, spectrum: &Spectrum, z_m: f64, plane: &mut [Complex32], scratch: &mut Scratch) -> Result<()> {
        let distance_m = z_m - self.display.offset_m();
        if distance_m.is_nan() || distance_m.abs() > self.reach_m * (1.0 + 1e-9) {
            return Err(Error::Setting(format!(
                "z = {} mm is {} mm from the hologram; the plan reaches {} mm",
                z_m * 1e3,
                distance_m.abs() * 1e3,
                self.reach_m * 1e3
            )));
        }
        let padded = self.fft.padded_size();
        let transfer = Transfer::new(
            padded,
            self.display.pitch_m(),
            spectrum.wavelength_m,
            distance_m,
            |_, _| true,
        );
        scratch
            .columns
            .par_chunks_exact_mut(padded.height)
            .zip(spectrum.columns.par_chunks_exact(padded.height))
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

    /// Returns the amplitudes |ASM(H, z − offset)| of a whole `hologram`, (C, H, W), for each z: stacks of (C, H, W) in
    /// the order of `z_m`.
    ///
    /// # Errors
    /// Returns the same errors as [`Self::field`].
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

/// Writes the field directly behind a modulator that displays `levels`, (C, H, W): `scale`·exp(iφ) for each level. The
/// Fourier aperture turns it into the field that was encoded at this scale.
///
/// # Panics
/// Panics if the lengths differ or `response` is for another shape.
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

/// Returns the light, (C, H, W), behind the modulator of `target` that displays the `levels` of a hologram of
/// `size`. `scale` is the amplitude that maps to full light. The panel's phases are left out because they compensate
/// the panel's own curvature or rotate all light equally.
///
/// # Errors
/// Returns an error if a table or panel has fewer pixels.
///
/// # Panics
/// Panics if `levels` does not have C·H·W values.
pub fn shown_field(levels: Levels<'_>, scale: f32, target: &Target, size: Size) -> Result<Vec<Complex32>> {
    let mut field = vec![Complex32::ZERO; target.display.colours() * size.height * size.width];
    match levels {
        Levels::Bytes(levels) => {
            let response = target.response.clone().centred(size)?;
            phase_only_field(levels, &response, scale, &mut field);
        }
        Levels::Words(levels) => {
            assert_eq!(levels.len(), field.len());
            let turn = TAU / (1u32 << target.display.bits()) as f32;
            for (value, level) in field.iter_mut().zip(levels) {
                *value = Complex32::from_polar(scale, f32::from(*level) * turn);
            }
        }
    }
    if let Some(panel) = PanelPlan::new(&target.panel, &target.display, size)? {
        panel.remove(&mut field);
    }
    if let Some(light) = &target.illumination {
        light.shine(&mut field, size, target.modulator());
    }
    Ok(field)
}

/// Returns the field at `z_m`, (C, H, W), without the carrier: the field of [`shown_field`] after the optics and
/// aperture of `target`.
///
/// # Errors
/// Returns the same errors as [`shown_field`] and [`Refocus::new`], and an error if a correction moves light farther
/// than can be padded.
///
/// # Panics
/// Panics under the same conditions as [`shown_field`].
pub fn seen_field(levels: Levels<'_>, scale: f32, target: &Target, size: Size, z_m: f64) -> Result<Vec<Complex32>> {
    // Rejects a z that is too far away before a field is allocated.
    let opening = Opening::centred(target.display.aperture_radius());
    let plan = Refocus::new(size, &target.display, &[z_m], Some(opening))?;
    let aberration = target.correction.as_ref().map(Aberration::reversed);
    let optics = target.propagators(size, 1, 0.0, aberration.as_ref())?;
    let mut field = shown_field(levels, scale, target, size)?;
    let mut through = optics.as_ref().map(|optics| optics[0].scratch());
    let mut scratch = plan.scratch();
    for (colour, plane) in field.chunks_exact_mut(size.height * size.width).enumerate() {
        if let (Some(optics), Some(through)) = (&optics, &mut through) {
            optics[colour].propagate(plane, through);
        }
        let spectrum = plan.spectrum(plane, colour, &mut scratch);
        plan.field(&spectrum, z_m, plane, &mut scratch)?;
    }
    Ok(field)
}
