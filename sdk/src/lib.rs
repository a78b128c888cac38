//! RGB-D frames to phase-only 3D holograms, on the device: an implementation of *End-to-end
//! learning of 3D phase-only holograms for holographic display* (Shi, Li, Matusik, Light:
//! Science & Applications 11, 247, 2022).
//!
//! Conventions, everywhere: colours in the order red, green, blue; lengths in metres; planes
//! row-major (H, W), stacks (3, H, W); x right, y down, z toward the viewer; the midpoint hologram
//! at z = 0. An image's value is the amplitude. Plans are immutable and shared between threads;
//! their hot calls take scratch memory and allocate nothing.

mod brightness;
pub mod calibration;
pub mod depth;
pub mod display;
pub mod encode;
pub mod error;
pub mod frame;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod illumination;
pub mod method;
pub mod modulator;
pub mod network;
pub mod output;
pub mod pipeline;
pub mod preview;
pub mod refocus;
pub mod seeded;
pub mod session;
pub mod slm;
pub mod sweep;
pub mod wave;

pub use calibration::Calibration;
pub use display::Display;
pub use error::{Error, Result};
pub use frame::RgbdFrame;
pub use illumination::Illumination;
pub use method::Method;
pub use modulator::Modulator;
pub use network::{Network, NetworkPlan, NetworkScratch};
pub use pipeline::Pipeline;
pub use session::Session;
pub use sweep::Sweep;

/// The README's code compiles.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
