//! The naive oracle, which runs a chain exactly as defined, with one sum for each value. It is slow. Every fast path is
//! tested against it.

use super::chain::{Chain, Quantisation, Weights};
use crate::Bounds;
use crate::Size;

/// The pixels of a square of two by two, from the upper left.
const PIXELS: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];

/// Runs `chain` on one frame: `input` is planar `(C, H, W)`, the result is `(outputs, H, W)`.
///
/// An int8 chain is computed in real numbers (f64 sums) with the roundings of the file.
///
/// # Panics
/// Panics if `input` does not have `chain.inputs · height · width` values.
pub fn run(chain: &Chain, input: &[f32], size: Size) -> Vec<f32> {
    let Size { width, height } = size;
    assert_eq!(input.len(), chain.inputs * height * width);
    let mut output = if chain.halved {
        let half = (height.div_ceil(2), width.div_ceil(2));
        let output = layers(
            chain,
            &squares(input, size),
            Size {
                width: half.1,
                height: half.0,
            },
        );
        pixels(&output, chain.outputs(), size)
    } else {
        layers(chain, input, size)
    };
    if chain.tanh {
        output.iter_mut().for_each(|v| *v = v.tanh());
    }
    output
}

/// Rearranges (C, H, W) as (4·C, ⌈H/2⌉, ⌈W/2⌉).
fn squares(values: &[f32], size: Size) -> Vec<f32> {
    let Size { width, height } = size;
    let mut squares = Vec::new();
    for (dy, dx) in PIXELS {
        for plane in values.chunks(height * width) {
            for y in (0..height).step_by(2) {
                let row = (y + dy).min(height - 1) * width;
                squares.extend((0..width).step_by(2).map(|x| plane[row + (x + dx).min(width - 1)]));
            }
        }
    }
    squares
}

/// Rearranges squares as pixels. This is the inverse of [`squares`].
fn pixels(squares: &[f32], channels: usize, size: Size) -> Vec<f32> {
    let Size { width, height } = size;
    let (rows, columns) = (height.div_ceil(2), width.div_ceil(2));
    let mut values = Vec::new();
    for channel in 0..channels {
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let plane = (y % 2 * 2 + x % 2) * channels + channel;
            values.push(squares[(plane * rows + y / 2) * columns + x / 2]);
        }
    }
    values
}

/// Runs the layers on (C, H, W) at their own resolution.
fn layers(chain: &Chain, input: &[f32], size: Size) -> Vec<f32> {
    let last = chain.layers.len() - 1;
    let mut inputs: Vec<Vec<f32>> = Vec::new();
    let mut output = input.to_vec();
    for (i, layer) in chain.layers.iter().enumerate() {
        let rounding = &layer.quantisation;
        let mut x = output;
        if Chain::has_skip(i) {
            round(&mut x, rounding.relu);
            x.iter_mut().zip(&inputs[i - 2]).for_each(|(x, skip)| *x += skip);
            if i == last {
                round(&mut x, rounding.sum);
            }
        } else if i == last {
            round(&mut x, rounding.relu);
        }
        if i == last {
            let mut network_input = input.to_vec();
            if chain.concat_rounded_input {
                round(&mut network_input, chain.layers[0].quantisation.input);
            }
            x.extend(network_input);
        }
        round(&mut x, rounding.input);
        output = convolve(&x, &real_kernel(layer), layer.outputs, size);
        if i < last {
            output.iter_mut().for_each(|v| *v = v.at_least(0.0));
        }
        inputs.push(x);
    }
    output
}

fn round(values: &mut [f32], quantisation: Option<Quantisation>) {
    if let Some(q) = quantisation {
        values.iter_mut().for_each(|v| *v = q.dequantise(q.quantise(*v)));
    }
}

/// Returns kernel and bias of a layer as real numbers.
fn real_kernel(layer: &super::chain::Layer) -> (Vec<f64>, Vec<f64>) {
    match &layer.weights {
        Weights::F32 { kernel, bias } => (
            kernel.iter().map(|&w| w.into()).collect(),
            bias.iter().map(|&b| b.into()).collect(),
        ),
        Weights::Int8 { kernel, scale, bias } => {
            let input = f64::from(layer.quantisation.input.map_or(1.0, |q| q.scale));
            let per_filter = 9 * layer.inputs;
            let real = kernel
                .iter()
                .enumerate()
                .map(|(k, &w)| f64::from(w) * f64::from(scale[k / per_filter]));
            let real_bias = bias
                .iter()
                .zip(scale)
                .map(|(&b, &s)| f64::from(b) * input * f64::from(s));
            (real.collect(), real_bias.collect())
        }
    }
}

/// Computes a 3×3 convolution (a correlation, as in networks) with stride 1 and zero padding.
fn convolve(x: &[f32], (kernel, bias): &(Vec<f64>, Vec<f64>), outputs: usize, size: Size) -> Vec<f32> {
    let Size { width, height } = size;
    let inputs = x.len() / (height * width);
    let mut result = Vec::with_capacity(outputs * height * width);
    for (o, bias) in bias.iter().enumerate().take(outputs) {
        for row in 0..height {
            for column in 0..width {
                let mut sum = *bias;
                for c in 0..inputs {
                    for (tap, w) in kernel[(o * inputs + c) * 9..][..9].iter().enumerate() {
                        let (r, k) = (row + tap / 3, column + tap % 3);
                        if (1..=height).contains(&r) && (1..=width).contains(&k) {
                            sum += w * f64::from(x[(c * height + r - 1) * width + k - 1]);
                        }
                    }
                }
                result.push(sum as f32);
            }
        }
    }
    result
}
