//! The target of holograms.

use crate::display::Display;
use crate::error::{PhasefrontError, guard};
use phasefront::target::Response;
use phasefront_core::runtime::file;
use std::path::Path;
use std::sync::Arc;

/// The target of holograms: a display and its calibration, if there is one: the modulator's response to phases, the
/// light of the lasers, and the correction of the optics. It is immutable and can be used by several sessions.
#[derive(Debug, uniffi::Object)]
#[uniffi(name = "HologramTarget")]
pub struct Target {
    pub(crate) core: phasefront::Target,
}

#[uniffi::export(name = "HologramTarget")]
impl Target {
    /// Creates a target whose levels are equal steps of phase, with as many levels as the display's bits allow.
    ///
    /// # Errors
    /// Returns an error if the display is impossible.
    #[uniffi::constructor]
    pub fn of_display(display: Display) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let core = phasefront::Display::try_from(&display)?.into();
            Ok(Arc::new(Target { core }))
        })
    }

    /// Creates a target whose modulator was calibrated as a whole. `levels` has 256 entries; the level at i displays
    /// the phase 2πi/256.
    ///
    /// # Errors
    /// Returns an error if the display is impossible or there are not 256 levels.
    #[uniffi::constructor]
    pub fn with_look_up_table(display: Display, levels: Vec<u8>) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let display = phasefront::Display::try_from(&display)?;
            let levels = <[u8; 256]>::try_from(levels.as_slice()).map_err(|_| {
                PhasefrontError::Setting(format!(
                    "the look-up table has {} levels; 256 are right, one for each phase step of 2π/256",
                    levels.len()
                ))
            })?;
            let core = phasefront::Target {
                response: Response::lut(levels),
                ..display.into()
            };
            Ok(Arc::new(Target { core }))
        })
    }

    /// Reads a target from the bytes of a calibration file, as `phasefront calibrate pack` writes it.
    ///
    /// # Errors
    /// Returns an error that says what is wrong if the bytes are not such a file.
    #[uniffi::constructor]
    pub fn from_bytes(file: &[u8]) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let core = phasefront::Target::from_bytes(file)?;
            Ok(Arc::new(Target { core }))
        })
    }

    /// Reads a target from a calibration file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, and the errors of [`Self::from_bytes`].
    #[uniffi::constructor]
    pub fn from_file(path: String) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let file = file::read(Path::new(&path), file::MOST_TARGET)
                .map_err(|e| PhasefrontError::File(format!("the calibration {path} cannot be read: {e}")))?;
            Self::from_bytes(&file)
        })
    }

    /// Returns the bytes of a calibration file, which [`Self::from_bytes`] reads.
    ///
    /// # Errors
    /// Returns an error if the target cannot be written.
    pub fn to_bytes(&self) -> Result<Vec<u8>, PhasefrontError> {
        guard(|| Ok(self.core.to_bytes()?))
    }

    /// Returns the display.
    pub fn display(&self) -> Display {
        self.core.display.clone().into()
    }
}
