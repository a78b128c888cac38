//! The target of a hologram: a display, its modulator's response, its laser illumination, and the correction of its
//! optics. Every plan takes a target. An uncalibrated target is just a [`Display`].
//!
//! ```
//! use phasefront::{Display, Target};
//!
//! let target = Target::from(Display::from_toml("width = 3840\nheight = 2160\npitch_um = 3.74")?);
//! assert_eq!(target.display.size().width, 3840);
//! # Ok::<(), phasefront::Error>(())
//! ```

mod file;

use crate::Size;
use crate::display::illumination::Illumination;
use crate::display::model::Model;
use crate::display::panel::Panel;
use crate::display::registration::Registration;
use crate::display::response::Response;
use crate::display::{Display, check_colours};
use crate::optics::asm::{Padding, Propagator};
use crate::optics::zernike::Aberration;
use crate::runtime::error::{Error, Result};
use std::sync::Arc;

/// A display and its calibration. A hologram smaller than the modulator lies in its middle.
#[derive(Debug, Clone)]
pub struct Target {
    /// The physics of the display.
    pub display: Display,
    /// The modulator's response to phases. For a display of more than 8 bits it is linear and gives the upper 8 bits.
    pub response: Response,
    /// The laser light over the modulator, or `None` if it is uniform.
    pub illumination: Option<Illumination>,
    /// The correction of the optics' aberration, if it is the same at all depths.
    pub correction: Option<Aberration>,
    /// The phases and the phase range of the panel, from a calibration file.
    #[doc(hidden)]
    pub panel: Panel,
    /// The shift and the scale of each colour, from a calibration file.
    #[doc(hidden)]
    pub registration: Registration,
    /// What was learned from photographs beyond all of these.
    #[doc(hidden)]
    pub model: Option<Arc<Model>>,
}

impl From<Display> for Target {
    /// Creates a target with a linear response of the display's bits, uniform light and no correction.
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
            model: None,
        }
    }
}

impl From<&Display> for Target {
    fn from(display: &Display) -> Self {
        display.clone().into()
    }
}

impl Default for Target {
    /// Returns the target of the paper's display, [`Display::default`].
    fn default() -> Self {
        Display::default().into()
    }
}

impl Target {
    /// Checks that all parts of the target match the display.
    ///
    /// # Errors
    /// Returns an error if a table or a map is for another modulator or number of lasers, if a table is given for a
    /// display of more than 8 bits, if the panel or the registration is invalid, or if the panel of a learned model
    /// adds phases.
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
        if let Some(model) = &self.model {
            check_colours("the learned model", model.colours().len(), colours)?;
            if !self.panel.is_plain() {
                return Err(Error::Setting(
                    "a learned model is for a panel without carrier, lens, flatness and range over 2π; leave one out"
                        .into(),
                ));
            }
        }
        let size = self.display.size();
        if let Some(other) = self.response.size()
            && other != size
        {
            return Err(Error::Setting(format!(
                "the per-pixel table is for {}×{} pixels, the display has {}×{}; both must be of one size",
                other.width, other.height, size.width, size.height
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

    /// Returns the size of the modulator.
    pub fn modulator(&self) -> Size {
        self.display.size()
    }

    /// Plans the propagation of each colour of fields of `size` over `distance_m`, including `correction`. A
    /// pixel of the fields covers `binning`² modulator pixels. Returns `None` if the distance is 0 and there is no
    /// correction.
    ///
    /// # Errors
    /// Returns an error if the distance or the correction moves light farther than the field can be padded.
    #[doc(hidden)]
    pub fn propagators(
        &self,
        Size { width, height }: Size,
        binning: usize,
        distance_m: f64,
        correction: Option<&Aberration>,
    ) -> Result<Option<Vec<Propagator>>> {
        let (pupil_pitch_m, colours) = (self.display.pitch_m(), self.display.wavelengths_m());
        let pitch_m = pupil_pitch_m * binning as f64;
        match (distance_m, correction) {
            (_, Some(correction)) => Propagator::for_colours_corrected(
                Size { width, height },
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
                Propagator::for_colours(Size { width, height }, pitch_m, colours, distance_m, padding).map(Some)
            }
        }
    }
}
