//! What every module builds on: errors, panics as values, cancelling, the clock, the stages of a frame, bounded reading
//! of files, and the keys of TOML files.

pub mod cancel;
pub mod caught;
pub mod clock;
pub mod error;
pub mod file;
pub mod keys;
pub mod stage;
