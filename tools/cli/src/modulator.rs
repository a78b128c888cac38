//! Modulators at a desktop: frames on a screen, the pattern that tests the link to it, and several maps of one wave.

pub mod link;
pub mod multiplex;
pub mod show;
