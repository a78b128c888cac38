//! The f32 kernels for NEON, and the code that the int8 kernels of both dot-product files share. They compute 8 filters
//! and 12 pixels at a time, with 4 pixels per register. NEON is part of every ARM64 processor.
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::f32;
use crate::int8::{self, GROUP, SkipSum, Taps};
use crate::wavefront::{BLOCK, Geometry, MARGIN, last_row_by_blocks};
use std::arch::aarch64::*;

/// The f32 kernels.
pub(crate) const KERNELS: f32::Kernels = f32::Kernels {
    size: |left| left.min(FILTERS),
    hidden_row,
    last_row,
};

/// The numbers of filters and of pixel registers computed together.
pub(crate) const FILTERS: usize = 8;
pub(crate) const BLOCKS: usize = 3;
/// The number of pixels computed together.
pub(crate) const SPAN: usize = 4 * BLOCKS;

fn hidden_row(layer: &f32::Packed, rows: &[&[f32]; 3], skip: Option<&[f32]>, out: &mut [f32], geometry: Geometry) {
    for first in (0..layer.outputs).step_by(FILTERS) {
        let range = first * geometry.stride()..(first + FILTERS) * geometry.stride();
        let skip = skip.map(|skip| &skip[range.clone()]);
        let out = &mut out[range];
        for x in (0..geometry.width).step_by(SPAN) {
            let sums = sums::<FILTERS>(layer, first, rows, x, geometry);
            for (o, sums) in sums.iter().enumerate() {
                for (b, sum) in sums.iter().enumerate() {
                    let at = o * geometry.stride() + geometry.start() + x + 4 * b;
                    let out = &mut out[at..at + 4];
                    // SAFETY: NEON is available, and the slices hold four values.
                    unsafe {
                        let mut value = vmaxq_f32(*sum, vdupq_n_f32(0.0));
                        if let Some(skip) = skip {
                            value = vaddq_f32(value, vld1q_f32(skip[at..at + 4].as_ptr()));
                        }
                        vst1q_f32(out.as_mut_ptr(), value);
                    }
                }
            }
        }
    }
}

fn last_row(layer: &f32::Packed, rows: &[&[f32]; 3], out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
    last_row_by_blocks(out, from, |x, values| {
        for start in (0..BLOCK).step_by(SPAN) {
            let sums = sums::<OUTPUTS>(layer, 0, rows, x + start, geometry);
            for (values, sums) in values.iter_mut().zip(sums) {
                store(&mut values[start..], sums);
            }
        }
    });
}

/// Stores the registers that are inside the block.
pub(crate) fn store(values: &mut [f32], sums: [float32x4_t; BLOCKS]) {
    for (values, sum) in values.as_chunks_mut::<4>().0.iter_mut().zip(sums) {
        // SAFETY: NEON is available, and the slice holds four values.
        unsafe { vst1q_f32(values.as_mut_ptr(), sum) };
    }
}

/// Returns the sums of `O` filters at [`SPAN`] pixels from `x`.
#[inline(always)]
fn sums<const O: usize>(
    layer: &f32::Packed,
    first: usize,
    rows: &[&[f32]; 3],
    x: usize,
    geometry: Geometry,
) -> [[float32x4_t; BLOCKS]; O] {
    let weights = &layer.weights[first * 9 * layer.inputs..][..O * 9 * layer.inputs];
    assert!(rows.iter().all(|row| row.len() >= layer.inputs * geometry.stride()));
    assert!(x + SPAN < geometry.padded + MARGIN);
    // SAFETY: NEON is available. By the asserts, rows with their margin extend past the block, and there are as many
    // weights as the loops read.
    unsafe {
        let mut sums = [[vdupq_n_f32(0.0); BLOCKS]; O];
        for (sums, bias) in sums.iter_mut().zip(&layer.bias[first..first + O]) {
            *sums = [vdupq_n_f32(*bias); BLOCKS];
        }
        let mut weight = weights.as_ptr();
        for row in rows {
            let mut pixels = row.as_ptr().add(geometry.start() + x - 1);
            for _ in 0..layer.inputs {
                for kx in 0..3 {
                    let values: [float32x4_t; BLOCKS] = std::array::from_fn(|b| vld1q_f32(pixels.add(kx + 4 * b)));
                    for sums in &mut sums {
                        let w = *weight;
                        weight = weight.add(1);
                        for (sum, value) in sums.iter_mut().zip(values) {
                            *sum = vfmaq_n_f32(*sum, value, w);
                        }
                    }
                }
                pixels = pixels.wrapping_add(geometry.stride());
            }
        }
        sums
    }
}

/// Packs words of four weights as `[8 filters][ky][group][kx][filter]`.
pub(crate) fn pack(taps: &Taps<'_>) -> Vec<i32> {
    taps.dot_words(&vec![FILTERS; taps.outputs().div_ceil(FILTERS)])
}

/// Converts the sums of four filters at four pixels to 16 bytes, saturating. `skip` holds the skip's bytes.
#[inline(always)]
pub(crate) fn requantised(
    sums: [int32x4_t; GROUP],
    multiplier: &[f32],
    skip: Option<(SkipSum, uint8x16_t)>,
    zero_point: u8,
) -> uint8x16_t {
    // SAFETY: NEON is available.
    unsafe {
        let values: [int32x4_t; GROUP] = std::array::from_fn(|k| {
            let v = vmulq_n_f32(vcvtq_f32_s32(sums[k]), multiplier[k]);
            let Some((factors, skip)) = skip else {
                return vcvtnq_s32_f32(v);
            };
            let v = vmaxq_f32(v, vdupq_n_f32(0.0));
            let a = match factors.relu {
                Some(factor) => vmulq_n_f32(vrndnq_f32(vminq_f32(v, vdupq_n_f32(255.0))), factor),
                None => v,
            };
            // Byte k of each group, widened.
            let groups = vreinterpretq_u32_u8(skip);
            let bytes = vandq_u32(vshlq_u32(groups, vdupq_n_s32(-8 * k as i32)), vdupq_n_u32(255));
            vcvtnq_s32_f32(vaddq_f32(a, vmulq_n_f32(vcvtq_f32_u32(bytes), factors.skip)))
        });
        let narrow = |v| vqmovun_s16(v);
        let ab = narrow(vcombine_s16(vqmovn_s32(values[0]), vqmovn_s32(values[1])));
        let cd = narrow(vcombine_s16(vqmovn_s32(values[2]), vqmovn_s32(values[3])));
        vqaddq_u8(turned(vcombine_u8(ab, cd)), vdupq_n_u8(zero_point))
    }
}

/// Transposes a 4×4 block of bytes.
#[inline(always)]
pub(crate) fn turned(bytes: uint8x16_t) -> uint8x16_t {
    const TURN: [u8; 16] = [0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15];
    // SAFETY: NEON is available, and the table has 16 bytes.
    unsafe { vqtbl1q_u8(bytes, vld1q_u8(TURN.as_ptr())) }
}

/// The parts of a layer that one call of a dot-product kernel needs, with bounds checks of its reads.
pub(crate) struct Dots<'a> {
    pub(crate) weights: &'a [i32],
    pub(crate) bias: &'a [i32],
    pub(crate) groups: usize,
}

impl<'a> Dots<'a> {
    /// Checks and returns the parts for eight filters from `first` and three rows from pixel `x`.
    pub(crate) fn new(layer: &'a int8::Packed, first: usize, rows: &[&[u8]; 3], x: usize, geometry: Geometry) -> Self {
        let words = 9 * layer.groups;
        assert!(rows.iter().all(|row| row.len() >= layer.groups * geometry.stride()));
        assert!(x + SPAN < geometry.padded + MARGIN && geometry.group == GROUP);
        Dots {
            weights: &layer.weights[first * words..][..FILTERS * words],
            bias: &layer.bias[first..first + FILTERS],
            groups: layer.groups,
        }
    }
}

/// Defines the int8 kernels, given an instruction set's `load` of 16 bytes of pixels and `dot::<LANE>(sum, pixels,
/// weights)`.
macro_rules! int8_kernels {
    ($features:literal) => {
        /// Returns the sums of eight filters at [`SPAN`] pixels from `x`.
        #[target_feature(enable = $features)]
        fn sums(
            layer: &Packed,
            first: usize,
            rows: &[&[u8]; 3],
            x: usize,
            geometry: Geometry,
        ) -> [[int32x4_t; BLOCKS]; FILTERS] {
            let dots = Dots::new(layer, first, rows, x, geometry);
            let mut sums = [[vdupq_n_s32(0); BLOCKS]; FILTERS];
            for (sums, bias) in sums.iter_mut().zip(dots.bias) {
                *sums = [vdupq_n_s32(*bias); BLOCKS];
            }
            // SAFETY: `Dots` has checked the loops' reads, and the function enables the features.
            unsafe {
                let mut weight = dots.weights.as_ptr();
                for row in rows {
                    let mut pixels = row.as_ptr().add(geometry.start() + x * GROUP - GROUP);
                    for _ in 0..dots.groups {
                        for kx in 0..3 {
                            let a = vld1q_s8(weight.cast());
                            let b = vld1q_s8(weight.add(GROUP).cast());
                            weight = weight.add(FILTERS);
                            for block in 0..BLOCKS {
                                let values = load(pixels.add((kx + 4 * block) * GROUP));
                                sums[0][block] = dot::<0>(sums[0][block], values, a);
                                sums[1][block] = dot::<1>(sums[1][block], values, a);
                                sums[2][block] = dot::<2>(sums[2][block], values, a);
                                sums[3][block] = dot::<3>(sums[3][block], values, a);
                                sums[4][block] = dot::<0>(sums[4][block], values, b);
                                sums[5][block] = dot::<1>(sums[5][block], values, b);
                                sums[6][block] = dot::<2>(sums[6][block], values, b);
                                sums[7][block] = dot::<3>(sums[7][block], values, b);
                            }
                        }
                        pixels = pixels.wrapping_add(geometry.stride());
                    }
                }
            }
            sums
        }

        fn hidden_row(layer: &Packed, rows: Slots<'_, u8>, skip: Option<&[u8]>, out: &mut [u8], geometry: Geometry) {
            let rows = rows.rows();
            for first in (0..layer.outputs).step_by(FILTERS) {
                for x in (0..geometry.width).step_by(SPAN) {
                    // SAFETY: `kernels` has detected the feature.
                    let sums = unsafe { sums(layer, first, &rows, x, geometry) };
                    for g in 0..FILTERS / GROUP {
                        let multiplier = &layer.multiplier[first + g * GROUP..][..GROUP];
                        for b in 0..BLOCKS {
                            let group = (first / GROUP + g) * geometry.stride();
                            let at = group + geometry.start() + (x + 4 * b) * GROUP;
                            let four = std::array::from_fn(|k| sums[g * GROUP + k][b]);
                            let skip = skip.map(|skip| &skip[at..][..16]);
                            let out = &mut out[at..][..16];
                            // SAFETY: NEON is available, and the slices hold 16 bytes.
                            unsafe {
                                let skip = layer.skip.zip(skip.map(|skip| vld1q_u8(skip.as_ptr())));
                                vst1q_u8(
                                    out.as_mut_ptr(),
                                    requantised(four, multiplier, skip, layer.zero_point),
                                );
                            }
                        }
                    }
                }
            }
        }

        fn last_row(layer: &Packed, rows: Slots<'_, u8>, out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
            let rows = rows.rows();
            last_row_by_blocks(out, from, |x, values| {
                for start in (0..BLOCK).step_by(SPAN) {
                    // SAFETY: `kernels` has detected the feature.
                    let sums = unsafe { sums(layer, 0, &rows, x + start, geometry) };
                    for ((values, sums), multiplier) in values.iter_mut().zip(sums).zip(&layer.multiplier) {
                        // SAFETY: NEON is available.
                        let values_of = |sum| unsafe { vmulq_n_f32(vcvtq_f32_s32(sum), *multiplier) };
                        store(&mut values[start..], sums.map(values_of));
                    }
                }
            });
        }
    };
}
pub(crate) use int8_kernels;
