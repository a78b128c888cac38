//! Runs whole frames on the GPU: the stages of [`phasefront_core::pipeline`] as wgpu compute passes for Vulkan, Metal,
//! DirectX 12 and a browser's WebGPU. The input is a frame and the output is modulator levels. The CPU computes only
//! the focal stack of natural focus, from the frame as the GPU has read it.
//!
//! Each stage is a .wgsl file beside its Rust file. The Rust code prepends a header of constants to the shader text, so
//! that loops have constant bounds. The CPU stage is the reference: f32 agrees with it to 1e-4, int8 networks agree bit
//! for bit. A device is used only after it has computed small frames as the CPU does.
//!
//! | module | purpose |
//! |---|---|
//! | `device` | opens a GPU, compiles programs, allocates memory, returns failures as errors |
//! | `input` | converts camera formats to groups of four channels, and decides the depth of pixels from readings |
//! | `method` | runs a network (`chain`), the plane sweep (`sweep`, `hidden`), or the network on the sweep's field |
//! | `fft` | applies a filter in the Fourier domain in three dispatches; `paths` several and their adjoints |
//! | `encode` | filters, largest amplitude, double phase, levels, local and midpoint correction, natural focus |
//! | `pipeline` | runs all stages, with three frames in flight |
//! | `probe` | compares a small frame with the CPU's |
//! | `renderer` | reopens a lost device |
//! | `view` | renders what an eye sees of levels on the GPU |
//! | `canvas` | draws to the canvases of a browser's page |
//! | `watch` | abandons calls into drivers that do not return |
//! | `blocking` | blocks on the futures of a native GPU |
//!
//! What waits for the device is a future, because a browser's thread must not block. `blocking` blocks on them.
//!
//! In `chain` each thread computes four pixels of a column for eight filters at a time. The weights are in uniform
//! memory in the order in which they are read. Two layers and the skip around them can be one dispatch, which saves
//! memory reads and writes and costs a fifth more arithmetic. `sweep` can process one or two planes per dispatch. The
//! plan measures both variants and takes the faster. Sines, arc functions and tanh are polynomials in this crate,
//! because drivers guarantee an error of only 5e-4.
//!
//! A session falls back to the CPU by itself. To display levels without a copy to the CPU, use this crate directly:
//!
//! ```no_run
//! use phasefront_gpu::{Deliver, Device, DeviceOptions, Frame, GpuError, GpuPipeline, Job, probe};
//! use phasefront::{Method, Network, RgbdFrame, Size, Target};
//! use std::sync::Arc;
//!
//! fn show(network: Arc<Network>, frame: &RgbdFrame) -> Result<(), GpuError> {
//!     let device = Arc::new(Device::open(&DeviceOptions::default())?);
//!     let job = Job::new(Size { width: 1920, height: 1080 }, Method::Network(network), Target::default());
//!     probe(&device, &job)?;
//!     let mut pipeline = GpuPipeline::new(&device, &job)?;
//!     let ticket = pipeline.submit(&Frame::of(frame), Deliver::Shown)?;
//!     let _levels = pipeline.texture(&ticket);
//!     pipeline.finish(ticket)?;
//!     Ok(())
//! }
//! ```

#[cfg(not(target_arch = "wasm32"))]
mod blocking;
mod brightness;
#[cfg(target_arch = "wasm32")]
mod canvas;
mod device;
mod encode;
mod fft;
mod input;
mod method;
mod numbers;
mod pipeline;
mod probe;
mod renderer;
mod view;
mod watch;

#[cfg(not(target_arch = "wasm32"))]
pub use blocking::probe;
#[cfg(target_arch = "wasm32")]
pub use canvas::paint;
#[cfg(not(target_arch = "wasm32"))]
pub use device::peak::Peak;
pub use device::{Device, DeviceOptions};
pub use input::{Colour, ColourData, Depth, DepthData, Frame};
pub use method::chain::{ChainOptions, Fusion, GpuNetworkPlan};
pub use numbers::Float;
pub use phasefront_core::frame::Past;
pub use pipeline::{Deliver, FLIGHTS, GpuLevels, GpuPipeline, GpuReport, Job, Ticket};
pub use probe::probe_async;
pub use renderer::{InFlight, Renderer};
pub use view::GpuView;

/// The reason why the GPU cannot be used.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// There is no GPU, or none that matches the options.
    #[error("no GPU: {0}")]
    None(String),
    /// The GPU does not support a feature, a limit or a size.
    #[error("the GPU refuses: {0}")]
    Refused(String),
    /// The GPU has too little memory.
    #[error("the GPU is out of memory: {0}")]
    OutOfMemory(String),
    /// The results differ from the CPU's.
    #[error("the GPU answers wrongly: {0}")]
    Wrong(String),
    /// The device was lost, with the frames in flight.
    #[error("the GPU was lost: {0}")]
    Lost(String),
    /// An error that the CPU path returns too.
    #[error(transparent)]
    Core(#[from] phasefront_core::runtime::error::Error),
}

/// The result type of this crate.
pub(crate) type Result<T> = std::result::Result<T, GpuError>;
