//! The double phase method, Eq. 7. It represents one complex value A·exp(iφ) by two phases φ ± acos A on the two
//! colours of a checkerboard, whose light adds up to the value.

use crate::Bounds;
use crate::display::response::{Response, wrap};
use num_complex::Complex32;
use phasefront_kernels::wide;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Returns the phase of one value at pixel (x, y), in \[0, 2π): φ + acos A if x + y is even, φ − acos A if it is odd. A
/// is the amplitude divided by `scale`, clamped to 1. A scale of 0 means darkness.
pub fn encode_value(value: Complex32, x: usize, y: usize, scale: f32) -> f32 {
    let amplitude = if scale > 0.0 {
        (value.norm() / scale).at_most(1.0)
    } else {
        0.0
    };
    let half = amplitude.acos();
    let phase = value.im.atan2(value.re) + if (x + y).is_multiple_of(2) { half } else { -half };
    wrap(phase)
}

/// Returns the largest |u|² of a row, or 0 for an empty row.
pub fn max_norm_sqr(row: &[Complex32]) -> f32 {
    wide!(largest(row))
}

#[inline(always)]
fn largest(row: &[Complex32]) -> f32 {
    // Several parallel maxima let the loop vectorise.
    let (runs, rest) = row.as_chunks::<16>();
    let mut most = [0.0f32; 16];
    for run in runs {
        for (most, value) in most.iter_mut().zip(run) {
            *most = value.norm_sqr().at_least(*most);
        }
    }
    let rest = rest.iter().map(Complex32::norm_sqr);
    rest.chain(most).fold(0.0, |most, v| v.at_least(most))
}

/// Encodes row `y` of a plane like [`encode_value`], to 1e-5 rad.
pub fn encode_row(values: &[Complex32], y: usize, scale: f32, phases: &mut [f32]) {
    wide!(encode_run(values, y, scale, phases));
}

/// Encodes a run of row `y` that begins in an even column.
#[inline(always)]
fn encode_run(values: &[Complex32], y: usize, scale: f32, phases: &mut [f32]) {
    let inverse = if scale > 0.0 { 1.0 / scale } else { 0.0 };
    // The sign of acos on the two colours of the checkerboard.
    let sign = if y.is_multiple_of(2) { 1.0 } else { -1.0 };
    let signs: [f32; 16] = std::array::from_fn(|x| if x % 2 == 0 { sign } else { -sign });
    let (runs, rest) = values.as_chunks::<16>();
    let (phase_runs, phase_rest) = phases.as_chunks_mut::<16>();
    for (values, phases) in runs.iter().zip(phase_runs) {
        for ((value, phase), sign) in values.iter().zip(phases).zip(signs) {
            *phase = encode_one(*value, inverse, sign);
        }
    }
    for ((value, phase), sign) in rest.iter().zip(phase_rest).zip(signs) {
        *phase = encode_one(*value, inverse, sign);
    }
}

/// Applies [`encode_row`] and [`Response::level`] in one pass, so that phases never leave the cache. The row begins at
/// value `first` of the stack (C, H, W).
pub fn encode_row_levels(
    values: &[Complex32],
    y: usize,
    scale: f32,
    response: &Response,
    first: usize,
    levels: &mut [u8],
) {
    wide!(levels_by(values, response, first, levels, |values, phases| encode_run(
        values, y, scale, phases
    )));
}

/// Writes the phases of the values of a row, in \[0, 2π), to 1e-6 rad. The phase of 0 is 0.
pub fn phase_row(values: &[Complex32], phases: &mut [f32]) {
    wide!(phase_run(values, phases));
}

/// Applies [`phase_row`] and [`Response::level`] in one pass. The row begins at value `first` of the stack (C, H, W).
pub fn phase_row_levels(values: &[Complex32], response: &Response, first: usize, levels: &mut [u8]) {
    wide!(levels_by(values, response, first, levels, phase_run));
}

/// Writes the levels of the phases that `phases_of` computes for runs of a row.
#[inline(always)]
fn levels_by(
    values: &[Complex32],
    response: &Response,
    first: usize,
    levels: &mut [u8],
    phases_of: impl Fn(&[Complex32], &mut [f32]),
) {
    /// An even length starts each run on the same colour of the checkerboard as its row.
    const RUN: usize = 256;
    let mut phases = [0.0; RUN];
    let runs = values.chunks(RUN).zip(levels.chunks_mut(RUN));
    for (run, (values, levels)) in runs.enumerate() {
        let phases = &mut phases[..values.len()];
        phases_of(values, phases);
        response.levels(phases, first + run * RUN, levels);
    }
}

#[inline(always)]
fn phase_run(values: &[Complex32], phases: &mut [f32]) {
    for (value, phase) in values.iter().zip(phases) {
        *phase = one_turn(atan2(value.im, value.re));
    }
}

/// Returns the phase of one value. It has no branches, so loops over it vectorise.
#[inline(always)]
fn encode_one(value: Complex32, inverse: f32, sign: f32) -> f32 {
    let amplitude = (value.norm_sqr().sqrt() * inverse).at_most(1.0);
    one_turn(atan2(value.im, value.re) + sign * acos(amplitude))
}

/// Maps a phase from [−3π/2, 3π/2] to \[0, 2π).
#[inline(always)]
fn one_turn(phase: f32) -> f32 {
    let turned = if phase < 0.0 { phase + TAU } else { phase };
    if turned < TAU { turned } else { 0.0 }
}

/// Returns the acos of a number in \[0, 1] to 1e-6: √(1 − a) times a polynomial (Abramowitz and Stegun, 4.4.46).
#[inline(always)]
fn acos(a: f32) -> f32 {
    const C: [f32; 8] = [
        FRAC_PI_2,
        -0.214_598_8,
        0.088_978_99,
        -0.050_174_305,
        0.030_891_88,
        -0.017_088_126,
        0.006_670_09,
        -0.001_262_491_1,
    ];
    let polynomial = C.iter().rev().fold(0.0, |sum, c| sum * a + c);
    (1.0 - a).at_least(0.0).sqrt() * polynomial
}

/// Returns the angle of (x, y) to 1e-6, or 0 for the origin, from a polynomial on the octant (Abramowitz and Stegun,
/// 4.4.49) and reflections.
#[inline(always)]
fn atan2(y: f32, x: f32) -> f32 {
    const C: [f32; 9] = [
        1.0,
        -0.333_331_45,
        0.199_935_5,
        -0.142_089,
        0.106_562_64,
        -0.075_289_64,
        0.042_909_614,
        -0.016_165_737,
        0.002_866_225_7,
    ];
    let (ax, ay) = (x.abs(), y.abs());
    let slope = ax.at_most(ay) / ax.at_least(ay).at_least(f32::MIN_POSITIVE);
    let square = slope * slope;
    let octant = slope * C.iter().rev().fold(0.0, |sum, c| sum * square + c);
    let quadrant = if ay > ax { FRAC_PI_2 - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    if y < 0.0 { -half } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Size;
    use crate::display::response::per_pixel::{self, PerPixel};

    #[test]
    fn the_two_phases_sum_to_the_value() {
        for (re, im) in [(0.3, 0.4), (-0.9, 0.1), (0.0, 0.0), (0.0, -1.0), (1.0, 0.0)] {
            let value = Complex32::new(re, im);
            let even = encode_value(value, 0, 0, 1.0);
            let odd = encode_value(value, 1, 0, 1.0);
            let sum = (Complex32::from_polar(1.0, even) + Complex32::from_polar(1.0, odd)) / 2.0;
            assert!((sum - value).norm() < 1e-6, "{value}: {sum}");
            assert!((0.0..TAU).contains(&even) && (0.0..TAU).contains(&odd));
        }
    }

    #[test]
    fn the_largest_amplitude_is_found_wherever_it_stands() {
        for n in [0, 1, 15, 16, 40] {
            for at in 0..n {
                let mut row = vec![Complex32::new(0.1, -0.2); n];
                row[at] = Complex32::new(-0.3, 0.4);
                assert!((max_norm_sqr(&row) - 0.25).abs() < 1e-6);
            }
            assert_eq!(max_norm_sqr(&vec![Complex32::ZERO; n]), 0.0);
        }
    }

    #[test]
    fn a_zero_scale_is_dark_and_tiny_negative_phases_stay_in_range() {
        let even = encode_value(Complex32::new(1.0, 0.0), 0, 0, 0.0);
        let odd = encode_value(Complex32::new(1.0, 0.0), 1, 0, 0.0);
        let sum = Complex32::from_polar(1.0, even) + Complex32::from_polar(1.0, odd);
        assert!(sum.norm() < 1e-6);
        assert_eq!(wrap(-1e-12), 0.0);
    }

    /// Returns a table whose curves differ from node to node.
    fn per_pixel(Size { width: w, height: h }: Size) -> Response {
        let (rows, columns) = per_pixel::nodes(Size { width: w, height: h }, 20);
        let steepness = |node: usize| 20.0 + (node % 11) as f32;
        let levels: Vec<f32> = (0..3 * rows * columns * 9)
            .map(|i| (i % 9) as f32 * steepness(i / 9))
            .collect();
        let turns = vec![6.0; 3 * rows * columns];
        let table = PerPixel::new(Size { width: w, height: h }, 20, 8, &levels, &turns);
        Response::PerPixel(table.expect("a table").into())
    }

    #[test]
    fn the_fast_forms_agree_with_the_value_by_value_one() {
        let (h, w) = (7, 301);
        let field: Vec<_> = (0..3 * h * w)
            .map(|i| {
                let t = i as f32;
                match i % 50 {
                    0 => Complex32::ZERO,
                    1 => Complex32::new(-0.5, 0.0),
                    2 => Complex32::new(0.0, -0.5),
                    3 => Complex32::new(1e-20, -1e-20),
                    _ => Complex32::from_polar(0.6 + 0.6 * (t * 0.37).sin(), t * 0.11),
                }
            })
            .collect();
        for scale in [1.0, 0.7, 0.0] {
            let mut phase = vec![0.0; field.len()];
            let rows = field.chunks_exact(w).zip(phase.chunks_exact_mut(w));
            for (row, (values, phases)) in rows.enumerate() {
                encode_row(values, row % h, scale, phases);
            }
            for (i, (value, phase)) in field.iter().zip(&phase).enumerate() {
                let exact = encode_value(*value, i % w, i / w % h, scale);
                let apart = (exact - phase).abs();
                // acos is steep at full light, where rounding the amplitude changes it by up to 1e-3.
                let most = if value.norm() > 0.999 * scale && scale > 0.0 {
                    1e-3
                } else {
                    1e-5
                };
                assert!(apart.min(TAU - apart) < most, "{value} {exact} {phase}");
                assert!((0.0..TAU).contains(phase));
            }
            for response in [
                Response::Linear { bits: 8 },
                Response::lut(std::array::from_fn(|i| 255 - i as u8)),
                per_pixel(Size { width: w, height: h }),
            ] {
                let mut fused = vec![0; field.len()];
                let rows = field.chunks_exact(w).zip(fused.chunks_exact_mut(w));
                for (row, (values, levels)) in rows.enumerate() {
                    encode_row_levels(values, row % h, scale, &response, row * w, levels);
                }
                assert!((phase.iter().zip(&fused).enumerate()).all(|(at, (p, l))| response.level(*p, at) == *l));
            }
        }
    }
}
