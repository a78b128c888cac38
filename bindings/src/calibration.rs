//! Calibrated displays, from the file that `phasefront calibrate pack` writes.

use crate::display::Display;
use crate::error::{PhasefrontError, guard};
use std::sync::Arc;

/// A display as it was calibrated: its modulator, its laser, its optics. Immutable; one serves many sessions.
#[derive(Debug, uniffi::Object)]
pub struct CalibratedDisplay {
    pub(crate) core: phasefront::Calibration,
}

#[uniffi::export]
impl CalibratedDisplay {
    /// Reads the file's bytes.
    ///
    /// # Errors
    /// What is not such a file, with what is not so.
    #[uniffi::constructor]
    pub fn from_bytes(file: &[u8]) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            Ok(Arc::new(CalibratedDisplay {
                core: phasefront::Calibration::from_bytes(file)?,
            }))
        })
    }

    /// Reads the file.
    ///
    /// # Errors
    /// A file that cannot be read; as [`Self::from_bytes`].
    #[uniffi::constructor]
    pub fn from_file(path: String) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let file = std::fs::read(&path).map_err(|e| {
                PhasefrontError::File(format!("the calibration {path} cannot be read: {e}"))
            })?;
            Self::from_bytes(&file)
        })
    }

    /// The display itself.
    pub fn display(&self) -> Result<Display, PhasefrontError> {
        guard(|| Ok(self.core.display.clone().into()))
    }
}
