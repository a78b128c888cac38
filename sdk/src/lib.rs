//! Converts RGB-D frames to phase-only 3D holograms on the device, in real time. Implements *End-to-end learning of 3D
//! phase-only holograms for holographic display* (Shi, Li, Matusik, Light: Science & Applications 11, 247, 2022).
//!
//! A [session] makes a [`Hologram`] of each camera frame. A [`Pipeline`] takes frames that are already amplitude and
//! normalized depth:
//!
//! ```
//! use phasefront::ndarray::{Array2, Array3};
//! use phasefront::{Display, EncoderOptions, Method, Pipeline, RgbdFrame, Size, Sweep, Target};
//!
//! let display = Display::from_toml("width = 64\nheight = 48\noffset_mm = 3.0")?;
//! let method = Method::Sweep(Sweep::for_display(&display));
//! let target = Target::from(display);
//! let pipeline = Pipeline::new(Size { width: 64, height: 48 }, method, &target, &EncoderOptions::default())?;
//!
//! // A bright square in front of a dark wall.
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
//! | [`session`] | sequences of frames: live, video, images; quality levels, statistics, events |
//! | [`input`] | camera input: colour and depth images, their formats, orientation, two cameras |
//! | [`Method`] | how a hologram is made: a [`Network`], the plane [`Sweep`], or both |
//! | [`target`] | the target of a hologram: display, modulator response, laser light, correction of the optics |
//! | [`EncoderOptions`] | how a field becomes levels: [`Encoding`], [`Brightness`] |
//! | [`Pipeline`] | a single frame through all stages, without a session |
//! | [`Hologram::of_field`] | your own complex field, to levels |
//! | [`output`] | converts levels to the images that a modulator takes, and back; commercially available modulators |
//!
//! With the feature `models`, [`models`] has the bundled networks, and [`SessionOptions::for_target`] chooses one.
//!
//! # Features
//!
//! - `tract`, on by default: runs networks that the kernels do not support on tract. Without it they are refused.
//! - `models`: the bundled networks in int8, 0.2 MB.
//! - `gpu`: computes whole frames on Vulkan, Metal or DirectX 12. Select it with
//!   [`SessionOptions::backend`](session::SessionOptions::backend).
//!
//! # How to be fast
//!
//! - Make a plan once for each shape, and keep it and its scratch. Plans are immutable and can be shared between
//!   threads; their hot calls allocate nothing.
//! - Use int8 networks: they are three to four times as fast as f32 networks and lose between a few hundredths of a dB
//!   and 0.3 dB.
//! - Compile with optimisation, also in development: `[profile.dev.package."*"] opt-level = 3`. The kernels choose the
//!   processor's instructions at run time (AVX2, AVX-512, AMX, NEON) and need no flags. Only WebAssembly needs a flag
//!   (`-C target-feature=+simd128`), because its vector instructions are fixed at compile time.
//! - Stages use the current rayon pool. `ThreadPool::install` limits their threads. A session has its own pool.
//! - A modulator at the midpoint (`offset_mm = 0`) and a sweep, which propagates to the modulator itself, need no
//!   Fourier transforms.
//!
//! # Conventions
//!
//! Colours are in the order red, green, blue. Lengths are in metres (`_m`). Planes are row-major (H, W), stacks (C, H,
//! W). x points right, y down, z toward the viewer; the midpoint hologram is at z = 0. The value of an image is the
//! amplitude. C is 3, or 1 if the display has one laser, which displays the luminance of a picture
//! ([`RgbdFrame::for_display`]).

#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(feature = "models")]
pub use phasefront_models as models;
pub use {ndarray, num_complex};

pub mod input;
pub mod output {
    //! Converts levels to the images that a modulator takes, and back; data of commercially available modulators.
    pub use phasefront_core::display::levels::Levels;
    pub use phasefront_core::output::modulator::{ModulatorSpec, Packing};
    pub use phasefront_core::output::{BitPlanes, Cells, Layout, Output, Placement};
    // For the bindings, which have them in each language.
    #[doc(hidden)]
    pub use phasefront_core::output::{ModulatorInput, OutputSize};
}
pub mod session;
pub mod target {
    //! The parts of a hologram's target besides its [`Display`](crate::Display): modulator response, laser light and
    //! correction of the optics.
    pub use phasefront_core::display::illumination::Illumination;
    pub use phasefront_core::display::primaries::Balance;
    pub use phasefront_core::display::response::Response;
    pub use phasefront_core::optics::zernike::Aberration;
}

pub use phasefront_core::Size;
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

/// Compiles the code of the README and of the guide.
#[cfg(all(doctest, feature = "models"))]
#[doc = include_str!("../../README.md")]
#[doc = include_str!("../../docs/rust.md")]
struct Pages;
