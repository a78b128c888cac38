//! Neighbouring values that are computed together, so that the compiler makes vectors of them.

pub(super) const LANES: usize = 8;
pub(super) type Lanes = [f32; LANES];

/// Returns the `values` from `at` on, and `beyond` after their end.
#[inline(always)]
pub(super) fn load<T: Copy>(values: &[T], at: usize, beyond: T) -> [T; LANES] {
    let mut lanes = [beyond; LANES];
    if let Some(values) = values.get(at..at + LANES) {
        lanes.copy_from_slice(values);
    } else {
        let values = &values[at.min(values.len())..];
        lanes.iter_mut().zip(values).for_each(|(lane, value)| *lane = *value);
    }
    lanes
}

/// Returns `value` of the lanes.
#[inline(always)]
pub(super) fn lanes(value: impl Fn(usize) -> f32) -> Lanes {
    let mut lanes = [0.0; LANES];
    for (i, lane) in lanes.iter_mut().enumerate() {
        *lane = value(i);
    }
    lanes
}

/// Writes the first lanes to `to`, as many as it has.
#[inline(always)]
pub(super) fn store(lanes: &Lanes, to: &mut [f32]) {
    if let Ok(to) = <&mut Lanes>::try_from(&mut *to) {
        *to = *lanes;
    } else {
        for (to, lane) in to.iter_mut().zip(lanes) {
            *to = *lane;
        }
    }
}
