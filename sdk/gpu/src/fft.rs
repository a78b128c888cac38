//! Applies a filter in the Fourier domain of zero-padded planes in three dispatches: rows, columns with the filter
//! between their two transforms, and rows back. `paths` applies several filters and their adjoints. The counterpart of
//! [`phasefront_core::optics::fft`].
//!
//! A line is transformed in workgroup memory, which limits its length: to 4096 with 32 KiB.

mod paths;

use super::device::{Constants, Device, Dispatch};
use super::{GpuError, Result};
use num_complex::Complex32;
pub(super) use paths::{Paths, PathsJob};
use phasefront_core::Size;
use std::f64::consts::PI;
use std::fmt::Write;

/// The largest number of threads of a workgroup that every GPU supports.
const MOST_THREADS: usize = 256;
/// The values that a thread holds at a time if there are enough threads.
const PER_THREAD: usize = 8;

/// Returns one quadrant, `(W'/2 + 1, H'/2 + 1)`, of `factor`(kx, ky), times the transforms' 1/(H'·W').
pub(super) fn quadrant(
    Size {
        width: padded_width,
        height: padded_height,
    }: Size,
    factor: impl Fn(usize, usize) -> f32,
) -> Vec<Complex32> {
    let scale = 1.0 / (padded_height * padded_width) as f32;
    let rows = padded_height / 2 + 1;
    (0..(padded_width / 2 + 1) * rows)
        .map(|i| Complex32::new(scale * factor(i / rows, i % rows), 0.0))
        .collect()
}

/// The input of a convolution.
pub(super) struct Planes<'a> {
    /// (3, H, W). The filtered field replaces it.
    pub(super) field: &'a wgpu::Buffer,
    pub(super) size: Size,
    pub(super) padded: Size,
    /// One filter for all colours or three, including the factor 1/(H'·W'). Each is one quadrant, (W'/2 + 1, H'/2 + 1),
    /// if it is even in both frequencies, else (W', H').
    pub(super) factors: &'a [&'a [Complex32]],
    /// The factors that the colours are multiplied by when they are read, if any.
    pub(super) turn: Option<&'a wgpu::Buffer>,
}

/// A convolution of three planes, ready to run.
pub(super) struct Convolution {
    steps: [Dispatch; 3],
    filter: wgpu::Buffer,
}

/// The operations of a dispatch.
#[derive(Clone, Copy)]
struct Stage {
    length: usize,
    forward: bool,
    filter: bool,
    /// Whether the filter has the conjugate factors.
    conjugate: bool,
    inverse: bool,
    even: bool,
    /// Whether the result replaces the source.
    in_place: bool,
    /// Whether the result is added to what is there.
    add: bool,
    turn: bool,
}

/// Lines of three planes in one buffer. `places` holds the strides from plane to plane, from line to line and along a
/// line, and the length of a line.
struct Lines<'a> {
    buffer: &'a wgpu::Buffer,
    count: usize,
    places: [usize; 4],
}

impl<'a> Lines<'a> {
    /// The rows of planes of this size.
    fn rows(buffer: &'a wgpu::Buffer, Size { width, height }: Size) -> Self {
        Lines {
            buffer,
            count: height,
            places: [height * width, width, 1, width],
        }
    }

    /// The columns of planes of this size.
    fn columns(buffer: &'a wgpu::Buffer, Size { width, height }: Size) -> Self {
        Lines {
            buffer,
            count: width,
            places: [height * width, 1, width, height],
        }
    }
}

/// The resources that the dispatches of a filter share.
struct Shared<'a> {
    device: &'a Device,
    filter: &'a wgpu::Buffer,
    /// The stride between the filters of two colours, or 0 if one filter serves all.
    filter_plane: usize,
    turn: &'a wgpu::Buffer,
}

impl Convolution {
    pub(super) fn new(device: &Device, planes: &Planes<'_>) -> Result<Self> {
        let Planes { size, padded, .. } = *planes;
        let spectra = spectra_size(size, padded);
        let one = planes.factors[0].len();
        let table: Vec<Complex32> = planes.factors.concat();
        let table = device.table("a filter", bytemuck::cast_slice(&table))?;
        let rows = device.buffer("spectra", 24 * spectra.pixels())?;
        let row_roots = roots(device, padded.width)?.buffer;
        let column_roots = roots(device, padded.height)?.buffer;
        let [row, column, back] = Stage::of(padded, is_even(one, padded), planes.turn.is_some());
        let shared = Shared {
            device,
            filter: &table.buffer,
            filter_plane: if planes.factors.len() > 1 { one } else { 0 },
            turn: planes.turn.unwrap_or(&row_roots),
        };
        let frame = || Lines::rows(planes.field, size);
        let across = || Lines::rows(&rows, spectra);
        let down = |buffer| Lines::columns(buffer, spectra);
        let steps = [
            shared.step("rows", row, &row_roots, (frame(), across()))?,
            // In place: the program reads the result's buffer and ignores the one bound as its source.
            shared.step("columns", column, &column_roots, (down(&column_roots), down(&rows)))?,
            shared.step("rows back", back, &row_roots, (across(), frame()))?,
        ];
        Ok(Convolution {
            steps,
            filter: table.buffer,
        })
    }

    /// Replaces the filter by another with as many factors, which holds from the next submission on.
    pub(super) fn set_filter(&self, device: &Device, factors: &[&[Complex32]]) {
        let table = factors.concat();
        device.write(&self.filter, 0, bytemuck::cast_slice(&table));
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.steps.iter().for_each(|step| step.run(pass));
    }
}

/// Returns the size of a plane whose rows are transformed and padded.
fn spectra_size(size: Size, padded: Size) -> Size {
    Size {
        width: padded.width,
        height: size.height,
    }
}

/// Returns whether a filter of `values` values is one quadrant.
fn is_even(values: usize, padded: Size) -> bool {
    values == (padded.height / 2 + 1) * (padded.width / 2 + 1)
}

/// Creates a table of exp(2πi j/n) for each j below `n`.
fn roots(device: &Device, n: usize) -> Result<Constants> {
    let root = |j: usize| {
        let (sin, cos) = (2.0 * PI * j as f64 / n as f64).sin_cos();
        Complex32::new(cos as f32, sin as f32)
    };
    let roots: Vec<Complex32> = (0..n).map(root).collect();
    device.table("roots of unity", bytemuck::cast_slice(&roots))
}

impl Shared<'_> {
    /// Creates the dispatch of `stage` from the lines `from` to as many lines `to`.
    fn step(
        &self,
        what: &str,
        stage: Stage,
        roots: &wgpu::Buffer,
        (from, to): (Lines<'_>, Lines<'_>),
    ) -> Result<Dispatch> {
        let (device, lines) = (self.device, to.count);
        let together = stage.lines_together(device)?;
        let numbers = [&[lines], &from.places[..], &to.places, &[self.filter_plane]].concat();
        let mut numbers: Vec<u32> = numbers.into_iter().map(|n| n as u32).collect();
        numbers.resize(12, 0);
        let numbers = device.constants("lines", bytemuck::cast_slice(&numbers))?;
        let program = device.program(what, stage.source(together), "convolve");
        let arguments = [
            (0, numbers.buffer.as_entire_binding()),
            (1, roots.as_entire_binding()),
            (2, from.buffer.as_entire_binding()),
            (3, to.buffer.as_entire_binding()),
            (4, self.filter.as_entire_binding()),
            (5, self.turn.as_entire_binding()),
        ];
        program.on(device, &arguments, [lines.div_ceil(together), 3, 1])
    }
}

impl Stage {
    /// Returns the stages for rows, columns and rows back. `even` means that the filter is one quadrant, `turn` that
    /// the colours are turned when they are read.
    fn of(padded: Size, even: bool, turn: bool) -> [Stage; 3] {
        let row = Stage {
            length: padded.width,
            forward: true,
            filter: false,
            conjugate: false,
            inverse: false,
            even,
            in_place: false,
            add: false,
            turn,
        };
        let column = Stage {
            length: padded.height,
            filter: true,
            inverse: true,
            in_place: true,
            turn: false,
            ..row
        };
        let back = Stage {
            forward: false,
            inverse: true,
            turn: false,
            ..row
        };
        [row, column, back]
    }

    /// Returns the number of lines that a workgroup transforms: four columns if they fit, because a memory access reads
    /// four values at a time.
    fn lines_together(&self, device: &Device) -> Result<usize> {
        let most = device.limits().max_compute_workgroup_storage_size as usize;
        let wanted: &[usize] = if self.filter { &[4, 2, 1] } else { &[1] };
        let fits = |lines: &&usize| **lines * self.length * 8 <= most;
        wanted.iter().find(fits).copied().ok_or_else(|| {
            GpuError::Refused(format!(
                "lines of {} values do not fit the {most} bytes of workgroup memory of {}; smaller frames or distances are right",
                self.length,
                device.name()
            ))
        })
    }

    /// Returns the source of the program for this number of lines per workgroup.
    fn source(&self, lines: usize) -> String {
        let Stage { length, .. } = *self;
        let each = length
            .div_ceil(PER_THREAD)
            .next_power_of_two()
            .clamp(32, MOST_THREADS / lines);
        let header = format!(
            "const N: u32 = {length}u;
            const LINES: u32 = {lines}u;
            const EACH: u32 = {each}u;
            const THREADS: u32 = {threads}u;
            const FORWARD: bool = {};
            const FILTER: bool = {};
            const CONJUGATE: bool = {};
            const INVERSE: bool = {};
            const EVEN: bool = {};
            const IN_PLACE: bool = {};
            const ADD: bool = {};
            const TURN: bool = {};
            ",
            self.forward,
            self.filter,
            self.conjugate,
            self.inverse,
            self.even,
            self.in_place,
            self.add,
            self.turn,
            threads = each * lines,
        );
        header + include_str!("fft.wgsl") + &stages(length, each)
    }
}

/// Factors a length into radices: first those with their own butterfly, then other primes.
fn radices(mut n: usize) -> Vec<usize> {
    let mut all = Vec::new();
    for radix in [7, 5, 4, 3, 2] {
        while n.is_multiple_of(radix) {
            all.push(radix);
            n /= radix;
        }
    }
    let mut prime = 11;
    while n > 1 {
        while n.is_multiple_of(prime) {
            all.push(prime);
            n /= prime;
        }
        prime += 2;
        if prime * prime > n && n > 1 {
            all.push(n);
            n = 1;
        }
    }
    all
}

/// Returns the stages of a transform of length `n` by `each` threads, and `transform`, which runs them. A thread keeps
/// the results of its butterflies until all threads have read.
fn stages(n: usize, each: usize) -> String {
    let mut text = String::new();
    let mut calls = String::new();
    let mut done = 1;
    for (i, radix) in radices(n).into_iter().enumerate() {
        let _ = writeln!(calls, "    stage{i}(t, l, sign);");
        let _ = writeln!(text, "\nfn stage{i}(t: u32, l: u32, sign: f32) {{");
        match radix {
            2 | 3 | 4 | 5 | 7 => butterflies(&mut text, n, each, radix, done),
            _ => direct(&mut text, n, each, radix, done),
        }
        text += "}\n";
        done *= radix;
    }
    if radices(n).len() <= 1 {
        // A single butterfly needs no roots, but an argument that no program reads cannot be bound.
        calls += "    _ = roots[0];\n";
    }
    text + "\nfn transform(t: u32, l: u32, sign: f32) {\n" + &calls + "}\n"
}

/// Writes a stage of radix `r` after stages of product `done`: butterfly j reads j + q·n/r, multiplies by the root q·(j
/// mod done)/(done·r), and writes ⌊j/done⌋·done·r + (j mod done) + q·done.
fn butterflies(text: &mut String, n: usize, each: usize, r: usize, done: usize) {
    let count = n / r;
    let rounds = count.div_ceil(each);
    let step = n / (done * r);
    for k in 0..rounds {
        let mut values = Vec::new();
        for q in 0..r {
            let value = format!("row[(j + {}u) * LINES + l]", q * count);
            values.push(match q * (done - 1) {
                0 => value,
                _ => format!("times({value}, root((j % {done}u) * {}u, sign))", q * step),
            });
        }
        let _ = writeln!(
            text,
            "    var v{k}: array<vec2f, {r}>;
    {{ let j = t + {}u; if (j < {count}u) {{ v{k} = dft{r}({}, sign); }} }}",
            k * each,
            values.join(", ")
        );
    }
    *text += "    workgroupBarrier();\n";
    for k in 0..rounds {
        let _ = writeln!(
            text,
            "    {{ let j = t + {}u; if (j < {count}u) {{ let at = (j / {done}u) * {}u + j % {done}u;",
            k * each,
            done * r
        );
        for q in 0..r {
            let _ = writeln!(text, "        row[(at + {}u) * LINES + l] = v{k}[{q}];", q * done);
        }
        *text += "    } }\n";
    }
    *text += "    workgroupBarrier();\n";
}

/// Writes a stage for a prime without a butterfly. It computes each value as a direct sum.
fn direct(text: &mut String, n: usize, each: usize, r: usize, done: usize) {
    let rounds = n.div_ceil(each);
    for k in 0..rounds {
        let _ = writeln!(
            text,
            "    var v{k} = vec2f(0);
    {{ let o = t + {start}u; if (o < {n}u) {{
        let place = o % {span}u;
        let j = (o / {span}u) * {done}u + place % {done}u;
        for (var m = 0u; m < {r}u; m++) {{
            v{k} += times(row[(j + m * {count}u) * LINES + l], root((m * place * {step}u) % {n}u, sign));
        }}
    }} }}",
            start = k * each,
            span = done * r,
            count = n / r,
            step = n / (done * r),
        );
    }
    *text += "    workgroupBarrier();\n";
    for k in 0..rounds {
        let _ = writeln!(
            text,
            "    {{ let o = t + {}u; if (o < {n}u) {{ row[o * LINES + l] = v{k}; }} }}",
            k * each
        );
    }
    *text += "    workgroupBarrier();\n";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radices_multiply_to_the_length() {
        for n in 1..5000 {
            let all = radices(n);
            assert_eq!(all.iter().product::<usize>(), n);
            assert!(
                all.iter().all(|&r| r == 4 || (2..r).all(|d| r % d != 0)),
                "{n}: {all:?}"
            );
        }
    }
}

#[cfg(test)]
mod twins {
    #![allow(clippy::unwrap_used)]
    use super::super::device::testing::{apart, device, field, read, run, upload};
    use super::*;
    use phasefront_core::encode::band_limit::BandLimit;
    use phasefront_core::optics::aperture::{self, Aperture, Opening};
    use phasefront_core::optics::asm::{Padding, Propagator};

    const WAVELENGTHS_M: [f64; 3] = [638e-9, 520e-9, 450e-9];

    fn check(size: Size, distance_m: f64, padding: Padding) {
        let device = device();
        let plans = Propagator::for_colours(size, 8e-6, &WAVELENGTHS_M, distance_m, padding).unwrap();
        let given = field(size.height * size.width);
        let buffer = upload(&device, &given);
        let turns = [(0.6, 0.8), (-1.0, 0.0), (0.0, 1.0)].map(|(re, im)| Complex32::new(re, im));
        let planes = Planes {
            field: &buffer,
            size,
            padded: plans[0].padded_size(),
            factors: &plans.iter().map(|plan| plan.transfer().factors()).collect::<Vec<_>>(),
            turn: Some(&upload(&device, &turns)),
        };
        let convolution = device.guarded(|| Convolution::new(&device, &planes)).unwrap();
        run(&device, |pass| convolution.run(pass));
        let mut expected = given;
        let mut scratch = plans[0].scratch();
        let colours = expected.chunks_exact_mut(size.height * size.width);
        for ((plan, plane), turn) in plans.iter().zip(colours).zip(turns) {
            plane.iter_mut().for_each(|value| *value *= turn);
            plan.propagate(plane, &mut scratch);
        }
        let worst = apart(&read(&device, &buffer, expected.len()), &expected);
        assert!(worst < 1e-4, "{size:?}, {distance_m} m, {padding:?}: {worst}");
    }

    #[test]
    fn propagation_agrees_with_the_cpu() {
        for (size, distance_m, padding) in [
            (Size { width: 47, height: 61 }, 6e-3, Padding::Reach),
            (Size { width: 47, height: 61 }, -20e-3, Padding::Double),
            // 7 and 49 have their own butterflies; 11, 13 and 61 do not.
            (Size { width: 22, height: 49 }, 1e-3, Padding::Circular),
            (Size { width: 26, height: 61 }, 1e-3, Padding::Circular),
            (Size { width: 1, height: 1 }, 1e-3, Padding::Reach),
            (
                Size {
                    width: 384,
                    height: 384,
                },
                6e-3,
                Padding::Reach,
            ),
            (
                Size {
                    width: 960,
                    height: 540,
                },
                10e-3,
                Padding::Reach,
            ),
        ] {
            check(size, distance_m, padding);
        }
    }

    #[test]
    fn aperture_and_band_limit_agree_with_the_cpu() {
        let device = device();
        for size in [
            Size { width: 47, height: 61 },
            Size { width: 96, height: 48 },
            Size { width: 5, height: 7 },
            Size { width: 2, height: 3 },
            Size { width: 6, height: 1 },
            Size { width: 61, height: 4 },
            Size { width: 1, height: 1 },
            Size {
                width: 384,
                height: 384,
            },
            Size {
                width: 960,
                height: 540,
            },
        ] {
            let plans = (
                Aperture::new(size, Opening::centred(0.8)).unwrap(),
                BandLimit::new(size, 1.0).unwrap(),
            );
            let round = |kx: usize, ky: usize| {
                let (fx, fy) = (kx as f64 / size.width as f64, ky as f64 / size.height as f64);
                f32::from(u8::from(aperture::passes(fx, fy, 0.8)))
            };
            let limit = |kx, ky| f32::from(u8::from(plans.1.keeps(kx, ky)));
            for (name, kept) in [("aperture", quadrant(size, round)), ("limit", quadrant(size, limit))] {
                let given = field(size.height * size.width);
                let buffer = upload(&device, &given);
                let planes = Planes {
                    field: &buffer,
                    size,
                    padded: size,
                    factors: &[&kept],
                    turn: None,
                };
                let convolution = device.guarded(|| Convolution::new(&device, &planes)).unwrap();
                run(&device, |pass| convolution.run(pass));
                let mut expected = given;
                for plane in expected.chunks_exact_mut(size.height * size.width) {
                    match name {
                        "aperture" => plans.0.filter(plane, &mut plans.0.scratch()),
                        _ => plans.1.filter(plane, &mut plans.1.scratch()),
                    }
                }
                let worst = apart(&read(&device, &buffer, expected.len()), &expected);
                assert!(worst < 1e-4, "{name} {size:?}: {worst}");
            }
        }
    }

    #[test]
    fn a_line_that_does_not_fit_is_refused() {
        let device = device();
        let buffer = upload(&device, &field(9000));
        let size = Size { width: 9000, height: 1 };
        let planes = Planes {
            field: &buffer,
            size,
            padded: size,
            factors: &[&quadrant(size, |_, _| 1.0)],
            turn: None,
        };
        let refused = device.guarded(|| Convolution::new(&device, &planes)).err();
        assert!(refused.unwrap().to_string().contains("9000"));
    }
}
