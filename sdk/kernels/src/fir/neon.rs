//! The filter for NEON: 8 pixels per pair of registers, real and imaginary. NEON is part of every ARM64 processor.
#![allow(unsafe_code)]

use super::{Kernels, Lanes, Pixel, Run, Tap, Taps};
use std::arch::aarch64::*;

pub(super) const KERNELS: Kernels = Kernels { one, two, blend };

/// # Safety
/// The contract of [`super::one`].
unsafe fn one(taps: &Taps, run: Run<1>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::one::<int16x8x2_t, 2>(taps, run) }
}

/// # Safety
/// The contract of [`super::two`].
unsafe fn two(taps: &Taps, run: Run<2>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::two::<int16x8x2_t, 1>(taps, run) }
}

/// # Safety
/// The contract of [`super::blend`].
unsafe fn blend(field: &mut [Pixel], light: &[Pixel], share: &[Pixel]) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::blend::<int16x8x2_t>(field, light, share) }
}

impl Lanes for int16x8x2_t {
    const LANES: usize = 8;
    /// The lower and upper halves of the real parts, then of the imaginary parts.
    type Sums = [[int32x4_t; 2]; 2];

    #[inline(always)]
    unsafe fn load(from: *const Pixel) -> Self {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe { vld2q_s16(from.cast()) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut Pixel) {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe { vst2q_s16(to.cast(), self) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe { int16x8x2_t(vaddq_s16(self.0, other.0), vaddq_s16(self.1, other.1)) }
    }

    #[inline(always)]
    unsafe fn blend(self, light: Self, share: Self) -> Self {
        // SAFETY: the caller upholds the contract of the trait.
        let part = |part, light, share| unsafe { vaddq_s16(part, vqrdmulhq_s16(vsubq_s16(part, light), share)) };
        int16x8x2_t(part(self.0, light.0, share.0), part(self.1, light.1, share.1))
    }

    #[inline(always)]
    unsafe fn sums(start: i32) -> Self::Sums {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe { [[vdupq_n_s32(start); 2]; 2] }
    }

    #[inline(always)]
    unsafe fn multiply(self, tap: &Tap, [re, im]: Self::Sums) -> Self::Sums {
        [products(self, tap[0], re), products(self, tap[1], im)]
    }

    #[inline(always)]
    unsafe fn narrow(sums: Self::Sums, shift: u32) -> Self {
        // SAFETY: the caller upholds the contract of the trait.
        let [re, im] = sums.map(|sums| unsafe {
            let [lower, upper] = sums.map(|sums| vshlq_s32(sums, vdupq_n_s32(1 - shift as i32)));
            vshrq_n_s16::<1>(vqmovn_high_s32(vqmovn_s32(lower), upper))
        });
        int16x8x2_t(re, im)
    }
}

/// Adds re·a + im·b to the sums.
#[inline(always)]
fn products(pixels: int16x8x2_t, [a, b]: [i16; 2], [lower, upper]: [int32x4_t; 2]) -> [int32x4_t; 2] {
    let int16x8x2_t(re, im) = pixels;
    // SAFETY: NEON is always there.
    unsafe {
        let lower = vmlal_n_s16(lower, vget_low_s16(re), a);
        let upper = vmlal_high_n_s16(upper, re, a);
        [vmlal_n_s16(lower, vget_low_s16(im), b), vmlal_high_n_s16(upper, im, b)]
    }
}
