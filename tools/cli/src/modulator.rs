//! Modulators on a desktop: frames on a screen, and several maps of one wave.

pub mod multiplex;
pub mod show;
