//! Phasefront for Swift, Kotlin and Python, and through `bindings/c` for C. This crate only translates calls; the core
//! does the work.
//!
//! The packages in `ios/`, `android/` and `bindings/python/` add a layer written by hand to the code that is generated
//! from this crate, so that it feels native in each language. Only these layers use the objects named `Raw…`. This
//! crate follows these rules:
//!
//! - Images are passed as `&[u8]`, which UniFFI passes without a copy. Results are objects whose memory is read in
//!   place, at an address that is valid as long as the object, and images are written into memory of the caller.
//!   Nothing is passed pixel by pixel.
//! - Every call that can fail returns a result. A panic becomes [`PhasefrontError::Internal`].
//! - Listeners are called on the session's own thread.

mod display;
mod error;
mod frame;
mod hologram;
mod log;
mod modulator;
mod network;
#[cfg(not(feature = "tract"))]
mod no_depth_network;
mod options;
mod session;
mod statistics;
mod target;
mod trace;

pub use display::{Display, display_from_toml};
#[doc(hidden)]
pub use error::guard;
pub use error::{ListenerError, PhasefrontError};
pub use frame::{Cameras, ColourFormat, ColourInfo, ConfidenceInfo, DepthInfo, FrameInfo, PlaneInfo, Pose};
pub use hologram::{HologramInfo, OutputSize, RawHologram, RawMemory, RawPlanes};
pub use log::{LogLevel, LogListener, set_log_listener};
pub use modulator::{RawModulator, modulator_names};
pub use network::{DeepPair, DepthNetwork, Network, NetworkInfo, built_in_pair};
#[cfg(not(feature = "tract"))]
pub use no_depth_network::ColourScale;
pub use options::{
    Brightness, EncoderOptions, Encoding, Method, Quality, QualityLevel, RunningMode, SessionOptions, phone_options,
    session_options,
};
#[cfg(feature = "tract")]
pub use phasefront::input::ColourScale;
pub use phasefront::input::{
    ConfidenceFormat, DepthFormat, DepthRange, Intrinsics, Orientation, RgbEncoding, Rotation, YuvMatrix,
};
pub use phasefront::output::{Layout, Placement};
pub use phasefront::session::{Backend, Focus, Thermal};
pub use session::{DropReason, QualityChange, QualityReason, RawSession, SessionListener};
pub use statistics::{Drops, FrameTimes, Statistics};
pub use target::Target;
pub use trace::{Stage, StageListener, set_stage_listener};

uniffi::setup_scaffolding!();

type Int = usize;

uniffi::custom_type!(
    /// A number of pixels, steps and the like.
    Int,
    i32,
    {
        remote,
        lower: |number| i32::try_from(number).unwrap_or(i32::MAX),
        // A negative number becomes one that every check of a range refuses.
        try_lift: |number| Ok(u32::try_from(number).unwrap_or(u32::MAX) as usize),
    }
);

/// Returns the version of the library.
#[uniffi::export]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}
