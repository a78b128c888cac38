//! The basis of every module: errors, panics as values, cancellation, the clock, the stages of a frame, bounded file
//! reading, and the keys of TOML files.

pub mod cancel;
pub mod caught;
pub mod clock;
pub mod error;
pub mod file;
pub mod keys;
pub mod stage;
