//! A chain on Phasefront's own kernels: the choice of kernels, and the step sizes that they multiply by.

use super::chain::{Chain, Precision, Quantisation, Weights};
use super::{Head, InputKind, Source};
use crate::Size;
use crate::method::standing::Changes;
use crate::parallel::prelude::*;
use crate::runtime::cancel::Cancel;
use num_complex::Complex32;
use phasefront_kernels::{
    Band, F32Chain, F32Layer, Int8Chain, Int8Layer, Isa, OUTPUTS, Quantiser, Requantise, Rows, Scratch, SkipSum,
    Tiling, wide,
};
use std::ops::Range;

/// A chain packed for the kernels. It works for any frame size, and threads can share it.
pub(super) struct FusedChain {
    kernels: Kernels,
    /// The pixels along each side of a layer's pixel.
    side: usize,
    tanh: bool,
}

enum Kernels {
    Int8(Int8Chain),
    F32(F32Chain),
}

/// The working memory of a run. The first frame allocates it.
#[derive(Debug, Default)]
pub(super) struct FusedScratch {
    int8: Scratch<u8>,
    f32: Scratch<f32>,
    pub(super) cancel: Cancel,
}

impl FusedScratch {
    pub(super) fn bytes(&self) -> usize {
        self.int8.bytes() + self.f32.bytes()
    }
}

impl FusedChain {
    /// Packs `chain` for `isa`, or for the fastest kernels that this processor supports.
    ///
    /// # Errors
    /// Returns a description of the part that the kernels do not support.
    pub(super) fn new(chain: &Chain, isa: Option<Isa>) -> Result<FusedChain, String> {
        let kernels = match chain.precision {
            Precision::Int8 => {
                let isa = isa.unwrap_or_else(|| Isa::int8_for(chain.filters()));
                Kernels::Int8(int8(chain, isa)?)
            }
            Precision::F32 => Kernels::F32(f32(chain, isa.unwrap_or_else(|| Isa::f32()[0]))?),
        };
        Ok(FusedChain {
            kernels,
            side: chain.side(),
            tanh: chain.tanh,
        })
    }

    pub(super) fn isa(&self) -> Isa {
        match &self.kernels {
            Kernels::Int8(chain) => chain.isa(),
            Kernels::F32(chain) => chain.isa(),
        }
    }

    /// Runs the chain on the current rayon pool. `input` and `output` are planes of `size`.
    pub(super) fn run(&self, input: &[f32], output: &mut [f32], size: Size, scratch: &FusedScratch) {
        let tiling = self.tiling(size);
        match &self.kernels {
            Kernels::Int8(chain) => chain.run(input, output, size, tiling, &scratch.int8),
            Kernels::F32(chain) => chain.run(input, output, size, tiling, &scratch.f32),
        }
        if self.tanh {
            const CHUNK: usize = 1 << 14;
            output.par_chunks_mut(CHUNK).for_each(|chunk| wide!(tanh(&mut [chunk])));
        }
    }

    /// Returns how far from a pixel the output depends on the input, in pixels.
    pub(super) fn reach(&self) -> usize {
        // A square of two by two pixels reaches one pixel farther to one side.
        self.layers() * self.side + self.side - 1
    }

    /// Runs the chain from `source` into `field`, (C, H, W), row by row. Neither the input nor the output is stored as
    /// a whole. If `changes` to the input are given, only what they affect is computed.
    pub(super) fn field<S: Source + ?Sized, const C: usize>(
        &self,
        changes: Option<&Changes>,
        source: &S,
        into: FieldOf<C>,
        field: &mut [Complex32],
        size: Size,
        scratch: &FusedScratch,
    ) {
        let rows = FieldRows {
            source,
            into,
            tanh: self.tanh,
            changes: changes.map(|changes| (changes, self.reach())),
            cancel: &scratch.cancel,
        };
        let mut planes = field.chunks_exact_mut((size.height * size.width).max(1));
        let planes: [_; C] = std::array::from_fn(|_| planes.next().unwrap_or_default());
        self.run_rows(&rows, planes, size, self.tiling(size), scratch);
    }

    pub(super) fn layers(&self) -> usize {
        match &self.kernels {
            Kernels::Int8(chain) => chain.layers(),
            Kernels::F32(chain) => chain.layers(),
        }
    }

    /// Returns whether the chain ends with tanh, which output rows do not include yet.
    pub(super) fn has_tanh(&self) -> bool {
        self.tanh
    }

    /// Returns the tiling that suits a frame of `size` and the current rayon pool.
    pub(super) fn tiling(&self, size: Size) -> Tiling {
        match &self.kernels {
            Kernels::Int8(chain) => chain.tiling(size),
            Kernels::F32(chain) => chain.tiling(size),
        }
    }

    /// Runs the chain without its tanh.
    pub(super) fn run_rows<R: Rows<PLANES>, const PLANES: usize>(
        &self,
        rows: &R,
        planes: [&mut [R::Value]; PLANES],
        size: Size,
        tiling: Tiling,
        scratch: &FusedScratch,
    ) {
        match &self.kernels {
            Kernels::Int8(chain) => chain.run_rows(rows, planes, size, tiling, &scratch.int8),
            Kernels::F32(chain) => chain.run_rows(rows, planes, size, tiling, &scratch.f32),
        }
    }
}

/// The field that a chain writes to.
pub(super) struct FieldOf<const C: usize> {
    /// The kind of the source's planes.
    pub(super) kind: InputKind,
    pub(super) head: Head,
    /// The colours of the output that are the field's planes.
    pub(super) colours: [usize; C],
}

/// Reads rows of a source and writes rows of a field.
struct FieldRows<'a, S: ?Sized, const C: usize> {
    source: &'a S,
    into: FieldOf<C>,
    tanh: bool,
    /// The changes of the input and how far they reach.
    changes: Option<(&'a Changes, usize)>,
    cancel: &'a Cancel,
}

impl<S: Source + ?Sized, const C: usize> Rows<C> for FieldRows<'_, S, C> {
    type Value = Complex32;

    fn read(&self, row: usize, from: usize, _: &Band<'_, Complex32, C>, into: &mut [f32]) {
        let count = into.len() / self.into.kind.channels();
        wide!({
            for (plane, into) in into.chunks_exact_mut(count).enumerate() {
                self.source.read(plane, row, from, into);
            }
        });
    }

    fn write(&self, row: usize, from: usize, mut values: [&mut [f32]; OUTPUTS], band: &mut Band<'_, Complex32, C>) {
        let field = band.rows_mut(row, from, values[0].len());
        let base = |plane: usize, at: usize, into: &mut [f32]| {
            self.source.read(plane, row, from + at, into);
        };
        wide!({
            if self.tanh {
                tanh(&mut values);
            }
            let values = values.map(|run| &*run);
            let FieldOf { kind, head, colours } = &self.into;
            head.row(*kind, colours, values, base, field);
        });
    }

    fn needed(&self, rows: Range<usize>, columns: Range<usize>) -> Option<[Range<usize>; 2]> {
        match self.changes {
            None => Some([rows, columns]),
            Some((changes, reach)) => changes.affected([&rows, &columns], reach),
        }
    }

    fn given_up(&self) -> bool {
        self.cancel.requested()
    }
}

fn f32(chain: &Chain, isa: Isa) -> Result<F32Chain, String> {
    let layers = chain.layers.iter().map(|layer| match &layer.weights {
        Weights::F32 { kernel, bias } => Ok(F32Layer {
            inputs: layer.inputs,
            outputs: layer.outputs,
            kernel: kernel.clone(),
            bias: bias.clone(),
        }),
        Weights::Int8 { .. } => Err(format!("layer '{}' is int8 in an f32 chain", layer.name)),
    });
    F32Chain::new(&layers.collect::<Result<Vec<_>, _>>()?, isa)
}

fn int8(chain: &Chain, isa: Isa) -> Result<Int8Chain, String> {
    let all = int8_layers(chain)?;
    let twice = chain.concat_rounded_input;
    Int8Chain::new(&all.layers, all.input, all.concatenated, twice, isa)
}

/// A quantised chain in the steps that kernels multiply by.
pub struct Int8Layers {
    /// The layers in the order in which they run.
    pub layers: Vec<Int8Layer>,
    /// The rounding of the network's input for the first layer.
    pub input: Quantiser,
    /// The rounding of the network's input for the last layer.
    pub concatenated: Quantiser,
}

/// Returns the layers of a quantised chain in the form that [`Int8Chain`] takes.
pub fn int8_layers(chain: &Chain) -> Result<Int8Layers, String> {
    let input = |i: usize| -> Result<Quantisation, String> {
        chain.layers[i]
            .quantisation
            .input
            .ok_or_else(|| format!("layer {i}'s input is not rounded"))
    };
    let last = chain.layers.len() - 1;
    let mut layers = Vec::new();
    for (i, layer) in chain.layers.iter().enumerate() {
        let Weights::Int8 { kernel, scale, bias } = &layer.weights else {
            return Err(format!("layer '{}' is f32 in an int8 chain", layer.name));
        };
        // The step that the multiplied sums are in, and the operations that follow.
        let mut requantise = Requantise {
            skip: None,
            rescale: None,
        };
        let step = if i == last {
            1.0
        } else {
            let next = &chain.layers[i + 1].quantisation;
            let end = f64::from(input(i + 1)?.scale);
            let relu = next.relu.map(|q| f64::from(q.scale));
            // The first rounding of the concatenation's input, if it is rounded before.
            let first = if Chain::has_skip(i + 1) {
                next.sum.map(|q| f64::from(q.scale))
            } else {
                relu
            };
            let target = first.unwrap_or(end);
            requantise.rescale = first.map(|first| (first / end) as f32).filter(|_| i + 1 == last);
            if Chain::has_skip(i + 1) {
                requantise.skip = Some(SkipSum {
                    relu: relu.map(|relu| (relu / target) as f32),
                    skip: (f64::from(input(i - 1)?.scale) / target) as f32,
                });
                relu.unwrap_or(target)
            } else {
                target
            }
        };
        let input = input(i)?;
        layers.push(Int8Layer {
            inputs: layer.inputs,
            outputs: layer.outputs,
            zero_point: input.zero_point,
            kernel: kernel.clone(),
            bias: bias.clone(),
            multiplier: scale
                .iter()
                .map(|&scale| (f64::from(input.scale) * f64::from(scale) / step) as f32)
                .collect(),
            requantise,
        });
    }
    let quantiser = |q: Quantisation| Quantiser {
        scale: q.scale,
        zero_point: q.zero_point,
    };
    Ok(Int8Layers {
        input: quantiser(input(0)?),
        concatenated: quantiser(input(last)?),
        layers,
    })
}

/// Computes tanh of runs of values, in place.
#[inline(always)]
pub(super) fn tanh(runs: &mut [&mut [f32]]) {
    for run in runs {
        run.iter_mut().for_each(|v| *v = tanh_value(*v));
    }
}

/// Returns tanh to 3e-7 as `1 − 2/(e^2x + 1)`. It has no branches, so loops over it vectorise.
#[inline(always)]
fn tanh_value(x: f32) -> f32 {
    // Beyond ±10, tanh is ±1 in f32.
    let y = x.clamp(-10.0, 10.0) * (2.0 * std::f32::consts::LOG2_E);
    // 2^y = 2^k · 2^r with |r| ≤ ½. Adding 1.5·2²³ rounds and leaves k in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let shifted = y + ROUND;
    let k = shifted.to_bits() << 23;
    let r = (y - (shifted - ROUND)) * std::f32::consts::LN_2;
    // Taylor series of e^r. The next term is below 2e-7 of the sum.
    let e = 1.0 + r * (1.0 + r * (1.0 / 2.0 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r / 720.0)))));
    let e = f32::from_bits(e.to_bits().wrapping_add(k));
    1.0 - 2.0 / (e + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tanh_agrees_with_f64() {
        for k in -120_000..=120_000 {
            let x = k as f32 / 10_000.0;
            let worst = (f64::from(tanh_value(x)) - f64::from(x).tanh()).abs();
            assert!(worst < 3e-7, "tanh {x} is off by {worst}");
        }
        for (x, expected) in [(1e30, 1.0), (-1e30, -1.0), (f32::INFINITY, 1.0), (0.0, 0.0)] {
            assert!((tanh_value(x) - expected).abs() < 3e-7);
        }
    }
}
