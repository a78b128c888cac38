//! The filter for WebAssembly: 4 values per register. WebAssembly has no fused multiply-add, so products are rounded
//! separately and results differ from the other instruction sets' in the last bits.

use super::{Lanes, Run, Taps};
use std::arch::wasm32::*;

/// Filters a run.
///
/// # Safety
/// The contract of [`super::filter`].
pub(super) unsafe fn kernel(taps: &Taps, run: Run<'_>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::filter::<v128, 4>(taps, run) }
}

impl Lanes for v128 {
    const LANES: usize = 4;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        f32x4_splat(value)
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller upholds this function's contract.
        unsafe { v128_load(from.cast()) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the caller upholds this function's contract.
        unsafe { v128_store(to.cast(), self) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        f32x4_add(self, other)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        f32x4_mul(self, other)
    }

    #[inline(always)]
    fn plus(self, a: Self, b: Self) -> Self {
        f32x4_add(self, f32x4_mul(a, b))
    }

    #[inline(always)]
    fn minus(self, a: Self, b: Self) -> Self {
        f32x4_sub(self, f32x4_mul(a, b))
    }
}
