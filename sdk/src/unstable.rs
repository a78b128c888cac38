//! The rooms of the core as they are inside, for the laboratory, the tests and the benchmarks. Nothing here is
//! promised: it changes without notice, in any release.

/// Depth: units, holes, alignment, temporal smoothing, refinement.
pub mod depth {
    pub use crate::depth::*;
}
/// From a complex field to phases.
pub mod encode {
    pub use crate::encode::*;
}
/// Messages on one line.
pub mod error {
    pub use crate::caught::caught;
    pub use crate::error::Line;
}
/// Bounded reading of files.
pub mod file {
    pub use crate::file::*;
}
/// Camera images to amplitudes.
pub mod frame {
    pub use crate::frame::*;
}
/// The whole frame on the GPU.
#[cfg(feature = "gpu")]
pub mod gpu {
    pub use crate::gpu::*;
}
/// Keys of files, and messages about unknown ones.
pub mod keys {
    pub use crate::keys::*;
}
/// Plans of methods.
pub mod method {
    pub use crate::method::{MethodPlan, MethodScratch};
}
/// From a field to the modulator's levels.
pub mod modulator {
    pub use crate::modulator::*;
}
/// The lasers' light.
pub mod illumination {
    pub use crate::illumination::*;
}
/// The networks' chain, plans and oracle.
pub mod network {
    pub use crate::network::*;
}
/// What a panel adds to the response.
pub mod panel {
    pub use crate::panel::*;
}
/// Small views of holograms.
pub mod preview {
    pub use crate::preview::*;
}
/// Views of holograms, at full resolution.
pub mod refocus {
    pub use crate::refocus::*;
}
/// Networks that correct the sweep's field.
pub mod seeded {
    pub use crate::seeded::*;
}
/// Phases to levels.
pub mod slm {
    pub use crate::slm::*;
}
/// The plane sweep.
pub mod sweep {
    pub use crate::sweep::*;
}
/// Diffraction.
pub mod wave {
    pub use crate::wave::*;
}
