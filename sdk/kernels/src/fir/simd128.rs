//! WebAssembly's vectors: 4 values to a register. They have no fused multiply-add, so products are rounded by
//! themselves: results differ from the other instruction sets' in their last bits.

use super::{Lanes, Run, Taps};
use std::arch::wasm32::*;

/// The kernel.
///
/// # Safety
/// As [`super::filter`].
pub(super) unsafe fn kernel(taps: &Taps, run: Run<'_>) {
    // SAFETY: the caller's.
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
        // SAFETY: the caller's.
        unsafe { v128_load(from.cast()) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the caller's.
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
