//! The learned model of a display ([`phasefront_core::display::model`]): the holograms to photograph, and its fit to
//! the photographs.

pub mod album;
pub mod fit;
mod gradient;
mod register;
pub mod scenes;
