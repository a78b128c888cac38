//! What holograms are made for.

use crate::display::Display;
use crate::error::{PhasefrontError, guard};
use phasefront::target::Response;
use phasefront_core::runtime::file;
use std::path::Path;
use std::sync::Arc;

/// What holograms are made for: a display and, where it is calibrated, what its modulator answers to a phase, its
/// lasers' light, what corrects its optics. Immutable; one serves many sessions.
#[derive(Debug, uniffi::Object)]
pub struct Target {
    pub(crate) core: phasefront::Target,
}

#[uniffi::export]
impl Target {
    /// A display with levels in equal steps of phase, as many as its bits have.
    ///
    /// # Errors
    /// A display that cannot be.
    #[uniffi::constructor]
    pub fn of_display(display: Display) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let core = phasefront::Display::try_from(&display)?.into();
            Ok(Arc::new(Target { core }))
        })
    }

    /// A display whose modulator was calibrated as a whole: of 256 levels the one at i shows the phase 2πi/256.
    ///
    /// # Errors
    /// A display that cannot be, or another number of levels.
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

    /// Reads the bytes of a calibration's file, as `phasefront calibrate pack` writes it.
    ///
    /// # Errors
    /// What is not such a file, with what is not so.
    #[uniffi::constructor]
    pub fn from_bytes(file: &[u8]) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let core = phasefront::Target::from_bytes(file)?;
            Ok(Arc::new(Target { core }))
        })
    }

    /// Reads a calibration's file.
    ///
    /// # Errors
    /// A file that cannot be read; as [`Self::from_bytes`].
    #[uniffi::constructor]
    pub fn from_file(path: String) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let file = file::read(Path::new(&path), file::MOST_TARGET)
                .map_err(|e| PhasefrontError::File(format!("the calibration {path} cannot be read: {e}")))?;
            Self::from_bytes(&file)
        })
    }

    /// The display itself.
    pub fn display(&self) -> Result<Display, PhasefrontError> {
        guard(|| Ok(self.core.display.clone().into()))
    }
}
