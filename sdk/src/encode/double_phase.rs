//! The double phase method, Eq. 7: one complex value A·exp(iφ) as two phases φ ± acos A, on the
//! two colours of a checkerboard, whose light sums to it.

use num_complex::Complex32;
use rayon::prelude::*;
use std::f32::consts::TAU;

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

/// [`encode_value`] on a stack of planes of `width` columns and `plane` values each.
pub fn encode(field: &[Complex32], width: usize, plane: usize, scale: f32, phase: &mut [f32]) {
    field
        .par_chunks_exact(width)
        .zip(phase.par_chunks_exact_mut(width))
        .enumerate()
        .for_each(|(row, (values, phases))| {
            let y = row % (plane / width);
            for (x, (value, phase)) in values.iter().zip(phases).enumerate() {
                *phase = encode_value(*value, x, y, scale);
            }
        });
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
