//! What a hologram network is: a residual chain of 3×3 convolutions, its weights and its quantisation.
//!
//! Nothing here knows ONNX or how a chain is run. `L` layers are counted from 0; every one is a 3×3 convolution of
//! stride 1 with zero padding, all but the last followed by ReLU:
//!
//! - `input[0]` is the network's input, `input[i] = output[i−1]`;
//! - for odd `i ≥ 3`, `input[i] = output[i−1] + input[i−2]`;
//! - the last layer's input has the network's input concatenated behind the features.
//!
//! A halved chain does so at half the resolution: a square of two by two pixels is a pixel of its layers, which have
//! four times the channels of the network's input and output, those of the upper left pixel first, then upper right,
//! lower left, lower right. Where a side is odd, its last row or column is repeated. It sees twice as far for as many
//! layers.

/// Numbers of a chain's layers: one of the two precisions, throughout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 32-bit floating point.
    F32,
    /// u8 activations (per tensor) times s8 weights (per output channel), 32-bit accumulators.
    Int8,
}

impl std::fmt::Display for Precision {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Precision::F32 => "f32",
            Precision::Int8 => "int8",
        })
    }
}

/// How u8 values stand for real ones: `real = scale · (value − zero_point)`; `value = clamp(round(real/scale) +
/// zero_point, 0, 255)`, rounding half to even.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantisation {
    /// Real size of one step; finite and positive.
    pub scale: f32,
    /// The value that stands for 0.
    pub zero_point: u8,
}

impl Quantisation {
    /// The nearest value to `real`.
    pub fn quantise(&self, real: f32) -> u8 {
        let zero = f32::from(self.zero_point);
        let steps = (real / self.scale).clamp(-zero, 255.0 - zero).round_ties_even();
        (steps + zero) as u8
    }

    /// What `value` stands for.
    pub fn dequantise(&self, value: u8) -> f32 {
        (i32::from(value) - i32::from(self.zero_point)) as f32 * self.scale
    }
}

/// Weights of one convolution, `(out, in, 3, 3)` row-major, and its bias.
#[derive(Debug, Clone, PartialEq)]
pub enum Weights {
    /// Real weights and bias.
    F32 {
        /// `(out, in, 3, 3)`.
        kernel: Vec<f32>,
        /// One an output channel.
        bias: Vec<f32>,
    },
    /// `real weight = scale[out] · kernel`; `real bias = input scale · scale[out] · bias`.
    Int8 {
        /// `(out, in, 3, 3)`.
        kernel: Vec<i8>,
        /// One an output channel.
        scale: Vec<f32>,
        /// One an output channel.
        bias: Vec<i32>,
    },
}

/// The roundings on the way from a layer's ReLU to the next layer's input; all `None` in an f32 chain.
///
/// In order: `relu` on the ReLU's output where a sum or a concatenation comes after it, `sum` on the sum where a
/// concatenation comes after that, and `input` on what the convolution reads.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct InputQuantisation {
    /// On the previous layer's ReLU, before the sum or the concatenation.
    pub relu: Option<Quantisation>,
    /// On the sum, before the concatenation.
    pub sum: Option<Quantisation>,
    /// On what the convolution reads.
    pub input: Option<Quantisation>,
}

/// One layer of a chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// The name of the layer's convolution in the file.
    pub name: String,
    /// Channels read, the concatenated ones of the last layer included.
    pub inputs: usize,
    /// Channels written.
    pub outputs: usize,
    /// Weights and bias.
    pub weights: Weights,
    /// How the layer's input is rounded.
    pub quantisation: InputQuantisation,
}

/// A whole residual chain. [`super::Network`] makes one from an ONNX file and vouches for its shapes and values.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Channels of the network's input.
    pub inputs: usize,
    /// Whether it runs at half the resolution.
    pub halved: bool,
    /// The layers in order, two at least.
    pub layers: Vec<Layer>,
    /// Whether tanh follows the last convolution.
    pub tanh: bool,
    /// Of an int8 chain: whether the last layer's concatenation reads the network's input as the first layer does
    /// (rounded), rather than as given.
    pub concat_rounded_input: bool,
    /// The numbers of all layers.
    pub precision: Precision,
}

impl Chain {
    /// Channels of the network's output.
    pub fn outputs(&self) -> usize {
        self.layers.last().map_or(0, |layer| layer.outputs / self.side().pow(2))
    }

    /// Pixels of the frame along each side of one of the layers' own: 1, or 2 in a halved chain.
    pub fn side(&self) -> usize {
        if self.halved { 2 } else { 1 }
    }

    /// Filters of the hidden layers.
    pub fn filters(&self) -> usize {
        self.layers.first().map_or(0, |layer| layer.outputs)
    }

    /// Whether layer `i` reads `output[i−1] + input[i−2]`.
    pub fn has_skip(i: usize) -> bool {
        i >= 3 && i % 2 == 1
    }

    /// Multiply-accumulate operations for one pixel.
    pub fn macs_per_pixel(&self) -> usize {
        let all: usize = self.layers.iter().map(|layer| 9 * layer.inputs * layer.outputs).sum();
        all / self.side().pow(2)
    }
}
