//! Encodes a complex field as phases alone, by the double phase method and by filters that keep its checkerboard from
//! aliasing.
//!
//! Encoders do not change the field's phase, offset or scale. Phases lie in \[0, 2π). [`crate::display::response`] maps
//! phases to levels. The scale is the amplitude that maps to full light.

pub mod brightness;
mod dark_threshold;
pub mod double_phase;
mod encoder;
mod encoding;
pub mod focal_plane;
pub mod local;
pub mod midpoint;
pub mod modelled;
pub mod natural;
mod source;
mod start;
mod still;

use crate::encode::brightness::Brightness;
use crate::runtime::error::{Error, Result};
pub use encoder::{Encoder, EncoderScratch};
pub use encoding::{Encoding, anti_alias, band_limit, deep};
pub(crate) use source::Source;

/// Options for encoding a field into levels.
#[derive(Debug, Clone)]
pub struct EncoderOptions {
    /// The encoding from a complex field to phases.
    pub encoding: Encoding,
    /// The amplitude that maps to full light.
    pub brightness: Brightness,
    /// The share of full light, 0 to 1, below which the phase is moved toward 0 before double phase. Double phase would
    /// display the noise there as coloured speckle. 0 leaves phases unchanged.
    pub dark_threshold: f32,
    /// The number of local correction steps, at most 8. Each step moves the image behind the display's aperture toward
    /// the target field. The first step brings the largest gain.
    pub local_steps: usize,
    /// The number of correction steps at the midpoint that follow the local steps, at most 100. They make still images
    /// sharper at the midpoint and cost four transforms for each colour and step. Three steps bring nearly all of the
    /// gain.
    pub midpoint_steps: usize,
    /// The number of steps of natural focus that follow the local steps, at most 1000. They bring the displayed light
    /// to the focal stack of incoherent light of an RGB-D frame ([`natural`]), so that what is out of focus is soft. 30
    /// bring most of the gain. They take the place of [`Self::midpoint_steps`]. Fields without a frame have none.
    pub focus_steps: usize,
}

impl EncoderOptions {
    /// The default of [`Self::dark_threshold`], chosen on validation scenes.
    pub const DARK_THRESHOLD: f32 = 0.4;

    /// Returns options for `encoding` as published, without dark threshold and correction steps.
    pub fn plain(encoding: Encoding) -> Self {
        EncoderOptions {
            dark_threshold: 0.0,
            local_steps: 0,
            ..encoding.into()
        }
    }

    /// Checks the options.
    ///
    /// # Errors
    /// Returns an error if a number is out of its range.
    pub fn check(&self) -> Result<()> {
        self.brightness.check()?;
        let steps = self.local_steps + self.midpoint_steps + self.focus_steps;
        if matches!(self.encoding, Encoding::Phase) && (self.dark_threshold != 0.0 || steps > 0) {
            return Err(Error::Setting(
                "phases are shown as they are; a dark threshold and steps of 0 are right".into(),
            ));
        }
        if !(0.0..=1.0).contains(&self.dark_threshold) {
            return Err(Error::Setting(format!(
                "the dark threshold is {}; it must be a share of full light from 0 to 1",
                self.dark_threshold
            )));
        }
        if self.local_steps > local::MAX_STEPS {
            return Err(Error::Setting(format!(
                "{} local steps; there must be at most {}, and after the second they bring nothing",
                self.local_steps,
                local::MAX_STEPS
            )));
        }
        if self.midpoint_steps > midpoint::MAX_STEPS {
            return Err(Error::Setting(format!(
                "{} steps at the midpoint; there must be at most {}, and 3 bring nearly all",
                self.midpoint_steps,
                midpoint::MAX_STEPS
            )));
        }
        if self.focus_steps > natural::MAX_STEPS {
            return Err(Error::Setting(format!(
                "{} steps of natural focus; there must be at most {}, and 30 bring most of the gain",
                self.focus_steps,
                natural::MAX_STEPS
            )));
        }
        if self.focus_steps > 0 && self.midpoint_steps > 0 {
            return Err(Error::Setting(
                "steps at the midpoint make the focus coherent, steps of natural focus soft; give one of the two"
                    .into(),
            ));
        }
        Ok(())
    }
}

impl Default for EncoderOptions {
    /// Returns AA-DPM with smoothed brightness, [`Self::DARK_THRESHOLD`] and one local correction step.
    fn default() -> Self {
        Encoding::ANTI_ALIAS.into()
    }
}

impl From<Encoding> for EncoderOptions {
    /// Uses `encoding` with smoothed brightness, [`Self::DARK_THRESHOLD`] and one local step. For a pre-filter, which
    /// was trained without the last two, and for [`Encoding::Phase`], both are 0.
    fn from(encoding: Encoding) -> Self {
        let (dark, local_steps) = match encoding {
            Encoding::Deep(_) | Encoding::Phase => (0.0, 0),
            _ => (Self::DARK_THRESHOLD, 1),
        };
        EncoderOptions {
            encoding,
            brightness: Brightness::default(),
            dark_threshold: dark,
            local_steps,
            midpoint_steps: 0,
            focus_steps: 0,
        }
    }
}
