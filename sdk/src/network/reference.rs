//! The naive oracle: a chain run as its definition reads, one sum a value. Slow; every fast path is tested against it.

use super::chain::{Chain, Quantisation, Weights};

/// Runs `chain` on one frame: `input` planar `(C, H, W)`, the result `(outputs, H, W)`.
///
/// An int8 chain is computed in real numbers (f64 sums) with the roundings where the file has them.
///
/// # Panics
/// If `input` is not `chain.inputs · height · width` long.
pub fn run(chain: &Chain, input: &[f32], height: usize, width: usize) -> Vec<f32> {
    let area = height * width;
    assert_eq!(input.len(), chain.inputs * area);
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
        output = convolve(&x, &real_kernel(layer), layer.outputs, height, width);
        if i < last {
            output.iter_mut().for_each(|v| *v = v.max(0.0));
        }
        inputs.push(x);
    }
    if chain.tanh {
        output.iter_mut().for_each(|v| *v = v.tanh());
    }
    output
}

fn round(values: &mut [f32], quantisation: Option<Quantisation>) {
    if let Some(q) = quantisation {
        values.iter_mut().for_each(|v| *v = q.dequantise(q.quantise(*v)));
    }
}

/// Kernel and bias of a layer as real numbers.
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

/// A 3×3 convolution (correlation, as networks have it), stride 1, zero padding.
fn convolve(x: &[f32], (kernel, bias): &(Vec<f64>, Vec<f64>), outputs: usize, height: usize, width: usize) -> Vec<f32> {
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
