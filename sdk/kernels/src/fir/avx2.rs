//! The filter for AVX2 with FMA: 8 values per register.
#![allow(unsafe_code)]

use super::{Kernel, Lanes, Run, Taps};
use std::arch::x86_64::*;

/// Returns the kernel if the processor supports it.
pub(super) fn kernel() -> Option<Kernel> {
    (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")).then_some(run as Kernel)
}

/// # Safety
/// The contract of [`super::filter`].
#[target_feature(enable = "avx2,fma")]
unsafe fn run(taps: &Taps, run: Run<'_>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::filter::<__m256, 2>(taps, run) }
}

#[expect(
    clippy::undocumented_unsafe_blocks,
    reason = "all run inside `run` alone, which has the instructions"
)]
impl Lanes for __m256 {
    const LANES: usize = 8;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        unsafe { _mm256_set1_ps(value) }
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        unsafe { _mm256_loadu_ps(from) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        unsafe { _mm256_storeu_ps(to, self) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        unsafe { _mm256_add_ps(self, other) }
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        unsafe { _mm256_mul_ps(self, other) }
    }

    #[inline(always)]
    fn plus(self, a: Self, b: Self) -> Self {
        unsafe { _mm256_fmadd_ps(a, b, self) }
    }

    #[inline(always)]
    fn minus(self, a: Self, b: Self) -> Self {
        unsafe { _mm256_fnmadd_ps(a, b, self) }
    }
}
