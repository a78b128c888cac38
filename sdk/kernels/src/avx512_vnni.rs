//! int8 kernels for AVX-512 with VNNI: 16 pixels to a register, one multiply-accumulate instruction for 64 products.
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::avx2::{quantise_row, rescale_row};
use crate::int8::{GROUP, Kernels, Packed, SkipSum, Taps};
use crate::wavefront::{BLOCK, Geometry, MARGIN, Window, last_row_by_blocks};
use std::arch::x86_64::*;
use std::hint::black_box;

/// The kernels, where the processor has what they need.
pub(crate) fn kernels() -> Option<Kernels> {
    available().then_some(Kernels {
        pack,
        hidden_row,
        last_row,
        offset: 0,
        quantise_row,
        rescale_row,
    })
}

pub(crate) fn available() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vnni")
}

/// Filters computed together: their sums fill the 32 registers.
fn sizes(outputs: usize) -> impl Iterator<Item = usize> {
    let mut left = outputs;
    std::iter::from_fn(move || {
        let size = match left {
            0 => return None,
            OUTPUTS => OUTPUTS,
            8..16 => 8,
            16..24 => 16,
            _ => 24,
        };
        left -= size;
        Some(size)
    })
}

fn pack(taps: &Taps<'_>) -> Vec<i32> {
    taps.dot_words(&sizes(taps.outputs()).collect::<Vec<_>>())
}

fn hidden_row(
    layer: &Packed,
    window: Window<'_, u8>,
    skip: Option<&[u8]>,
    out: &mut [u8],
    geometry: Geometry,
) {
    let rows = window.rows();
    let stride = geometry.stride();
    let mut first = 0;
    for size in sizes(layer.outputs) {
        let words = 9 * layer.groups;
        let weights = &layer.weights[first * words..][..size * words];
        let constants = Constants::new(layer, first, size);
        let groups = first / GROUP * stride..(first + size) / GROUP * stride;
        let skip = skip.map(|skip| &skip[groups.clone()]);
        let out = &mut out[groups];
        // SAFETY: `kernels` has found the features. The slices hold what the functions state.
        unsafe {
            match size {
                24 => filters::<24, 1>(
                    &rows,
                    layer.groups,
                    weights,
                    &constants,
                    skip,
                    out,
                    geometry,
                ),
                16 => filters::<16, 1>(
                    &rows,
                    layer.groups,
                    weights,
                    &constants,
                    skip,
                    out,
                    geometry,
                ),
                _ => filters::<8, 2>(
                    &rows,
                    layer.groups,
                    weights,
                    &constants,
                    skip,
                    out,
                    geometry,
                ),
            }
        }
        first += size;
    }
}

fn last_row(
    layer: &Packed,
    window: Window<'_, u8>,
    out: [&mut [f32]; OUTPUTS],
    from: usize,
    geometry: Geometry,
) {
    let rows = window.rows();
    last_row_by_blocks(out, from, |x, values| {
        // SAFETY: `kernels` has found the features.
        unsafe { last_block(layer, &rows, x, values, geometry) }
    });
}

/// What follows the sums of some filters.
pub(crate) struct Constants<'a> {
    pub(crate) bias: &'a [i32],
    pub(crate) multiplier: &'a [f32],
    pub(crate) skip: Option<SkipSum>,
    pub(crate) zero_point: u8,
}

impl<'a> Constants<'a> {
    pub(crate) fn new(layer: &'a Packed, first: usize, size: usize) -> Self {
        Constants {
            bias: &layer.bias[first..first + size],
            multiplier: &layer.multiplier[first..first + size],
            skip: layer.skip,
            zero_point: layer.zero_point,
        }
    }
}

/// Checks that three rows hold `groups` groups of blocks and margins, so that block reads stay inside.
pub(crate) fn check_rows(rows: &[&[u8]; 3], groups: usize, geometry: Geometry) {
    assert!(
        rows.iter()
            .all(|row| row.len() >= groups * geometry.stride())
    );
    assert!(geometry.group == GROUP && geometry.padded.is_multiple_of(BLOCK) && MARGIN >= 16);
}

/// `O` filters on a row, `B` registers of pixels at a time.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn filters<const O: usize, const B: usize>(
    rows: &[&[u8]; 3],
    groups: usize,
    weights: &[i32],
    constants: &Constants<'_>,
    skip: Option<&[u8]>,
    out: &mut [u8],
    geometry: Geometry,
) {
    let stride = geometry.stride();
    check_rows(rows, groups, geometry);
    assert!(weights.len() == O * 9 * groups && constants.bias.len() == O);
    assert!(out.len() == O / GROUP * stride && skip.is_none_or(|skip| skip.len() == out.len()));
    for x in (0..geometry.width).step_by(16 * B) {
        // SAFETY: `x` is a block of the row; the asserts above hold for what is read.
        let sums = unsafe { sums::<O, B>(rows, groups, weights, constants.bias, x, geometry) };
        for g in 0..O / GROUP {
            #[allow(clippy::needless_range_loop)]
            for b in 0..B {
                let at = g * stride + geometry.start() + (x + 16 * b) * GROUP;
                let four: [__m512i; GROUP] = std::array::from_fn(|k| sums[g * GROUP + k][b]);
                let multiplier = &constants.multiplier[g * GROUP..][..GROUP];
                // SAFETY: 64 bytes at `at` lie in the group, whose blocks are whole.
                unsafe {
                    let value = match (constants.skip, skip) {
                        (Some(factors), Some(skip)) => {
                            let skip = _mm512_loadu_si512(skip.as_ptr().add(at).cast());
                            requantise_sum(four, multiplier, factors, skip)
                        }
                        _ => requantise(four, multiplier),
                    };
                    let zero = _mm512_set1_epi8(constants.zero_point as i8);
                    _mm512_storeu_si512(
                        out.as_mut_ptr().add(at).cast(),
                        _mm512_adds_epu8(value, zero),
                    );
                }
            }
        }
    }
}

/// The sums of `O` filters at `16·B` pixels from `x`.
///
/// # Safety
/// `rows` and `geometry` have passed [`check_rows`], `x + 16·B` is within the padded row, `weights` holds `9·O·groups`
/// words and `bias` `O`.
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
    // SAFETY: as the function's own.
    unsafe {
        let mut weight = weights.as_ptr();
        for row in rows {
            let mut pixels = row.as_ptr().add(geometry.start() + x * GROUP - GROUP);
            for _ in 0..groups {
                for kx in 0..3 {
                    let values: [__m512i; B] = std::array::from_fn(|b| {
                        _mm512_loadu_si512(pixels.add((kx + 16 * b) * GROUP).cast())
                    });
                    for (o, sums) in sums.iter_mut().enumerate() {
                        let weight = _mm512_set1_epi32(*weight.add(o));
                        for (sum, value) in sums.iter_mut().zip(values) {
                            *sum = _mm512_dpbusd_epi32(*sum, value, weight);
                        }
                    }
                    weight = weight.add(O);
                }
                pixels = pixels.add(geometry.stride());
            }
        }
    }
    sums
}

#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn last_block(
    layer: &Packed,
    rows: &[&[u8]; 3],
    x: usize,
    values: &mut [[f32; BLOCK]; OUTPUTS],
    geometry: Geometry,
) {
    check_rows(rows, layer.groups, geometry);
    assert!(layer.weights.len() == OUTPUTS * 9 * layer.groups && x + BLOCK <= geometry.padded);
    // SAFETY: the asserts above.
    unsafe {
        let sums = sums::<OUTPUTS, 4>(
            rows,
            layer.groups,
            &layer.weights,
            &layer.bias[..OUTPUTS],
            x,
            geometry,
        );
        for (o, (sums, values)) in sums.iter().zip(values).enumerate() {
            let multiplier = _mm512_set1_ps(layer.multiplier[o]);
            for (b, sum) in sums.iter().enumerate() {
                let value = _mm512_mul_ps(_mm512_cvtepi32_ps(*sum), multiplier);
                _mm512_storeu_ps(values.as_mut_ptr().add(16 * b), value);
            }
        }
    }
}

/// `sat(rint(sum · multiplier))` of four filters, as one register of groups.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
pub(crate) fn requantise(sums: [__m512i; GROUP], multiplier: &[f32]) -> __m512i {
    let values = std::array::from_fn(|k| {
        _mm512_cvtps_epi32(_mm512_mul_ps(
            _mm512_cvtepi32_ps(sums[k]),
            _mm512_set1_ps(multiplier[k]),
        ))
    });
    pack_groups(values)
}

/// The same with the sum of a skip.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
pub(crate) fn requantise_sum(
    sums: [__m512i; GROUP],
    multiplier: &[f32],
    factors: SkipSum,
    skip: __m512i,
) -> __m512i {
    let zero = _mm512_setzero_ps();
    let skip_factor = _mm512_set1_ps(factors.skip);
    let values = std::array::from_fn(|k| {
        let v = _mm512_mul_ps(_mm512_cvtepi32_ps(sums[k]), _mm512_set1_ps(multiplier[k]));
        let v = _mm512_max_ps(v, zero);
        let a = match factors.relu {
            Some(factor) => {
                let v = _mm512_min_ps(v, _mm512_set1_ps(255.0));
                _mm512_mul_ps(
                    _mm512_cvtepi32_ps(_mm512_cvtps_epi32(v)),
                    _mm512_set1_ps(factor),
                )
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

/// Four registers of one channel's 16 pixels to 16 groups of bytes, saturating.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn pack_groups([a, b, c, d]: [__m512i; GROUP]) -> __m512i {
    // Both packs work in 128-bit lanes: four pixels of a, then of b, c and d; the shuffle turns this 4×4 block.
    let bytes = _mm512_packus_epi16(_mm512_packs_epi32(a, b), _mm512_packs_epi32(c, d));
    let turn = _mm512_set4_epi32(0x0f0b_0703, 0x0e0a_0602, 0x0d09_0501, 0x0c08_0400);
    _mm512_shuffle_epi8(bytes, turn)
}

/// Multiply-accumulates in registers, for the machine's peak.
pub(crate) fn burn(rounds: u64) -> u64 {
    #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
    fn run(rounds: u64) {
        let x = black_box(_mm512_setzero_si512());
        let mut sums = [x; 24];
        for _ in 0..rounds {
            for sum in &mut sums {
                *sum = _mm512_dpbusd_epi32(*sum, x, x);
            }
        }
        black_box(sums);
    }
    // SAFETY: the caller has found the features.
    unsafe { run(rounds) };
    rounds * 24 * 64
}
