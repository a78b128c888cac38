//! The filter in plain Rust: the definition that the others are tested against.
//!
//! It is slow if the processor has no fused multiply-add, because the language then computes it in software. x86
//! processors without one are older than AVX2.
#![allow(unsafe_code)]

use super::{Lanes, Run, Taps};

const LANES: usize = 8;

/// # Safety
/// The contract of [`super::filter`].
pub(super) unsafe fn kernel(taps: &Taps, run: Run<'_>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::filter::<[f32; LANES], 1>(taps, run) }
}

impl Lanes for [f32; LANES] {
    const LANES: usize = LANES;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        [value; LANES]
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller upholds this function's contract.
        unsafe { from.cast::<Self>().read_unaligned() }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the caller upholds this function's contract.
        unsafe { to.cast::<Self>().write_unaligned(self) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] + other[i])
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] * other[i])
    }

    #[inline(always)]
    fn plus(self, a: Self, b: Self) -> Self {
        std::array::from_fn(|i| a[i].mul_add(b[i], self[i]))
    }

    #[inline(always)]
    fn minus(self, a: Self, b: Self) -> Self {
        std::array::from_fn(|i| (-a[i]).mul_add(b[i], self[i]))
    }
}
