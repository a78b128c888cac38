//! Files: pictures, depth maps, photos with depth, films, layered depth images, holograms and displays.
//!
//! Everything that a desktop reads goes through [`input`], everything that it writes through [`output`].

pub mod dice;
pub mod display;
mod error;
pub mod film;
pub mod fingerprint;
pub mod frame;
pub mod hologram;
pub mod input;
pub mod ldi;
pub mod output;
pub mod picture;

pub use error::{Error, Result};
