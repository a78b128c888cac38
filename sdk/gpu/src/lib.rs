//! The whole frame on the GPU: the stages of [`phasefront_core::pipeline`] as compute passes of wgpu, for Vulkan, Metal and
//! DirectX 12, RGB-D in and modulator levels out, nothing coming back to the CPU between.
//!
//! Each stage is a .wgsl file beside its Rust, and has its CPU twin as oracle: f32 agrees with it to 1e-4, int8 chains
//! to the bit. A device is not trusted before a small frame came out of it as out of the CPU.
//!
//! A session falls back to the CPU by itself. Whoever wants the levels on the GPU, to show them without a copy, plans
//! here:
//!
//! ```no_run
//! use phasefront_gpu::{Deliver, Device, DeviceOptions, Frame, GpuError, GpuPipeline, Job, probe};
//! use phasefront::{Method, Network, RgbdFrame, Target};
//! use std::sync::Arc;
//!
//! fn show(network: Arc<Network>, frame: &RgbdFrame) -> Result<(), GpuError> {
//!     let device = Arc::new(Device::open(&DeviceOptions::default())?);
//!     let job = Job::new((1080, 1920), Method::Network(network), Target::default());
//!     probe(&device, &job)?;
//!     let mut pipeline = GpuPipeline::new(&device, &job)?;
//!     let ticket = pipeline.submit(&Frame::of(frame), Deliver::Shown)?;
//!     let _levels = pipeline.texture(&ticket);
//!     pipeline.finish(ticket)?;
//!     Ok(())
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
mod probe;
mod renderer;
mod sweep;
mod watch;

pub use chain::{ChainOptions, Float, Fusion, GpuNetworkPlan};
pub use device::{Device, DeviceOptions};
pub use input::{Colour, ColourData, Depth, DepthData, Frame};
pub use peak::Peak;
pub use phasefront_core::encode::brightness::Past;
pub use pipeline::{Deliver, FLIGHTS, GpuPipeline, GpuReport, Job, Ticket};
pub use probe::probe;
pub use renderer::{InFlight, Renderer};

/// Why the GPU does not serve.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
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
    Core(#[from] phasefront_core::runtime::error::Error),
}

/// A result of the GPU.
pub(crate) type Result<T> = std::result::Result<T, GpuError>;
