//! The double phase method, Eq. 7: one complex value A·exp(iφ) as two phases φ ± acos A, on the
//! two colours of a checkerboard, whose light sums to it.

use crate::slm::Response;
use num_complex::Complex32;
use rayon::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// The two phases of one value at pixel (x, y): φ + acos A where x + y is even, φ − acos A where it is
/// odd, in \[0, 2π). A is the amplitude over `scale`, clamped to 1. A scale of 0 stands for darkness.
pub fn encode_value(value: Complex32, x: usize, y: usize, scale: f32) -> f32 {
    let amplitude = if scale > 0.0 {
        (value.norm() / scale).min(1.0)
    } else {
        0.0
    };
    let half = amplitude.acos();
    let phase = value.im.atan2(value.re)
        + if (x + y).is_multiple_of(2) {
            half
        } else {
            -half
        };
    wrap(phase)
}

/// `phase` brought to \[0, 2π).
pub fn wrap(phase: f32) -> f32 {
    let wrapped = phase.rem_euclid(TAU);
    // rem_euclid of a tiny negative number rounds up to 2π itself.
    if wrapped < TAU { wrapped } else { 0.0 }
}

/// The largest amplitude in `field`, 0 for an empty one.
pub fn max_amplitude(field: &[Complex32]) -> f32 {
    field
        .par_chunks(1 << 14)
        .map(|part| part.iter().map(Complex32::norm_sqr).fold(0.0, f32::max))
        .reduce(|| 0.0, f32::max)
        .sqrt()
}

/// [`encode_value`] on a stack of planes of `width` columns and `plane` values each, to 1e-5 rad.
pub fn encode(field: &[Complex32], width: usize, plane: usize, scale: f32, phase: &mut [f32]) {
    let height = plane / width;
    field
        .par_chunks_exact(width)
        .zip(phase.par_chunks_exact_mut(width))
        .enumerate()
        .for_each(|(row, (values, phases))| encode_run(values, row % height, scale, phases));
}

/// [`encode`] and [`Response::level`] in one sweep: phases never leave the cache.
pub fn encode_levels(
    field: &[Complex32],
    width: usize,
    plane: usize,
    scale: f32,
    response: &Response,
    levels: &mut [u8],
) {
    /// Even, so that each run starts on the colour of the checkerboard that its row starts on.
    const RUN: usize = 256;
    let height = plane / width;
    field
        .par_chunks_exact(width)
        .zip(levels.par_chunks_exact_mut(width))
        .enumerate()
        .for_each(|(row, (values, levels))| {
            let mut phases = [0.0; RUN];
            let runs = values.chunks(RUN).zip(levels.chunks_mut(RUN));
            for (run, (values, levels)) in runs.enumerate() {
                let phases = &mut phases[..values.len()];
                encode_run(values, row % height, scale, phases);
                response.levels(phases, row * width + run * RUN, levels);
            }
        });
}

/// [`encode_value`] from an even x on, in row `y`; without branches, so that it vectorises.
fn encode_run(values: &[Complex32], y: usize, scale: f32, phases: &mut [f32]) {
    let inverse = if scale > 0.0 { 1.0 / scale } else { 0.0 };
    for (x, (value, phase)) in values.iter().zip(phases).enumerate() {
        let amplitude = (value.norm_sqr().sqrt() * inverse).min(1.0);
        let half = acos(amplitude);
        let signed = if (x + y) & 1 == 0 { half } else { -half };
        let sum = atan2(value.im, value.re) + signed;
        // The sum lies in [−3π/2, 3π/2].
        let turned = if sum < 0.0 { sum + TAU } else { sum };
        *phase = if turned < TAU { turned } else { 0.0 };
    }
}

/// acos of a number in \[0, 1], to 1e-6: √(1 − a) times a polynomial (Abramowitz and Stegun, 4.4.46).
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
    (1.0 - a).max(0.0).sqrt() * polynomial
}

/// The angle of (x, y) to 1e-6, 0 for the origin: a polynomial on the octant (Abramowitz and Stegun,
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
    let slope = ax.min(ay) / ax.max(ay).max(f32::MIN_POSITIVE);
    let square = slope * slope;
    let octant = slope * C.iter().rev().fold(0.0, |sum, c| sum * square + c);
    let quadrant = if ay > ax { FRAC_PI_2 - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    if y < 0.0 { -half } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slm::per_pixel::{self, PerPixel};

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
    fn a_zero_scale_is_dark_and_tiny_negative_phases_stay_in_range() {
        let even = encode_value(Complex32::new(1.0, 0.0), 0, 0, 0.0);
        let odd = encode_value(Complex32::new(1.0, 0.0), 1, 0, 0.0);
        let sum = Complex32::from_polar(1.0, even) + Complex32::from_polar(1.0, odd);
        assert!(sum.norm() < 1e-6);
        assert_eq!(wrap(-1e-12), 0.0);
    }

    /// A table whose curves differ from node to node.
    fn per_pixel((h, w): (usize, usize)) -> Response {
        let (rows, columns) = per_pixel::nodes(h, w, 20);
        let steepness = |node: usize| 20.0 + (node % 11) as f32;
        let levels: Vec<f32> = (0..3 * rows * columns * 9)
            .map(|i| (i % 9) as f32 * steepness(i / 9))
            .collect();
        let turns = vec![6.0; 3 * rows * columns];
        let table = PerPixel::new(h, w, 20, 8, &levels, &turns);
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
            encode(&field, w, h * w, scale, &mut phase);
            for (i, (value, phase)) in field.iter().zip(&phase).enumerate() {
                let exact = encode_value(*value, i % w, i / w % h, scale);
                let apart = (exact - phase).abs();
                // acos is steep at full light, where the amplitude's own rounding is worth 1e-3.
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
                per_pixel((h, w)),
            ] {
                let mut fused = vec![0; field.len()];
                encode_levels(&field, w, h * w, scale, &response, &mut fused);
                assert!(
                    (phase.iter().zip(&fused).enumerate())
                        .all(|(at, (p, l))| response.level(*p, at) == *l)
                );
            }
        }
    }
}
