//! Kernels in plain Rust: the definition that every other instruction set is tested against.

use crate::Bounds;
use crate::int8::{GROUP, Kernels, LayerKernels, Packed, RowKernels, Taps, quantise_row, rescale_row};
use crate::wavefront::{Geometry, Slots};
use crate::{OUTPUTS, f32};

pub(crate) const INT8: Kernels = Kernels {
    layers: LayerKernels::Rows(RowKernels {
        pack,
        hidden_row,
        last_row,
        offset: 0,
    }),
    quantise_row,
    rescale_row,
};

/// Packs words of four weights as `[filter][ky][group][kx]`.
fn pack(taps: &Taps<'_>) -> Vec<i32> {
    taps.dot_words(&vec![1; taps.outputs()])
}

/// Returns the sum of `filter` at pixel `x`, including its bias.
fn sum(layer: &Packed, rows: &[&[u8]; 3], filter: usize, x: usize, geometry: Geometry) -> i32 {
    let per_row = layer.groups * 3;
    let weights = &layer.weights[filter * 3 * per_row..][..3 * per_row];
    let mut sum = layer.bias[filter];
    for (row, weights) in rows.iter().zip(weights.chunks_exact(per_row)) {
        for (group, taps) in row.chunks_exact(geometry.stride()).zip(weights.chunks_exact(3)) {
            let pixels = &group[geometry.start() + x * GROUP - GROUP..][..3 * GROUP];
            for (pixel, weights) in pixels.chunks_exact(GROUP).zip(taps) {
                for (value, weight) in pixel.iter().zip(weights.to_le_bytes()) {
                    sum += i32::from(*value) * i32::from(weight as i8);
                }
            }
        }
    }
    sum
}

fn hidden_row(layer: &Packed, rows: Slots<'_, u8>, skip: Option<&[u8]>, out: &mut [u8], geometry: Geometry) {
    let rows = rows.rows();
    for filter in 0..layer.outputs {
        let at = filter / GROUP * geometry.stride() + geometry.start() + filter % GROUP;
        for x in 0..geometry.width {
            let v = sum(layer, &rows, filter, x, geometry) as f32 * layer.multiplier[filter];
            let at = at + x * GROUP;
            let value = match (layer.skip, skip) {
                (Some(factors), Some(skip)) => {
                    let a = match factors.relu {
                        Some(factor) => v.clamp(0.0, 255.0).round_ties_even() * factor,
                        None => v.at_least(0.0),
                    };
                    a + f32::from(skip[at]) * factors.skip
                }
                _ => v,
            };
            out[at] = (value.round_ties_even() as u8).saturating_add(layer.zero_point);
        }
    }
}

fn last_row(layer: &Packed, rows: Slots<'_, u8>, out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
    let rows = rows.rows();
    for (filter, out) in out.into_iter().enumerate() {
        for (x, out) in out.iter_mut().enumerate() {
            *out = sum(layer, &rows, filter, from + x, geometry) as f32 * layer.multiplier[filter];
        }
    }
}

pub(crate) const F32: f32::Kernels = f32::Kernels {
    size: |_| 1,
    hidden_row: f32_hidden_row,
    last_row: f32_last_row,
};

/// Computes the sums of `filter` along a row, including the bias.
fn f32_sums(layer: &f32::Packed, rows: &[&[f32]; 3], filter: usize, sums: &mut [f32], from: usize, geometry: Geometry) {
    sums.fill(layer.bias[filter]);
    let per_row = layer.inputs * 3;
    let weights = &layer.weights[filter * 3 * per_row..][..3 * per_row];
    for (row, weights) in rows.iter().zip(weights.chunks_exact(per_row)) {
        for (channel, taps) in row.chunks_exact(geometry.stride()).zip(weights.chunks_exact(3)) {
            for (kx, weight) in taps.iter().enumerate() {
                let pixels = &channel[geometry.start() + from + kx - 1..][..sums.len()];
                for (sum, pixel) in sums.iter_mut().zip(pixels) {
                    *sum += weight * pixel;
                }
            }
        }
    }
}

fn f32_hidden_row(layer: &f32::Packed, rows: &[&[f32]; 3], skip: Option<&[f32]>, out: &mut [f32], geometry: Geometry) {
    for filter in 0..layer.outputs {
        let range = filter * geometry.stride() + geometry.start()..;
        let out = &mut out[range.clone()][..geometry.width];
        f32_sums(layer, rows, filter, out, 0, geometry);
        match skip {
            Some(skip) => out
                .iter_mut()
                .zip(&skip[range])
                .for_each(|(out, skip)| *out = out.at_least(0.0) + skip),
            None => out.iter_mut().for_each(|out| *out = out.at_least(0.0)),
        }
    }
}

fn f32_last_row(layer: &f32::Packed, rows: &[&[f32]; 3], out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
    for (filter, out) in out.into_iter().enumerate() {
        f32_sums(layer, rows, filter, out, from, geometry);
    }
}
