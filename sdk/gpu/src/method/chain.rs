//! Runs the convolution chain on the GPU with one dispatch per layer, or one per two layers and the skip around them if
//! that is faster on the device. Its counterparts are [`phasefront_core::method::network::reference`] and the int8
//! module of the kernels.

use crate::device::{Constants, Device, Dispatch};
use crate::input::{ChainInput, Form, Packer, Source};
use crate::numbers::{Float, GROUP, Numbers};
use crate::{GpuError, Result};
use phasefront_core::Bounds;
use phasefront_core::Size;
use phasefront_core::method::network::chain::{Chain, Layer, Weights};
use phasefront_core::method::network::{Head, InputKind, Network};
use phasefront_core::runtime::clock::Instant;
use std::sync::Arc;
use std::time::Duration;

/// Returns the chain of `network` and the kind of its output.
///
/// # Errors
/// Returns [`GpuError::Refused`] for a network of another form.
pub(crate) fn chain_of(network: &Network) -> Result<(&Chain, Head)> {
    (network.chain().zip(network.head()))
        .ok_or_else(|| GpuError::Refused("a network of another form than a chain runs on the CPU only".into()))
}

/// The number of filters that a thread computes at a time.
const BLOCK: usize = 8;
/// The columns and rows of a workgroup of `layer` and `last`, in pixels.
const TILE: (usize, usize) = (32, 8);
/// The side, in pixels, of the first layer's tile in a workgroup of `pair`. The second layer's is [`PAIR_INNER`].
const PAIR_TILE: usize = 16;
const PAIR_INNER: usize = 14;
/// The bound up to which sums are exact in f32, in which they are multiplied.
const LARGEST_SUM: i64 = 1 << 24;

/// The number of layers per dispatch. The result is bit-identical.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fusion {
    /// The faster of the two, measured when the plan is made. One layer on software drivers and in browsers.
    #[default]
    Measured,
    /// One layer.
    Layers,
    /// Two layers and the skip around them, with the intermediate values in workgroup memory.
    Pairs,
}

/// The options for computing a chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ChainOptions {
    /// The number format of an f32 chain. An int8 chain has its own format.
    pub float: Float,
    /// The number of layers per dispatch.
    pub fusion: Fusion,
}

/// The output of the last layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// The six planes.
    Planes,
    /// The complex field that the planes represent, and its sum in each workgroup.
    Field(Head, InputKind),
}

/// A chain on the GPU for one frame size.
pub(crate) struct ChainPlan {
    steps: Vec<Dispatch>,
    pub(crate) fusion: Fusion,
    /// (6, H, W) f32, the output of [`End::Planes`].
    pub(crate) planes: wgpu::Buffer,
    /// (3, H, W) complex f32, the output of [`End::Field`].
    pub(crate) field: wgpu::Buffer,
    /// The sums of the field: three complex f32 for each of `parts` workgroups.
    pub(crate) partial: wgpu::Buffer,
    pub(crate) parts: usize,
    /// The bytes that the dispatches read and write, counting each value once.
    pub(crate) bytes: usize,
}

/// The state that all steps of a chain share while they are planned.
struct Maker<'a> {
    device: &'a Device,
    numbers: Numbers,
    /// The size of the layers in pixels.
    size: Size,
    frame: Constants,
}

/// A layer's weights as bytes, in the order in which programs read them.
struct Packed {
    bytes: Vec<u8>,
    groups: usize,
    beside: usize,
    outputs: usize,
    /// The tables of an int8 layer.
    requantise: Option<Tables>,
    /// The word of four activations that represent 0.
    zero: u32,
}

/// The tables that an int8 layer applies to its sums. See chain_int8.wgsl.
struct Tables {
    skip: Vec<f32>,
    relu: Option<Vec<f32>>,
    next: Option<Vec<u8>>,
}

impl ChainPlan {
    /// Plans `chain` for frames of `size` from `input`, with the given or the measured fusion.
    pub(crate) fn new(
        device: &Device,
        chain: &Chain,
        numbers: Numbers,
        size: Size,
        input: &ChainInput,
        end: End,
        fusion: Fusion,
    ) -> Result<Self> {
        let packed = match numbers {
            Numbers::Int8 => pack_int8(chain)?,
            _ => (chain.layers.iter().enumerate())
                .map(|(i, layer)| pack_float(chain, i, layer, numbers))
                .collect::<Result<_>>()?,
        };
        let pixels = size.height * size.width;
        let (width, height) = (size.width.div_ceil(chain.side()), size.height.div_ceil(chain.side()));
        let tiles = (width.div_ceil(TILE.0), height.div_ceil(TILE.1));
        let constants = [width, height, width * height, tiles.0, size.width, size.height, 0, 0].map(|n| n as u32);
        let maker = Maker {
            device,
            numbers,
            size: Size { width, height },
            frame: device.constants("frame", bytemuck::cast_slice(&constants))?,
        };
        let groups = chain.filters().div_ceil(GROUP);
        let bytes = groups * width * height * numbers.value_bytes();
        let features = [
            device.buffer("a layer's output", bytes)?,
            device.buffer("a layer's output", bytes)?,
        ];
        let (planes, field) = match end {
            End::Planes => (24 * pixels, 0),
            End::Field(..) => (0, 24 * pixels),
        };
        let mut plan = ChainPlan {
            steps: Vec::new(),
            fusion: Fusion::Layers,
            planes: device.buffer("the network's output", planes)?,
            field: device.buffer("the field", field)?,
            partial: device.buffer("sums", 24 * tiles.0 * tiles.1)?,
            parts: tiles.0 * tiles.1,
            bytes: 0,
        };
        let all = Layers {
            chain,
            packed: &packed,
            input,
            features: &features,
            plan: &plan,
            end,
        };
        let make = |fusion| maker.steps(&all, fusion);
        let between = groups * PAIR_TILE * PAIR_TILE * numbers.value_bytes();
        let fits = between <= device.limits().max_compute_workgroup_storage_size as usize;
        let pairs = packed.len() > 3 && fits;
        (plan.steps, plan.fusion) = match fusion {
            Fusion::Pairs if pairs => (make(Fusion::Pairs)?, Fusion::Pairs),
            Fusion::Measured if pairs && device.measures() => {
                let (layers, fused) = (make(Fusion::Layers)?, make(Fusion::Pairs)?);
                if time(device, &fused)? < time(device, &layers)? {
                    (fused, Fusion::Pairs)
                } else {
                    (layers, Fusion::Layers)
                }
            }
            _ => (make(Fusion::Layers)?, Fusion::Layers),
        };
        let input = chain.inputs.div_ceil(GROUP) * pixels * numbers.value_bytes();
        // The features are written and read once by each hidden layer, and read by the last layer. Skips are read once
        // more if layers are not fused. The input is read twice and the output written once.
        let hidden = plan.dispatches() - 1;
        let skips = (1..packed.len()).filter(|&i| Chain::has_skip(i)).count();
        let again = if plan.fusion == Fusion::Pairs { 0 } else { skips };
        plan.bytes = (2 * hidden + again) * bytes + 2 * input + 24 * pixels;
        Ok(plan)
    }

    pub(crate) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.steps.iter().for_each(|step| step.run(pass));
    }

    /// Returns the number of dispatches per frame.
    pub(crate) fn dispatches(&self) -> usize {
        self.steps.len()
    }
}

/// Returns the shortest time of three runs after a warm-up run.
pub(crate) fn time(device: &Device, steps: &[Dispatch]) -> Result<Duration> {
    let run = || {
        let mut encoder = device.inner.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        steps.iter().for_each(|step| step.run(&mut pass));
        drop(pass);
        let start = Instant::now();
        device.wait(&device.queue.submit([encoder.finish()]))?;
        Ok::<_, GpuError>(start.elapsed())
    };
    run()?;
    let mut best = Duration::MAX;
    for _ in 0..3 {
        best = best.min(run()?);
    }
    Ok(best)
}

/// A chain's layers and their buffers.
struct Layers<'a> {
    chain: &'a Chain,
    packed: &'a [Packed],
    input: &'a ChainInput,
    /// The buffers that hidden layers write alternately.
    features: &'a [wgpu::Buffer; 2],
    /// The plan, with the buffers that the last layer writes.
    plan: &'a ChainPlan,
    end: End,
}

impl Maker<'_> {
    fn steps(&self, all: &Layers<'_>, fusion: Fusion) -> Result<Vec<Dispatch>> {
        let Layers {
            packed,
            input,
            features,
            ..
        } = *all;
        let last = packed.len() - 1;
        let mut steps = vec![self.layer(&packed[0], &input.first, &features[0], false)?];
        // The index of the buffer that holds the current layer's input.
        let mut at = 0;
        let mut i = 1;
        while i < last {
            let (from, to) = (&features[at], &features[1 - at]);
            let pair = fusion == Fusion::Pairs && i + 1 < last && Chain::has_skip(i + 2);
            if pair {
                steps.push(self.pair(&packed[i], &packed[i + 1], from, to)?);
            } else {
                steps.push(self.layer(&packed[i], from, to, Chain::has_skip(i + 1))?);
            }
            at = 1 - at;
            i += if pair { 2 } else { 1 };
        }
        steps.push(self.last(&packed[last], &features[at], all)?);
        Ok(steps)
    }

    fn layer(&self, layer: &Packed, from: &wgpu::Buffer, to: &wgpu::Buffer, skip: bool) -> Result<Dispatch> {
        let weights = self.device.constants("weights", &layer.bytes)?;
        let tables = self.tables(layer)?;
        let source = self.source(layer, &weights, skip, "") + include_str!("chain_layer.wgsl");
        let program = self.device.program("a layer", source, "layer");
        let mut arguments = self.arguments(&weights, from, from);
        arguments.push((4, to.as_entire_binding()));
        arguments.extend(tables.iter().map(|t| (8, t.buffer.as_entire_binding())));
        program.on(self.device, &arguments, self.grid())
    }

    fn pair(&self, first: &Packed, second: &Packed, from: &wgpu::Buffer, to: &wgpu::Buffer) -> Result<Dispatch> {
        let both = [&first.bytes[..], &second.bytes].concat();
        let weights = self.device.constants("weights", &both)?;
        let tables = self.tables(second)?;
        let each = first.bytes.len() / self.eight_bytes();
        let more = format!("const EACH: u32 = {each}u;\n");
        let source = self.source(second, &weights, true, &more) + include_str!("chain_pair.wgsl");
        let program = self.device.program("two layers", source, "pair");
        let mut arguments = self.arguments(&weights, from, from);
        arguments.push((4, to.as_entire_binding()));
        arguments.extend(tables.iter().map(|t| (8, t.buffer.as_entire_binding())));
        let Size { width, height } = self.size;
        let grid = [width.div_ceil(PAIR_INNER), height.div_ceil(PAIR_INNER), 1];
        program.on(self.device, &arguments, grid)
    }

    fn last(&self, layer: &Packed, from: &wgpu::Buffer, all: &Layers<'_>) -> Result<Dispatch> {
        let &Layers { input, plan, .. } = all;
        let weights = self.device.constants("weights", &layer.bytes)?;
        let head = match all.end {
            End::Planes => 0,
            End::Field(Head::AmplitudePhase, _) => 1,
            End::Field(Head::RealImaginary, InputKind::Field | InputKind::BlurredField) => 3,
            End::Field(Head::RealImaginary, InputKind::Seeded) => 4,
            End::Field(Head::RealImaginary, InputKind::SplitBlurredField) => 5,
            End::Field(Head::RealImaginary, _) => 2,
        };
        let more = format!(
            "const HEAD: u32 = {head}u;\nconst SIDE: i32 = {};\nconst TANH: bool = {};\nconst REMAINDER_GAIN: f32 = {:?};\n",
            all.chain.side(),
            all.chain.tanh,
            InputKind::REMAINDER_GAIN
        );
        let source = self.source(layer, &weights, false, &more)
            + include_str!("../direction.wgsl")
            + include_str!("chain_last.wgsl");
        let program = self.device.program("the last layer", source, "last");
        let mut arguments = self.arguments(&weights, from, &input.last);
        arguments.push((5, plan.planes.as_entire_binding()));
        arguments.push((6, plan.field.as_entire_binding()));
        arguments.push((7, plan.partial.as_entire_binding()));
        if self.numbers == Numbers::Int8 {
            arguments.push((9, input.image.as_entire_binding()));
        }
        program.on(self.device, &arguments, self.grid())
    }

    fn grid(&self) -> [usize; 3] {
        [self.size.width.div_ceil(TILE.0), self.size.height.div_ceil(TILE.1), 1]
    }

    fn arguments<'b>(
        &'b self,
        weights: &'b Constants,
        features: &'b wgpu::Buffer,
        beside: &'b wgpu::Buffer,
    ) -> Vec<(u32, wgpu::BindingResource<'b>)> {
        vec![
            (0, self.frame.buffer.as_entire_binding()),
            (1, weights.buffer.as_entire_binding()),
            (2, features.as_entire_binding()),
            (3, beside.as_entire_binding()),
        ]
    }

    /// Returns the bytes of an `Eight`.
    fn eight_bytes(&self) -> usize {
        match self.numbers {
            Numbers::F16 => 16,
            _ => 32,
        }
    }

    /// Returns the program's text up to its entry point.
    fn source(&self, layer: &Packed, weights: &Constants, skip: bool, more: &str) -> String {
        let real = match self.numbers {
            Numbers::F16 => "enable f16;\nalias Real4 = vec4<f16>;\n",
            Numbers::F32 => "alias Real4 = vec4<f32>;\n",
            Numbers::Int8 => "alias Real4 = vec4<u32>;\n",
        };
        let tables = layer.requantise.as_ref();
        let count = weights.buffer.size() as usize / self.eight_bytes();
        let header = format!(
            "{real}struct Eight {{ low: Real4, high: Real4 }}
            @group(0) @binding(1) var<{space}> weights: array<Eight, {count}>;
            const HALF: bool = {half};
            const SKIP: bool = {skip};
            const ROUNDED_RELU: bool = {rounded};
            const NEXT: bool = {next};
            const ZERO: u32 = {zero}u;
            const GROUPS: u32 = {groups}u;
            const BESIDE: u32 = {beside}u;
            const BLOCKS: u32 = {blocks}u;
            const GROUPS_OUT: u32 = {out}u;
            {more}",
            space = weights.space(),
            half = self.numbers == Numbers::F16,
            rounded = tables.is_some_and(|t| t.relu.is_some()),
            next = tables.is_some_and(|t| t.next.is_some()),
            zero = layer.zero,
            groups = layer.groups,
            beside = layer.beside,
            blocks = layer.outputs.div_ceil(BLOCK),
            out = layer.outputs.div_ceil(GROUP),
        );
        let numbers = match self.numbers {
            Numbers::Int8 => include_str!("chain_int8.wgsl"),
            _ => include_str!("chain_float.wgsl"),
        };
        header + numbers + include_str!("chain.wgsl")
    }

    /// Creates the tables of an int8 layer in the order of chain_int8.wgsl.
    fn tables(&self, layer: &Packed) -> Result<Option<Constants>> {
        let Some(tables) = &layer.requantise else {
            return Ok(None);
        };
        let relu = tables.relu.clone().unwrap_or(vec![0.0; 256]);
        let next = tables.next.as_ref();
        let next: Vec<u32> = (0..256)
            .map(|q| next.map_or(q as u32, |next| u32::from(next[q])))
            .collect();
        let bytes = [
            bytemuck::cast_slice(&tables.skip),
            bytemuck::cast_slice(&relu),
            bytemuck::cast_slice::<u32, u8>(&next),
        ]
        .concat();
        self.device.table("roundings", &bytes).map(Some)
    }
}

/// Returns a layer's feature channels, their groups, and the groups concatenated with them.
fn groups(chain: &Chain, i: usize, layer: &Layer) -> (usize, usize, usize) {
    let last = i + 1 == chain.layers.len();
    let beside = if last { chain.layers[0].inputs } else { 0 };
    let features = layer.inputs - beside;
    (features, features.div_ceil(GROUP), beside.div_ceil(GROUP))
}

/// Returns the values of a layer's outputs. In the last layer of a halved chain, each pixel of a square gets its own
/// block.
fn by_pixel<T: Copy + Default>(chain: &Chain, i: usize, values: &[T]) -> Vec<T> {
    if !chain.halved || i + 1 < chain.layers.len() {
        return values.to_vec();
    }
    let of_pixel = values.len() / 4;
    let padding = of_pixel / chain.outputs() * (BLOCK - chain.outputs());
    let blocks = values.chunks_exact(of_pixel);
    blocks
        .flat_map(|block| [block, &vec![T::default(); padding]].concat())
        .collect()
}

/// Returns the channel of a layer's input at position `k` of a group, if there is one.
fn channel(features: usize, groups: usize, inputs: usize, group: usize, k: usize) -> Option<usize> {
    match group.checked_sub(groups) {
        None => Some(group * GROUP + k).filter(|&c| c < features),
        Some(after) => Some(features + after * GROUP + k).filter(|&c| c < inputs),
    }
}

fn pack_float(chain: &Chain, i: usize, layer: &Layer, numbers: Numbers) -> Result<Packed> {
    let Weights::F32 { kernel, bias } = &layer.weights else {
        return Err(
            phasefront_core::runtime::error::Error::Network(format!("layer {i} is int8 in an f32 chain")).into(),
        );
    };
    let (features, groups, beside) = groups(chain, i, layer);
    let (kernel, bias) = (by_pixel(chain, i, kernel), by_pixel(chain, i, bias));
    let outputs = bias.len();
    let blocks = outputs.div_ceil(BLOCK);
    let mut values = bias;
    values.resize(blocks * BLOCK, 0.0);
    for block in 0..blocks {
        for kx in 0..3 {
            for group in 0..groups + beside {
                for ky in 0..3 {
                    for k in 0..GROUP {
                        let c = channel(features, groups, layer.inputs, group, k);
                        values.extend((block * BLOCK..(block + 1) * BLOCK).map(|o| match c {
                            Some(c) if o < outputs => kernel[((o * layer.inputs + c) * 3 + ky) * 3 + kx],
                            _ => 0.0,
                        }));
                    }
                }
            }
        }
    }
    let bytes = match numbers {
        Numbers::F16 => {
            let halves: Vec<u16> = values.iter().map(|&v| half::f16::from_f32(v).to_bits()).collect();
            bytemuck::cast_slice(&halves).to_vec()
        }
        _ => bytemuck::cast_slice(&values).to_vec(),
    };
    Ok(Packed {
        bytes,
        groups,
        beside,
        outputs,
        requantise: None,
        zero: 0,
    })
}

fn pack_int8(chain: &Chain) -> Result<Vec<Packed>> {
    let whole = phasefront_core::method::network::int8_layers(chain)
        .map_err(phasefront_core::runtime::error::Error::Network)?;
    let last = whole.layers.len() - 1;
    let mut all = Vec::new();
    for (i, layer) in whole.layers.iter().enumerate() {
        let (features, groups, beside) = groups(chain, i, &chain.layers[i]);
        let per_filter = layer.inputs * 9;
        let (kernel, biases) = (by_pixel(chain, i, &layer.kernel), by_pixel(chain, i, &layer.bias));
        let outputs = biases.len();
        let blocks = outputs.div_ceil(BLOCK);
        let mut bias = Vec::new();
        for (o, weights) in kernel.chunks_exact(per_filter).enumerate() {
            let total: i64 = weights.iter().map(|&w| i64::from(w)).sum();
            let reach: i64 = weights.iter().map(|&w| 255 * i64::from(w).abs()).sum();
            let plain = i64::from(biases[o]) - i64::from(layer.zero_point) * total;
            if plain.abs() + reach > LARGEST_SUM {
                return Err(GpuError::Refused(format!(
                    "sums of layer {i} exceed 24 bits, which f32 holds; the CPU is right"
                )));
            }
            // Activations are stored minus 128.
            bias.push((plain + 128 * total) as i32);
        }
        let mut words: Vec<u32> = bias.iter().map(|&b| b as u32).collect();
        words.resize(blocks * BLOCK, 0);
        words.extend(by_pixel(chain, i, &layer.multiplier).iter().map(|m| m.to_bits()));
        words.resize(2 * blocks * BLOCK, 0);
        for block in 0..blocks {
            for kx in 0..3 {
                for group in 0..groups + beside {
                    for ky in 0..3 {
                        words.extend((block * BLOCK..(block + 1) * BLOCK).map(|o| {
                            u32::from_le_bytes(std::array::from_fn(|k| {
                                match channel(features, groups, layer.inputs, group, k) {
                                    Some(c) if o < outputs => kernel[((o * layer.inputs + c) * 3 + ky) * 3 + kx] as u8,
                                    _ => 0,
                                }
                            }))
                        }));
                    }
                }
            }
        }
        let after = |factor: f32| -> Vec<f32> { (0..256).map(|v| v as f32 * factor).collect() };
        let skip = layer.requantise.skip;
        // The features of the last layer's input may be rounded again and have its zero point.
        let next = (i + 1 == last).then(|| {
            let zero = whole.layers[last].zero_point;
            let rounded = |q: u8| match layer.requantise.rescale {
                Some(factor) => (f32::from(q) * factor).at_most(255.0).round_ties_even() as u8,
                None => q,
            };
            (0..=255).map(|q| rounded(q).saturating_add(zero)).collect()
        });
        all.push(Packed {
            bytes: bytemuck::cast_slice(&words).to_vec(),
            groups,
            beside,
            outputs,
            requantise: Some(Tables {
                skip: after(skip.map_or(0.0, |s| s.skip)),
                relu: skip.and_then(|s| s.relu).map(after),
                next,
            }),
            zero: u32::from_le_bytes([layer.zero_point ^ 0x80; 4]),
        });
    }
    Ok(all)
}

/// A network on the GPU for one frame size: the counterpart of [`phasefront_core::method::network::NetworkPlan`].
pub struct GpuNetworkPlan {
    device: Arc<Device>,
    size: Size,
    inputs: usize,
    numbers: Numbers,
    packer: Packer,
    chain: ChainPlan,
}

impl GpuNetworkPlan {
    /// Prepares `network` for frames of `size`.
    ///
    /// # Errors
    /// Returns [`GpuError::Refused`] if `device` does not support the number format or the size, or
    /// [`GpuError::OutOfMemory`].
    pub async fn new_async(device: &Arc<Device>, network: &Network, size: Size, options: ChainOptions) -> Result<Self> {
        phasefront_core::method::network::check_size(size, phasefront_core::method::network::MAX_PIXELS)?;
        let build = || {
            let (chain, _) = chain_of(network)?;
            let numbers = Numbers::of(device, chain, options.float)?;
            let packer = Packer::new(device, Form::Chain(chain, numbers, 1.0), size, Source::Planes, None)?;
            let (input, fusion) = (&packer.input, options.fusion);
            let plan = ChainPlan::new(device, chain, numbers, size, input, End::Planes, fusion)?;
            Ok(GpuNetworkPlan {
                device: device.clone(),
                size,
                inputs: chain.inputs,
                numbers,
                packer,
                chain: plan,
            })
        };
        device.guarded_async(build).await
    }

    /// Describes the number format, the device and the number of dispatches.
    pub fn describe(&self) -> String {
        format!(
            "{} on {}, {} dispatches",
            self.numbers.name(),
            self.device.name(),
            self.chain.dispatches()
        )
    }

    /// Runs the network on one frame. `input` is planar (C, H, W), as in
    /// [`phasefront_core::method::network::NetworkPlan::run`], and `output` is (6, H, W).
    ///
    /// # Errors
    /// Returns an error if a length is wrong, or [`GpuError::Lost`].
    pub async fn run_async(&self, input: &[f32], output: &mut [f32]) -> Result<()> {
        let area = self.size.height * self.size.width;
        if input.len() != self.inputs * area || output.len() != 6 * area {
            return Err(phasefront_core::runtime::error::Error::Frame(format!(
                "network input has {} values and output {}; {} and 6 planes of {}×{} pixels are right",
                input.len(),
                output.len(),
                self.inputs,
                self.size.width,
                self.size.height
            ))
            .into());
        }
        let device = &self.device;
        let work = || {
            device
                .queue
                .write_buffer(&self.packer.planes, 0, bytemuck::cast_slice(input));
            let mut encoder = device.inner.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.packer.run(&mut pass);
            self.chain.run(&mut pass);
            drop(pass);
            device.queue.submit([encoder.finish()]);
            Ok(())
        };
        device.guarded_async(work).await?;
        let bytes = device.read_async(&self.chain.planes, 4 * output.len()).await?;
        output.copy_from_slice(bytemuck::cast_slice(&bytes));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_of_another_form_is_refused_in_one_line() {
        let own = include_bytes!("../../../../bindings/tests/own-network.onnx");
        let network = Network::from_onnx(own).map_err(|why| why.to_string());
        let why = network.map(|network| chain_of(&network).err().map(|why| why.to_string()));
        let right = "the GPU refuses: a network of another form than a chain runs on the CPU only";
        assert_eq!(why, Ok(Some(right.to_owned())));
    }
}
