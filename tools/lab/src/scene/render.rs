//! Rendering to layered depth images: exactly on the CPU, or by depth peeling on a GPU.

mod peel;
mod raster;

pub use peel::DepthPeeler;
pub use raster::render_ldi_reference;
