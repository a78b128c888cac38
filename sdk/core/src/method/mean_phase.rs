//! The mean phase of a field. The constant phase of a method's field is arbitrary, and double phase wraps least around
//! 0.

use num_complex::{Complex32, Complex64};
use phasefront_kernels::wide;
use rayon::prelude::*;

/// What happens to the mean phase of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MeanPhase {
    /// It stays as the method gives it.
    Kept,
    /// Each colour is rotated by it, so that its phase is centred on 0.
    Removed,
}

/// Rotates each of the `colours` planes of `field`, (C, H, W), by its mean phase arg Σu, so that its phase is centred
/// on 0.
pub fn remove_mean_phase(field: &mut [Complex32], colours: usize) {
    let size = field.len() / colours;
    if size == 0 {
        return;
    }
    for plane in field.chunks_exact_mut(size) {
        let turn = turn_of(plane, |value| value);
        plane.par_chunks_mut(PART).for_each(|part| {
            wide!({
                for value in part {
                    *value *= turn;
                }
            });
        });
    }
}

/// Returns the factor that removes the mean phase of a field with these values.
pub(super) fn turn_of<T: Copy + Sync>(values: &[T], value: impl Fn(T) -> Complex32 + Copy + Sync) -> Complex32 {
    let turn = Complex64::from_polar(1.0, -sum(values, value).arg());
    Complex32::new(turn.re as f32, turn.im as f32)
}

/// The number of values that one thread takes at a time.
const PART: usize = 1 << 14;

/// Sums values by repeated halving at fixed places, so that the result has the same bits on any number of threads.
fn sum<T: Copy + Sync>(values: &[T], value: impl Fn(T) -> Complex32 + Copy + Sync) -> Complex64 {
    if values.len() > PART {
        let (first, second) = values.split_at(values.len().div_ceil(PART).div_ceil(2) * PART);
        let (first, second) = rayon::join(|| sum(first, value), || sum(second, value));
        return first + second;
    }
    const LANES: usize = 16;
    wide!({
        let (runs, rest) = values.as_chunks::<LANES>();
        let mut sums = [Complex32::ZERO; LANES];
        for run in runs {
            for (sum, of) in sums.iter_mut().zip(run) {
                *sum += value(*of);
            }
        }
        let all = sums.into_iter().chain(rest.iter().map(|of| value(*of)));
        all.map(|v| Complex64::new(v.re.into(), v.im.into())).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_phase_is_taken_from_each_colour() {
        let mut field: Vec<_> = (0..3 * 20_000)
            .map(|i| Complex32::from_polar(1.0 + (i % 7) as f32, (i / 20_000) as f32 + 0.1 * (i % 3) as f32))
            .collect();
        let wave = field.clone();
        remove_mean_phase(&mut field, 3);
        for (plane, wave) in field.chunks_exact(20_000).zip(wave.chunks_exact(20_000)) {
            let sum: Complex32 = plane.iter().sum();
            assert!(sum.arg().abs() < 1e-4);
            let turn = turn_of(wave, |value| value);
            assert!(plane.iter().zip(wave).all(|(u, w)| *u == w * turn));
        }
    }
}
