//! From a complex field to phases alone: the double phase method and what is done to a field
//! before it so that the checkerboard does not alias.
//!
//! Encoders take the field as given: its phase, its offset, its scale. Phases lie in \[0, 2π).
//! What level shows a phase is [`crate::display::response`]'s knowledge; an amplitude's scale is what full light stands
//! for.

pub mod brightness;
mod dark_threshold;
pub mod double_phase;
mod encoder;
mod encoding;
pub mod local;
pub mod midpoint;
mod start;

use crate::encode::brightness::Brightness;
use crate::runtime::error::{Error, Result};
pub use encoder::{Encoder, EncoderScratch};
pub use encoding::{Encoding, anti_alias, band_limit, deep};

/// How a field becomes levels.
#[derive(Debug, Clone)]
pub struct EncoderOptions {
    /// From a complex field to phases.
    pub encoding: Encoding,
    /// Which amplitude full light stands for.
    pub brightness: Brightness,
    /// Where the amplitude is below this share of full light, 0 to 1, the phase is drawn to 0 before double phase,
    /// which shows noise there as coloured speckle. 0 leaves phases as they are.
    pub dark_threshold: f32,
    /// Steps of local correction: each draws the image behind the display's aperture toward the field that is
    /// wanted. The first brings most; 8 at most.
    pub local_steps: usize,
    /// Steps of correction at the midpoint after them, for stills: sharper there, at four transforms a colour and step.
    /// 3 bring nearly all; 100 at most.
    pub midpoint_steps: usize,
}

impl EncoderOptions {
    /// The default [`Self::dark_threshold`], chosen on validation scenes.
    pub const DARK_THRESHOLD: f32 = 0.4;

    /// `encoding` as it is published: nothing is drawn or corrected.
    pub fn plain(encoding: Encoding) -> Self {
        EncoderOptions {
            dark_threshold: 0.0,
            local_steps: 0,
            ..encoding.into()
        }
    }

    /// # Errors
    /// A number out of its range.
    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        self.brightness.check()?;
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
        Ok(())
    }
}

impl Default for EncoderOptions {
    /// AA-DPM, corrected by one local step; smoothed brightness.
    fn default() -> Self {
        Encoding::ANTI_ALIAS.into()
    }
}

impl From<Encoding> for EncoderOptions {
    /// This encoding, smoothed brightness, [`Self::DARK_THRESHOLD`] and one local step. A pre-filter was trained
    /// without the two: with it both are 0.
    fn from(encoding: Encoding) -> Self {
        let (dark, local_steps) = match encoding {
            Encoding::Deep(_) => (0.0, 0),
            _ => (Self::DARK_THRESHOLD, 1),
        };
        EncoderOptions {
            encoding,
            brightness: Brightness::default(),
            dark_threshold: dark,
            local_steps,
            midpoint_steps: 0,
        }
    }
}
