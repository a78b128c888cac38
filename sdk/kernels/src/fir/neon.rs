//! The filter for NEON: 4 values per register. NEON is part of every ARM64 processor.
#![allow(unsafe_code)]

use super::{Lanes, Run, Taps};
use std::arch::aarch64::*;

/// Filters a run.
///
/// # Safety
/// The contract of [`super::filter`].
pub(super) unsafe fn kernel(taps: &Taps, run: Run<'_>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::filter::<float32x4_t, 4>(taps, run) }
}

#[expect(clippy::undocumented_unsafe_blocks, reason = "NEON is always there")]
impl Lanes for float32x4_t {
    const LANES: usize = 4;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        unsafe { vdupq_n_f32(value) }
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        unsafe { vld1q_f32(from) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        unsafe { vst1q_f32(to, self) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        unsafe { vaddq_f32(self, other) }
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        unsafe { vmulq_f32(self, other) }
    }

    #[inline(always)]
    fn plus(self, a: Self, b: Self) -> Self {
        unsafe { vfmaq_f32(self, a, b) }
    }

    #[inline(always)]
    fn minus(self, a: Self, b: Self) -> Self {
        unsafe { vfmsq_f32(self, a, b) }
    }
}
