//! Whole frames on the GPU: the stages of [`phasefront_core::pipeline`] as compute passes of wgpu, for Vulkan, Metal
//! and DirectX 12. A frame goes in, modulator levels come out, and nothing comes back to the CPU between.
//!
//! Each stage is a .wgsl file beside its Rust. A header that the Rust writes before the text holds the constants, so
//! that loops have constant bounds. The CPU's stage is the oracle: f32 agrees with it to 1e-4, int8 networks agree to
//! the bit. A device is used only after it has computed a small frame as the CPU does.
//!
//! | module | what it does |
//! |---|---|
//! | `device` | opens a GPU, compiles programs, holds memory; errors are values |
//! | `input` | camera formats to groups of four channels |
//! | `method` | a network (`chain`), the plane sweep (`sweep`, `hidden`), or the network on the sweep's field |
//! | `fft` | a filter in the Fourier domain in three dispatches |
//! | `encode` | filters, largest amplitude, double phase, levels, local and midpoint correction |
//! | `pipeline` | all of it, three frames in flight |
//! | `probe` | compares a small frame with the CPU's |
//! | `renderer` | opens a lost device again |
//! | `watch` | gives up on drivers that do not answer |
//!
//! In `chain` a thread computes four pixels of a column for eight filters at a time, with weights in uniform memory in
//! reading order. Two layers and the skip around them can be one dispatch: fewer reads and writes of memory for a fifth
//! more arithmetic. `sweep` can take one or two planes in a dispatch. The plan measures both ways and takes the faster.
//! Sines, arc functions and tanh are polynomials of our own, because drivers promise only 5e-4.
//!
//! A session falls back to the CPU by itself. To display levels without a copy to the CPU, plan here:
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
mod device;
mod encode;
mod fft;
mod input;
mod method;
mod numbers;
mod pipeline;
mod probe;
mod renderer;
mod watch;

pub use device::peak::Peak;
pub use device::{Device, DeviceOptions};
pub use input::{Colour, ColourData, Depth, DepthData, Frame};
pub use method::chain::{ChainOptions, Fusion, GpuNetworkPlan};
pub use numbers::Float;
pub use phasefront_core::encode::brightness::Past;
pub use pipeline::{Deliver, FLIGHTS, GpuPipeline, GpuReport, Job, Ticket};
pub use probe::probe;
pub use renderer::{InFlight, Renderer};

/// Why the GPU does not serve.
#[derive(Debug, Clone, thiserror::Error)]
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
