//! RGB-D frames to phase-only 3D holograms, on the device, in real time: an implementation of *End-to-end learning of
//! 3D phase-only holograms for holographic display* (Shi, Li, Matusik, Light: Science & Applications 11, 247, 2022).
//!
//! Each frame of a camera becomes a [`Hologram`] in a [session]. A frame that is already amplitude and
//! normalized depth goes through a [`Pipeline`]:
//!
//! ```
//! use phasefront::ndarray::{Array2, Array3};
//! use phasefront::{Display, EncoderOptions, Method, Pipeline, RgbdFrame, Sweep, Target};
//!
//! let display = Display::from_toml("width = 64\nheight = 48\noffset_mm = 3.0")?;
//! let method = Method::Sweep(Sweep::for_display(&display));
//! let target = Target::from(display);
//! let pipeline = Pipeline::new((48, 64), method, &target, &EncoderOptions::default())?;
//!
//! // A bright square before a dark wall.
//! let inside = |y: usize, x: usize| (16..32).contains(&y) && (24..40).contains(&x);
//! let rgb = Array3::from_shape_fn((3, 48, 64), |(_, y, x)| if inside(y, x) { 0.9 } else { 0.2 });
//! let depth = Array2::from_shape_fn((48, 64), |(y, x)| if inside(y, x) { 0.1 } else { 0.8 });
//! let frame = RgbdFrame::new(rgb, depth)?;
//!
//! // (3, 48, 64) levels, red first.
//! let levels = pipeline.levels(&frame)?;
//! # assert!(levels.iter().any(|&level| level != levels[0]));
//! # Ok::<(), phasefront::Error>(())
//! ```
//!
//! # Map
//!
//! | | |
//! |---|---|
//! | [`session`] | many frames: live, video, images; quality levels, statistics, events |
//! | [`input`] | what cameras give: colour and depth images, their formats, orientation, two cameras |
//! | [`Method`] | how a hologram is made: a [`Network`], the plane [`Sweep`], or both |
//! | [`target`] | what it is made for: display, modulator's response, lasers' light, correction of the optics |
//! | [`EncoderOptions`] | how a field becomes levels: [`Encoding`], [`Brightness`] |
//! | [`Pipeline`] | one frame through all stages, by hand |
//! | [`output`] | levels to the images that a modulator takes, and back; modulators that can be bought |
//!
//! The bundled networks are in the crate `phasefront-models`.
//!
//! # Features
//!
//! - `tract`, on by default: networks that the kernels do not take run on tract. Without it they are refused.
//! - `gpu`: whole frames on Vulkan, Metal or DirectX 12, by
//!   [`SessionOptions::backend`](session::SessionOptions::backend).
//!
//! # How to be fast
//!
//! - Make a plan once for a shape, keep it and its scratch. Plans are immutable and shared between threads; their hot
//!   calls allocate nothing.
//! - Take int8 networks: three to four times as fast as f32, for some hundredths to 0.3 dB.
//! - Compile with optimisation, also in development: `[profile.dev.package."*"] opt-level = 3`. The kernels choose the
//!   processor's instructions when they run (AVX2, AVX-512, AMX, NEON); no flags are needed, but for WebAssembly, whose
//!   vectors are known before: `-C target-feature=+simd128`.
//! - Stages use the current rayon pool. `ThreadPool::install` bounds their threads; a session has a pool of its own.
//! - A modulator at the midpoint (`offset_mm = 0`) or a sweep, which goes on to the modulator by itself, needs no
//!   Fourier transforms.
//!
//! # Conventions
//!
//! Colours in the order red, green, blue; lengths in metres (`_m`); planes row-major (H, W), stacks (C, H, W); x right,
//! y down, z toward the viewer; the midpoint hologram at z = 0. An image's value is the amplitude. C is 3, or 1 where
//! the display has one laser, which shows a picture's luminance ([`RgbdFrame::for_display`]).

#![cfg_attr(docsrs, feature(doc_cfg))]

pub use {ndarray, num_complex};

pub mod input;
pub mod output {
    //! Levels to the images that a modulator takes, and back; modulators that can be bought, as data.
    pub use phasefront_core::output::modulator::{ModulatorSpec, Packing};
    pub use phasefront_core::output::{BitPlanes, Cells, Layout, Levels, Output, Placement};
}
pub mod session;
pub mod target {
    //! What a hologram is made for beside its [`Display`](crate::Display): the modulator's response, the lasers' light,
    //! the correction of the optics.
    pub use phasefront_core::display::illumination::Illumination;
    pub use phasefront_core::display::response::Response;
    pub use phasefront_core::optics::zernike::Aberration;
}

pub use phasefront_core::display::Display;
pub use phasefront_core::display::target::Target;
pub use phasefront_core::encode::brightness::Brightness;
pub use phasefront_core::encode::{EncoderOptions, Encoding};
pub use phasefront_core::frame::RgbdFrame;
pub use phasefront_core::method::Method;
pub use phasefront_core::method::network::Network;
pub use phasefront_core::method::sweep::Sweep;
pub use phasefront_core::pipeline::{FrameReport, Pipeline, PipelineScratch};
pub use phasefront_core::runtime::error::{Error, Result};
pub use session::{Hologram, ImageSession, LiveSession, SessionOptions, VideoSession};
