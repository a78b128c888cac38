//! Packs the taps of int8 filters into runs whose sums fit 16 bits.
//!
//! A tap has the weights of four channels. The byte multiply adds the products of two of them, so a register has two
//! 16-bit sums of each pixel, and a run's sums are those of its taps. Activations are 0 to 255. A sum therefore fits if
//! the positive weights of its two channels over the run add up to at most 128, and the negative weights too: 128·255 =
//! 32,640. This is exact for all weights; the smaller they are, the longer the runs.

use crate::int8::{GROUP, Taps};

/// The most that the positive or the negative weights of a sum may add up to.
const MOST: i32 = 128;

/// The weights of a pair of filters at a tap.
type Weights = [[i8; GROUP]; 2];

/// The sums of the positive and of the negative weights of each 16-bit sum: two of each filter.
type Load = [i32; 8];

/// A tap: its place `(ky·groups + group)·3 + kx` and four weights of each filter of a pair. Before the taps of a run is
/// their number, and before the runs of a pair theirs, each followed by zeros.
pub(super) type Words = [i32; 3];

/// Returns the [`Words`] of all pairs of filters.
pub(super) fn pack(taps: &Taps<'_>) -> Vec<i32> {
    let mut words: Vec<Words> = Vec::new();
    for filter in (0..taps.outputs()).step_by(2) {
        let runs = runs(entries(taps, filter));
        words.push([runs.len() as i32, 0, 0]);
        for run in runs {
            words.push([run.len() as i32, 0, 0]);
            words.extend(run.into_iter().map(|(place, weights)| {
                let [first, second] = weights.map(|four| i32::from_le_bytes(four.map(|w| w as u8)));
                [place as i32, first, second]
            }));
        }
    }
    words.into_flattened()
}

/// Returns the places and weights of a pair of filters. A tap that is too large for a run of its own is two: its even
/// channels and its odd ones.
fn entries(taps: &Taps<'_>, filter: usize) -> Vec<(usize, Weights)> {
    let mut entries = Vec::new();
    for place in 0..9 * taps.groups() {
        let (ky, group, kx) = (place / 3 / taps.groups(), place / 3 % taps.groups(), place % 3);
        let weights = [filter, filter + 1].map(|filter| taps.group(filter, group, ky, kx));
        let parts = if fits(load(&weights)) {
            vec![weights]
        } else {
            vec![
                weights.map(|[a, _, c, _]| [a, 0, c, 0]),
                weights.map(|[_, b, _, d]| [0, b, 0, d]),
            ]
        };
        let parts = parts.into_iter().filter(|weights| *weights != Weights::default());
        entries.extend(parts.map(|weights| (place, weights)));
    }
    entries
}

/// Divides entries into few runs: each, from the largest on, into the fullest run that takes it.
fn runs(mut entries: Vec<(usize, Weights)>) -> Vec<Vec<(usize, Weights)>> {
    let fill = |load: Load| load.into_iter().max().unwrap_or(0);
    entries.sort_by_key(|(_, weights)| std::cmp::Reverse((fill(load(weights)), load(weights).iter().sum::<i32>())));
    let mut runs: Vec<(Load, Vec<_>)> = Vec::new();
    for (place, weights) in entries {
        let with = |(before, _): &(Load, _)| {
            let more = load(&weights);
            std::array::from_fn(|k| before[k] + more[k])
        };
        let best = (runs.iter_mut())
            .filter(|run| fits(with(run)))
            .max_by_key(|run| fill(with(run)));
        match best {
            Some(run) => {
                run.0 = with(run);
                run.1.push((place, weights));
            }
            None => runs.push((load(&weights), vec![(place, weights)])),
        }
    }
    runs.into_iter().map(|(_, run)| run).collect()
}

fn fits(load: Load) -> bool {
    load.into_iter().all(|sum| sum <= MOST)
}

fn load(weights: &Weights) -> Load {
    std::array::from_fn(|k| {
        let sign = if k % 2 == 0 { 1 } else { -1 };
        let two = &weights[k / 4][k / 2 % 2 * 2..][..2];
        two.iter().map(|w| (sign * i32::from(*w)).max(0)).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_keep_every_weight_and_fit_16_bits() {
        let mut seed = 1u32;
        let mut weight = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 24) as i8
        };
        let entries: Vec<(usize, Weights)> = (0..54)
            .map(|place| (place, std::array::from_fn(|_| std::array::from_fn(|_| weight() / 2))))
            .collect();
        let runs = runs(entries.clone());
        let mut packed = runs.concat();
        packed.sort_by_key(|(place, _)| *place);
        assert_eq!(packed, entries);
        assert!(runs.len() < entries.len());
        for run in runs {
            // The activations that make a sum largest and least.
            for sign in [1, -1] {
                for (filter, first) in [(0, 0), (0, 2), (1, 0), (1, 2)] {
                    let products = run.iter().flat_map(|(_, weights)| &weights[filter][first..first + 2]);
                    let sum: i32 = products.map(|w| 255 * (sign * i32::from(*w)).max(0)).sum();
                    assert!(sum <= i32::from(i16::MAX), "{sum}");
                }
            }
        }
    }
}
