//! int8 kernels for ARM64 with the mixed-sign dot product of i8mm: USDOT multiplies the activations as
//! they are. Inline assembly: the intrinsics are not stable.
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::arm::neon::{BLOCKS, Constants, Dots, FILTERS, SPAN, int8_kernels, pack, requantise, store};
use crate::int8::{GROUP, Kernels, Packed, quantise_row, rescale_row};
use crate::wavefront::{BLOCK, Geometry, Window, last_row_by_blocks};
use std::arch::aarch64::*;
use std::arch::asm;

/// The kernels, where the processor has what they need.
pub(crate) fn kernels() -> Option<Kernels> {
    std::arch::is_aarch64_feature_detected!("i8mm").then_some(Kernels {
        pack,
        hidden_row,
        last_row,
        offset: 0,
        quantise_row,
        rescale_row,
    })
}

int8_kernels!("neon,i8mm");

/// Sixteen bytes: four pixels of a group.
///
/// # Safety
/// They lie at `pixels`.
#[inline]
#[target_feature(enable = "neon,i8mm")]
unsafe fn load(pixels: *const u8) -> uint8x16_t {
    // SAFETY: as the function's own.
    unsafe { vld1q_u8(pixels) }
}

/// `sum + dot(pixels, weights[LANE])` for each of four pixels.
#[inline]
#[target_feature(enable = "neon,i8mm")]
pub(crate) fn dot<const LANE: usize>(sum: int32x4_t, pixels: uint8x16_t, weights: int8x16_t) -> int32x4_t {
    let mut result = sum;
    // SAFETY: registers alone; the feature is the function's.
    unsafe {
        asm!("usdot {0:v}.4s, {1:v}.16b, {2:v}.4b[{lane}]",
            inout(vreg) result, in(vreg) pixels, in(vreg) weights, lane = const LANE,
            options(pure, nomem, nostack, preserves_flags));
    }
    result
}
