//! A shim that goes away.
pub use phasefront_core::depth;
pub use phasefront_core::display::illumination;
pub use phasefront_core::display::panel;
pub use phasefront_core::display::response as slm;
pub use phasefront_core::encode;
pub use phasefront_core::frame;
pub use phasefront_core::method;
pub use phasefront_core::method::network;
pub use phasefront_core::method::seeded;
pub use phasefront_core::method::sweep;
pub use phasefront_core::optics as wave;
pub mod modulator {
    pub use phasefront_core::pipeline::display_plan::DisplayPlan as Modulator;
    pub use phasefront_core::pipeline::display_plan::*;
}

pub use phasefront_core::runtime::file;
pub use phasefront_core::runtime::keys;
pub use phasefront_core::view::preview;
pub use phasefront_core::view::refocus;
#[cfg(feature = "gpu")]
pub use phasefront_gpu as gpu;
/// Messages.
pub mod error {
    pub use phasefront_core::runtime::caught::caught;
    pub use phasefront_core::runtime::error::Line;
}
