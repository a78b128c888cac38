//! The int8 and f32 kernels for AVX2: 8 pixels per register, 4 filters at a time.
//!
//! The byte multiply of AVX2 adds two products in 16 bits. The taps of two filters are packed in runs whose sums fit 16
//! bits for any activations ([`runs`]), so only a run's end needs 32 bits.
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::f32;
use crate::int8::{self, GROUP, MOST_GROUPS, Packed, Rounding, SkipSum};
use crate::wavefront::{BLOCK, Geometry, MARGIN, SourceRow, Window, last_row_by_blocks};
use crate::x86::runs::{self, Words};
use std::arch::x86_64::*;

/// Returns the int8 kernels if the processor supports them.
pub(crate) fn int8_kernels() -> Option<int8::Kernels> {
    available().then_some(int8::Kernels {
        pack: runs::pack,
        hidden_row,
        last_row,
        offset: 0,
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
const INT8_BLOCKS: usize = 4;
const F32_BLOCKS: usize = 3;

/// The sums of four filters at `8·INT8_BLOCKS` pixels.
type Int8Sums = [[__m256i; INT8_BLOCKS]; GROUP];

fn hidden_row(layer: &Packed, window: Window<'_, u8>, skip: Option<&[u8]>, out: &mut [u8], geometry: Geometry) {
    let places = Places::new(layer, window, geometry);
    // SAFETY: `int8_kernels` has detected the features.
    unsafe { int8_filters(layer, &places, skip, out, geometry) }
}

#[target_feature(enable = "avx2,fma")]
fn int8_filters(layer: &Packed, places: &Places<'_>, skip: Option<&[u8]>, out: &mut [u8], geometry: Geometry) {
    let groups = layer.outputs / GROUP;
    assert!(out.len() >= groups * geometry.stride());
    assert!(skip.is_none_or(|skip| skip.len() >= groups * geometry.stride()));
    let zero = _mm256_set1_epi8(layer.zero_point as i8);
    for x in (0..geometry.width).step_by(8 * INT8_BLOCKS) {
        let mut words = layer.weights.as_chunks().0;
        for g in 0..groups {
            let (bias, multiplier) = (
                &layer.bias[g * GROUP..][..GROUP],
                &layer.multiplier[g * GROUP..][..GROUP],
            );
            let sums;
            (sums, words) = int8_sums(words, bias, places, x);
            #[allow(clippy::needless_range_loop)]
            for b in 0..INT8_BLOCKS {
                let at = g * geometry.stride() + geometry.start() + (x + 8 * b) * GROUP;
                let four = std::array::from_fn(|k| sums[k][b]);
                // SAFETY: 32 bytes at `at` are inside the group, whose blocks are whole.
                unsafe {
                    let value = match (layer.skip, skip) {
                        (Some(factors), Some(skip)) => {
                            let skip = _mm256_loadu_si256(skip.as_ptr().add(at).cast());
                            requantise_sum(four, multiplier, factors, skip)
                        }
                        _ => requantise(four, multiplier),
                    };
                    _mm256_storeu_si256(out.as_mut_ptr().add(at).cast(), _mm256_adds_epu8(value, zero));
                }
            }
        }
    }
}

/// The places of a layer's taps in its window.
struct Places<'a> {
    slots: &'a [u8],
    /// The place of each tap `(ky·groups + group)·3 + kx` for the first pixel of a row.
    starts: [u32; 9 * MOST_GROUPS],
    padded: usize,
}

impl<'a> Places<'a> {
    fn new(layer: &Packed, window: Window<'a, u8>, geometry: Geometry) -> Self {
        let row = window.slots.len() / 3;
        assert!(row >= layer.groups * geometry.stride() && window.slots.len() <= u32::MAX as usize);
        assert!(MARGIN >= 1 && geometry.group == GROUP);
        let mut starts = [0; 9 * MOST_GROUPS];
        for (tap, start) in starts[..9 * layer.groups].iter_mut().enumerate() {
            let (ky, group, kx) = (tap / 3 / layer.groups, tap / 3 % layer.groups, tap % 3);
            let at = (window.first + ky) % 3 * row + group * geometry.stride();
            *start = (at + geometry.start() + kx * GROUP - GROUP) as u32;
        }
        Places {
            slots: window.slots,
            starts,
            padded: geometry.padded,
        }
    }
}

/// Returns the sums of the four filters of a group at `8·INT8_BLOCKS` pixels from `x`, and the words of the next group.
/// A group has two pairs of filters; of the last layer's second group only one exists.
#[inline]
#[target_feature(enable = "avx2")]
fn int8_sums<'a>(mut words: &'a [Words], bias: &[i32], places: &Places<'_>, x: usize) -> (Int8Sums, &'a [Words]) {
    assert!(x + 8 * INT8_BLOCKS <= places.padded);
    let mut sums = [[_mm256_setzero_si256(); INT8_BLOCKS]; GROUP];
    for (pair, bias) in sums.as_chunks_mut::<2>().0.iter_mut().zip(bias.as_chunks::<2>().0) {
        for (sums, bias) in pair.iter_mut().zip(bias) {
            *sums = [_mm256_set1_epi32(*bias); INT8_BLOCKS];
        }
        let Some(([runs, ..], rest)) = words.split_first() else {
            break;
        };
        words = rest;
        for _ in 0..*runs {
            let [taps, ..] = words[0];
            let (run, rest) = words[1..].split_at(taps as usize);
            words = rest;
            // SAFETY: `pack` wrote places of the layer's taps, whose rows extend one pixel past the block.
            unsafe { add_run(run, places, x, pair) };
        }
    }
    (sums, words)
}

/// Adds the products of a run's taps to the sums of a pair of filters. The run's sums fit 16 bits.
///
/// # Safety
/// [`products`]' contract.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn add_run(run: &[Words], places: &Places<'_>, x: usize, pair: &mut [[__m256i; INT8_BLOCKS]; 2]) {
    let Some((first, rest)) = run.split_first() else {
        return;
    };
    // SAFETY: the caller upholds this function's contract.
    unsafe {
        let mut narrow = products(first, places, x);
        for tap in rest {
            let products = products(tap, places, x);
            for (narrow, products) in narrow.as_flattened_mut().iter_mut().zip(products.as_flattened()) {
                *narrow = _mm256_add_epi16(*narrow, *products);
            }
        }
        let ones = _mm256_set1_epi16(1);
        for (sum, narrow) in pair.as_flattened_mut().iter_mut().zip(narrow.as_flattened()) {
            *sum = _mm256_add_epi32(*sum, _mm256_madd_epi16(*narrow, ones));
        }
    }
}

/// Returns the products of a tap for a pair of filters, added in twos.
///
/// # Safety
/// The tap's place must be below 9 times the layer's groups, and `x + 8·INT8_BLOCKS` within the padded row.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn products([place, first, second]: &Words, places: &Places<'_>, x: usize) -> [[__m256i; INT8_BLOCKS]; 2] {
    // SAFETY: the caller upholds this function's contract.
    unsafe {
        let start = *places.starts.get_unchecked(*place as usize) as usize;
        let pixels = places.slots.as_ptr().add(start + x * GROUP);
        let mut products = [[_mm256_setzero_si256(); INT8_BLOCKS]; 2];
        // Loads each weight by itself: from one load of both the compiler would move them through general registers.
        for (products, four) in products.iter_mut().zip([first, second]) {
            let four = _mm256_castps_si256(_mm256_broadcast_ss(&*std::ptr::from_ref(four).cast()));
            for (b, products) in products.iter_mut().enumerate() {
                let bytes = _mm256_loadu_si256(pixels.add(8 * b * GROUP).cast());
                *products = _mm256_maddubs_epi16(bytes, four);
            }
        }
        products
    }
}

/// Returns `sat(rint(sum · multiplier))` of four filters as one register of groups.
#[inline]
#[target_feature(enable = "avx2")]
fn requantise(sums: [__m256i; GROUP], multiplier: &[f32]) -> __m256i {
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
fn requantise_sum(sums: [__m256i; GROUP], multiplier: &[f32], factors: SkipSum, skip: __m256i) -> __m256i {
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

fn last_row(layer: &Packed, window: Window<'_, u8>, out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
    let places = Places::new(layer, window, geometry);
    last_row_by_blocks(out, from, |x, values| {
        // SAFETY: `int8_kernels` has detected the features.
        unsafe { int8_last_block(layer, &places, x, values) }
    });
}

#[target_feature(enable = "avx2,fma")]
fn int8_last_block(layer: &Packed, places: &Places<'_>, x: usize, values: &mut [[f32; BLOCK]; OUTPUTS]) {
    for start in (0..BLOCK).step_by(8 * INT8_BLOCKS) {
        let mut words = layer.weights.as_chunks().0;
        for (g, values) in values.chunks_mut(GROUP).enumerate() {
            let sums;
            (sums, words) = int8_sums(words, &layer.bias[g * GROUP..][..GROUP], places, x + start);
            for (o, (values, sums)) in values.iter_mut().zip(sums).enumerate() {
                let multiplier = _mm256_set1_ps(layer.multiplier[g * GROUP + o]);
                for (values, sum) in values[start..].as_chunks_mut::<8>().0.iter_mut().zip(sums) {
                    let value = _mm256_mul_ps(_mm256_cvtepi32_ps(sum), multiplier);
                    // SAFETY: the slice holds 8 values.
                    unsafe { _mm256_storeu_ps(values.as_mut_ptr(), value) };
                }
            }
        }
    }
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
