//! The int8 kernels for AVX-512 with VNNI: 16 pixels per register, one multiply-accumulate instruction for 64 products.
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::int8::{GROUP, Kernels, LayerKernels, Packed, RowKernels, SkipSum, Taps};
use crate::wavefront::{BLOCK, Geometry, MARGIN, Slots, last_row_by_blocks};
use crate::x86::avx2::{quantise_row, rescale_row};
use std::arch::x86_64::*;

/// Returns the kernels if the processor supports them.
pub(crate) fn kernels() -> Option<Kernels> {
    available().then_some(Kernels {
        layers: LayerKernels::Rows(RowKernels {
            pack,
            hidden_row,
            last_row,
            offset: 0,
        }),
        quantise_row,
        rescale_row,
    })
}

pub(crate) fn available() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vnni")
}

fn pack(taps: &Taps<'_>) -> Vec<i32> {
    let outputs = taps.outputs();
    let together = if outputs == OUTPUTS { OUTPUTS } else { GROUP };
    taps.dot_words(&vec![together; outputs / together])
}

fn hidden_row(layer: &Packed, rows: Slots<'_, u8>, skip: Option<&[u8]>, out: &mut [u8], geometry: Geometry) {
    let rows = rows.rows();
    check_rows(&rows, layer.groups, geometry);
    let mut x = 0;
    while x < geometry.width {
        let left = geometry.width - x;
        // SAFETY: `kernels` has detected the features, the rows are checked, and they are padded to 64 pixels: `x` is a
        // multiple of 64 until fewer are left, so no step ends after the padding.
        unsafe {
            x += match left {
                49.. => block::<4>(layer, &rows, x, skip, out, geometry),
                17.. => block::<2>(layer, &rows, x, skip, out, geometry),
                _ => block::<1>(layer, &rows, x, skip, out, geometry),
            }
        }
    }
}

fn last_row(layer: &Packed, rows: Slots<'_, u8>, out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
    let rows = rows.rows();
    last_row_by_blocks(out, from, |x, values| {
        // SAFETY: `kernels` has detected the features.
        unsafe { last_block(layer, &rows, x, values, geometry) }
    });
}

/// Checks that three rows hold `groups` groups of blocks and margins, so that block reads stay inside.
pub(crate) fn check_rows(rows: &[&[u8]; 3], groups: usize, geometry: Geometry) {
    assert!(rows.iter().all(|row| row.len() >= groups * geometry.stride()));
    assert!(geometry.group == GROUP && geometry.padded.is_multiple_of(BLOCK) && MARGIN >= 16);
}

/// Computes all filters at `16·B` pixels, four at a time. The sums of four filters are requantised while those of the
/// next four are computed. Returns the number of pixels computed.
///
/// # Safety
/// `rows` and `geometry` must have passed [`check_rows`], and `x + 16·B` must be within the padded row.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
unsafe fn block<const B: usize>(
    layer: &Packed,
    rows: &[&[u8]; 3],
    x: usize,
    skip: Option<&[u8]>,
    out: &mut [u8],
    geometry: Geometry,
) -> usize {
    let words = GROUP * 9 * layer.groups;
    for (g, weights) in layer.weights.chunks_exact(words).enumerate() {
        let filter = g * GROUP;
        let bias = &layer.bias[filter..][..GROUP];
        // SAFETY: the caller upholds this function's contract.
        let sums = unsafe { sums::<GROUP, B>(rows, layer.groups, weights, bias, x, geometry) };
        #[allow(clippy::needless_range_loop)]
        for b in 0..B {
            let at = g * geometry.stride() + geometry.start() + (x + 16 * b) * GROUP;
            requantise(layer, filter, sums.map(|sums| sums[b]), skip, out, at);
        }
    }
    16 * B
}

/// Returns the sums of `O` filters at `16·B` pixels from `x`.
///
/// # Safety
/// `rows` and `geometry` must have passed [`check_rows`], `x + 16·B` must be within the padded row, `weights` must hold
/// `9·O·groups` words and `bias` `O`.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
unsafe fn sums<const O: usize, const B: usize>(
    rows: &[&[u8]; 3],
    groups: usize,
    weights: &[i32],
    bias: &[i32],
    x: usize,
    geometry: Geometry,
) -> [[__m512i; B]; O] {
    let mut sums = [[_mm512_setzero_si512(); B]; O];
    for (sums, bias) in sums.iter_mut().zip(bias) {
        *sums = [_mm512_set1_epi32(*bias); B];
    }
    // SAFETY: the caller upholds this function's contract.
    unsafe {
        let mut weight = weights.as_ptr();
        for row in rows {
            let mut pixels = row.as_ptr().add(geometry.start() + x * GROUP - GROUP);
            for _ in 0..groups {
                for kx in 0..3 {
                    let values: [__m512i; B] =
                        std::array::from_fn(|b| _mm512_loadu_si512(pixels.add((kx + 16 * b) * GROUP).cast()));
                    for (o, sums) in sums.iter_mut().enumerate() {
                        let weight = _mm512_set1_epi32(*weight.add(o));
                        for (sum, value) in sums.iter_mut().zip(values) {
                            *sum = _mm512_dpbusd_epi32(*sum, value, weight);
                        }
                    }
                    weight = weight.add(O);
                }
                pixels = pixels.wrapping_add(geometry.stride());
            }
        }
    }
    sums
}

#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn last_block(layer: &Packed, rows: &[&[u8]; 3], x: usize, values: &mut [[f32; BLOCK]; OUTPUTS], geometry: Geometry) {
    check_rows(rows, layer.groups, geometry);
    assert!(layer.weights.len() == OUTPUTS * 9 * layer.groups && x + BLOCK <= geometry.padded);
    // SAFETY: the asserts above hold.
    unsafe {
        let sums = sums::<OUTPUTS, 4>(rows, layer.groups, &layer.weights, &layer.bias[..OUTPUTS], x, geometry);
        for (o, (sums, values)) in sums.iter().zip(values).enumerate() {
            let multiplier = _mm512_set1_ps(layer.multiplier[o]);
            for (b, sum) in sums.iter().enumerate() {
                let value = _mm512_mul_ps(_mm512_cvtepi32_ps(*sum), multiplier);
                _mm512_storeu_ps(values.as_mut_ptr().add(16 * b), value);
            }
        }
    }
}

/// Converts the sums of four filters at 16 pixels to their group in the next layer's input. The group is at `at` in the
/// row `out` and in the skip's row.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
pub(crate) fn requantise(
    layer: &Packed,
    filter: usize,
    sums: [__m512i; GROUP],
    skip: Option<&[u8]>,
    out: &mut [u8],
    at: usize,
) {
    let multiplier = &layer.multiplier[filter..][..GROUP];
    let values = match (layer.skip, skip) {
        (Some(factors), Some(skip)) => {
            let skip = &skip[at..at + 16 * GROUP];
            // SAFETY: the slice holds 64 bytes.
            let skip = unsafe { _mm512_loadu_si512(skip.as_ptr().cast()) };
            with_skip(sums, multiplier, factors, skip)
        }
        _ => without_skip(sums, multiplier),
    };
    let value = _mm512_adds_epu8(values, _mm512_set1_epi8(layer.zero_point as i8));
    let out = &mut out[at..at + 16 * GROUP];
    // SAFETY: the slice holds 64 bytes.
    unsafe { _mm512_storeu_si512(out.as_mut_ptr().cast(), value) };
}

/// Returns `sat(rint(sum · multiplier))` of four filters as one register of groups.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn without_skip(sums: [__m512i; GROUP], multiplier: &[f32]) -> __m512i {
    let values = std::array::from_fn(|k| {
        _mm512_cvtps_epi32(_mm512_mul_ps(
            _mm512_cvtepi32_ps(sums[k]),
            _mm512_set1_ps(multiplier[k]),
        ))
    });
    pack_groups(values)
}

/// Requantises the sums of four filters and adds a skip.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn with_skip(sums: [__m512i; GROUP], multiplier: &[f32], factors: SkipSum, skip: __m512i) -> __m512i {
    let zero = _mm512_setzero_ps();
    let skip_factor = _mm512_set1_ps(factors.skip);
    let values = std::array::from_fn(|k| {
        let v = _mm512_mul_ps(_mm512_cvtepi32_ps(sums[k]), _mm512_set1_ps(multiplier[k]));
        let v = _mm512_max_ps(v, zero);
        let a = match factors.relu {
            Some(factor) => {
                let v = _mm512_min_ps(v, _mm512_set1_ps(255.0));
                _mm512_mul_ps(_mm512_roundscale_ps::<0>(v), _mm512_set1_ps(factor))
            }
            None => v,
        };
        // Byte k of each group, widened.
        let bytes = _mm512_and_si512(
            _mm512_srlv_epi32(skip, _mm512_set1_epi32(8 * k as i32)),
            _mm512_set1_epi32(255),
        );
        let s = _mm512_mul_ps(_mm512_cvtepi32_ps(bytes), skip_factor);
        _mm512_cvtps_epi32(_mm512_add_ps(a, s))
    });
    pack_groups(values)
}

/// Packs four registers of one channel's 16 pixels into 16 groups of bytes, saturating.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn pack_groups([a, b, c, d]: [__m512i; GROUP]) -> __m512i {
    // Both packs work in 128-bit lanes: four pixels of a, then of b, c and d. The shuffle transposes this 4×4 block.
    let bytes = _mm512_packus_epi16(_mm512_packs_epi32(a, b), _mm512_packs_epi32(c, d));
    let turn = _mm512_set4_epi32(0x0f0b_0703, 0x0e0a_0602, 0x0d09_0501, 0x0c08_0400);
    _mm512_shuffle_epi8(bytes, turn)
}
