//! What a hologram is made for: a display, what its modulator answers to a phase, its lasers' light, what corrects its
//! optics. Every plan takes one. Where nothing is calibrated it is a [`Display`] alone.
//!
//! ```
//! use phasefront::{Display, Target};
//!
//! let target = Target::from(Display::from_toml("width = 3840\nheight = 2160\npitch_um = 3.74")?);
//! assert_eq!(target.display.width(), 3840);
//! # Ok::<(), phasefront::Error>(())
//! ```

mod file;

use crate::display::illumination::Illumination;
use crate::display::panel::Panel;
use crate::display::registration::Registration;
use crate::display::response::Response;
use crate::display::{Display, check_colours};
use crate::optics::asm::{Padding, Propagator};
use crate::optics::zernike::Aberration;
use crate::runtime::error::{Error, Result};

/// A display, and what a calibration found of it. A hologram smaller than the modulator stands in its middle.
#[derive(Debug, Clone)]
pub struct Target {
    /// The physics.
    pub display: Display,
    /// What the modulator answers to a phase: of a display of over 8 bits linear levels, whose upper 8 it says.
    pub response: Response,
    /// The lasers' light over the modulator; None where it is even.
    pub illumination: Option<Illumination>,
    /// What corrects the optics' aberration, where it is one for all depths.
    pub correction: Option<Aberration>,
    /// What the panel adds to the response. It comes with a calibrated target's file.
    #[doc(hidden)]
    pub panel: Panel,
    /// How each colour is moved and scaled. It comes with a calibrated target's file.
    #[doc(hidden)]
    pub registration: Registration,
}

impl From<Display> for Target {
    /// A linear response of the display's bits, even light, nothing to correct.
    fn from(display: Display) -> Self {
        Target {
            response: Response::Linear {
                bits: display.bits().min(8),
            },
            display,
            illumination: None,
            correction: None,
            panel: Panel::default(),
            registration: Registration::default(),
        }
    }
}

impl From<&Display> for Target {
    fn from(display: &Display) -> Self {
        display.clone().into()
    }
}

impl Default for Target {
    /// The paper's display: [`Display::default`].
    fn default() -> Self {
        Display::default().into()
    }
}

impl Target {
    /// # Errors
    /// A table or a map for another modulator or another number of lasers, or a table for a display of over 8 bits.
    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        let colours = self.display.colours();
        if let Response::PerPixel(table) = &self.response {
            check_colours("the per-pixel table", table.colours(), colours)?;
        }
        if let Some(light) = &self.illumination {
            check_colours("the laser's map", light.colours(), colours)?;
        }
        if let Some(correction) = &self.correction {
            check_colours("the correction", correction.coefficients().len(), colours)?;
        }
        let shape = (self.display.height(), self.display.width());
        if let Some(other) = self.response.shape()
            && other != shape
        {
            return Err(Error::Setting(format!(
                "the per-pixel table is for {}×{} pixels, the display has {}×{}; both must be of one size",
                other.1, other.0, shape.1, shape.0
            )));
        }
        if self.display.bits() > 8 && self.response != (Response::Linear { bits: 8 }) {
            return Err(Error::Setting(format!(
                "a display of {} bits answers linearly; a table is for one of 8 bits",
                self.display.bits()
            )));
        }
        self.panel.check(&self.display)?;
        self.registration.check(colours)
    }

    /// (H, W) of the modulator.
    pub fn modulator(&self) -> (usize, usize) {
        (self.display.height(), self.display.width())
    }

    /// The way of each colour of (C, H, W) = `shape` fields over `distance_m`, `correction` being part of it: in pixels
    /// of `binning`² of the modulator's. None where there is nothing to do.
    ///
    /// # Errors
    /// A distance or correction that moves light farther than can be padded.
    #[doc(hidden)]
    pub fn propagators(
        &self,
        (height, width): (usize, usize),
        binning: usize,
        distance_m: f64,
        correction: Option<&Aberration>,
    ) -> Result<Option<Vec<Propagator>>> {
        let (pupil_pitch_m, colours) = (self.display.pitch_m(), self.display.wavelengths_m());
        let pitch_m = pupil_pitch_m * binning as f64;
        match (distance_m, correction) {
            (_, Some(correction)) => Propagator::for_colours_corrected(
                height,
                width,
                pitch_m,
                colours,
                distance_m,
                correction,
                pupil_pitch_m,
            )
            .map(Some),
            (0.0, None) => Ok(None),
            (_, None) => {
                let padding = Padding::Reach;
                Propagator::for_colours(height, width, pitch_m, colours, distance_m, padding).map(Some)
            }
        }
    }
}
