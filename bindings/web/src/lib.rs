//! Phasefront for browsers. This crate only translates calls to the core. Only the TypeScript layer of the npm package
//! (`package/src`) calls it: it uses objects named `Raw…`, the format names of the TypeScript and lengths in its units.
//! The rules of this interface:
//!
//! - Images are passed in as bytes that are copied once into the module's memory, and returned as copies: memory moves
//!   when it grows, and a page transfers arrays to its workers.
//! - Every error is a JavaScript `Error` with the core's one-line message and its `kind`. A panic cannot be caught in
//!   WebAssembly: it throws an error of the kind `panic`, after which the module must not be called again. The
//!   TypeScript layer ensures that.

#[cfg(target_arch = "wasm32")]
mod error;
#[cfg(target_arch = "wasm32")]
mod frame;
#[cfg(target_arch = "wasm32")]
mod hologram;
#[cfg(target_arch = "wasm32")]
mod log;
#[cfg(target_arch = "wasm32")]
mod modulator;
#[cfg(target_arch = "wasm32")]
mod network;
#[cfg(target_arch = "wasm32")]
mod options;
#[cfg(target_arch = "wasm32")]
mod session;
#[cfg(target_arch = "wasm32")]
mod target;
#[cfg(all(target_arch = "wasm32", target_feature = "atomics"))]
mod threads;

#[cfg(target_arch = "wasm32")]
pub use error::{start, version};
#[cfg(all(target_arch = "wasm32", target_feature = "atomics"))]
pub use threads::{help, of_this_module, start_threads};
