//! Views of hologram files: the amplitudes that an eye focused at z would see.

use crate::display::DisplayFile;
use crate::display::calibration::AberrationFile;
use crate::hologram::{Hologram, HologramInfo};
use crate::{Error, Result};
use ndarray::{Array3, Axis};
use num_complex::Complex32;
use phasefront::Display;
use phasefront::Size;
use phasefront::target::Aberration;
use phasefront_core::display::lens::{Lens, LensPlan};
use phasefront_core::optics::aperture::Opening;
use phasefront_core::optics::asm::Propagator;
use phasefront_core::view::refocus::{Refocus, shown_field};

/// Propagation through optics whose aberration is the same for all depths, for holograms of one shape.
pub struct AberratedOptics(Vec<Propagator>);

impl AberratedOptics {
    /// Plans the optics whose aberration `correction` corrects.
    ///
    /// # Errors
    /// Returns an error if the size is empty or the correction has another number of colours.
    pub fn new(Size { width, height }: Size, display: &Display, correction: &Aberration) -> Result<Self> {
        let pitch_m = display.pitch_m();
        let plans = Propagator::for_colours_corrected(
            Size { width, height },
            pitch_m,
            display.wavelengths_m(),
            0.0,
            &correction.reversed(),
            pitch_m,
        )?;
        Ok(AberratedOptics(plans))
    }

    /// Propagates `field`, (C, H, W), through the optics in place.
    pub fn pass(&self, field: &mut [Complex32]) {
        let mut scratch = self.0[0].scratch();
        let area = field.len() / self.0.len();
        for (plan, plane) in self.0.iter().zip(field.chunks_exact_mut(area)) {
            plan.propagate(plane, &mut scratch);
        }
    }
}

impl Hologram {
    /// Returns the size in pixels.
    pub fn size(&self) -> Size {
        let (_, height, width) = match self {
            Hologram::Levels(levels, _) => levels.dim(),
            Hologram::Complex(field, _) => field.dim(),
        };
        Size { width, height }
    }

    /// Returns the info stored with the hologram.
    pub fn info(&self) -> &HologramInfo {
        match self {
            Hologram::Levels(_, info) | Hologram::Complex(_, info) => info,
        }
    }

    /// Checks that the hologram was made for the display of `file`: that the lasers, pitch and offset match, and that
    /// levels match the display's bits.
    ///
    /// # Errors
    /// Returns an error that names the differing values of both.
    pub fn check_display(&self, file: &DisplayFile) -> Result<()> {
        let (theirs, ours) = (&self.info().display, &file.target.display);
        let of_levels = !matches!(self, Hologram::Complex(..));
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b.abs();
        let lasers = |display: &Display| {
            let nm = display.wavelengths_m().iter().map(|m| rounded(m * 1e9));
            format!("lasers of {} nm", nm.collect::<Vec<_>>().join("/"))
        };
        let pitch = |display: &Display| format!("a pitch of {} µm", rounded(display.pitch_m() * 1e6));
        let offset = |display: &Display| format!("an offset of {} mm", rounded(display.offset_m() * 1e3));
        let bits = |display: &Display| format!("levels of {} bits", display.bits());
        let same_lasers = theirs.colours() == ours.colours()
            && (theirs.wavelengths_m().iter().zip(ours.wavelengths_m())).all(|(a, b)| near(*a, *b));
        let same_offset = (theirs.offset_m() - ours.offset_m()).abs() < 1e-8;
        let differs = [
            (of_levels && theirs.bits() != ours.bits(), bits(theirs), bits(ours)),
            (!same_lasers, lasers(theirs), lasers(ours)),
            (!near(theirs.pitch_m(), ours.pitch_m()), pitch(theirs), pitch(ours)),
            (!same_offset, offset(theirs), offset(ours)),
        ];
        let (theirs, ours): (Vec<_>, Vec<_>) = differs
            .into_iter()
            .filter_map(|(differs, theirs, ours)| differs.then_some((theirs, ours)))
            .unzip();
        if theirs.is_empty() {
            return self.check_plane(file);
        }
        Err(Error::Input(format!(
            "the hologram is for {}, the display has {}; make it with this --display, or give the display and the --offset-mm that it was made for",
            theirs.join(", "),
            ours.join(", ")
        )))
    }

    /// Checks that the hologram's picture lies in the focal plane of a lens if that of the display of `file` does.
    fn check_plane(&self, file: &DisplayFile) -> Result<()> {
        let plane = |is_fourier: bool| match is_fourier {
            true => "in the focal plane of a lens",
            false => "about the modulator",
        };
        let theirs = self.info().is_in_focal_plane();
        let ours = file.lens.is_some();
        if theirs == ours {
            return Ok(());
        }
        Err(Error::Input(format!(
            "the hologram's picture lies {}, that of the display {}; give the display that it was made for, or make it with this --display",
            plane(theirs),
            plane(ours)
        )))
    }

    /// Computes the amplitudes, (C, H, W), at each of `z_m`, in metres from the middle of the volume.
    ///
    /// # Errors
    /// Returns an error if a z is one that [`check_z`] refuses, if the look-up table is invalid, or if the hologram was
    /// made for a calibrated display.
    pub fn views(&self, z_m: &[f64]) -> Result<Vec<Array3<f32>>> {
        self.views_on(&self.info().display_file()?, z_m)
    }

    /// Computes [`Self::views`] for a display with its calibration: its phase curves, its laser profile and its
    /// aberration, which must be the same for all depths.
    ///
    /// # Errors
    /// Returns the errors of [`Self::views`], and an error if the hologram was made for another display, if a table is
    /// for fewer pixels, or if the aberration changes over depth or over the frame.
    pub fn views_on(&self, file: &DisplayFile, z_m: &[f64]) -> Result<Vec<Array3<f32>>> {
        let size = self.size();
        let Size { width, height } = size;
        let info = self.info();
        self.check_display(file)?;
        z_m.iter().try_for_each(|z| check_z(&info.display, *z))?;
        if let Some(lens) = &file.lens {
            return self.views_in_focal_plane(file, lens, z_m);
        }
        let (mut field, aperture) = match self {
            Hologram::Complex(field, _) => (field.clone(), None),
            Hologram::Levels(levels, _) => {
                let opening = Opening::centred(file.target.display.aperture_radius());
                let field = shown_field(levels.view(), info.scale.unwrap_or(1.0), &file.target, size)?;
                let field = Array3::from_shape_vec(levels.dim(), field).expect("a value for each level");
                (field, Some(opening))
            }
        };
        if let Some(AberrationFile::Uniform(all)) = &file.aberration
            && let Some(correction) = all.constant()
        {
            let optics = AberratedOptics::new(size, &info.display, &correction)?;
            optics.pass(field.as_slice_mut().expect("standard layout"));
        } else if file.aberration.is_some() {
            return Err(Error::Input(
                "the display's aberration changes over depth or over the frame; such views cannot be made yet, leave the aberration out of the display's file".into(),
            ));
        }
        let plan = Refocus::new(size, &info.display, z_m, aperture)?;
        let views = plan.focal_stack(field.as_slice().expect("standard layout"), z_m)?;
        Ok(views
            .into_iter()
            .map(|view| {
                Array3::from_shape_vec((info.display.colours(), height, width), view)
                    .expect("a view of the hologram's shape")
            })
            .collect())
    }

    /// Computes the amplitudes, (C, H, W), at each of `z_m` from the focal plane of `lens`.
    fn views_in_focal_plane(&self, file: &DisplayFile, lens: &Lens, z_m: &[f64]) -> Result<Vec<Array3<f32>>> {
        let Hologram::Levels(levels, info) = self else {
            return Err(Error::Input(
                "a complex field has no view in the focal plane of a lens; give levels".into(),
            ));
        };
        let display = &file.target.display;
        if self.size() != display.size() {
            return Err(Error::Input(format!(
                "the hologram is {}, the modulator {}; for the focal plane of a lens both must be of one size",
                self.size(),
                display.size()
            )));
        }
        let light = shown_field(levels.view(), info.scale.unwrap_or(1.0), &file.target, self.size())?;
        let light = Array3::from_shape_vec(levels.dim(), light).expect("a value for each level");
        let mut views = vec![Array3::zeros(light.dim()); z_m.len()];
        for (colour, light) in light.outer_iter().enumerate() {
            let plan = LensPlan::new(lens, display, colour);
            for (view, z_m) in views.iter_mut().zip(z_m) {
                let mut plane = light.to_owned();
                plan.to_picture(plane.as_slice_mut().expect("standard layout"), *z_m);
                view.index_axis_mut(Axis(0), colour)
                    .assign(&plane.mapv(|value| value.norm()));
            }
        }
        Ok(views)
    }
}

/// The distance from the middle of the volume to which views are made, in depths of the volume beyond the modulator's
/// hologram.
const MOST_DEPTHS: f64 = 10.0;

/// Checks that a view at `z_m`, in metres from the middle of the volume, shows something of a hologram for `display`.
///
/// # Errors
/// Returns an error if z is farther away than ten times the depth of the volume and the offset together.
pub fn check_z(display: &Display, z_m: f64) -> Result<()> {
    let most_m = MOST_DEPTHS * display.volume_depth_m() + display.offset_m().abs();
    if z_m.abs() <= most_m {
        return Ok(());
    }
    Err(Error::Input(format!(
        "z = {} mm is far outside the volume, which reaches from -{half} mm to {half} mm; views reach {} mm",
        rounded(z_m * 1e3),
        rounded(most_m * 1e3),
        half = rounded(display.volume_depth_m() * 500.0)
    )))
}

/// Formats a number without the rounding noise of its last digits.
fn rounded(value: f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}
