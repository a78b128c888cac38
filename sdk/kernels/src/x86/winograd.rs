//! Tiles for AVX2, 8 at once.
//!
//! A register of pixels holds a row of two tiles. Four registers are transposed as 4×4 blocks of pixels in each 128-bit
//! lane, so that a column's pixels are adjacent. This orders the tiles differently from their places in the row, and
//! the same transposition turns the outputs back.
#![allow(unsafe_code)]

use crate::int8::{GROUP, Packed, SkipSum};
use crate::wavefront::{Geometry, LastRows, SlotsMut};
use crate::winograd::{self, Kernels, NINTH, REACH, Register, Rows, SHIFT, SIDE, Tiles, register};
use crate::x86::avx2;
use std::arch::x86_64::*;

pub(super) const AVX2: Kernels = Kernels {
    filters: Avx2::FILTERS,
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
    #[target_feature(enable = "avx2,fma")]
    fn compiled(
        layer: &Packed,
        rows: &Rows<'_>,
        skip: Option<[&[u8]; SIDE]>,
        out: SlotsMut<'_, u8>,
        geometry: Geometry,
    ) {
        winograd::hidden_rows(Avx2(()), layer, rows, skip, out, geometry);
    }
    // SAFETY: the constructor of the kernels has detected the features.
    unsafe { compiled(layer, rows, skip, out, geometry) }
}

fn last_rows(layer: &Packed, rows: &Rows<'_>, out: LastRows<'_>, from: usize, geometry: Geometry) {
    #[target_feature(enable = "avx2,fma")]
    fn compiled(layer: &Packed, rows: &Rows<'_>, out: LastRows<'_>, from: usize, geometry: Geometry) {
        winograd::last_rows(Avx2(()), layer, rows, out, from, geometry);
    }
    // SAFETY: as in `hidden_rows`.
    unsafe { compiled(layer, rows, out, from, geometry) }
}

/// Shows that the processor has AVX2.
#[derive(Clone, Copy)]
struct Avx2(());

register!(
    Avx2Pairs,
    __m256i,
    _mm256_setzero_si256(),
    _mm256_add_epi16,
    _mm256_sub_epi16,
    |v| _mm256_slli_epi16::<2>(v)
);
register!(
    Avx2Sums,
    __m256i,
    _mm256_setzero_si256(),
    _mm256_add_epi32,
    _mm256_sub_epi32,
    |v| _mm256_slli_epi32::<2>(v)
);

impl Tiles for Avx2 {
    const TILES: usize = 8;
    const FILTERS: usize = 12;
    type Pairs = Avx2Pairs;
    type Sums = Avx2Sums;

    #[inline(always)]
    fn row(self, pixels: &[u8]) -> [[Avx2Pairs; REACH]; 2] {
        let [c0, c1, c2, c3] = self.transposed(self.loaded(pixels));
        let [c4, c5, ..] = self.transposed(self.loaded(&pixels[16..]));
        let mut pairs = [[Avx2Pairs::zero(); REACH]; 2];
        for (x, column) in [c0, c1, c2, c3, c4, c5].into_iter().enumerate() {
            // SAFETY: `self` shows the features.
            unsafe {
                // Bytes of the first pair of channels, then of the second.
                let turn = _mm_set_epi32(0x0f0e_0b0a, 0x0706_0302, 0x0d0c_0908, 0x0504_0100);
                let column = _mm256_shuffle_epi8(column, _mm256_broadcastsi128_si256(turn));
                pairs[0][x] = Avx2Pairs(_mm256_unpacklo_epi8(column, _mm256_setzero_si256()));
                pairs[1][x] = Avx2Pairs(_mm256_unpackhi_epi8(column, _mm256_setzero_si256()));
            }
        }
        pairs
    }

    #[inline(always)]
    fn multiply<const O: usize>(self, sums: &mut [Avx2Sums; O], inputs: &[Avx2Pairs], weights: &[i32]) {
        for (input, weights) in inputs.iter().zip(weights.as_chunks::<O>().0) {
            for (sum, weight) in sums.iter_mut().zip(weights) {
                // SAFETY: `self` shows the features.
                unsafe {
                    let pair = _mm256_castps_si256(_mm256_broadcast_ss(&*std::ptr::from_ref(weight).cast()));
                    sum.0 = _mm256_add_epi32(sum.0, _mm256_madd_epi16(input.0, pair));
                }
            }
        }
    }

    #[inline(always)]
    fn divided(self, sums: Avx2Sums, bias: i32) -> Avx2Sums {
        // SAFETY: `self` shows the features.
        unsafe {
            let ninths = _mm256_mullo_epi32(sums.0, _mm256_set1_epi32(NINTH));
            let quotients = _mm256_srai_epi32::<{ SHIFT as i32 }>(ninths);
            Avx2Sums(_mm256_add_epi32(quotients, _mm256_set1_epi32(bias)))
        }
    }

    #[inline(always)]
    fn finish_last(self, [a, b, c, d]: [Avx2Sums; SIDE], multiplier: f32, out: &mut [f32]) {
        let sums = self.transposed([a.0, b.0, c.0, d.0]);
        for (out, sums) in out.as_chunks_mut::<8>().0.iter_mut().zip(sums) {
            // SAFETY: `self` shows the features, and the array holds 8 values.
            unsafe {
                let values = _mm256_mul_ps(_mm256_cvtepi32_ps(sums), _mm256_set1_ps(multiplier));
                _mm256_storeu_ps(out.as_mut_ptr(), values);
            }
        }
    }

    #[inline(always)]
    fn finish(
        self,
        [a, b, c, d]: &[[Avx2Sums; SIDE]; GROUP],
        multiplier: &[f32],
        zero_point: u8,
        skip: Option<(SkipSum, &[u8])>,
        out: &mut [u8],
    ) {
        let skip = skip.map(|(factors, skip)| (factors, self.transposed(self.loaded(skip))));
        // SAFETY: `self` shows the features.
        let mut values = unsafe { [_mm256_setzero_si256(); SIDE] };
        for (x, values) in values.iter_mut().enumerate() {
            let sums = [a[x].0, b[x].0, c[x].0, d[x].0];
            // SAFETY: `self` shows the features.
            *values = unsafe {
                match skip {
                    Some((factors, skip)) => avx2::requantise_sum(sums, multiplier, factors, skip[x]),
                    None => avx2::requantise(sums, multiplier),
                }
            };
        }
        for (out, pixels) in out.as_chunks_mut::<32>().0.iter_mut().zip(self.transposed(values)) {
            // SAFETY: `self` shows the features, and the array holds 32 bytes.
            unsafe {
                let pixels = _mm256_adds_epu8(pixels, _mm256_set1_epi8(zero_point as i8));
                _mm256_storeu_si256(out.as_mut_ptr().cast(), pixels);
            }
        }
    }
}

impl Avx2 {
    /// Returns the first 32 pixels, 8 in each register.
    #[inline(always)]
    fn loaded(self, pixels: &[u8]) -> [__m256i; SIDE] {
        let pixels: *const __m256i = pixels[..128].as_ptr().cast();
        // SAFETY: `self` shows the features, and the slice holds four registers.
        unsafe {
            [
                _mm256_loadu_si256(pixels),
                _mm256_loadu_si256(pixels.add(1)),
                _mm256_loadu_si256(pixels.add(2)),
                _mm256_loadu_si256(pixels.add(3)),
            ]
        }
    }

    /// Transposes the 4×4 blocks of pixels in each lane.
    #[inline(always)]
    fn transposed(self, [a, b, c, d]: [__m256i; SIDE]) -> [__m256i; SIDE] {
        // SAFETY: `self` shows the features.
        unsafe {
            let low = (_mm256_unpacklo_epi32(a, b), _mm256_unpacklo_epi32(c, d));
            let high = (_mm256_unpackhi_epi32(a, b), _mm256_unpackhi_epi32(c, d));
            [
                _mm256_unpacklo_epi64(low.0, low.1),
                _mm256_unpackhi_epi64(low.0, low.1),
                _mm256_unpacklo_epi64(high.0, high.1),
                _mm256_unpackhi_epi64(high.0, high.1),
            ]
        }
    }
}
