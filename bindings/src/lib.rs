//! Phasefront for Swift, Kotlin and Python, and under `bindings/c` for C. This crate only translates: what a call does,
//! is the core's.
//!
//! The packages in `ios/`, `android/` and `bindings/python/` put a layer by hand over what is generated from here, so
//! that it feels native there; the objects named `Raw…` are for them alone. Rules of this border:
//!
//! - Images come in as `&[u8]`, which UniFFI passes without a copy; results are objects whose memory is read in place,
//!   at an address that is valid as long as the object. Nothing is passed pixel by pixel.
//! - Every call gives a result; a panic becomes [`PhasefrontError::Internal`].
//! - Listeners are called on the session's own thread.

mod display;
mod error;
mod frame;
mod hologram;
mod log;
mod network;
mod options;
mod session;
mod statistics;
mod target;
mod trace;

pub use display::{Display, display_from_toml};
#[doc(hidden)]
pub use error::guard;
pub use error::{ListenerError, PhasefrontError};
pub use frame::{
    Cameras, ColourFormat, ColourInfo, ConfidenceFormat, ConfidenceInfo, DepthFormat, DepthInfo, FrameInfo, Intrinsics,
    Orientation, PlaneInfo, Pose, Rotation, YuvMatrix,
};
pub use hologram::{HologramInfo, RawHologram, RawImage, RawPlanes};
pub use log::{LogLevel, LogListener, set_log_listener};
pub use network::{DeepPair, Network, NetworkInfo, built_in_pair};
pub use options::{
    Backend, Brightness, DepthRange, Encoding, Layout, Method, Placement, Quality, QualityLevel, RunningMode,
    SessionOptions, Thermal, session_options,
};
pub use session::{DropReason, QualityChange, QualityReason, RawSession, SessionListener};
pub use statistics::{Drops, FrameTimes, Statistics};
pub use target::Target;
pub use trace::{Stage, StageListener, set_stage_listener};

uniffi::setup_scaffolding!();

/// The version of the library.
#[uniffi::export]
pub fn version() -> Result<String, PhasefrontError> {
    Ok(env!("CARGO_PKG_VERSION").to_owned())
}
