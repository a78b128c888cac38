//! The filter for AVX2: 8 pixels per register.
#![allow(unsafe_code)]

use super::{Kernels, Lanes, Pixel, Run, Tap, Taps};
use std::arch::x86_64::*;

/// Returns the kernels if the processor supports it.
pub(super) fn kernels() -> Option<Kernels> {
    is_x86_feature_detected!("avx2").then_some(Kernels { one, two, blend })
}

/// # Safety
/// The contract of [`super::one`].
#[target_feature(enable = "avx2")]
unsafe fn one(taps: &Taps, run: Run<1>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::one::<__m256i, 4>(taps, run) }
}

/// # Safety
/// The contract of [`super::two`].
#[target_feature(enable = "avx2")]
unsafe fn two(taps: &Taps, run: Run<2>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::two::<__m256i, 2>(taps, run) }
}

/// # Safety
/// The contract of [`super::blend`].
#[target_feature(enable = "avx2")]
unsafe fn blend(field: &mut [Pixel], light: &[Pixel], share: &[Pixel]) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::blend::<__m256i>(field, light, share) }
}

impl Lanes for __m256i {
    const LANES: usize = 8;
    type Sums = [Self; 2];

    #[inline(always)]
    unsafe fn load(from: *const Pixel) -> Self {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe { _mm256_loadu_si256(from.cast()) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut Pixel) {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe { _mm256_storeu_si256(to.cast(), self) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe { _mm256_add_epi16(self, other) }
    }

    #[inline(always)]
    unsafe fn blend(self, light: Self, share: Self) -> Self {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe { _mm256_add_epi16(self, _mm256_mulhrs_epi16(_mm256_sub_epi16(self, light), share)) }
    }

    #[inline(always)]
    unsafe fn sums(start: i32) -> Self::Sums {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe { [_mm256_set1_epi32(start); 2] }
    }

    #[inline(always)]
    unsafe fn multiply(self, tap: &Tap, [re, im]: Self::Sums) -> Self::Sums {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe {
            let [c, d] = [word(tap[0]), word(tap[1])];
            [
                _mm256_add_epi32(re, _mm256_madd_epi16(self, c)),
                _mm256_add_epi32(im, _mm256_madd_epi16(self, d)),
            ]
        }
    }

    #[inline(always)]
    unsafe fn narrow([re, im]: Self::Sums, shift: u32) -> Self {
        // SAFETY: the caller upholds the contract of the trait.
        unsafe {
            // A shift by a vector takes half the time of one by a number that is not a constant.
            let shift = _mm256_set1_epi32(shift as i32 - 1);
            let [re, im] = [_mm256_srav_epi32(re, shift), _mm256_srav_epi32(im, shift)];
            // Each 128-bit lane has four real and four imaginary parts.
            let order =
                _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 8, 9, 2, 3, 10, 11, 4, 5, 12, 13, 6, 7, 14, 15));
            let doubled = _mm256_shuffle_epi8(_mm256_packs_epi32(re, im), order);
            _mm256_srai_epi16::<1>(doubled)
        }
    }
}

/// Returns a tap's two factors in all lanes.
///
/// # Safety
/// The caller must have detected the instruction set.
#[inline(always)]
unsafe fn word(factors: [i16; 2]) -> __m256i {
    let word = u32::from(factors[0].cast_unsigned()) | u32::from(factors[1].cast_unsigned()) << 16;
    // SAFETY: the caller upholds this function's contract.
    unsafe { _mm256_set1_epi32(word.cast_signed()) }
}
