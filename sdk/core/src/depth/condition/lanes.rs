//! Neighbouring values that are computed together, so that the compiler makes vectors of them, and a quick search for
//! the few values that need work.

/// The number of values of most vectors.
pub(super) const LANES: usize = 8;
pub(super) type Lanes<const N: usize = LANES> = [f32; N];

/// The number of values that a search passes over at a time.
pub(super) const STRIDE: usize = 32;

/// Returns whether any of the `values` is `wanted`. It looks at all of them, so the compiler makes vectors of them.
#[inline(always)]
pub(super) fn any<T>(values: &[T], wanted: impl Fn(&T) -> bool) -> bool {
    values.iter().fold(false, |any, value| any | wanted(value))
}

/// Returns the first of the `values` that is `wanted`.
#[inline(always)]
pub(super) fn first<T>(values: &[T], wanted: impl Fn(&T) -> bool) -> Option<usize> {
    let mut strides = values.chunks(STRIDE).enumerate();
    let (i, stride) = strides.find(|(_, stride)| any(stride, &wanted))?;
    Some(i * STRIDE + stride.iter().position(&wanted)?)
}

/// Returns the ranges of up to 32 of `length` values.
pub(super) fn strides(length: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
    (0..length)
        .step_by(STRIDE)
        .map(move |start| start..(start + STRIDE).min(length))
}

/// Returns the `values` from `at` on, and `beyond` after their end.
#[inline(always)]
pub(super) fn load<T: Copy, const N: usize>(values: &[T], at: usize, beyond: T) -> [T; N] {
    let mut lanes = [beyond; N];
    if let Some(values) = values.get(at..at + N) {
        lanes.copy_from_slice(values);
    } else {
        let values = &values[at.min(values.len())..];
        lanes.iter_mut().zip(values).for_each(|(lane, value)| *lane = *value);
    }
    lanes
}

/// Returns `value` of the lanes.
#[inline(always)]
pub(super) fn lanes<const N: usize>(value: impl Fn(usize) -> f32) -> Lanes<N> {
    let mut lanes = [0.0; N];
    for (i, lane) in lanes.iter_mut().enumerate() {
        *lane = value(i);
    }
    lanes
}

/// Writes the first lanes to `to`, as many as it has.
#[inline(always)]
pub(super) fn store<const N: usize>(lanes: &Lanes<N>, to: &mut [f32]) {
    if let Ok(to) = <&mut Lanes<N>>::try_from(&mut *to) {
        *to = *lanes;
    } else {
        for (to, lane) in to.iter_mut().zip(lanes) {
            *to = *lane;
        }
    }
}
