//! The learned model of a display ([`phasefront_core::display::model`]): the holograms to photograph, and its fit to
//! the photographs.

pub mod album;
pub mod fit;
mod gradient;
pub(crate) mod register;
pub mod scenes;
