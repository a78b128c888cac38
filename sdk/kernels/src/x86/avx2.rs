//! The int8 and f32 kernels for AVX2: 8 pixels per register, 4 filters at a time. The int8 layers run in tiles
//! ([`super::winograd`]).
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::f32;
use crate::int8::{self, GROUP, LayerKernels, Rounding, SkipSum};
use crate::wavefront::{BLOCK, Geometry, MARGIN, SourceRow, last_row_by_blocks};
use std::arch::x86_64::*;

/// Returns the int8 kernels if the processor supports them.
pub(crate) fn int8_kernels() -> Option<int8::Kernels> {
    available().then_some(int8::Kernels {
        layers: LayerKernels::Tiles(super::winograd::AVX2),
        quantise_row,
        rescale_row,
    })
}

/// Returns the f32 kernels if the processor supports them.
pub(crate) fn f32_kernels() -> Option<f32::Kernels> {
    let size = |left: usize| left.min(GROUP);
    available().then_some(f32::Kernels {
        size,
        hidden_row: f32_hidden_row,
        last_row: f32_last_row,
    })
}

fn available() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

/// The number of pixel registers computed together.
const F32_BLOCKS: usize = 3;

/// Returns `sat(rint(sum · multiplier))` of four filters as one register of groups.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn requantise(sums: [__m256i; GROUP], multiplier: &[f32]) -> __m256i {
    pack_groups(std::array::from_fn(|k| {
        _mm256_cvtps_epi32(_mm256_mul_ps(
            _mm256_cvtepi32_ps(sums[k]),
            _mm256_set1_ps(multiplier[k]),
        ))
    }))
}

/// Requantises the sums of four filters and adds a skip.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn requantise_sum(sums: [__m256i; GROUP], multiplier: &[f32], factors: SkipSum, skip: __m256i) -> __m256i {
    pack_groups(std::array::from_fn(|k| {
        let v = _mm256_mul_ps(_mm256_cvtepi32_ps(sums[k]), _mm256_set1_ps(multiplier[k]));
        let v = _mm256_max_ps(v, _mm256_setzero_ps());
        let a = match factors.relu {
            Some(factor) => {
                let v = _mm256_min_ps(v, _mm256_set1_ps(255.0));
                _mm256_mul_ps(_mm256_cvtepi32_ps(_mm256_cvtps_epi32(v)), _mm256_set1_ps(factor))
            }
            None => v,
        };
        // Byte k of each group, widened.
        let shift = _mm256_set1_epi32(8 * k as i32);
        let byte = _mm256_and_si256(_mm256_srlv_epi32(skip, shift), _mm256_set1_epi32(255));
        let s = _mm256_mul_ps(_mm256_cvtepi32_ps(byte), _mm256_set1_ps(factors.skip));
        _mm256_cvtps_epi32(_mm256_add_ps(a, s))
    }))
}

/// Packs four registers of one channel's 8 pixels into 8 groups of bytes, saturating.
#[inline]
#[target_feature(enable = "avx2")]
fn pack_groups([a, b, c, d]: [__m256i; GROUP]) -> __m256i {
    // Both packs work in 128-bit lanes: four pixels of a, then of b, c and d. The shuffle transposes this 4×4 block.
    let bytes = _mm256_packus_epi16(_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d));
    let turn = _mm256_broadcastsi128_si256(_mm_set_epi32(0x0f0b_0703, 0x0e0a_0602, 0x0d09_0501, 0x0c08_0400));
    _mm256_shuffle_epi8(bytes, turn)
}

fn f32_hidden_row(layer: &f32::Packed, rows: &[&[f32]; 3], skip: Option<&[f32]>, out: &mut [f32], geometry: Geometry) {
    for first in (0..layer.outputs).step_by(GROUP) {
        let range = first * geometry.stride()..(first + GROUP) * geometry.stride();
        let skip = skip.map(|skip| &skip[range.clone()]);
        // SAFETY: `f32_kernels` has detected the features.
        unsafe { f32_filters(layer, first, rows, skip, &mut out[range], geometry) }
    }
}

#[target_feature(enable = "avx2,fma")]
fn f32_filters(
    layer: &f32::Packed,
    first: usize,
    rows: &[&[f32]; 3],
    skip: Option<&[f32]>,
    out: &mut [f32],
    geometry: Geometry,
) {
    assert!(out.len() == GROUP * geometry.stride() && skip.is_none_or(|skip| skip.len() == out.len()));
    const SPAN: usize = 8 * F32_BLOCKS;
    for x in (0..geometry.width).step_by(SPAN) {
        // The last span of a row starts earlier if necessary, so that it ends within the whole blocks.
        let x = x.min(geometry.padded - SPAN);
        let sums = f32_sums::<GROUP>(layer, first, rows, x, geometry);
        for (o, sums) in sums.iter().enumerate() {
            for (b, sum) in sums.iter().enumerate() {
                let at = o * geometry.stride() + geometry.start() + x + 8 * b;
                let mut value = _mm256_max_ps(*sum, _mm256_setzero_ps());
                // SAFETY: 8 pixels at `at` are inside the filter's row or the margin after it.
                unsafe {
                    if let Some(skip) = skip {
                        value = _mm256_add_ps(value, _mm256_loadu_ps(skip.as_ptr().add(at)));
                    }
                    _mm256_storeu_ps(out.as_mut_ptr().add(at), value);
                }
            }
        }
    }
}

/// Returns the sums of `O` filters at `8·F32_BLOCKS` pixels from `x`.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn f32_sums<const O: usize>(
    layer: &f32::Packed,
    first: usize,
    rows: &[&[f32]; 3],
    x: usize,
    geometry: Geometry,
) -> [[__m256; F32_BLOCKS]; O] {
    let weights = &layer.weights[first * 9 * layer.inputs..][..O * 9 * layer.inputs];
    assert!(rows.iter().all(|row| row.len() >= layer.inputs * geometry.stride()));
    assert!(x + 8 * F32_BLOCKS < geometry.padded + MARGIN);
    let mut sums = [[_mm256_setzero_ps(); F32_BLOCKS]; O];
    for (sums, bias) in sums.iter_mut().zip(&layer.bias[first..first + O]) {
        *sums = [_mm256_set1_ps(*bias); F32_BLOCKS];
    }
    // SAFETY: by the asserts above, rows with their margin extend past the block, and there are as many weights as the
    // loops read.
    unsafe {
        let mut weight = weights.as_ptr();
        for row in rows {
            let mut pixels = row.as_ptr().add(geometry.start() + x - 1);
            for _ in 0..layer.inputs {
                for kx in 0..3 {
                    let values: [__m256; F32_BLOCKS] = std::array::from_fn(|b| _mm256_loadu_ps(pixels.add(kx + 8 * b)));
                    for sums in &mut sums {
                        let w = _mm256_set1_ps(*weight);
                        weight = weight.add(1);
                        for (sum, value) in sums.iter_mut().zip(values) {
                            *sum = _mm256_fmadd_ps(value, w, *sum);
                        }
                    }
                }
                pixels = pixels.wrapping_add(geometry.stride());
            }
        }
    }
    sums
}

fn f32_last_row(layer: &f32::Packed, rows: &[&[f32]; 3], out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
    last_row_by_blocks(out, from, |x, values| {
        // SAFETY: `f32_kernels` has detected the features.
        unsafe { f32_last_block(layer, rows, x, values, geometry) }
    });
}

#[target_feature(enable = "avx2,fma")]
fn f32_last_block(
    layer: &f32::Packed,
    rows: &[&[f32]; 3],
    x: usize,
    values: &mut [[f32; BLOCK]; OUTPUTS],
    geometry: Geometry,
) {
    const SPAN: usize = 8 * F32_BLOCKS;
    let (wide, narrow) = values.split_at_mut(GROUP);
    for start in (0..BLOCK).step_by(SPAN) {
        store(wide, start, f32_sums::<GROUP>(layer, 0, rows, x + start, geometry));
        store(
            narrow,
            start,
            f32_sums::<{ OUTPUTS - GROUP }>(layer, GROUP, rows, x + start, geometry),
        );
    }
}

/// Stores the registers that are inside the block.
#[inline]
#[target_feature(enable = "avx2")]
fn store<const O: usize>(values: &mut [[f32; BLOCK]], start: usize, sums: [[__m256; F32_BLOCKS]; O]) {
    for (values, sums) in values.iter_mut().zip(sums) {
        for (values, sum) in values[start..].as_chunks_mut::<8>().0.iter_mut().zip(sums) {
            // SAFETY: the slice holds 8 values.
            unsafe { _mm256_storeu_ps(values.as_mut_ptr(), sum) };
        }
    }
}

/// Runs [`int8::quantise_row`], compiled for AVX2. The AVX-512 kernels use it too, because they imply AVX2.
pub(crate) fn quantise_row(source: SourceRow<'_>, rounding: Rounding, out: &mut [u8], geometry: Geometry) {
    #[target_feature(enable = "avx2")]
    fn compiled(source: SourceRow<'_>, rounding: Rounding, out: &mut [u8], geometry: Geometry) {
        int8::quantise_row(source, rounding, out, geometry);
    }
    // SAFETY: the constructors of the kernels have detected AVX2, or AVX-512, which implies it.
    unsafe { compiled(source, rounding, out, geometry) }
}

/// Runs [`int8::rescale_row`], compiled for AVX2.
pub(crate) fn rescale_row(row: &mut [u8], factor: f32, zero_point: u8, geometry: Geometry) {
    #[target_feature(enable = "avx2")]
    fn compiled(row: &mut [u8], factor: f32, zero_point: u8, geometry: Geometry) {
        int8::rescale_row(row, factor, zero_point, geometry);
    }
    // SAFETY: as in `quantise_row`.
    unsafe { compiled(row, factor, zero_point, geometry) }
}
