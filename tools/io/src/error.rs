//! The one error type of the tools. Each message is one line that names what is wrong and what would be right.

use phasefront_core::runtime::error::Line;
use phasefront_gpu::GpuError;
use std::path::PathBuf;

/// Why a tool refused to go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder that cannot be read, written or understood.
    #[error("{}: {}", Line(&path.display().to_string()), Line(reason))]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it, and what would be right.
        reason: String,
    },
    /// A value, shape or scene that cannot be used as asked.
    #[error("{}", Line(.0))]
    Input(String),
    /// The core refused.
    #[error(transparent)]
    Core(#[from] phasefront::Error),
}

impl Error {
    /// An error about one file or folder.
    pub fn file(path: impl Into<PathBuf>, reason: impl std::fmt::Display) -> Self {
        Self::File {
            path: path.into(),
            reason: reason.to_string(),
        }
    }
}

/// A tool's result.
pub type Result<T> = std::result::Result<T, Error>;

impl From<GpuError> for Error {
    fn from(why: GpuError) -> Self {
        match why {
            GpuError::Core(why) => Error::Core(why),
            why => Error::Input(format!("{why}; --backend cpu needs no GPU")),
        }
    }
}
