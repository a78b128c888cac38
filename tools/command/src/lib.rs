//! The parts that the commands `phasefront` and `phasefront-lab` share: start, output, trace, networks by name, and
//! common flags.
//!
//! This is a separate crate because the two commands do not depend on each other, and the crate that reads files needs
//! no command line.

pub mod flags;
pub mod interrupt;
pub mod networks;
pub mod start;
pub mod terminal;
mod trace;
