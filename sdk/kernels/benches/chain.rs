//! Benchmarks the paper's 8-layer chain and the pre-filter's shape on every instruction set, with one thread and one
//! small frame.
#![allow(clippy::unwrap_used, missing_docs)]

use divan::{Bencher, counter::ItemsCount};
use phasefront_kernels::Size;
use phasefront_kernels::*;

const SIZE: Size = Size { width: 512, height: 64 };

/// (network inputs, filters, layers).
const SHAPES: [(usize, usize, usize); 2] = [(4, 24, 8), (6, 8, 8)];

fn main() {
    divan::main();
}

/// Returns `(inputs, outputs)` of each layer.
fn layers((inputs, filters, count): (usize, usize, usize)) -> Vec<(usize, usize)> {
    (0..count)
        .map(|i| match i {
            0 => (inputs, filters),
            _ if i + 1 == count => (filters + inputs, OUTPUTS),
            _ => (filters, filters),
        })
        .collect()
}

/// The argument of a benchmark, which divan uses as its name.
#[derive(Clone, Copy)]
struct Case {
    isa: Isa,
    shape: (usize, usize, usize),
}

impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}, {} layers of {}", self.isa, self.shape.2, self.shape.1)
    }
}

fn cases(isas: Vec<Isa>) -> Vec<Case> {
    isas.into_iter()
        .flat_map(|isa| SHAPES.map(|shape| Case { isa, shape }))
        .collect()
}

fn run(bencher: Bencher<'_, '_>, shape: (usize, usize, usize), frame: impl Fn(&[f32], &mut [f32]) + Sync) {
    let area = SIZE.pixels();
    let input: Vec<f32> = (0..shape.0 * area)
        .map(|k| (k * 7919 % 255) as f32 / 255.0 - 0.5)
        .collect();
    let mut output = vec![0.0; OUTPUTS * area];
    let macs: usize = layers(shape).iter().map(|(inputs, outputs)| 9 * inputs * outputs).sum();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    bencher
        .counter(ItemsCount::new(macs * area))
        .bench_local(|| pool.install(|| frame(&input, &mut output)));
}

#[divan::bench(args = cases(Isa::int8()))]
fn int8(bencher: Bencher<'_, '_>, Case { isa, shape }: Case) {
    let shapes = layers(shape);
    let last = shapes.len() - 1;
    let layers: Vec<_> = shapes
        .iter()
        .enumerate()
        .map(|(i, &(inputs, outputs))| Int8Layer {
            inputs,
            outputs,
            zero_point: if i == 0 { 127 } else { 0 },
            kernel: (0..9 * inputs * outputs)
                .map(|k| (k * 7919 % 255) as u8 as i8)
                .collect(),
            bias: vec![100; outputs],
            multiplier: vec![1e-3; outputs],
            requantise: Requantise {
                skip: (i >= 2 && i % 2 == 0 && i < last).then_some(SkipSum {
                    relu: Some(0.7),
                    skip: 0.6,
                }),
                rescale: None,
            },
        })
        .collect();
    let input = Quantiser {
        scale: 1.0 / 254.0,
        zero_point: 127,
    };
    let concatenated = Quantiser {
        scale: 0.01,
        zero_point: 0,
    };
    let chain = Int8Chain::new(&layers, input, concatenated, false, isa).unwrap();
    let scratch = Scratch::default();
    run(bencher, shape, |input, output| {
        chain.run(input, output, SIZE, chain.tiling(SIZE), &scratch);
    });
}

#[divan::bench(args = cases(Isa::f32()))]
fn f32(bencher: Bencher<'_, '_>, Case { isa, shape }: Case) {
    let layers: Vec<_> = layers(shape)
        .into_iter()
        .map(|(inputs, outputs)| F32Layer {
            inputs,
            outputs,
            kernel: (0..9 * inputs * outputs)
                .map(|k| (k * 7919 % 255) as f32 / 2550.0 - 0.05)
                .collect(),
            bias: vec![0.1; outputs],
        })
        .collect();
    let chain = F32Chain::new(&layers, isa).unwrap();
    let scratch = Scratch::default();
    run(bencher, shape, |input, output| {
        chain.run(input, output, SIZE, chain.tiling(SIZE), &scratch);
    });
}
