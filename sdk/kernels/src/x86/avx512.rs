//! The f32 kernels for AVX-512: 16 pixels per register, 24 filters at a time.
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::f32::{Kernels, Packed};
use crate::wavefront::{BLOCK, Geometry, MARGIN, last_row_by_blocks};
use std::arch::x86_64::*;

/// Returns the kernels if the processor supports them.
pub(crate) fn kernels() -> Option<Kernels> {
    is_x86_feature_detected!("avx512f").then_some(Kernels {
        size,
        hidden_row,
        last_row,
    })
}

fn size(left: usize) -> usize {
    match left {
        OUTPUTS => OUTPUTS,
        8..16 => 8,
        16..24 => 16,
        _ => 24,
    }
}

fn hidden_row(layer: &Packed, rows: &[&[f32]; 3], skip: Option<&[f32]>, out: &mut [f32], geometry: Geometry) {
    let mut first = 0;
    while first < layer.outputs {
        let size = size(layer.outputs - first);
        let range = first * geometry.stride()..(first + size) * geometry.stride();
        let skip = skip.map(|skip| &skip[range.clone()]);
        let out = &mut out[range];
        // SAFETY: `kernels` has detected the feature.
        unsafe {
            match size {
                24 => filters::<24, 1>(layer, first, rows, skip, out, geometry),
                16 => filters::<16, 1>(layer, first, rows, skip, out, geometry),
                _ => filters::<8, 2>(layer, first, rows, skip, out, geometry),
            }
        }
        first += size;
    }
}

fn last_row(layer: &Packed, rows: &[&[f32]; 3], out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
    last_row_by_blocks(out, from, |x, values| {
        // SAFETY: `kernels` has detected the feature.
        unsafe { last_block(layer, rows, x, values, geometry) }
    });
}

#[target_feature(enable = "avx512f")]
fn filters<const O: usize, const B: usize>(
    layer: &Packed,
    first: usize,
    rows: &[&[f32]; 3],
    skip: Option<&[f32]>,
    out: &mut [f32],
    geometry: Geometry,
) {
    assert!(out.len() == O * geometry.stride() && skip.is_none_or(|skip| skip.len() == out.len()));
    let zero = _mm512_setzero_ps();
    for x in (0..geometry.width).step_by(16 * B) {
        let sums = sums::<O, B>(layer, first, rows, x, geometry);
        for (o, sums) in sums.iter().enumerate() {
            for (b, sum) in sums.iter().enumerate() {
                let at = o * geometry.stride() + geometry.start() + x + 16 * b;
                let mut value = _mm512_max_ps(*sum, zero);
                // SAFETY: 16 pixels at `at` are inside the filter's row, whose blocks are whole.
                unsafe {
                    if let Some(skip) = skip {
                        value = _mm512_add_ps(value, _mm512_loadu_ps(skip.as_ptr().add(at)));
                    }
                    _mm512_storeu_ps(out.as_mut_ptr().add(at), value);
                }
            }
        }
    }
}

/// Returns the sums of `O` filters at `16·B` pixels from `x`.
#[inline]
#[target_feature(enable = "avx512f")]
fn sums<const O: usize, const B: usize>(
    layer: &Packed,
    first: usize,
    rows: &[&[f32]; 3],
    x: usize,
    geometry: Geometry,
) -> [[__m512; B]; O] {
    let weights = &layer.weights[first * 9 * layer.inputs..][..O * 9 * layer.inputs];
    assert!(rows.iter().all(|row| row.len() >= layer.inputs * geometry.stride()));
    assert!(x + 16 * B <= geometry.padded && MARGIN >= 1);
    let mut sums = [[_mm512_setzero_ps(); B]; O];
    for (sums, bias) in sums.iter_mut().zip(&layer.bias[first..first + O]) {
        *sums = [_mm512_set1_ps(*bias); B];
    }
    // SAFETY: by the asserts above, rows extend one pixel past the block, and there are as many weights as the loops
    // read.
    unsafe {
        let mut weight = weights.as_ptr();
        for row in rows {
            let mut pixels = row.as_ptr().add(geometry.start() + x - 1);
            for _ in 0..layer.inputs {
                for kx in 0..3 {
                    let values: [__m512; B] = std::array::from_fn(|b| _mm512_loadu_ps(pixels.add(kx + 16 * b)));
                    for (o, sums) in sums.iter_mut().enumerate() {
                        let weight = _mm512_set1_ps(*weight.add(o));
                        for (sum, value) in sums.iter_mut().zip(values) {
                            *sum = _mm512_fmadd_ps(value, weight, *sum);
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

#[target_feature(enable = "avx512f")]
fn last_block(layer: &Packed, rows: &[&[f32]; 3], x: usize, values: &mut [[f32; BLOCK]; OUTPUTS], geometry: Geometry) {
    let sums = sums::<OUTPUTS, 4>(layer, 0, rows, x, geometry);
    for (sums, values) in sums.iter().zip(values) {
        for (sum, values) in sums.iter().zip(values.as_chunks_mut::<16>().0) {
            // SAFETY: the slice holds 16 values.
            unsafe { _mm512_storeu_ps(values.as_mut_ptr(), *sum) };
        }
    }
}
