//! RGB-D frames to phase-only 3D holograms.

pub mod error;

pub use error::{Error, Result};
