//! Tiles for NEON, 4 at once. They serve processors without dot products of bytes.
//!
//! The lower half of a register of pairs holds the tiles' first channel, the upper half the second.
#![allow(unsafe_code)]

use crate::arm::neon::{requantised, turned};
use crate::int8::{self, GROUP, LayerKernels, Packed, SkipSum, quantise_row, rescale_row};
use crate::wavefront::{Geometry, LastRows, SlotsMut};
use crate::winograd::{self, NINTH, REACH, Register, Rows, SHIFT, SIDE, Tiles, register};
use std::arch::aarch64::*;

pub(crate) const INT8: int8::Kernels = int8::Kernels {
    layers: LayerKernels::Tiles(winograd::Kernels {
        filters: Neon::FILTERS,
        hidden_rows,
        last_rows,
    }),
    quantise_row,
    rescale_row,
};

fn hidden_rows(
    layer: &Packed,
    rows: &Rows<'_>,
    skip: Option<[&[u8]; SIDE]>,
    out: SlotsMut<'_, u8>,
    geometry: Geometry,
) {
    winograd::hidden_rows(Neon, layer, rows, skip, out, geometry);
}

fn last_rows(layer: &Packed, rows: &Rows<'_>, out: LastRows<'_>, from: usize, geometry: Geometry) {
    winograd::last_rows(Neon, layer, rows, out, from, geometry);
}

register!(
    Pairs,
    int16x8_t,
    vdupq_n_s16(0),
    vaddq_s16,
    vsubq_s16,
    |v| vshlq_n_s16::<2>(v)
);
register!(
    Sums,
    int32x4_t,
    vdupq_n_s32(0),
    vaddq_s32,
    vsubq_s32,
    |v| vshlq_n_s32::<2>(v)
);

#[derive(Clone, Copy)]
struct Neon;

impl Tiles for Neon {
    const TILES: usize = 4;
    const FILTERS: usize = 12;
    type Pairs = Pairs;
    type Sums = Sums;

    #[inline(always)]
    fn row(self, pixels: &[u8]) -> [[Pairs; REACH]; 2] {
        let [c0, c1, c2, c3] = transposed(loaded(pixels));
        let [c4, c5, ..] = transposed(loaded(&pixels[16..]));
        let mut pairs = [[Pairs::zero(); REACH]; 2];
        for (x, column) in [c0, c1, c2, c3, c4, c5].into_iter().enumerate() {
            // SAFETY: NEON is available.
            unsafe {
                let column = turned(vreinterpretq_u8_u32(column));
                pairs[0][x] = Pairs(vreinterpretq_s16_u16(vmovl_u8(vget_low_u8(column))));
                pairs[1][x] = Pairs(vreinterpretq_s16_u16(vmovl_high_u8(column)));
            }
        }
        pairs
    }

    #[inline(always)]
    fn multiply<const O: usize>(self, sums: &mut [Sums; O], inputs: &[Pairs], weights: &[i32]) {
        for (input, weights) in inputs.iter().zip(weights.as_chunks::<O>().0) {
            for (sums, weights) in sums.as_chunks_mut::<4>().0.iter_mut().zip(weights.as_chunks::<4>().0) {
                // SAFETY: NEON is available, and the array holds four words.
                unsafe {
                    let (pairs, low) = (vld1q_s16(weights.as_ptr().cast()), vget_low_s16(input.0));
                    let [a, b, c, d] = sums;
                    a.0 = vmlal_high_laneq_s16::<1>(vmlal_laneq_s16::<0>(a.0, low, pairs), input.0, pairs);
                    b.0 = vmlal_high_laneq_s16::<3>(vmlal_laneq_s16::<2>(b.0, low, pairs), input.0, pairs);
                    c.0 = vmlal_high_laneq_s16::<5>(vmlal_laneq_s16::<4>(c.0, low, pairs), input.0, pairs);
                    d.0 = vmlal_high_laneq_s16::<7>(vmlal_laneq_s16::<6>(d.0, low, pairs), input.0, pairs);
                }
            }
        }
    }

    #[inline(always)]
    fn divided(self, sums: Sums, bias: i32) -> Sums {
        // SAFETY: NEON is available.
        unsafe {
            let quotients = vshrq_n_s32::<{ SHIFT as i32 }>(vmulq_n_s32(sums.0, NINTH));
            Sums(vaddq_s32(quotients, vdupq_n_s32(bias)))
        }
    }

    #[inline(always)]
    fn finish_last(self, [a, b, c, d]: [Sums; SIDE], multiplier: f32, out: &mut [f32]) {
        // SAFETY: NEON is available.
        let sums = unsafe { [a, b, c, d].map(|sums| vreinterpretq_u32_s32(sums.0)) };
        for (out, sums) in out.as_chunks_mut::<4>().0.iter_mut().zip(transposed(sums)) {
            // SAFETY: NEON is available, and the array holds four values.
            unsafe {
                let values = vcvtq_f32_s32(vreinterpretq_s32_u32(sums));
                vst1q_f32(out.as_mut_ptr(), vmulq_n_f32(values, multiplier));
            }
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
        let skip = skip.map(|(factors, skip)| (factors, transposed(loaded(skip))));
        let values = std::array::from_fn(|x| {
            // SAFETY: NEON is available.
            let skip = skip.map(|(factors, skip)| (factors, unsafe { vreinterpretq_u8_u32(skip[x]) }));
            let values = requantised(sums.map(|sums| sums[x].0), multiplier, skip, zero_point);
            // SAFETY: NEON is available.
            unsafe { vreinterpretq_u32_u8(values) }
        });
        for (out, pixels) in out.as_chunks_mut::<16>().0.iter_mut().zip(transposed(values)) {
            // SAFETY: NEON is available, and the array holds 16 bytes.
            unsafe { vst1q_u8(out.as_mut_ptr(), vreinterpretq_u8_u32(pixels)) };
        }
    }
}

/// Returns the first 16 pixels, four in each register.
#[inline(always)]
fn loaded(pixels: &[u8]) -> [uint32x4_t; SIDE] {
    let pixels = pixels[..64].as_ptr();
    // SAFETY: NEON is available, and the slice holds four registers.
    std::array::from_fn(|q| unsafe { vreinterpretq_u32_u8(vld1q_u8(pixels.add(16 * q))) })
}

/// Transposes a 4×4 block of pixels.
#[inline(always)]
fn transposed([a, b, c, d]: [uint32x4_t; SIDE]) -> [uint32x4_t; SIDE] {
    // SAFETY: NEON is available.
    unsafe {
        let low = [vzip1q_u32(a, b), vzip1q_u32(c, d)].map(|v| vreinterpretq_u64_u32(v));
        let high = [vzip2q_u32(a, b), vzip2q_u32(c, d)].map(|v| vreinterpretq_u64_u32(v));
        [
            vreinterpretq_u32_u64(vzip1q_u64(low[0], low[1])),
            vreinterpretq_u32_u64(vzip2q_u64(low[0], low[1])),
            vreinterpretq_u32_u64(vzip1q_u64(high[0], high[1])),
            vreinterpretq_u32_u64(vzip2q_u64(high[0], high[1])),
        ]
    }
}
