//! The filter in plain Rust: the definition that the others are tested against.
#![allow(unsafe_code)]

use super::{Kernels, LEAST, Lanes, MOST, Pixel, Run, Tap, Taps};

const LANES: usize = 8;

pub(super) const KERNELS: Kernels = Kernels { one, two, blend };

/// # Safety
/// The contract of [`super::one`].
unsafe fn one(taps: &Taps, run: Run<1>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::one::<[Pixel; LANES], 1>(taps, run) }
}

/// # Safety
/// The contract of [`super::two`].
unsafe fn two(taps: &Taps, run: Run<2>) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::two::<[Pixel; LANES], 1>(taps, run) }
}

/// # Safety
/// The contract of [`super::blend`].
unsafe fn blend(field: &mut [Pixel], light: &[Pixel], share: &[Pixel]) {
    // SAFETY: the caller upholds this function's contract.
    unsafe { super::blend::<[Pixel; LANES]>(field, light, share) }
}

impl Lanes for [Pixel; LANES] {
    const LANES: usize = LANES;
    type Sums = [[i32; 2]; LANES];

    #[inline(always)]
    unsafe fn load(from: *const Pixel) -> Self {
        // SAFETY: the caller upholds this function's contract.
        unsafe { from.cast::<Self>().read() }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut Pixel) {
        // SAFETY: the caller upholds this function's contract.
        unsafe { to.cast::<Self>().write(self) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        std::array::from_fn(|i| Pixel::new(self[i].re() + other[i].re(), self[i].im() + other[i].im()))
    }

    #[inline(always)]
    unsafe fn blend(self, light: Self, share: Self) -> Self {
        std::array::from_fn(|i| self[i].blend(light[i], -share[i].re()))
    }

    #[inline(always)]
    unsafe fn sums(start: i32) -> Self::Sums {
        [[start; 2]; LANES]
    }

    #[inline(always)]
    unsafe fn multiply(self, tap: &Tap, sums: Self::Sums) -> Self::Sums {
        let product = |pixel: Pixel, [a, b]: [i16; 2]| pixel.re() * i32::from(a) + pixel.im() * i32::from(b);
        std::array::from_fn(|i| std::array::from_fn(|part| sums[i][part].wrapping_add(product(self[i], tap[part]))))
    }

    #[inline(always)]
    unsafe fn narrow(sums: Self::Sums, shift: u32) -> Self {
        sums.map(|[re, im]| Pixel::new(saturated(re >> shift), saturated(im >> shift)))
    }
}

fn saturated(value: i32) -> i32 {
    value.clamp(LEAST.into(), MOST.into())
}
