//! The quantised chain: what it computes, to the bit, and how its weights are packed for the kernels.
//!
//! Activations are u8, weights s8, sums exact in 32 bits. After a sum come, in f32 and in this order (`rint` rounds
//! half to even, `sat` clamps to 0…255, each operation rounds by itself, nothing is fused):
//!
//! - `v = f32(sum + bias) · multiplier[filter]`;
//! - without a skip, `q = sat(rint(v))`: saturation is the ReLU;
//! - with a skip of value `s`, `q = sat(rint(a + f32(s) · skip))`, where `a = max(v, 0)`, or, where the file rounds the
//!   ReLU before the sum, `a = rint(min(max(v, 0), 255)) · relu`;
//! - where the file rounds once more before the concatenation, `q = sat(rint(f32(q) · rescale))`;
//! - `sat(q + zero_point)`.
//!
//! The last layer yields `f32(sum + bias) · multiplier[filter]`.
//!
//! A row is grouped by four channels: `[channel/4][pixel][4]`. The concatenated network input starts a group of its
//! own.

use crate::rows::Rows;
use crate::wavefront::{self, Chain, Geometry, Scratch, SourceRow, Tiling, Window};
use crate::{Isa, OUTPUTS};

/// Channels that lie together.
pub(crate) const GROUP: usize = 4;
/// Products of a sum and a multiplier stay below this, so that every conversion to an integer is exact.
const LARGEST: f64 = (1u32 << 30) as f64;

/// Real numbers to u8: `sat(rint(real / scale) + zero_point)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantiser {
    /// Size of one step.
    pub scale: f32,
    /// The value that stands for 0.
    pub zero_point: u8,
}

/// The sum with a skip: see the module's arithmetic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkipSum {
    /// Steps of the rounded ReLU in steps of the sum; `None` where the ReLU is not rounded by itself.
    pub relu: Option<f32>,
    /// Steps of the skip in steps of the sum.
    pub skip: f32,
}

/// From a hidden layer's sums to the next layer's input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Requantise {
    /// The sum with a skip, where there is one.
    pub skip: Option<SkipSum>,
    /// The factor of a second rounding.
    pub rescale: Option<f32>,
}

/// One layer.
#[derive(Debug, Clone, PartialEq)]
pub struct Int8Layer {
    /// Channels read, the concatenated ones of the last layer included.
    pub inputs: usize,
    /// Filters.
    pub outputs: usize,
    /// The value that stands for 0 in the layer's input.
    pub zero_point: u8,
    /// `(outputs, inputs, 3, 3)`.
    pub kernel: Vec<i8>,
    /// Without the zero point's share.
    pub bias: Vec<i32>,
    /// One a filter.
    pub multiplier: Vec<f32>,
    /// What follows a hidden layer; means nothing for the last.
    pub requantise: Requantise,
}

impl Int8Layer {
    /// Of a last layer, what gives the outputs of one pixel of each place.
    fn of_pixel(&self, pixel: usize) -> Int8Layer {
        let (weights, from) = (OUTPUTS * self.inputs * 9, pixel * OUTPUTS);
        Int8Layer {
            outputs: OUTPUTS,
            kernel: self.kernel[pixel * weights..][..weights].to_vec(),
            bias: self.bias[from..][..OUTPUTS].to_vec(),
            multiplier: self.multiplier[from..][..OUTPUTS].to_vec(),
            ..*self
        }
    }
}

/// A layer as the kernels read it.
pub(crate) struct Packed {
    /// Groups of four input channels.
    pub(crate) groups: usize,
    pub(crate) outputs: usize,
    /// With the shares of the zero point and of the kernels' offset; one a filter, then zeros to a multiple of 32.
    pub(crate) bias: Vec<i32>,
    pub(crate) multiplier: Vec<f32>,
    pub(crate) skip: Option<SkipSum>,
    /// Added, saturating, to what a hidden layer yields; 0 where a second rounding follows.
    pub(crate) zero_point: u8,
    /// In the order of the kernels' own `pack`.
    pub(crate) weights: Vec<i32>,
}

impl Packed {
    /// A layer for `kernels`; `next_zero` stands for 0 in what reads it.
    fn new(taps: &Taps<'_>, next_zero: u8, kernels: &Kernels) -> Packed {
        let layer = taps.layer;
        let of_filter = |(w, b): (&[i8], &i32)| {
            let weights: i32 = w.iter().map(|&w| i32::from(w)).sum();
            b + (kernels.offset - i32::from(layer.zero_point)) * weights
        };
        let filters = layer.kernel.chunks_exact(layer.inputs * 9);
        let mut bias: Vec<i32> = filters.zip(&layer.bias).map(of_filter).collect();
        let mut multiplier = layer.multiplier.clone();
        let padded = layer.outputs.next_multiple_of(32);
        bias.resize(padded, 0);
        multiplier.resize(padded, 0.0);
        Packed {
            groups: taps.groups(),
            outputs: layer.outputs,
            bias,
            multiplier,
            skip: layer.requantise.skip,
            zero_point: match layer.requantise.rescale {
                Some(_) => 0,
                None => next_zero,
            },
            weights: (kernels.pack)(taps),
        }
    }
}

/// A layer's weights by filter, group of channels and tap, for packing: channels that pad a group have weight 0.
pub(crate) struct Taps<'a> {
    layer: &'a Int8Layer,
    /// Channels before the concatenated ones.
    features: usize,
}

impl Taps<'_> {
    /// Four weights of `filter` (0 for filters that are padding) at row `ky` and column `kx`.
    pub(crate) fn group(&self, filter: usize, group: usize, ky: usize, kx: usize) -> [i8; GROUP] {
        let split = self.features.div_ceil(GROUP);
        std::array::from_fn(|k| {
            let channel = match group.checked_sub(split) {
                None => Some(group * GROUP + k).filter(|&c| c < self.features),
                Some(after) => Some(self.features + after * GROUP + k).filter(|&c| c < self.layer.inputs),
            };
            match channel {
                Some(c) if filter < self.layer.outputs => {
                    self.layer.kernel[((filter * self.layer.inputs + c) * 3 + ky) * 3 + kx]
                }
                _ => 0,
            }
        })
    }

    pub(crate) fn groups(&self) -> usize {
        self.features.div_ceil(GROUP) + (self.layer.inputs - self.features).div_ceil(GROUP)
    }

    pub(crate) fn outputs(&self) -> usize {
        self.layer.outputs
    }

    /// Words of four weights in the order `[filters by `size`][ky][group][kx][filter]`, as dot-product kernels read
    /// them.
    pub(crate) fn dot_words(&self, sizes: &[usize]) -> Vec<i32> {
        let mut words = Vec::new();
        let mut first = 0;
        for &size in sizes {
            for ky in 0..3 {
                for group in 0..self.groups() {
                    for kx in 0..3 {
                        for filter in first..first + size {
                            words.push(i32::from_le_bytes(self.group(filter, group, ky, kx).map(|w| w as u8)));
                        }
                    }
                }
            }
            first += size;
        }
        words
    }

    /// Each of [`Self::dot_words`] as two words of two 16-bit weights, of the even channels and of the odd ones.
    #[cfg(any(target_arch = "x86_64", target_arch = "wasm32"))]
    pub(crate) fn pair_words(&self, sizes: &[usize]) -> Vec<i32> {
        let pair = |low: i8, high: i8| i32::from(low) & 0xffff | i32::from(high) << 16;
        let dots = self.dot_words(sizes);
        dots.iter()
            .flat_map(|word| {
                let [a, b, c, d] = word.to_le_bytes().map(|w| w as i8);
                [pair(a, c), pair(b, d)]
            })
            .collect()
    }
}

/// An instruction set's kernels.
#[derive(Clone, Copy)]
#[allow(clippy::type_complexity)]
pub(crate) struct Kernels {
    pub(crate) pack: fn(&Taps<'_>) -> Vec<i32>,
    /// Layer, three rows, the skip's row, the row of features to write.
    pub(crate) hidden_row: fn(&Packed, Window<'_, u8>, Option<&[u8]>, &mut [u8], Geometry),
    /// Layer, three rows, the output planes' rows, the first pixel to yield.
    pub(crate) last_row: fn(&Packed, Window<'_, u8>, [&mut [f32]; OUTPUTS], usize, Geometry),
    /// What these kernels take off the activations as they load them; the biases give it back.
    pub(crate) offset: i32,
    /// [`quantise_row`].
    pub(crate) quantise_row: fn(SourceRow<'_>, Rounding, &mut [u8], Geometry),
    /// [`rescale_row`].
    pub(crate) rescale_row: fn(&mut [u8], f32, u8, Geometry),
}

/// How the network's input becomes u8: `channels` of it, rounded to `to`, after a rounding to `before` if there is one.
#[derive(Clone, Copy)]
pub(crate) struct Rounding {
    channels: usize,
    before: Option<Quantiser>,
    to: Quantiser,
}

fn kernels(isa: Isa) -> Option<Kernels> {
    match isa {
        Isa::Portable => Some(crate::portable::INT8),
        #[cfg(target_arch = "x86_64")]
        Isa::Amx => crate::x86::amx::kernels(),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512Vnni => crate::x86::avx512_vnni::kernels(),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => crate::x86::avx2::int8_kernels(),
        #[cfg(target_arch = "aarch64")]
        Isa::NeonDotprod => crate::arm::neon_dotprod::kernels(),
        #[cfg(target_arch = "aarch64")]
        Isa::NeonI8mm => crate::arm::neon_i8mm::kernels(),
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        Isa::Simd128 => Some(crate::wasm::simd128::INT8),
        _ => None,
    }
}

/// A quantised chain packed for one instruction set. Immutable; threads share it.
pub struct Int8Chain {
    isa: Isa,
    kernels: Kernels,
    inputs: usize,
    input: Quantiser,
    concatenated: Quantiser,
    /// Whether the concatenated input is rounded as `input` before.
    rounded_twice: bool,
    /// Pixels along each side of a place.
    side: usize,
    /// All but the last.
    layers: Vec<Packed>,
    /// The last one, of each pixel of a place.
    last: Vec<Packed>,
    rescale: Option<f32>,
    zero_points: Vec<u8>,
}

impl Int8Chain {
    /// Packs a chain. `input` rounds the network's input for the first layer; for the last it is rounded by
    /// `concatenated`, after a first rounding by `input` if `rounded_twice`.
    ///
    /// # Errors
    /// What the kernels cannot run: shapes that are no chain, filters not in eights, factors out of range, or an
    /// instruction set that this processor lacks.
    pub fn new(
        layers: &[Int8Layer],
        input: Quantiser,
        concatenated: Quantiser,
        rounded_twice: bool,
        isa: Isa,
    ) -> Result<Int8Chain, String> {
        let kernels = kernels(isa)
            .filter(|_| Isa::int8().contains(&isa))
            .ok_or_else(|| format!("this processor has no int8 kernels '{isa}'"))?;
        let [first, .., last] = layers else {
            return Err("a chain has two layers at least".into());
        };
        let (inputs, filters) = (first.inputs, first.outputs);
        let side = crate::check_shapes(layers.iter().map(|l| (l.inputs, l.outputs)))?;
        let (mut hidden, mut of_pixels) = (Vec::new(), Vec::new());
        for (i, layer) in layers.iter().enumerate() {
            let is_last = i + 1 == layers.len();
            check_numbers(layer, is_last).map_err(|why| format!("layer {i}: {why}"))?;
            let wants_skip = !is_last && wavefront::has_skip(i + 1);
            if wants_skip != (layer.requantise.skip.is_some() && !is_last) {
                return Err(format!(
                    "layer {i}: a skip is summed for odd layers from 3 on, and only there"
                ));
            }
            if layer.requantise.rescale.is_some() && i + 2 != layers.len() {
                return Err(format!(
                    "layer {i}: only what the concatenation reads is rounded a second time"
                ));
            }
            let pack = |layer: &Int8Layer, features| {
                let next_zero = layers.get(i + 1).map_or(0, |next| next.zero_point);
                Packed::new(&Taps { layer, features }, next_zero, &kernels)
            };
            if is_last {
                of_pixels = (0..side * side).map(|k| pack(&layer.of_pixel(k), filters)).collect();
            } else {
                hidden.push(pack(layer, layer.inputs));
            }
        }
        let zero_points: Vec<u8> = layers.iter().map(|l| l.zero_point).collect();
        let settled = first.zero_point == input.zero_point && last.zero_point == concatenated.zero_point;
        if !settled || zero_points[1..layers.len() - 1].iter().any(|&z| z != 0) {
            return Err("hidden inputs have zero point 0, the first and last those of their quantisers".into());
        }
        for scale in [input.scale, concatenated.scale] {
            if !scale.is_normal() || scale < 0.0 {
                return Err(format!("scale {scale}; finite and positive is right"));
            }
        }
        let rescale = layers[layers.len() - 2].requantise.rescale;
        Ok(Int8Chain {
            isa,
            kernels,
            inputs,
            input,
            concatenated,
            rounded_twice,
            side,
            layers: hidden,
            last: of_pixels,
            rescale,
            zero_points,
        })
    }

    /// The kernels in use.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// How many layers.
    pub fn layers(&self) -> usize {
        self.layers.len() + 1
    }

    /// The tiling that suits a frame size and the current rayon pool.
    pub fn tiling(&self, height: usize, width: usize) -> Tiling {
        wavefront::tiling_for(self, height, width)
    }

    /// Runs the chain on the current rayon pool: `input` planar `(C, H, W)`, `output` `(6, H, W)`.
    ///
    /// # Panics
    /// If a length does not fit the size.
    pub fn run(&self, input: &[f32], output: &mut [f32], size: (usize, usize), tiling: Tiling, scratch: &Scratch<u8>) {
        let area = size.0 * size.1;
        let inputs = self.inputs / (self.side * self.side);
        assert_eq!(input.len(), inputs * area, "planes of the input");
        assert_eq!(output.len(), OUTPUTS * area, "planes of the output");
        let mut planes = output.chunks_exact_mut(area.max(1));
        let planes = std::array::from_fn(|_| planes.next().unwrap_or_default());
        let rows = wavefront::Planar { input, size };
        self.run_rows(&rows, planes, size, tiling, scratch);
    }

    /// The same with input and output that need not be planes in memory: `rows` are read, and written to `planes`,
    /// each (H, W).
    ///
    /// # Panics
    /// If a length does not fit the size, and where `rows` do.
    pub fn run_rows<R: Rows<PLANES>, const PLANES: usize>(
        &self,
        rows: &R,
        planes: [&mut [R::Value]; PLANES],
        size: (usize, usize),
        tiling: Tiling,
        scratch: &Scratch<u8>,
    ) {
        wavefront::run(self, rows, planes, size, tiling, scratch);
    }
}

/// Sums must fit 32 bits, and their products with the factors stay where conversions are exact.
fn check_numbers(layer: &Int8Layer, is_last: bool) -> Result<(), String> {
    let (outputs, per_filter) = (layer.outputs, layer.inputs * 9);
    if layer.kernel.len() != outputs * per_filter || layer.bias.len() != outputs || layer.multiplier.len() != outputs {
        return Err(format!(
            "weights, biases or multipliers do not fit {outputs} filters of {per_filter} weights"
        ));
    }
    for (o, (&bias, &multiplier)) in layer.bias.iter().zip(&layer.multiplier).enumerate() {
        let weights = &layer.kernel[o * per_filter..][..per_filter];
        let reach: i64 = weights.iter().map(|&w| 255 * i64::from(w).abs()).sum::<i64>() + 2 * i64::from(bias).abs();
        if 2 * reach > i64::from(i32::MAX) {
            return Err(format!("sums of filter {o} do not fit 32 bits"));
        }
        let normal = multiplier.is_normal() && multiplier > 0.0;
        if !normal || (!is_last && 2.0 * reach as f64 * f64::from(multiplier) > LARGEST) {
            return Err(format!(
                "filter {o} has the scale {multiplier}, out of any range that makes sense"
            ));
        }
    }
    let skip = layer
        .requantise
        .skip
        .iter()
        .flat_map(|s| [s.relu.unwrap_or(1.0), s.skip]);
    match skip
        .chain(layer.requantise.rescale)
        .find(|f| !f.is_normal() || *f < 0.0 || f64::from(*f) * 1e3 > LARGEST)
    {
        Some(bad) => Err(format!("a rounding scales by {bad}, out of any range that makes sense")),
        None => Ok(()),
    }
}

impl Chain for Int8Chain {
    type Element = u8;
    const GROUP: usize = GROUP;
    // A byte is worked on as long as four of f32, so rings may outgrow the cache: narrower strips only cost their
    // edges, 4 % at 30 layers.
    const CACHE: usize = 1 << 21;

    fn layers(&self) -> usize {
        self.layers.len() + 1
    }

    fn side(&self) -> usize {
        self.side
    }

    fn inputs(&self) -> usize {
        self.inputs
    }

    fn groups(&self, i: usize) -> usize {
        self.layers.get(i).unwrap_or(&self.last[0]).groups
    }

    fn zero(&self, i: usize) -> u8 {
        self.zero_points[i]
    }

    fn input_row(&self, source: SourceRow<'_>, out: &mut [u8], geometry: Geometry) {
        let rounding = Rounding {
            channels: self.inputs,
            before: None,
            to: self.input,
        };
        (self.kernels.quantise_row)(source, rounding, out, geometry);
    }

    fn concatenated_row(&self, source: SourceRow<'_>, out: &mut [u8], geometry: Geometry) {
        let features = self.layers[0].outputs / GROUP * geometry.stride();
        let (features, out) = out.split_at_mut(features);
        if let Some(factor) = self.rescale {
            (self.kernels.rescale_row)(features, factor, self.concatenated.zero_point, geometry);
        }
        let before = self.rounded_twice.then_some(self.input);
        let rounding = Rounding {
            channels: self.inputs,
            before,
            to: self.concatenated,
        };
        (self.kernels.quantise_row)(source, rounding, out, geometry);
    }

    fn hidden_row(&self, i: usize, window: Window<'_, u8>, skip: Option<&[u8]>, out: &mut [u8], geometry: Geometry) {
        (self.kernels.hidden_row)(&self.layers[i], window, skip, out, geometry);
    }

    fn last_row(
        &self,
        pixel: usize,
        window: Window<'_, u8>,
        out: [&mut [f32]; OUTPUTS],
        from: usize,
        geometry: Geometry,
    ) {
        (self.kernels.last_row)(&self.last[pixel], window, out, from, geometry);
    }
}

/// `x` rounded half to even as an integer in the low bits: adding 1.5·2²³ leaves no room for a fraction. For |x| < 2²².
#[inline(always)]
fn rint_bits(x: f32) -> u32 {
    (x + 12_582_912.0).to_bits()
}

impl Quantiser {
    #[inline(always)]
    fn quantise(self, real: f32) -> u8 {
        let zero = f32::from(self.zero_point);
        let steps = (real / self.scale).max(-zero).min(255.0 - zero);
        rint_bits(steps).wrapping_add(u32::from(self.zero_point)) as u8
    }

    #[inline(always)]
    fn dequantise(self, value: u8) -> f32 {
        (f32::from(value) - f32::from(self.zero_point)) * self.scale
    }
}

/// Writes planes of a source row as groups of four; channels that pad a group get 0, and have weight 0. Inlined into
/// each instruction set's own copy.
#[inline(always)]
pub(crate) fn quantise_row(source: SourceRow<'_>, rounding: Rounding, out: &mut [u8], geometry: Geometry) {
    let Rounding { channels, before, to } = rounding;
    match before {
        Some(before) => quantise_by(source, channels, out, geometry, |real| {
            to.quantise(before.dequantise(before.quantise(real)))
        }),
        None => quantise_by(source, channels, out, geometry, |real| to.quantise(real)),
    }
}

#[inline(always)]
fn quantise_by(
    source: SourceRow<'_>,
    channels: usize,
    out: &mut [u8],
    geometry: Geometry,
    quantise: impl Fn(f32) -> u8 + Copy,
) {
    let width = geometry.width;
    for (g, out) in out.chunks_exact_mut(geometry.stride()).enumerate() {
        let pixels = out[geometry.start()..][..GROUP * width].as_chunks_mut::<GROUP>().0;
        if (g + 1) * GROUP <= channels {
            let [a, b, c, d]: [&[f32]; GROUP] = std::array::from_fn(|k| source.channel(g * GROUP + k, width));
            for ((((pixel, &a), &b), &c), &d) in pixels.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *pixel = [quantise(a), quantise(b), quantise(c), quantise(d)];
            }
        } else {
            for (x, pixel) in pixels.iter_mut().enumerate() {
                *pixel = std::array::from_fn(|k| {
                    let c = g * GROUP + k;
                    if c < channels {
                        quantise(source.channel(c, width)[x])
                    } else {
                        0
                    }
                });
            }
        }
    }
}

/// The second rounding of a row of features. Inlined into each instruction set's own copy.
#[inline(always)]
pub(crate) fn rescale_row(row: &mut [u8], factor: f32, zero_point: u8, geometry: Geometry) {
    for group in row.chunks_exact_mut(geometry.stride()) {
        for value in &mut group[geometry.start()..][..GROUP * geometry.width] {
            let rounded = rint_bits((f32::from(*value) * factor).min(255.0)) as u8;
            *value = rounded.saturating_add(zero_point);
        }
    }
}
