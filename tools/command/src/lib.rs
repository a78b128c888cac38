//! What the commands `phasefront` and `phasefront-lab` share: how they start, print and trace, networks by name, and
//! the flags that both have.
//!
//! This is a crate of its own because the two commands do not depend on each other, and reading files needs no command
//! line.

pub mod flags;
pub mod networks;
pub mod start;
pub mod terminal;
mod trace;
