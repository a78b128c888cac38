//! The quantised chain: its bit-exact definition and the packing of its weights for the kernels.
//!
//! Activations are u8, weights s8, and sums exact in 32 bits. Each sum is followed by these f32 operations in this
//! order (`rint` rounds half to even, `sat` clamps to 0…255, each operation rounds separately, and nothing is fused):
//!
//! - `v = f32(sum + bias) · multiplier[filter]`;
//! - without a skip, `q = sat(rint(v))`, where saturation acts as the ReLU;
//! - with a skip of value `s`, `q = sat(rint(a + f32(s) · skip))`, where `a = max(v, 0)`, or, if the file rounds the
//!   ReLU before the sum, `a = rint(min(max(v, 0), 255)) · relu`;
//! - if the file rounds once more before the concatenation, `q = sat(rint(f32(q) · rescale))`;
//! - `sat(q + zero_point)`.
//!
//! The last layer returns `f32(sum + bias) · multiplier[filter]`.
//!
//! The channels of a row are in groups of four: `[channel/4][pixel][4]`. The concatenated network input starts a new
//! group.

use crate::Bounds;
use crate::Size;
use crate::rows::Rows;
use crate::wavefront::{self, Chain, Geometry, LastRows, Scratch, Slots, SlotsMut, SourceRow, Tiling};
use crate::winograd;
use crate::{Isa, OUTPUTS};

/// The channels of a group, which are adjacent in memory.
pub(crate) const GROUP: usize = 4;
/// The largest number of groups of a layer's input.
pub(crate) const MOST_GROUPS: usize = 256;
/// The bound on products of a sum and a multiplier, below which every conversion to an integer is exact.
const LARGEST: f64 = (1u32 << 30) as f64;

/// Converts real numbers to u8: `sat(rint(real / scale) + zero_point)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantiser {
    /// The size of one step.
    pub scale: f32,
    /// The value that represents 0.
    pub zero_point: u8,
}

/// The factors of the sum with a skip. See the module's arithmetic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkipSum {
    /// The step of the rounded ReLU in steps of the sum, or `None` if the ReLU is not rounded separately.
    pub relu: Option<f32>,
    /// The step of the skip in steps of the sum.
    pub skip: f32,
}

/// The conversion of a hidden layer's sums to the next layer's input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Requantise {
    /// The sum with a skip, if there is one.
    pub skip: Option<SkipSum>,
    /// The factor of the second rounding, if there is one.
    pub rescale: Option<f32>,
}

/// One layer.
#[derive(Debug, Clone, PartialEq)]
pub struct Int8Layer {
    /// The input channels, including the concatenated ones of the last layer.
    pub inputs: usize,
    /// The number of filters.
    pub outputs: usize,
    /// The value that represents 0 in the layer's input.
    pub zero_point: u8,
    /// `(outputs, inputs, 3, 3)`.
    pub kernel: Vec<i8>,
    /// One bias per filter, without the zero point's share.
    pub bias: Vec<i32>,
    /// One multiplier per filter.
    pub multiplier: Vec<f32>,
    /// The conversion after a hidden layer. Unused in the last layer.
    pub requantise: Requantise,
}

impl Int8Layer {
    /// Returns the part of a last layer that computes the outputs of one pixel of each place.
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

/// A layer in the layout of the kernels.
pub(crate) struct Packed {
    /// The number of groups of four input channels.
    pub(crate) groups: usize,
    pub(crate) outputs: usize,
    /// One bias per filter, including the shares of the zero point and of the kernels' offset, then zeros to a multiple
    /// of 32.
    pub(crate) bias: Vec<i32>,
    pub(crate) multiplier: Vec<f32>,
    pub(crate) skip: Option<SkipSum>,
    /// The saturating addend of a hidden layer's output, or 0 if a second rounding follows.
    pub(crate) zero_point: u8,
    /// The weights, in the order of the kernels' `pack`.
    pub(crate) weights: Vec<i32>,
}

impl Packed {
    /// Packs a layer for `kernels`. `next_zero` represents 0 in the input of the next layer.
    fn new(taps: &Taps<'_>, next_zero: u8, kernels: &Kernels) -> Packed {
        let layer = taps.layer;
        let (offset, weights) = match &kernels.layers {
            LayerKernels::Rows(rows) => (rows.offset, (rows.pack)(taps)),
            LayerKernels::Tiles(tiles) => (0, winograd::pack(taps, tiles.filters)),
        };
        let of_filter = |(w, b): (&[i8], &i32)| {
            let weights: i32 = w.iter().map(|&w| i32::from(w)).sum();
            b + (offset - i32::from(layer.zero_point)) * weights
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
            weights,
        }
    }
}

/// A layer's weights by filter, group of channels and tap, for packing. Channels that pad a group have weight 0.
pub(crate) struct Taps<'a> {
    layer: &'a Int8Layer,
    /// The number of channels before the concatenated ones.
    features: usize,
}

impl Taps<'_> {
    /// Returns four weights of `filter` (0 for padding filters) at row `ky` and column `kx`.
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

    /// Returns words of four weights in the order `[filters by `size`][ky][group][kx][filter]`, as the dot-product
    /// kernels read them.
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
}

/// The kernels of an instruction set.
#[derive(Clone, Copy)]
pub(crate) struct Kernels {
    pub(crate) layers: LayerKernels,
    /// [`quantise_row`], compiled for the instruction set.
    pub(crate) quantise_row: fn(SourceRow<'_>, Rounding, &mut [u8], Geometry),
    /// [`rescale_row`], compiled for the instruction set.
    pub(crate) rescale_row: fn(&mut [u8], f32, u8, Geometry),
}

/// The kernels that compute layers.
#[derive(Clone, Copy)]
pub(crate) enum LayerKernels {
    Rows(RowKernels),
    #[allow(dead_code, reason = "some processors have no kernels for tiles")]
    Tiles(winograd::Kernels),
}

/// The kernels that compute layers row by row.
#[derive(Clone, Copy)]
#[allow(clippy::type_complexity)]
pub(crate) struct RowKernels {
    pub(crate) pack: fn(&Taps<'_>) -> Vec<i32>,
    /// Computes a row of a hidden layer: layer, three rows, the skip's row, the row of features to write.
    pub(crate) hidden_row: fn(&Packed, Slots<'_, u8>, Option<&[u8]>, &mut [u8], Geometry),
    /// Computes a row of the last layer: layer, three rows, the output planes' rows, the first pixel to compute.
    pub(crate) last_row: fn(&Packed, Slots<'_, u8>, [&mut [f32]; OUTPUTS], usize, Geometry),
    /// The offset that these kernels subtract from the activations on loading. The biases compensate for it.
    pub(crate) offset: i32,
}

/// The conversion of `channels` input channels to u8, rounded to `to`, after a rounding to `before` if there is one.
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
        Isa::Neon => Some(crate::arm::winograd::INT8),
        #[cfg(target_arch = "aarch64")]
        Isa::NeonDotprod => crate::arm::neon_dotprod::kernels(),
        #[cfg(target_arch = "aarch64")]
        Isa::NeonI8mm => crate::arm::neon_i8mm::kernels(),
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        Isa::Simd128 => Some(crate::wasm::simd128::INT8),
        _ => None,
    }
}

/// A quantised chain packed for one instruction set. It is immutable and threads can share it.
pub struct Int8Chain {
    isa: Isa,
    kernels: Kernels,
    inputs: usize,
    input: Quantiser,
    concatenated: Quantiser,
    /// Whether the concatenated input is first rounded by `input`.
    rounded_twice: bool,
    /// The pixels along each side of a place.
    side: usize,
    /// All layers but the last.
    layers: Vec<Packed>,
    /// The last layer for each pixel of a place.
    last: Vec<Packed>,
    rescale: Option<f32>,
    zero_points: Vec<u8>,
}

impl Int8Chain {
    /// Packs a chain. `input` rounds the network's input for the first layer. For the last layer `concatenated` rounds
    /// it, after a first rounding by `input` if `rounded_twice`.
    ///
    /// # Errors
    /// Returns an error if the kernels cannot run the chain: the shapes form no chain, the filters are not in eights, a
    /// factor is out of range, or this processor lacks the instruction set.
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

    /// Returns the instruction set in use.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Returns the number of layers.
    pub fn layers(&self) -> usize {
        self.layers.len() + 1
    }

    /// Returns the tiling for a frame size and the current rayon pool.
    pub fn tiling(&self, size: Size) -> Tiling {
        wavefront::tiling_for(self, size)
    }

    /// Runs the chain on the current rayon pool. `input` is planar `(C, H, W)` and `output` is `(6, H, W)`.
    ///
    /// # Panics
    /// Panics if a length does not match the size.
    pub fn run(&self, input: &[f32], output: &mut [f32], size: Size, tiling: Tiling, scratch: &Scratch<u8>) {
        let area = size.height * size.width;
        let inputs = self.inputs / (self.side * self.side);
        assert_eq!(input.len(), inputs * area, "planes of the input");
        assert_eq!(output.len(), OUTPUTS * area, "planes of the output");
        let mut planes = output.chunks_exact_mut(area.max(1));
        let planes = std::array::from_fn(|_| planes.next().unwrap_or_default());
        let rows = wavefront::Planar { input, size };
        self.run_rows(&rows, planes, size, tiling, scratch);
    }

    /// Runs the chain with input and output that need not be planes in memory: reads the input from `rows` and writes
    /// the output through them to `planes`, each (H, W).
    ///
    /// # Panics
    /// Panics if a length does not match the size, or if `rows` panics.
    pub fn run_rows<R: Rows<PLANES>, const PLANES: usize>(
        &self,
        rows: &R,
        planes: [&mut [R::Value]; PLANES],
        size: Size,
        tiling: Tiling,
        scratch: &Scratch<u8>,
    ) {
        wavefront::run(self, rows, planes, size, tiling, scratch);
    }
}

/// Checks that sums fit 32 bits and that their products with the factors can be converted exactly.
fn check_numbers(layer: &Int8Layer, is_last: bool) -> Result<(), String> {
    let (outputs, per_filter) = (layer.outputs, layer.inputs * 9);
    // A last layer's input has two parts, each in whole groups.
    if layer.inputs > (MOST_GROUPS - 1) * GROUP {
        return Err(format!("{} input channels; kernels take at most 1020", layer.inputs));
    }
    if layer.kernel.len() != outputs * per_filter || layer.bias.len() != outputs || layer.multiplier.len() != outputs {
        return Err(format!(
            "weights, biases or multipliers do not fit {outputs} filters of {per_filter} weights"
        ));
    }
    for (o, (&bias, &multiplier)) in layer.bias.iter().zip(&layer.multiplier).enumerate() {
        let weights = &layer.kernel[o * per_filter..][..per_filter];
        let products: i64 = weights.iter().map(|&w| 255 * i64::from(w).abs()).sum();
        let reach = products + 2 * i64::from(bias).abs();
        if products >= winograd::LARGEST || 2 * reach > i64::from(i32::MAX) {
            return Err(format!("sums of filter {o} are too large"));
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

    fn layers(&self) -> usize {
        self.layers.len() + 1
    }

    fn step(&self) -> usize {
        match self.kernels.layers {
            LayerKernels::Rows(_) => 1,
            LayerKernels::Tiles(_) => winograd::SIDE,
        }
    }

    fn cache(&self) -> usize {
        match self.kernels.layers {
            // Each byte takes as long to process as four bytes of f32, so rings may exceed the cache: narrower strips
            // only add edges, 4 % at 30 layers.
            LayerKernels::Rows(_) => 1 << 21,
            // Four rows of a layer pass at once, and larger rings are as fast only while nothing else uses the cache.
            LayerKernels::Tiles(_) => 1 << 20,
        }
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

    fn hidden_rows(
        &self,
        i: usize,
        rows: Slots<'_, u8>,
        skip: Option<Slots<'_, u8>>,
        mut out: SlotsMut<'_, u8>,
        geometry: Geometry,
    ) {
        let layer = &self.layers[i];
        match &self.kernels.layers {
            LayerKernels::Rows(kernels) => {
                let skip = skip.map(|skip| skip.rows::<1>()[0]);
                (kernels.hidden_row)(layer, rows, skip, out.row_mut(0), geometry);
            }
            LayerKernels::Tiles(kernels) => {
                (kernels.hidden_rows)(layer, &rows.rows(), skip.map(|skip| skip.rows()), out, geometry);
            }
        }
    }

    fn last_rows(&self, pixel: usize, rows: Slots<'_, u8>, mut out: LastRows<'_>, from: usize, geometry: Geometry) {
        let layer = &self.last[pixel];
        match &self.kernels.layers {
            LayerKernels::Rows(kernels) => (kernels.last_row)(layer, rows, out.planes(0), from, geometry),
            LayerKernels::Tiles(kernels) => (kernels.last_rows)(layer, &rows.rows(), out, from, geometry),
        }
    }
}

/// Returns `x` rounded half to even, as an integer in the low bits: adding 1.5·2²³ leaves no fraction bits. For |x| <
/// 2²².
#[inline(always)]
fn rint_bits(x: f32) -> u32 {
    (x + 12_582_912.0).to_bits()
}

impl Quantiser {
    #[inline(always)]
    fn quantise(self, real: f32) -> u8 {
        let zero = f32::from(self.zero_point);
        let steps = (real / self.scale).at_least(-zero).at_most(255.0 - zero);
        rint_bits(steps).wrapping_add(u32::from(self.zero_point)) as u8
    }

    #[inline(always)]
    fn dequantise(self, value: u8) -> f32 {
        (f32::from(value) - f32::from(self.zero_point)) * self.scale
    }
}

/// Writes planes of a source row as groups of four. Channels that pad a group get 0 and have weight 0. Inlined into the
/// copy of each instruction set.
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

/// Applies the second rounding to a row of features. Inlined into the copy of each instruction set.
#[inline(always)]
pub(crate) fn rescale_row(row: &mut [u8], factor: f32, zero_point: u8, geometry: Geometry) {
    for group in row.chunks_exact_mut(geometry.stride()) {
        for value in &mut group[geometry.start()..][..GROUP * geometry.width] {
            let rounded = rint_bits((f32::from(*value) * factor).at_most(255.0)) as u8;
            *value = rounded.saturating_add(zero_point);
        }
    }
}
