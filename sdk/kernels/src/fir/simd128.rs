//! The filter for WebAssembly: 4 pixels per register.

use super::{Kernels, Lanes, Pixel, Run, Tap, Taps};
use std::arch::wasm32::*;

pub(super) const KERNELS: Kernels = Kernels { one, two, blend };

/// # Safety
/// The contract of [`super::one`].
unsafe fn one(taps: &Taps, run: Run<1>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::one::<v128, 4>(taps, run) }
}

/// # Safety
/// The contract of [`super::two`].
unsafe fn two(taps: &Taps, run: Run<2>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::two::<v128, 2>(taps, run) }
}

/// # Safety
/// The contract of [`super::blend`].
unsafe fn blend(field: &mut [Pixel], light: &[Pixel], share: &[Pixel]) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::blend::<v128>(field, light, share) }
}

impl Lanes for v128 {
    const LANES: usize = 4;
    type Sums = [Self; 2];

    #[inline(always)]
    unsafe fn load(from: *const Pixel) -> Self {
        // SAFETY: the caller upholds this function's contract.
        unsafe { v128_load(from.cast()) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut Pixel) {
        // SAFETY: the caller upholds this function's contract.
        unsafe { v128_store(to.cast(), self) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        i16x8_add(self, other)
    }

    #[inline(always)]
    unsafe fn blend(self, light: Self, share: Self) -> Self {
        i16x8_add(self, i16x8_q15mulr_sat(i16x8_sub(self, light), share))
    }

    #[inline(always)]
    unsafe fn sums(start: i32) -> Self::Sums {
        [i32x4_splat(start); 2]
    }

    #[inline(always)]
    unsafe fn multiply(self, tap: &Tap, [re, im]: Self::Sums) -> Self::Sums {
        [
            i32x4_add(re, i32x4_dot_i16x8(self, word(tap[0]))),
            i32x4_add(im, i32x4_dot_i16x8(self, word(tap[1]))),
        ]
    }

    #[inline(always)]
    unsafe fn narrow([re, im]: Self::Sums, shift: u32) -> Self {
        let doubled = i16x8_narrow_i32x4(i32x4_shr(re, shift - 1), i32x4_shr(im, shift - 1));
        i16x8_shr(i16x8_shuffle::<0, 4, 1, 5, 2, 6, 3, 7>(doubled, doubled), 1)
    }
}

/// Returns a tap's two factors in all lanes.
#[inline(always)]
fn word(factors: [i16; 2]) -> v128 {
    let word = u32::from(factors[0].cast_unsigned()) | u32::from(factors[1].cast_unsigned()) << 16;
    i32x4_splat(word.cast_signed())
}
