//! Implements the rounding of a chain's int8 input with comparisons.

use crate::device::{Constants, Device};
use crate::{GpuError, Result};
use phasefront_core::method::network::chain::{Chain, Quantisation};

/// Computes the smallest real numbers that round to each u8 value or above, for the first layer's rounding of the input
/// and for the last layer's. Comparisons are exact on every GPU; divisions are not.
pub(super) fn steps(device: &Device, chain: &Chain) -> Result<Constants> {
    let rounding = |i: usize| {
        let layer = &chain.layers[i];
        layer.quantisation.input.ok_or_else(|| {
            GpuError::Core(phasefront_core::runtime::error::Error::Network(format!(
                "layer {i}'s input is not rounded"
            )))
        })
    };
    let (first, last): (Quantisation, Quantisation) = (rounding(0)?, rounding(chain.layers.len() - 1)?);
    let concatenated = |real: f32| {
        if chain.concat_rounded_input {
            last.quantise(first.dequantise(first.quantise(real)))
        } else {
            last.quantise(real)
        }
    };
    let mut values = thresholds(|real| first.quantise(real));
    values.extend(thresholds(concatenated));
    device.table("roundings", bytemuck::cast_slice(&values))
}

/// For each k of 0 … 255 returns the smallest number that the nondecreasing function `rounded` maps to k or above, or
/// the largest number if there is none.
fn thresholds(rounded: impl Fn(f32) -> u8) -> Vec<f32> {
    // Map floats to integers of the same order.
    let float = |key: i32| f32::from_bits(if key < 0 { !key as u32 | 1 << 31 } else { key as u32 });
    let key = |real: f32| {
        let bits = real.to_bits();
        if bits >> 31 == 1 {
            !(bits & !(1 << 31)) as i32
        } else {
            bits as i32
        }
    };
    (0..=255u8)
        .map(|k| {
            let (mut low, mut high) = (i64::from(key(f32::MIN)), i64::from(key(f32::MAX)));
            while low < high {
                let middle = (low + high).div_euclid(2);
                if rounded(float(middle as i32)) >= k {
                    high = middle
                } else {
                    low = middle + 1
                }
            }
            float(high as i32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_round_as_the_quantiser_does() {
        for (scale, zero_point) in [(1.0 / 254.0, 127), (0.017, 31), (0.3, 0), (1e-3, 255)] {
            let q = Quantisation { scale, zero_point };
            let steps = thresholds(|real| q.quantise(real));
            for i in -40_000..40_000 {
                let real = i as f32 / 30_000.0;
                let found = steps.iter().rposition(|&step| real >= step);
                let expected = q.quantise(real);
                let least = steps.iter().rposition(|step| *step < f32::MAX);
                assert_eq!(found, Some(usize::from(expected)), "{real} {least:?}");
            }
            for &step in &steps[1..] {
                for real in [step.next_down(), step, step.next_up()] {
                    let found = steps.iter().rposition(|&step| real >= step);
                    assert_eq!(found, Some(usize::from(q.quantise(real))), "{real}");
                }
            }
        }
    }
}
