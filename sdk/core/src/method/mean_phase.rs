//! The mean phase of a field. The constant phase of a method's field is arbitrary, and double phase wraps least around
//! 0.

use crate::parallel::{self, prelude::*};
use num_complex::{Complex32, Complex64};
use phasefront_kernels::wide;
use std::ops::Range;

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
        let turn = turn_of(plane);
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
pub(super) fn turn_of(values: &[Complex32]) -> Complex32 {
    turn(sum(&|part| sum_part(values, part), 0..values.len().div_ceil(PART)))
}

/// The number of values of a part, which one thread takes at a time.
const PART: usize = 1 << 14;

/// The sums of the parts of a field, which stay where the field does.
pub(super) struct Sums {
    /// (C, parts).
    parts: Vec<Complex64>,
    /// The number of values of a colour.
    size: usize,
}

impl Sums {
    /// Creates the sums of `colours` of `size` values, all 0.
    pub(super) fn new(colours: usize, size: usize) -> Self {
        Sums {
            parts: vec![Complex64::ZERO; colours * size.div_ceil(PART)],
            size,
        }
    }

    /// Sums the values of `colour` again where they differ from before. `differs` tells it of a range of values.
    /// Returns what [`turn_of`] returns, with the same bits.
    pub(super) fn turn_of(
        &mut self,
        colour: usize,
        values: &[Complex32],
        differs: impl Fn(Range<usize>) -> bool + Sync,
    ) -> Complex32 {
        let count = self.size.div_ceil(PART);
        let parts = &mut self.parts[colour * count..][..count];
        (parts.par_iter_mut().enumerate())
            .filter(|(part, _)| differs(part * PART..((part + 1) * PART).min(values.len())))
            .for_each(|(part, of_part)| *of_part = sum_part(values, part));
        turn(sum(&|part| parts[part], 0..count))
    }
}

/// Returns the factor that removes the phase of `sum`.
pub(super) fn turn(sum: Complex64) -> Complex32 {
    let turn = Complex64::from_polar(1.0, -sum.arg());
    Complex32::new(turn.re as f32, turn.im as f32)
}

/// Adds the sums of `parts` by repeated halving at fixed places, so that the result has the same bits on any number of
/// threads.
fn sum(of_part: &(impl Fn(usize) -> Complex64 + Sync), parts: Range<usize>) -> Complex64 {
    match parts.len() {
        0 => Complex64::ZERO,
        1 => of_part(parts.start),
        count => {
            let middle = parts.start + count.div_ceil(2);
            let halves = (|| sum(of_part, parts.start..middle), || sum(of_part, middle..parts.end));
            let (first, second) = parallel::join(halves.0, halves.1);
            first + second
        }
    }
}

/// Sums part `part` of the values.
fn sum_part(values: &[Complex32], part: usize) -> Complex64 {
    const LANES: usize = 16;
    let values = &values[part * PART..((part + 1) * PART).min(values.len())];
    wide!({
        let (runs, rest) = values.as_chunks::<LANES>();
        let mut sums = [Complex32::ZERO; LANES];
        for run in runs {
            for (sum, of) in sums.iter_mut().zip(run) {
                *sum += *of;
            }
        }
        let all = sums.into_iter().chain(rest.iter().copied());
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
            let turn = turn_of(wave);
            assert!(plane.iter().zip(wave).all(|(u, w)| *u == w * turn));
        }
    }

    #[test]
    fn kept_sums_give_the_turn_of_all_values() {
        let mut values: Vec<_> = (0..3 * PART + 17)
            .map(|i| Complex32::from_polar(1.0 + (i % 7) as f32, (i % 5) as f32))
            .collect();
        let mut sums = Sums::new(2, values.len());
        let mut turn =
            |values: &[Complex32], differs: &(dyn Fn(Range<usize>) -> bool + Sync)| sums.turn_of(1, values, differs);
        assert_eq!(turn(&values, &|_| true), turn_of(&values));
        for at in [PART, 3 * PART + 5] {
            values[at] = Complex32::new(0.0, 3e4);
            assert_eq!(turn(&values, &|part| part.contains(&at)), turn_of(&values));
        }
        values[0] = Complex32::new(0.0, -3e4);
        assert_ne!(turn(&values, &|_| false), turn_of(&values));
    }
}
