//! Ground truth, data sets, evaluation: what prepares a display or a network for the phone.

pub mod error;
pub mod ldi;
pub mod scene;

pub use error::{Error, Result};
