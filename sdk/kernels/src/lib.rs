//! Fused chains of 3×3 convolutions: the inner loops of Phasefront's hologram networks.
//!
//! A chain runs depth first. A frame is cut into bands of rows, and each band is a task of the current rayon pool.
//! Within a band, rows flow through all layers at once, and three rows of each layer's input are kept
//! ([`wavefront`](self)). The working memory is therefore small and independent of the frame's height, and the result
//! does not depend on how the frame is cut.
//!
//! `int8` defines the arithmetic of the quantised chain so that every instruction set gives the same bits; `f32` chains
//! agree to rounding. Each instruction set is one file. The others are tested against `portable`, which is plain Rust.
//! `unsafe` is confined to those files and two that serve the optics: [`wide!`] runs plain loops in the widest vectors,
//! and [`each_tile_rows`] lets threads fill a plane whose tiles are stored column by column.
//!
//! [`fir`] is separate: it is the filter that propagates a wave from plane to plane. So are the Fourier [`transforms`].
//!
//! On some instruction sets the hidden layers of the int8 chain run in tiles of 4×4 outputs, which takes a quarter of
//! the products and gives the same bits (`winograd`).
//!
//! A chain may run at half the resolution. Its last layer then has an output for each of a square's four pixels
//! (`places`).
//!
//! This crate does not depend on ONNX, tract or optics.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod bounds;
mod f32;
mod fft;
pub mod fir;
mod int8;
mod isa;
pub mod parallel;
#[cfg(feature = "peak")]
mod peak;
mod places;
mod rows;
mod size;
mod tiles;
mod wavefront;
mod wide;
#[cfg_attr(
    not(any(
        target_arch = "x86_64",
        target_arch = "aarch64",
        all(target_arch = "wasm32", target_feature = "simd128")
    )),
    allow(dead_code, unused_macros, unused_imports)
)]
mod winograd;

mod portable;

#[cfg(target_arch = "aarch64")]
mod arm;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

#[cfg(target_arch = "x86_64")]
mod x86;
pub use bounds::Bounds;
pub use f32::{F32Chain, F32Layer};
pub use fft::transforms;
pub use int8::{Int8Chain, Int8Layer, Quantiser, Requantise, SkipSum};
pub use isa::Isa;
#[cfg(feature = "peak")]
pub use peak::{f32_peak, int8_peak};
pub use rows::{Band, Rows};
pub use size::Size;
pub use tiles::{TILE, TILE_VALUES, TileRows, each_tile_rows};
pub use wavefront::{Scratch, Tiling};
pub use wide::{has_avx2, has_avx512, in_avx2, in_avx512};

/// The number of planes of a hologram network's output: two per colour.
pub const OUTPUTS: usize = 6;

/// Checks a chain's shapes, `(inputs, outputs)` of each layer, and returns the side of its places: 2 if the last layer
/// has outputs for the four pixels of a square, else 1.
fn check_shapes(mut layers: impl ExactSizeIterator<Item = (usize, usize)>) -> Result<usize, String> {
    let count = layers.len();
    let Some((inputs, filters)) = layers.next().filter(|_| count >= 2) else {
        return Err("a chain has two layers at least".into());
    };
    if filters == 0 || filters % 8 != 0 || inputs == 0 {
        return Err(format!("{filters} filters; kernels take a multiple of 8"));
    }
    let mut side = 1;
    for (i, shape) in layers.enumerate() {
        let right = if i + 2 == count {
            if shape.1 == 4 * OUTPUTS && inputs % 4 == 0 {
                side = 2;
            }
            (filters + inputs, side * side * OUTPUTS)
        } else {
            (filters, filters)
        };
        if shape != right {
            return Err(format!(
                "layer {} has (inputs, outputs) {shape:?}; {right:?} is right",
                i + 1
            ));
        }
    }
    Ok(side)
}
