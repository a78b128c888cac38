//! The int8 kernels for ARM64 with the signed dot product.
//!
//! SDOT multiplies only signed bytes, so 128 is subtracted from the activations on loading, and each filter's bias
//! compensates for it. The code uses inline assembly because the intrinsics are not stable.
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::arm::neon::{BLOCKS, Dots, FILTERS, SPAN, int8_kernels, pack, requantised, store};
use crate::int8::{GROUP, Kernels, LayerKernels, Packed, RowKernels, quantise_row, rescale_row};
use crate::wavefront::{BLOCK, Geometry, Slots, last_row_by_blocks};
use std::arch::aarch64::*;
use std::arch::asm;

/// Returns the kernels if the processor supports them.
pub(crate) fn kernels() -> Option<Kernels> {
    std::arch::is_aarch64_feature_detected!("dotprod").then_some(Kernels {
        layers: LayerKernels::Rows(RowKernels {
            pack,
            hidden_row,
            last_row,
            offset: 128,
        }),
        quantise_row,
        rescale_row,
    })
}

int8_kernels!("neon,dotprod");

/// Loads sixteen bytes: four pixels of a group.
///
/// # Safety
/// The bytes at `pixels` must be readable.
#[inline]
#[target_feature(enable = "neon,dotprod")]
unsafe fn load(pixels: *const u8) -> int8x16_t {
    // SAFETY: the caller upholds this function's contract. Flipping the top bit subtracts 128.
    unsafe { vreinterpretq_s8_u8(veorq_u8(vld1q_u8(pixels), vdupq_n_u8(128))) }
}

/// Returns `sum + dot(pixels, weights[LANE])` for each of four pixels.
#[inline]
#[target_feature(enable = "neon,dotprod")]
pub(crate) fn dot<const LANE: usize>(sum: int32x4_t, pixels: int8x16_t, weights: int8x16_t) -> int32x4_t {
    let mut result = sum;
    // SAFETY: the assembly uses only registers, and the function enables the feature.
    unsafe {
        asm!("sdot {0:v}.4s, {1:v}.16b, {2:v}.4b[{lane}]",
            inout(vreg) result, in(vreg) pixels, in(vreg) weights, lane = const LANE,
            options(pure, nomem, nostack, preserves_flags));
    }
    result
}
