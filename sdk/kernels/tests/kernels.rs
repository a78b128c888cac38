//! Compares every instruction set of this processor with a plain frame-wide computation of the chain's definition.
#![allow(clippy::unwrap_used)]

#[path = "../../../tests/skip.rs"]
mod skip;

use phasefront_kernels::Size;
use phasefront_kernels::*;
use std::ops::Range;

/// The frame sizes. The widths 128 and 192 are whole blocks of pixels, which no kernel may exceed.
const SIZES: [Size; 7] = [
    Size { width: 1, height: 1 },
    Size { width: 5, height: 7 },
    Size { width: 128, height: 1 },
    Size { width: 192, height: 2 },
    Size { width: 300, height: 1 },
    Size { width: 67, height: 23 },
    Size { width: 131, height: 40 },
];

/// A small linear congruential generator, which suffices for the tests and builds for every target.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32
    }

    fn unit(&mut self) -> f32 {
        (self.next() >> 7) as f32 / (1 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }
}

/// `(H, W)` planes. Reading outside returns `outside`.
struct Planes<T> {
    data: Vec<T>,
    size: Size,
    outside: T,
}

impl<T: Copy> Planes<T> {
    fn at(&self, c: usize, y: isize, x: isize) -> T {
        let Size { width: w, height: h } = self.size;
        if y < 0 || x < 0 || y >= h as isize || x >= w as isize {
            return self.outside;
        }
        self.data[(c * h + y as usize) * w + x as usize]
    }

    fn channels(&self) -> usize {
        self.data.len() / (self.size.height * self.size.width)
    }
}

/// Returns the nine taps of every channel at (y, x), in the order of a filter's weights.
fn taps<T: Copy>(planes: &Planes<T>, y: usize, x: usize) -> Vec<T> {
    (0..9 * planes.channels())
        .map(|k| {
            let (ky, kx) = (k % 9 / 3, k % 3);
            planes.at(k / 9, (y + ky) as isize - 1, (x + kx) as isize - 1)
        })
        .collect()
}

struct Int8Case {
    layers: Vec<Int8Layer>,
    input: Quantiser,
    concatenated: Quantiser,
    rounded_twice: bool,
}

impl Int8Case {
    fn random(inputs: usize, filters: usize, count: usize, seed: u64) -> Int8Case {
        let mut random = Random(seed);
        let input = Quantiser {
            scale: 1.0 / 254.0,
            zero_point: 127,
        };
        let concatenated = Quantiser {
            scale: 0.009,
            zero_point: 55,
        };
        let inner_roundings = seed.is_multiple_of(2);
        let layers = (0..count)
            .map(|i| {
                let last = i + 1 == count;
                let reads = match i {
                    0 => inputs,
                    _ if last => filters + inputs,
                    _ => filters,
                };
                let outputs = if last { OUTPUTS } else { filters };
                let skip = !last && i + 1 >= 3 && (i + 1) % 2 == 1;
                Int8Layer {
                    inputs: reads,
                    outputs,
                    zero_point: match i {
                        0 => input.zero_point,
                        _ if last => concatenated.zero_point,
                        _ => 0,
                    },
                    kernel: (0..outputs * reads * 9)
                        .map(|_| (random.next() % 255) as u8 as i8)
                        .collect(),
                    bias: (0..outputs).map(|_| random.next() as i32 % 20_000 - 10_000).collect(),
                    multiplier: (0..outputs)
                        .map(|_| random.between(0.5, 1.5) / (reads as f32).sqrt() / 250.0)
                        .collect(),
                    requantise: Requantise {
                        skip: skip.then(|| SkipSum {
                            relu: inner_roundings.then(|| random.between(0.5, 0.9)),
                            skip: random.between(0.5, 0.9),
                        }),
                        rescale: (inner_roundings && i + 2 == count).then(|| random.between(0.5, 0.9)),
                    },
                }
            })
            .collect();
        Int8Case {
            layers,
            input,
            concatenated,
            rounded_twice: inner_roundings,
        }
    }

    fn chain(&self, isa: Isa) -> Result<Int8Chain, String> {
        Int8Chain::new(&self.layers, self.input, self.concatenated, self.rounded_twice, isa)
    }

    /// Computes the chain from its definition, plane by plane.
    fn expected(&self, input: &[f32], size: Size) -> Vec<f32> {
        let Size { width: w, height: h } = size;
        let quantise =
            |q: Quantiser, v: f32| ((v / q.scale).round_ties_even() + f32::from(q.zero_point)).clamp(0.0, 255.0) as u8;
        let dequantise = |q: Quantiser, v: u8| (f32::from(v) - f32::from(q.zero_point)) * q.scale;
        let planes = |data, outside| Planes { data, size, outside };
        let first = input.iter().map(|&v| quantise(self.input, v)).collect();
        let mut x = vec![planes(first, self.input.zero_point)];
        for (i, layer) in self.layers.iter().enumerate() {
            let last = i + 1 == self.layers.len();
            let mut real = vec![0.0; layer.outputs * h * w];
            let mut rounded = vec![0; layer.outputs * h * w];
            for (y, column) in (0..h).flat_map(|y| (0..w).map(move |column| (y, column))) {
                let taps = taps(&x[i], y, column);
                for o in 0..layer.outputs {
                    let weights = &layer.kernel[o * layer.inputs * 9..][..layer.inputs * 9];
                    let zero = i32::from(layer.zero_point);
                    let products = taps.iter().zip(weights);
                    let sum: i32 = products.map(|(&v, &w)| (i32::from(v) - zero) * i32::from(w)).sum();
                    let v = (sum + layer.bias[o]) as f32 * layer.multiplier[o];
                    let mut q = match layer.requantise.skip {
                        Some(skip) => {
                            let a = match skip.relu {
                                Some(relu) => v.clamp(0.0, 255.0).round_ties_even() * relu,
                                None => v.max(0.0),
                            };
                            let s = x[i - 1].at(o, y as isize, column as isize);
                            a + f32::from(s) * skip.skip
                        }
                        None => v,
                    };
                    q = q.round_ties_even().clamp(0.0, 255.0);
                    if let Some(factor) = layer.requantise.rescale {
                        q = (q * factor).round_ties_even().clamp(0.0, 255.0);
                    }
                    let next_zero = if last { 0 } else { self.layers[i + 1].zero_point };
                    real[(o * h + y) * w + column] = v;
                    rounded[(o * h + y) * w + column] = (q + f32::from(next_zero)).min(255.0) as u8;
                }
            }
            if last {
                return real;
            }
            if i + 2 == self.layers.len() {
                rounded.extend(input.iter().map(|&v| {
                    if self.rounded_twice {
                        quantise(self.concatenated, dequantise(self.input, quantise(self.input, v)))
                    } else {
                        quantise(self.concatenated, v)
                    }
                }));
            }
            x.push(planes(rounded, self.layers[i + 1].zero_point));
        }
        unreachable!("the last layer returns");
    }
}

fn frame(channels: usize, size: Size, seed: u64) -> Vec<f32> {
    let mut random = Random(seed);
    (0..channels * size.height * size.width)
        .map(|_| random.between(-0.5, 0.5))
        .collect()
}

fn tilings(size: Size) -> [Tiling; 4] {
    [(size.height, size.width), (8, 64), (5, 17), (1, 1000)].map(|(band_rows, strip_columns)| Tiling {
        band_rows,
        strip_columns,
    })
}

#[test]
fn int8_is_the_definition_to_the_bit_on_every_instruction_set_and_tiling() {
    let shapes = [
        (4, 24, 8),
        (4, 8, 2),
        (6, 8, 5),
        (4, 16, 4),
        (20, 24, 3),
        (4, 32, 6),
        (4, 40, 3),
        (4, 48, 3),
        (4, 56, 3),
    ];
    let mut distinct = 0;
    for (k, (inputs, filters, count)) in shapes.into_iter().enumerate() {
        for seed in [2 * k as u64, 2 * k as u64 + 1] {
            let case = Int8Case::random(inputs, filters, count, seed);
            for size in SIZES {
                // The plain chain is slow, so the larger frames are only for the first shapes.
                if size.height > 10 && (k > 1 || seed % 2 == 1) {
                    continue;
                }
                let input = frame(inputs, size, seed + 100);
                let expected = case.expected(&input, size);
                distinct += expected.windows(2).filter(|w| w[0] != w[1]).count();
                for isa in Isa::int8() {
                    let chain = case.chain(isa).unwrap();
                    let scratch = Scratch::default();
                    for tiling in tilings(size).into_iter().chain([chain.tiling(size)]) {
                        if isa == Isa::Portable && tiling.band_rows < 8 && size.height > 10 {
                            continue;
                        }
                        let mut output = vec![f32::NAN; expected.len()];
                        chain.run(&input, &mut output, size, tiling, &scratch);
                        let wrong = output
                            .iter()
                            .zip(&expected)
                            .position(|(a, b)| a.to_bits() != b.to_bits());
                        assert_eq!(
                            wrong,
                            None,
                            "{isa}, {count} layers of {filters}, {size:?}, {tiling:?}, seed {seed}: {:?} for {:?}",
                            wrong.map(|k| output[k]),
                            wrong.map(|k| expected[k])
                        );
                    }
                }
            }
        }
    }
    assert!(distinct > 10_000, "the outputs must vary: {distinct}");
}

fn f32_layers(inputs: usize, filters: usize, count: usize, seed: u64) -> Vec<F32Layer> {
    let mut random = Random(seed);
    (0..count)
        .map(|i| {
            let last = i + 1 == count;
            let reads = if i == 0 {
                inputs
            } else {
                filters + if last { inputs } else { 0 }
            };
            let outputs = if last { OUTPUTS } else { filters };
            let spread = (6.0 / (9 * reads) as f32).sqrt() * if i > 0 && i % 2 == 0 { 0.7 } else { 1.0 };
            F32Layer {
                inputs: reads,
                outputs,
                kernel: (0..outputs * reads * 9)
                    .map(|_| random.between(-spread, spread))
                    .collect(),
                bias: (0..outputs).map(|_| random.between(-0.1, 0.1)).collect(),
            }
        })
        .collect()
}

fn f32_expected(layers: &[F32Layer], input: &[f32], size: Size) -> Vec<f32> {
    let mut x = vec![Planes {
        data: input.to_vec(),
        size,
        outside: 0.0,
    }];
    for (i, layer) in layers.iter().enumerate() {
        let Size { width: w, height: h } = size;
        let mut data = vec![0.0; layer.outputs * h * w];
        for (y, column) in (0..h).flat_map(|y| (0..w).map(move |column| (y, column))) {
            let taps = taps(&x[i], y, column);
            for o in 0..layer.outputs {
                let weights = &layer.kernel[o * layer.inputs * 9..][..layer.inputs * 9];
                let products = taps.iter().zip(weights).map(|(&v, &w)| f64::from(v) * f64::from(w));
                let sum = products.sum::<f64>() + f64::from(layer.bias[o]);
                data[(o * h + y) * w + column] = sum as f32;
            }
        }
        if i + 1 == layers.len() {
            return data;
        }
        data.iter_mut().for_each(|v| *v = v.max(0.0));
        if i + 1 >= 3 && (i + 1) % 2 == 1 {
            data.iter_mut().zip(&x[i - 1].data).for_each(|(v, skip)| *v += skip);
        }
        if i + 2 == layers.len() {
            data.extend(input);
        }
        x.push(Planes {
            data,
            size,
            outside: 0.0,
        });
    }
    unreachable!("the last layer returns");
}

#[test]
fn f32_is_the_definition_to_rounding_on_every_instruction_set_and_equal_on_every_tiling() {
    for (inputs, filters, count) in [(4, 24, 8), (4, 8, 2), (6, 8, 5), (4, 16, 4), (20, 24, 3), (4, 40, 3)] {
        let layers = f32_layers(inputs, filters, count, 5);
        for size in SIZES {
            if size.height > 10 && filters != 8 {
                continue;
            }
            let input = frame(inputs, size, 77);
            let expected = f32_expected(&layers, &input, size);
            for isa in Isa::f32() {
                let chain = F32Chain::new(&layers, isa).unwrap();
                let scratch = Scratch::default();
                let mut whole = vec![f32::NAN; expected.len()];
                chain.run(&input, &mut whole, size, chain.tiling(size), &scratch);
                let worst = whole
                    .iter()
                    .zip(&expected)
                    .map(|(a, b)| (a - b).abs())
                    .fold(0.0, f32::max);
                assert!(worst < 1e-5, "{isa}, {count} layers of {filters}, {size:?}: {worst}");
                for tiling in tilings(size) {
                    let mut output = vec![f32::NAN; expected.len()];
                    chain.run(&input, &mut output, size, tiling, &scratch);
                    assert!(
                        output == whole,
                        "{isa}, {count} layers of {filters}, {size:?}, {tiling:?}"
                    );
                }
            }
        }
    }
}

/// Checks all widths, because blocks of pixels end differently in each.
#[test]
fn rows_of_every_width_agree_on_every_instruction_set() {
    let (case, layers) = (Int8Case::random(4, 8, 3, 2), f32_layers(4, 8, 3, 5));
    for width in 1..=400 {
        let size = Size { width, height: 1 };
        let input = frame(4, size, 7);
        let tiling = tilings(size)[0];
        let int8 = |isa| {
            let mut output = vec![f32::NAN; OUTPUTS * width];
            let chain = case.chain(isa).unwrap();
            chain.run(&input, &mut output, size, tiling, &Scratch::default());
            output
        };
        let f32 = |isa| {
            let mut output = vec![f32::NAN; OUTPUTS * width];
            let chain = F32Chain::new(&layers, isa).unwrap();
            chain.run(&input, &mut output, size, tiling, &Scratch::default());
            output
        };
        let expected = int8(Isa::Portable);
        assert!(Isa::int8().into_iter().all(|isa| int8(isa) == expected), "{width}");
        let expected = f32(Isa::Portable);
        for isa in Isa::f32() {
            let apart = f32(isa)
                .iter()
                .zip(&expected)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f32::max);
            assert!(apart < 1e-5, "{isa}, {width}: {apart}");
        }
    }
}

/// Converts `values` (C, H, W) to (4·C, ⌈H/2⌉, ⌈W/2⌉), with the pixels of a square of two by two one after another.
fn squares(values: &[f32], Size { width, height }: Size) -> Vec<f32> {
    let pixels = [(0, 0), (0, 1), (1, 0), (1, 1)];
    let planes = pixels
        .iter()
        .flat_map(|pixel| values.chunks(height * width).map(move |plane| (pixel, plane)));
    planes
        .flat_map(|((dy, dx), plane)| {
            let at = move |k: usize| {
                let (y, x) = (k / width.div_ceil(2), k % width.div_ceil(2));
                plane[(2 * y + dy).min(height - 1) * width + (2 * x + dx).min(width - 1)]
            };
            (0..height.div_ceil(2) * width.div_ceil(2)).map(at)
        })
        .collect()
}

/// Computes the inverse of [`squares`].
fn pixels(values: &[f32], Size { width, height }: Size) -> Vec<f32> {
    let columns = width.div_ceil(2);
    let area = height.div_ceil(2) * columns;
    let at = |k: usize| {
        let (c, y, x) = (k / (height * width), k / width % height, k % width);
        let plane = (y % 2 * 2 + x % 2) * OUTPUTS + c;
        values[plane * area + y / 2 * columns + x / 2]
    };
    (0..OUTPUTS * height * width).map(at).collect()
}

/// Rows in memory, of which only a rectangle is needed.
struct InRectangle<'a> {
    input: &'a [f32],
    size: Size,
    needed: [Range<usize>; 2],
}

impl Rows<OUTPUTS> for InRectangle<'_> {
    type Value = f32;

    fn read(&self, row: usize, from: usize, _: &Band<'_, f32, OUTPUTS>, into: &mut [f32]) {
        let planes = self.input.chunks_exact(self.size.pixels());
        let count = into.len() / planes.len();
        for (into, plane) in into.chunks_exact_mut(count).zip(planes) {
            into.copy_from_slice(&plane[row * self.size.width + from..][..count]);
        }
    }

    fn write(&self, row: usize, from: usize, values: [&mut [f32]; OUTPUTS], band: &mut Band<'_, f32, OUTPUTS>) {
        for (out, values) in band.rows_mut(row, from, values[0].len()).into_iter().zip(values) {
            out.copy_from_slice(values);
        }
    }

    fn needed(&self, rows: Range<usize>, columns: Range<usize>) -> Option<[Range<usize>; 2]> {
        let both = |a: &Range<usize>, b: Range<usize>| a.start.max(b.start)..a.end.min(b.end);
        let part = [both(&self.needed[0], rows), both(&self.needed[1], columns)];
        part.iter().all(|side| !side.is_empty()).then_some(part)
    }
}

/// Checks that a part of the output has the bits of the whole output, and that the rest stays as it was.
#[test]
fn only_what_is_needed_is_computed() {
    let size = Size { width: 301, height: 41 };
    for side in [1, 2] {
        let (case, layers) = of_side(side, 4, 8, 5);
        let input = frame(4, size, 3);
        let places = Size {
            width: size.width.div_ceil(side),
            height: size.height.div_ceil(side),
        };
        for needed in [
            [3..4, 200..201],
            [11..33, 17..150],
            [40..41, 300..301],
            [0..41, 0..301],
            [7..30, 0..90],
        ] {
            let rows = InRectangle {
                input: &input,
                size,
                needed: needed.clone(),
            };
            // Squares of pixels are whole.
            let [down, across] = needed.map(|pixels| pixels.start / side * side..pixels.end.next_multiple_of(side));
            let check = |whole: &[f32], run: &dyn Fn([&mut [f32]; OUTPUTS]), what: &str| {
                let mut part = vec![f32::INFINITY; whole.len()];
                let mut planes = part.chunks_exact_mut(size.pixels());
                run(std::array::from_fn(|_| planes.next().unwrap()));
                for (at, (part, whole)) in part.iter().zip(whole).enumerate() {
                    let (y, x) = (at / size.width % size.height, at % size.width);
                    let is_needed = down.contains(&y) && across.contains(&x);
                    assert!(
                        *part == if is_needed { *whole } else { f32::INFINITY },
                        "{what} ({y}, {x})"
                    );
                }
            };
            for isa in Isa::int8() {
                let (chain, scratch) = (case.chain(isa).unwrap(), Scratch::default());
                for tiling in tilings(places) {
                    let mut whole = vec![f32::NAN; OUTPUTS * size.pixels()];
                    chain.run(&input, &mut whole, size, tiling, &scratch);
                    let run = |planes: [&mut [f32]; OUTPUTS]| chain.run_rows(&rows, planes, size, tiling, &scratch);
                    check(&whole, &run, &format!("{isa} {side} {tiling:?}"));
                }
            }
            for isa in Isa::f32() {
                let (chain, scratch) = (F32Chain::new(&layers, isa).unwrap(), Scratch::default());
                for tiling in tilings(places) {
                    let mut whole = vec![f32::NAN; OUTPUTS * size.pixels()];
                    chain.run(&input, &mut whole, size, tiling, &scratch);
                    let run = |planes: [&mut [f32]; OUTPUTS]| chain.run_rows(&rows, planes, size, tiling, &scratch);
                    check(&whole, &run, &format!("f32 {isa} {side} {tiling:?}"));
                }
            }
        }
    }
}

/// Returns chains of `count` layers for pixels, or for squares of two by two pixels.
fn of_side(side: usize, channels: usize, filters: usize, count: usize) -> (Int8Case, Vec<F32Layer>) {
    let inputs = side * side * channels;
    let mut case = Int8Case::random(inputs, filters, count, 2);
    let mut layers = f32_layers(inputs, filters, count, 5);
    for pixel in 1..(side * side) as u64 {
        let more = Int8Case::random(inputs, filters, count, 10 + pixel)
            .layers
            .pop()
            .unwrap();
        let last = case.layers.last_mut().unwrap();
        last.outputs += OUTPUTS;
        last.kernel.extend(more.kernel);
        last.bias.extend(more.bias);
        last.multiplier.extend(more.multiplier);
        let more = f32_layers(inputs, filters, count, 10 + pixel).pop().unwrap();
        let last = layers.last_mut().unwrap();
        last.outputs += OUTPUTS;
        last.kernel.extend(more.kernel);
        last.bias.extend(more.bias);
    }
    (case, layers)
}

#[test]
fn chains_at_half_the_resolution_are_chains_on_squares_of_pixels() {
    for (channels, filters, count) in [(4, 48, 3), (4, 8, 5), (6, 16, 2)] {
        let (case, layers) = of_side(2, channels, filters, count);
        for size in [
            Size { width: 1, height: 1 },
            Size { width: 4, height: 6 },
            Size { width: 5, height: 7 },
            Size { width: 256, height: 2 },
            Size { width: 301, height: 1 },
            Size { width: 66, height: 23 },
        ] {
            let input = frame(channels, size, 3);
            let given = squares(&input, size);
            let half = Size {
                width: size.width.div_ceil(2),
                height: size.height.div_ceil(2),
            };
            let expected = pixels(&case.expected(&given, half), size);
            for isa in Isa::int8() {
                let (chain, scratch) = (case.chain(isa).unwrap(), Scratch::default());
                for tiling in tilings(half).into_iter().chain([chain.tiling(size)]) {
                    let mut output = vec![f32::NAN; expected.len()];
                    chain.run(&input, &mut output, size, tiling, &scratch);
                    assert!(
                        output == expected,
                        "{isa}, {count} layers of {filters}, {size:?}, {tiling:?}"
                    );
                }
            }
            let expected = pixels(&f32_expected(&layers, &given, half), size);
            for isa in Isa::f32() {
                let (chain, scratch) = (F32Chain::new(&layers, isa).unwrap(), Scratch::default());
                for tiling in tilings(half).into_iter().chain([chain.tiling(size)]) {
                    let mut output = vec![f32::NAN; expected.len()];
                    chain.run(&input, &mut output, size, tiling, &scratch);
                    let apart = output.iter().zip(&expected).map(|(a, b)| (a - b).abs());
                    assert!(apart.fold(0.0, f32::max) < 1e-5, "{isa}, {size:?}, {tiling:?}");
                }
            }
        }
    }
}

/// The test that `fuzz/miri` runs with the fastest instruction set that miri supports. miri is some ten thousand times
/// slower.
#[test]
fn small_chains_agree_on_every_instruction_set() {
    let size = Size { width: 3, height: 2 };
    let tilings = [size.shape(), (1, 2)].map(|(band_rows, strip_columns)| Tiling {
        band_rows,
        strip_columns,
    });
    let sets = |found: Vec<Isa>| found.into_iter().take(if cfg!(miri) { 1 } else { usize::MAX });
    let input = frame(4, size, 9);
    let case = Int8Case::random(4, 8, 4, 2);
    let expected = case.expected(&input, size);
    for isa in sets(Isa::int8()) {
        let (chain, scratch) = (case.chain(isa).unwrap(), Scratch::default());
        for tiling in tilings {
            let mut output = vec![f32::NAN; expected.len()];
            chain.run(&input, &mut output, size, tiling, &scratch);
            assert_eq!(output, expected, "{isa}, {tiling:?}");
        }
        println!("int8 on {isa}");
    }
    let layers = f32_layers(4, 8, 4, 5);
    let expected = f32_expected(&layers, &input, size);
    for isa in sets(Isa::f32()) {
        let (chain, scratch) = (F32Chain::new(&layers, isa).unwrap(), Scratch::default());
        for tiling in tilings {
            let mut output = vec![f32::NAN; expected.len()];
            chain.run(&input, &mut output, size, tiling, &scratch);
            let apart = output.iter().zip(&expected).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f32::max) < 1e-5, "{isa}, {tiling:?}");
        }
        println!("f32 on {isa}");
    }
}

#[test]
fn extreme_values_saturate_alike() {
    let mut case = Int8Case::random(4, 8, 5, 4);
    for layer in &mut case.layers {
        let count = layer.kernel.len();
        layer.kernel = (0..count)
            .map(|k| if k / (layer.inputs * 9) % 2 == 0 { 127 } else { -128 })
            .collect();
        layer.multiplier.iter_mut().for_each(|m| *m = 60.0);
    }
    let size = Size { width: 35, height: 6 };
    for value in [-1e30, 1e30, f32::NAN, f32::INFINITY] {
        let input = vec![value; 4 * 6 * 35];
        let outputs = Isa::int8().into_iter().map(|isa| {
            let chain = case.chain(isa).unwrap();
            let mut output = vec![0.0f32; 6 * 6 * 35];
            chain.run(
                &input,
                &mut output,
                size,
                chain.tiling(Size { width: 35, height: 6 }),
                &Scratch::default(),
            );
            output.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        });
        let outputs: Vec<_> = outputs.collect();
        assert!(outputs.iter().all(|o| *o == outputs[0]), "{value}");
    }
}

/// Runs `work` in a pool of one thread.
#[cfg(not(target_family = "wasm"))]
fn on_one_thread(work: impl FnOnce() + Send) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.unwrap().install(work);
}

/// Runs `work`. WebAssembly has one thread.
#[cfg(target_family = "wasm")]
fn on_one_thread(work: impl FnOnce()) {
    work();
}

#[test]
fn scratch_is_reused_and_small() {
    let case = Int8Case::random(4, 24, 8, 3);
    let chain = case.chain(Isa::int8()[0]).unwrap();
    let size = Size {
        width: 700,
        height: 300,
    };
    let (input, mut output) = (frame(4, size, 1), vec![0.0; 6 * 300 * 700]);
    let scratch = Scratch::default();
    let run = |output: &mut [f32]| {
        on_one_thread(|| {
            chain.run(
                &input,
                output,
                size,
                chain.tiling(Size {
                    width: 700,
                    height: 300,
                }),
                &scratch,
            )
        });
    };
    run(&mut output);
    let (first, bytes) = (output.clone(), scratch.bytes());
    assert!(bytes > 0 && bytes < 2 << 20, "{bytes} bytes");
    run(&mut output);
    assert!(first == output && bytes == scratch.bytes());
}

#[test]
fn chains_that_kernels_cannot_run_are_refused() {
    let broken = |spoil: &dyn Fn(&mut Int8Case)| {
        let mut case = Int8Case::random(4, 8, 5, 2);
        spoil(&mut case);
        case.chain(Isa::Portable).err().expect("must be refused")
    };
    assert!(broken(&|c| c.layers.truncate(1)).contains("two layers"));
    assert!(broken(&|c| c.layers[1].outputs = 7).contains("layer 1"));
    assert!(broken(&|c| c.layers[0].outputs = 7).contains("multiple of 8"));
    assert!(broken(&|c| c.layers[2].kernel.truncate(5)).contains("layer 2"));
    assert!(broken(&|c| c.layers[2].multiplier[1] = 0.0).contains("filter 1"));
    assert!(broken(&|c| c.layers[2].multiplier[1] = f32::NAN).contains("filter 1"));
    assert!(broken(&|c| c.layers[2].multiplier[1] = 1e9).contains("filter 1"));
    assert!(broken(&|c| c.layers[2].bias[1] = i32::MAX).contains("too large"));
    assert!(broken(&|c| c.layers[2].requantise.skip = None).contains("skip"));
    assert!(broken(&|c| c.layers[1].zero_point = 3).contains("zero point"));
    assert!(broken(&|c| c.input.scale = f32::NAN).contains("scale"));
    let mut layers = f32_layers(4, 8, 3, 1);
    layers[2].bias.pop();
    assert!(F32Chain::new(&layers, Isa::Portable).err().unwrap().contains("biases"));
    let foreign = if cfg!(target_arch = "x86_64") {
        Isa::Neon
    } else {
        Isa::Avx2
    };
    assert!(
        F32Chain::new(&f32_layers(4, 8, 3, 1), foreign)
            .err()
            .unwrap()
            .contains("no f32 kernels")
    );
    assert!(
        Int8Case::random(4, 8, 3, 1)
            .chain(foreign)
            .err()
            .unwrap()
            .contains("no int8 kernels")
    );
}

#[test]
fn chains_of_few_filters_leave_amx_alone() {
    for filters in [8, 16, 24] {
        let (isa, first) = (Isa::int8_for(filters), Isa::int8()[0]);
        assert!(Isa::int8().contains(&isa));
        assert_eq!(isa != first, first == Isa::Amx && filters == 8);
    }
}

/// Reports the missing instruction sets, whose kernels no other test here has run.
#[test]
fn instruction_sets_that_this_processor_lacks_are_noted() {
    let of_architecture: &[Isa] = if cfg!(target_arch = "x86_64") {
        &[Isa::Avx2, Isa::Avx512, Isa::Avx512Vnni, Isa::Amx]
    } else if cfg!(target_arch = "aarch64") {
        &[Isa::Neon, Isa::NeonDotprod, Isa::NeonI8mm]
    } else {
        &[]
    };
    let here = [Isa::int8(), Isa::f32()].concat();
    for isa in of_architecture.iter().filter(|isa| !here.contains(isa)) {
        skip::or_fail("instruction sets", format!("this processor lacks {isa}"));
    }
}

#[cfg(feature = "peak")]
#[test]
fn every_instruction_set_but_the_portable_one_has_a_peak() {
    let duration = std::time::Duration::from_millis(1);
    for isa in Isa::int8() {
        assert_eq!(
            int8_peak(isa, duration).is_some_and(|rate| rate > 0.0),
            isa != Isa::Portable,
            "{isa}"
        );
    }
    for isa in Isa::f32() {
        assert_eq!(
            f32_peak(isa, duration).is_some_and(|rate| rate > 0.0),
            isa != Isa::Portable,
            "{isa}"
        );
    }
}
