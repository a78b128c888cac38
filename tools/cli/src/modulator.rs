//! Modulators on a desktop: frames on a screen, a test pattern for the link, and several maps of one wave.

pub mod link;
pub mod multiplex;
pub mod show;
