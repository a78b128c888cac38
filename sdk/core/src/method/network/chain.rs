//! The structure of a hologram network: a residual chain of 3×3 convolutions with its weights and quantisation.
//!
//! This module is independent of ONNX and of how a chain is run. The `L` layers are counted from 0. Each is a 3×3
//! convolution of stride 1 with zero padding; all but the last are followed by ReLU:
//!
//! - `input[0]` is the network's input, `input[i] = output[i−1]`;
//! - for odd `i ≥ 3`, `input[i] = output[i−1] + input[i−2]`;
//! - the last layer's input is the features followed by the network's input.
//!
//! A halved chain works at half the resolution. A square of two by two pixels is one pixel of its layers, which have
//! four times the channels of the network's input and output: those of the upper left pixel first, then upper right,
//! lower left, lower right. If a side is odd, its last row or column is repeated. With the same number of layers, a
//! halved chain sees twice as far.

/// The number format of a chain's layers. All layers use the same one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 32-bit floating point.
    F32,
    /// u8 activations (per tensor) times s8 weights (per output channel), with 32-bit accumulators.
    Int8,
}

impl Precision {
    /// Returns the name for reports.
    pub fn name(self) -> &'static str {
        match self {
            Precision::F32 => "f32",
            Precision::Int8 => "int8",
        }
    }
}

impl std::fmt::Display for Precision {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// The mapping of u8 values to real numbers: `real = scale · (value − zero_point)`;
/// `value = clamp(round(real/scale) + zero_point, 0, 255)`, rounding half to even.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantisation {
    /// The real size of one step, finite and positive.
    pub scale: f32,
    /// The value that represents 0.
    pub zero_point: u8,
}

impl Quantisation {
    /// Returns the nearest value to `real`.
    pub fn quantise(&self, real: f32) -> u8 {
        let zero = f32::from(self.zero_point);
        let steps = (real / self.scale).clamp(-zero, 255.0 - zero).round_ties_even();
        (steps + zero) as u8
    }

    /// Returns the real number that `value` represents.
    pub fn dequantise(&self, value: u8) -> f32 {
        (i32::from(value) - i32::from(self.zero_point)) as f32 * self.scale
    }
}

/// The weights of one convolution, `(out, in, 3, 3)` row-major, and its bias.
#[derive(Debug, Clone, PartialEq)]
pub enum Weights {
    /// Real weights and bias.
    F32 {
        /// The kernel, `(out, in, 3, 3)`.
        kernel: Vec<f32>,
        /// The bias of each output channel.
        bias: Vec<f32>,
    },
    /// Quantised weights: `real weight = scale[out] · kernel`; `real bias = input scale · scale[out] · bias`.
    Int8 {
        /// The kernel, `(out, in, 3, 3)`.
        kernel: Vec<i8>,
        /// The scale of each output channel.
        scale: Vec<f32>,
        /// The bias of each output channel.
        bias: Vec<i32>,
    },
}

/// The roundings between a layer's ReLU and the next layer's input. All are `None` in an f32 chain.
///
/// In order: `relu` rounds the ReLU's output before a sum or a concatenation, `sum` rounds the sum before a
/// concatenation, and `input` rounds the input of the convolution.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct InputQuantisation {
    /// The rounding of the previous layer's ReLU, before the sum or the concatenation.
    pub relu: Option<Quantisation>,
    /// The rounding of the sum, before the concatenation.
    pub sum: Option<Quantisation>,
    /// The rounding of the convolution's input.
    pub input: Option<Quantisation>,
}

/// One layer of a chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// The name of the layer's convolution in the file.
    pub name: String,
    /// The number of input channels. In the last layer it includes the concatenated ones.
    pub inputs: usize,
    /// The number of output channels.
    pub outputs: usize,
    /// Weights and bias.
    pub weights: Weights,
    /// The roundings of the layer's input.
    pub quantisation: InputQuantisation,
}

/// A whole residual chain. [`super::Network`] reads it from an ONNX file and guarantees its shapes and values.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// The number of channels of the network's input.
    pub inputs: usize,
    /// Whether it runs at half the resolution.
    pub halved: bool,
    /// The layers in order, at least two.
    pub layers: Vec<Layer>,
    /// Whether tanh follows the last convolution.
    pub tanh: bool,
    /// Whether the last layer's concatenation of an int8 chain reads the network's input as rounded for the first
    /// layer, rather than unrounded.
    pub concat_rounded_input: bool,
    /// The number format of all layers.
    pub precision: Precision,
}

impl Chain {
    /// Returns the number of channels of the network's output.
    pub fn outputs(&self) -> usize {
        self.layers.last().map_or(0, |layer| layer.outputs / self.side().pow(2))
    }

    /// Returns how many of the frame's pixels form one side of a layer's pixel: 1, or 2 in a halved chain.
    pub fn side(&self) -> usize {
        if self.halved { 2 } else { 1 }
    }

    /// Returns the number of filters of the hidden layers.
    pub fn filters(&self) -> usize {
        self.layers.first().map_or(0, |layer| layer.outputs)
    }

    /// Returns whether layer `i` reads `output[i−1] + input[i−2]`.
    pub fn has_skip(i: usize) -> bool {
        i >= 3 && i % 2 == 1
    }

    /// Returns the number of multiply-accumulate operations for one pixel.
    pub fn macs_per_pixel(&self) -> usize {
        let all: usize = self.layers.iter().map(|layer| 9 * layer.inputs * layer.outputs).sum();
        all / self.side().pow(2)
    }
}
