//! Kernels for WebAssembly's 128-bit vectors: 4 filters at a time, 12 pixels of f32. The int8 layers run in tiles
//! ([`super::winograd`]). There is no detection: a module with these instructions does not load where they are missing.
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::f32;
use crate::int8::{self, GROUP, LayerKernels, SkipSum, quantise_row, rescale_row};
use crate::wavefront::{BLOCK, Geometry, MARGIN, last_row_by_blocks};
use std::arch::wasm32::*;

pub(crate) const INT8: int8::Kernels = int8::Kernels {
    layers: LayerKernels::Tiles(super::winograd::SIMD128),
    quantise_row,
    rescale_row,
};

pub(crate) const F32: f32::Kernels = f32::Kernels {
    size: |left| left.min(GROUP),
    hidden_row: f32_hidden_row,
    last_row: f32_last_row,
};

/// The number of pixel registers computed together.
const F32_BLOCKS: usize = 3;

/// Returns `sat(rint(v))` in 32 bits: adding 1.5·2²³ leaves no fraction bits.
#[inline(always)]
fn rounded(v: v128) -> v128 {
    let magic = f32x4_splat(12_582_912.0);
    let inside = f32x4_pmin(f32x4_splat(255.0), f32x4_pmax(f32x4_splat(0.0), v));
    i32x4_sub(f32x4_add(inside, magic), magic)
}

/// Returns `sum · multiplier` of four filters.
#[inline(always)]
fn scaled(sums: [v128; GROUP], multiplier: &[f32]) -> [v128; GROUP] {
    std::array::from_fn(|k| f32x4_mul(f32x4_convert_i32x4(sums[k]), f32x4_splat(multiplier[k])))
}

/// Returns `sat(rint(sum · multiplier))` of four filters as one register of groups.
#[inline(always)]
pub(super) fn requantise(sums: [v128; GROUP], multiplier: &[f32]) -> v128 {
    pack_groups(scaled(sums, multiplier).map(rounded))
}

/// Requantises the sums of four filters and adds a skip.
#[inline(always)]
pub(super) fn requantise_sum(sums: [v128; GROUP], multiplier: &[f32], factors: SkipSum, skip: v128) -> v128 {
    let values = scaled(sums, multiplier);
    pack_groups(std::array::from_fn(|k| {
        let a = match factors.relu {
            Some(factor) => f32x4_mul(f32x4_convert_i32x4(rounded(values[k])), f32x4_splat(factor)),
            None => f32x4_pmax(f32x4_splat(0.0), values[k]),
        };
        // Byte k of each group, widened.
        let byte = v128_and(u32x4_shr(skip, 8 * k as u32), u32x4_splat(255));
        rounded(f32x4_add(
            a,
            f32x4_mul(f32x4_convert_i32x4(byte), f32x4_splat(factors.skip)),
        ))
    }))
}

/// Packs four registers of one channel's 4 pixels, 0…255, into 4 groups of bytes.
#[inline(always)]
fn pack_groups([a, b, c, d]: [v128; GROUP]) -> v128 {
    let (ab, cd) = (v128_or(a, i32x4_shl(b, 8)), v128_or(c, i32x4_shl(d, 8)));
    v128_or(ab, i32x4_shl(cd, 16))
}

/// Stores the registers that are inside the block.
#[inline(always)]
fn store<const BLOCKS: usize>(values: &mut [f32], sums: [v128; BLOCKS]) {
    for (values, sum) in values.as_chunks_mut::<4>().0.iter_mut().zip(sums) {
        // SAFETY: the slice holds four values.
        unsafe { v128_store(values.as_mut_ptr().cast(), sum) };
    }
}

fn f32_hidden_row(layer: &f32::Packed, rows: &[&[f32]; 3], skip: Option<&[f32]>, out: &mut [f32], geometry: Geometry) {
    for first in (0..layer.outputs).step_by(GROUP) {
        let range = first * geometry.stride()..(first + GROUP) * geometry.stride();
        let skip = skip.map(|skip| &skip[range.clone()]);
        let out = &mut out[range];
        for x in (0..geometry.width).step_by(4 * F32_BLOCKS) {
            let sums = f32_sums::<GROUP>(layer, first, rows, x, geometry);
            for (o, sums) in sums.iter().enumerate() {
                for (b, sum) in sums.iter().enumerate() {
                    let at = o * geometry.stride() + geometry.start() + x + 4 * b;
                    let out = &mut out[at..at + 4];
                    let mut value = f32x4_pmax(f32x4_splat(0.0), *sum);
                    // SAFETY: the slices hold four values.
                    unsafe {
                        if let Some(skip) = skip {
                            value = f32x4_add(value, v128_load(skip[at..at + 4].as_ptr().cast()));
                        }
                        v128_store(out.as_mut_ptr().cast(), value);
                    }
                }
            }
        }
    }
}

fn f32_last_row(layer: &f32::Packed, rows: &[&[f32]; 3], out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
    last_row_by_blocks(out, from, |x, values| {
        let (wide, narrow) = values.split_at_mut(GROUP);
        for start in (0..BLOCK).step_by(4 * F32_BLOCKS) {
            let sums = f32_sums::<GROUP>(layer, 0, rows, x + start, geometry);
            wide.iter_mut()
                .zip(sums)
                .for_each(|(values, sums)| store(&mut values[start..], sums));
            let sums = f32_sums::<{ OUTPUTS - GROUP }>(layer, GROUP, rows, x + start, geometry);
            narrow
                .iter_mut()
                .zip(sums)
                .for_each(|(values, sums)| store(&mut values[start..], sums));
        }
    });
}

/// Returns the sums of `O` filters at `4·F32_BLOCKS` pixels from `x`.
#[inline(always)]
fn f32_sums<const O: usize>(
    layer: &f32::Packed,
    first: usize,
    rows: &[&[f32]; 3],
    x: usize,
    geometry: Geometry,
) -> [[v128; F32_BLOCKS]; O] {
    let weights = &layer.weights[first * 9 * layer.inputs..][..O * 9 * layer.inputs];
    assert!(rows.iter().all(|row| row.len() >= layer.inputs * geometry.stride()));
    assert!(x + 4 * F32_BLOCKS < geometry.padded + MARGIN);
    let mut sums = [[f32x4_splat(0.0); F32_BLOCKS]; O];
    for (sums, bias) in sums.iter_mut().zip(&layer.bias[first..first + O]) {
        *sums = [f32x4_splat(*bias); F32_BLOCKS];
    }
    // SAFETY: by the asserts above, rows with their margin extend past the block, and there are as many weights as the
    // loops read.
    unsafe {
        let mut weight = weights.as_ptr();
        for row in rows {
            let mut pixels = row.as_ptr().add(geometry.start() + x - 1);
            for _ in 0..layer.inputs {
                for kx in 0..3 {
                    let values: [v128; F32_BLOCKS] = std::array::from_fn(|b| v128_load(pixels.add(kx + 4 * b).cast()));
                    for sums in &mut sums {
                        let w = v128_load32_splat(weight.cast());
                        weight = weight.add(1);
                        for (sum, value) in sums.iter_mut().zip(values) {
                            *sum = f32x4_add(*sum, f32x4_mul(value, w));
                        }
                    }
                }
                pixels = pixels.wrapping_add(geometry.stride());
            }
        }
    }
    sums
}
