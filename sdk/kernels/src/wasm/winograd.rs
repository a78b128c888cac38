//! Tiles for WebAssembly's 128-bit vectors, 4 at once.
#![allow(unsafe_code)]

use super::simd128;
use crate::int8::{GROUP, Packed, SkipSum};
use crate::wavefront::{Geometry, LastRows, SlotsMut};
use crate::winograd::{self, Kernels, NINTH, REACH, Rows, SHIFT, SIDE, Tiles, register};
use std::arch::wasm32::*;

pub(super) const SIMD128: Kernels = Kernels {
    filters: Simd128::FILTERS,
    hidden_rows,
    last_rows,
};

fn hidden_rows(
    layer: &Packed,
    rows: &Rows<'_>,
    skip: Option<[&[u8]; SIDE]>,
    out: SlotsMut<'_, u8>,
    geometry: Geometry,
) {
    winograd::hidden_rows(Simd128, layer, rows, skip, out, geometry);
}

fn last_rows(layer: &Packed, rows: &Rows<'_>, out: LastRows<'_>, from: usize, geometry: Geometry) {
    winograd::last_rows(Simd128, layer, rows, out, from, geometry);
}

register!(Pairs, v128, i32x4_splat(0), i16x8_add, i16x8_sub, |v| i16x8_shl(v, 2));
register!(Sums, v128, i32x4_splat(0), i32x4_add, i32x4_sub, |v| i32x4_shl(v, 2));

#[derive(Clone, Copy)]
struct Simd128;

impl Tiles for Simd128 {
    const TILES: usize = 4;
    const FILTERS: usize = 8;
    type Pairs = Pairs;
    type Sums = Sums;

    #[inline(always)]
    fn row(self, pixels: &[u8]) -> [[Pairs; REACH]; 2] {
        let [c0, c1, c2, c3] = transposed(loaded(pixels));
        let [c4, c5, ..] = transposed(loaded(&pixels[16..]));
        let columns = [c0, c1, c2, c3, c4, c5];
        let zero = i32x4_splat(0);
        let first = |column| i8x16_shuffle::<0, 16, 1, 16, 4, 16, 5, 16, 8, 16, 9, 16, 12, 16, 13, 16>(column, zero);
        let second = |column| i8x16_shuffle::<2, 16, 3, 16, 6, 16, 7, 16, 10, 16, 11, 16, 14, 16, 15, 16>(column, zero);
        [
            columns.map(|column| Pairs(first(column))),
            columns.map(|column| Pairs(second(column))),
        ]
    }

    #[inline(always)]
    fn multiply<const O: usize>(self, sums: &mut [Sums; O], inputs: &[Pairs], weights: &[i32]) {
        for (input, weights) in inputs.iter().zip(weights.as_chunks::<O>().0) {
            for (sum, weight) in sums.iter_mut().zip(weights) {
                // SAFETY: the reference is to a word.
                let pair = unsafe { v128_load32_splat(std::ptr::from_ref(weight).cast()) };
                sum.0 = i32x4_add(sum.0, i32x4_dot_i16x8(input.0, pair));
            }
        }
    }

    #[inline(always)]
    fn divided(self, sums: Sums, bias: i32) -> Sums {
        let quotients = i32x4_shr(i32x4_mul(sums.0, i32x4_splat(NINTH)), SHIFT);
        Sums(i32x4_add(quotients, i32x4_splat(bias)))
    }

    #[inline(always)]
    fn finish_last(self, sums: [Sums; SIDE], multiplier: f32, out: &mut [f32]) {
        let out = out[..SIDE * Self::TILES].as_chunks_mut::<4>().0;
        for (out, sums) in out.iter_mut().zip(transposed(sums.map(|sums| sums.0))) {
            let values = f32x4_mul(f32x4_convert_i32x4(sums), f32x4_splat(multiplier));
            // SAFETY: the array holds four values.
            unsafe { v128_store(out.as_mut_ptr().cast(), values) };
        }
    }

    #[inline(always)]
    fn finish(
        self,
        sums: &[[Sums; SIDE]; GROUP],
        multiplier: &[f32],
        zero_point: u8,
        skip: Option<(SkipSum, &[u8])>,
        out: &mut [u8],
    ) {
        let column = |x: usize| sums.map(|sums| sums[x].0);
        let values = match skip {
            Some((factors, skip)) => {
                let skip = transposed(loaded(skip));
                std::array::from_fn(|x| simd128::requantise_sum(column(x), multiplier, factors, skip[x]))
            }
            None => std::array::from_fn(|x| simd128::requantise(column(x), multiplier)),
        };
        for (out, pixels) in out[..64].as_chunks_mut::<16>().0.iter_mut().zip(transposed(values)) {
            // SAFETY: the array holds 16 bytes.
            unsafe { v128_store(out.as_mut_ptr().cast(), u8x16_add_sat(pixels, u8x16_splat(zero_point))) };
        }
    }
}

/// Returns the first 16 pixels, four in each vector.
#[inline(always)]
fn loaded(pixels: &[u8]) -> [v128; SIDE] {
    let pixels = pixels[..64].as_ptr();
    // SAFETY: the slice holds four vectors.
    std::array::from_fn(|q| unsafe { v128_load(pixels.add(16 * q).cast()) })
}

/// Transposes a 4×4 block of pixels.
#[inline(always)]
fn transposed([a, b, c, d]: [v128; SIDE]) -> [v128; SIDE] {
    let (ab, cd) = (i32x4_shuffle::<0, 4, 1, 5>(a, b), i32x4_shuffle::<0, 4, 1, 5>(c, d));
    let (ef, gh) = (i32x4_shuffle::<2, 6, 3, 7>(a, b), i32x4_shuffle::<2, 6, 3, 7>(c, d));
    [
        i64x2_shuffle::<0, 2>(ab, cd),
        i64x2_shuffle::<1, 3>(ab, cd),
        i64x2_shuffle::<0, 2>(ef, gh),
        i64x2_shuffle::<1, 3>(ef, gh),
    ]
}
