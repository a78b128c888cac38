//! The error type of the tools. Each message is one line that names the problem and the expected input.

use phasefront_core::runtime::error::Line;
use phasefront_gpu::GpuError;
use std::path::PathBuf;

/// The reason why a tool failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder cannot be read, written or parsed.
    #[error("{}: {}", Line(&path.display().to_string()), Line(reason))]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The problem, and the expected contents.
        reason: String,
    },
    /// A value, shape or scene cannot be used as requested.
    #[error("{}", Line(.0))]
    Input(String),
    /// The command line is wrong: flags that do not go together, or that would change nothing.
    #[error("{}", Line(.0))]
    Usage(String),
    /// The core returned an error.
    #[error(transparent)]
    Core(#[from] phasefront::Error),
}

impl Error {
    /// Creates an error about one file or folder.
    pub fn file(path: impl Into<PathBuf>, reason: impl std::fmt::Display) -> Self {
        Self::File {
            path: path.into(),
            reason: reason.to_string(),
        }
    }

    /// Creates an error about the command line from the core's error about the value of a flag.
    pub fn usage(why: phasefront::Error) -> Self {
        Self::Usage(why.to_string())
    }
}

/// The result type of the tools.
pub type Result<T> = std::result::Result<T, Error>;

impl From<GpuError> for Error {
    fn from(why: GpuError) -> Self {
        match why {
            GpuError::Core(why) => Error::Core(why),
            why => Error::Input(format!("{why}; --backend cpu needs no GPU")),
        }
    }
}
