//! The whole frame on the GPU: the stages of [`crate::pipeline`] as compute passes of wgpu, for Vulkan, Metal and
//! DirectX 12, RGB-D in and modulator levels out, nothing coming back to the CPU between.
//!
//! Each stage is a .wgsl file beside its Rust, and has its CPU twin as oracle: f32 agrees with it to 1e-4, int8 chains
//! to the bit. A device is not trusted before a small frame came out of it as out of the CPU.
//!
//! ```no_run
//! use phasefront::encode::{Encoding, Scale};
//! use phasefront::gpu::{DeviceOptions, Error, Frame, Job, Otherwise, Renderer};
//! use phasefront::slm::Response;
//! use phasefront::{Display, Method, Network, RgbdFrame};
//! use std::sync::Arc;
//!
//! fn levels(network: Arc<Network>, frames: &[RgbdFrame]) -> Result<Vec<Vec<u8>>, Error> {
//!     let (method, response) = (Method::Network(network), Response::linear(8)?);
//!     let (encoding, scale) = (Encoding::ANTI_ALIAS, Scale::Fixed(1.0));
//!     let job = Job::new(1080, 1920, method, &Display::default(), encoding, scale, response);
//!     let mut renderer = Renderer::new(DeviceOptions::default(), job, Otherwise::Cpu)?;
//!     if let Some(why) = renderer.reason() {
//!         println!("on the CPU: {why}");
//!     }
//!     let mut all = Vec::new();
//!     for frame in frames {
//!         let handed = renderer.submit(&Frame::of(frame))?;
//!         let mut levels = vec![0; 3 * 1080 * 1920];
//!         renderer.collect(handed, &mut levels)?;
//!         all.push(levels);
//!     }
//!     Ok(all)
//! }
//! ```

mod brightness;
mod chain;
mod device;
mod encode;
mod fft;
mod hidden;
mod input;
mod method;
mod peak;
mod pipeline;
mod preview;
mod probe;
mod renderer;
mod sweep;
mod watch;

pub use crate::brightness::{Brightness, Past};
pub use chain::{ChainOptions, Float, Fusion, NetworkPlan};
pub use device::{Device, DeviceOptions};
pub use input::{Colour, ColourData, Depth, DepthData, Frame};
pub use peak::Peak;
pub use pipeline::{Deliver, FLIGHTS, FrameReport, Job, Pipeline, StageTimes, Ticket};
pub use preview::Preview;
pub use probe::probe;
pub use renderer::{Handed, Otherwise, Renderer};

/// Why the GPU does not serve.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No GPU, or none that is wanted.
    #[error("no GPU: {0}")]
    None(String),
    /// A feature, a limit or a size that this GPU refuses.
    #[error("the GPU refuses: {0}")]
    Refused(String),
    /// Memory that this GPU does not have.
    #[error("the GPU is out of memory: {0}")]
    OutOfMemory(String),
    /// Results that are not the CPU's.
    #[error("the GPU answers wrongly: {0}")]
    Wrong(String),
    /// A device that went away, with what it was computing.
    #[error("the GPU was lost: {0}")]
    Lost(String),
    /// What the CPU would refuse too.
    #[error(transparent)]
    Core(#[from] crate::Error),
}

/// A result of the GPU.
pub type Result<T> = std::result::Result<T, Error>;
