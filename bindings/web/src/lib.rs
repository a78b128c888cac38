//! Phasefront for browsers. This crate only translates: what a call does, is the core's. The npm package puts a layer
//! of TypeScript over it (`package/src`), which alone calls what is here: objects named `Raw…`, formats by the names
//! that the TypeScript has, lengths in its units. Rules of this border:
//!
//! - Images come in as bytes that are copied once into the module's memory, and go out as copies, for memory that grows
//!   moves, and a page hands arrays to its workers.
//! - Every error is a JavaScript `Error` with the core's line and its `kind`. A panic cannot be caught in WebAssembly:
//!   it throws an error of the kind `panic`, after which the module must not be called again; the layer above sees to
//!   that.

#[cfg(target_arch = "wasm32")]
mod error;
#[cfg(target_arch = "wasm32")]
mod frame;
#[cfg(target_arch = "wasm32")]
mod hologram;
#[cfg(target_arch = "wasm32")]
mod network;
#[cfg(target_arch = "wasm32")]
mod options;
#[cfg(target_arch = "wasm32")]
mod session;
#[cfg(target_arch = "wasm32")]
mod target;

#[cfg(target_arch = "wasm32")]
pub use error::{start, version};
