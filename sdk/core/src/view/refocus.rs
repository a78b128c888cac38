//! What an eye focused at z would see: |ASM(H, z − offset)|, for one z or a focal stack.
//!
//! A hologram that stands at z = offset is taken to the plane z, positive toward the viewer. A
//! phase-only hologram passes the Fourier aperture on its way, as its light does.

use crate::display::Display;
use crate::display::panel::PanelPlan;
use crate::display::response::Response;
use crate::display::target::Target;
use crate::optics::aperture::{Aperture, Opening};
use crate::optics::asm::{self, Padding, Transfer};
use crate::optics::fft::{Fft2, Scratch};
use crate::optics::zernike::Aberration;
use crate::output::Levels;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use rayon::prelude::*;
use std::f32::consts::TAU;

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
            return Err(Error::Setting("no z to refocus at; give at least one".into()));
        }
        if let Some(z) = z_m.iter().find(|z| !z.is_finite()) {
            return Err(Error::Setting(format!(
                "cannot refocus at z = {z} m; it must be finite"
            )));
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
            return Err(Error::Setting(format!(
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

/// The light behind the modulator of `target` that shows the `levels` of a hologram of (H, W) = `shape`, full light
/// standing for amplitude `scale`: (C, H, W). What the panel adds is left out: it undoes the panel's own bend, or turns
/// all light alike.
///
/// # Errors
/// A table or a panel for fewer pixels.
///
/// # Panics
/// If `levels` has not C·H·W values.
pub fn shown_field(levels: Levels<'_>, scale: f32, target: &Target, shape: (usize, usize)) -> Result<Vec<Complex32>> {
    let mut field = vec![Complex32::ZERO; target.display.colours() * shape.0 * shape.1];
    match levels {
        Levels::Bytes(levels) => {
            let response = target.response.clone().centred(shape.0, shape.1)?;
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
    if let Some(panel) = PanelPlan::new(&target.panel, &target.display, shape)? {
        panel.remove(&mut field);
    }
    if let Some(light) = &target.illumination {
        light.shine(&mut field, shape, target.modulator());
    }
    Ok(field)
}

/// The field that [`shown_field`] becomes through the optics of `target` and its aperture at `z_m`, without the
/// carrier: (C, H, W).
///
/// # Errors
/// As [`shown_field`] and [`Refocus::new`]; a correction that moves light farther than can be padded.
///
/// # Panics
/// As [`shown_field`].
pub fn seen_field(
    levels: Levels<'_>,
    scale: f32,
    target: &Target,
    shape: (usize, usize),
    z_m: f64,
) -> Result<Vec<Complex32>> {
    // Before there is a field, for a z too far away is refused here.
    let opening = Opening::centred(target.display.aperture_radius());
    let plan = Refocus::new(shape.0, shape.1, &target.display, &[z_m], Some(opening))?;
    let aberration = target.correction.as_ref().map(Aberration::reversed);
    let optics = target.propagators(shape, 1, 0.0, aberration.as_ref())?;
    let mut field = shown_field(levels, scale, target, shape)?;
    let mut through = optics.as_ref().map(|optics| optics[0].scratch());
    let mut scratch = plan.scratch();
    for (colour, plane) in field.chunks_exact_mut(shape.0 * shape.1).enumerate() {
        if let (Some(optics), Some(through)) = (&optics, &mut through) {
            optics[colour].propagate(plane, through);
        }
        let spectrum = plan.spectrum(plane, colour, &mut scratch);
        plan.field(&spectrum, z_m, plane, &mut scratch)?;
    }
    Ok(field)
}
