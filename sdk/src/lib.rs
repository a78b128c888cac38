//! RGB-D frames to phase-only 3D holograms.

pub mod error;
pub mod network;

pub use error::{Error, Result};
pub use network::{Network, NetworkPlan, NetworkScratch};
