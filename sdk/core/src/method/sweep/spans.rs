//! Spans of pixels in the rows of a tile's field, which bound where there is light.

/// A half-open range of pixels in a row. It is empty if the second bound is not greater than the first.
pub(super) type Span = [usize; 2];
pub(super) const NOWHERE: Span = [usize::MAX, 0];

/// Returns the least span that holds both.
#[inline(always)]
pub(super) fn join(a: Span, b: Span) -> Span {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Returns `span` with `by` pixels more on both sides.
pub(super) fn widened(span: Span, by: usize) -> Span {
    match span[0] < span[1] {
        true => [span[0] - by.min(span[0]), span[1] + by],
        false => NOWHERE,
    }
}

/// Widens the spans of rows by `by` pixels in all directions, into `wider`, as [`widen_down`].
pub(super) fn widen(spans: &[Span], wider: &mut Vec<Span>, by: usize) {
    widen_down(spans, wider, by);
    for span in wider {
        *span = widened(*span, by);
    }
}

/// Joins the span of each row with those of the rows up to `by` above and below, into `wider`. Allocates nothing if
/// `wider` has a capacity of 2·`by` more than there are rows.
pub(super) fn widen_down(spans: &[Span], wider: &mut Vec<Span>, by: usize) {
    wider.clear();
    wider.resize(by, NOWHERE);
    wider.extend_from_slice(spans);
    wider.resize(spans.len() + 2 * by, NOWHERE);
    // Each place holds the join of the places from itself on, of which there are up to twice as many in each turn.
    let mut joined = 1;
    while joined < 2 * by + 1 {
        let more = joined.min(2 * by + 1 - joined);
        for y in 0..wider.len() - more {
            wider[y] = join(wider[y], wider[y + more]);
        }
        joined += more;
    }
    wider.truncate(spans.len());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_spread_as_far_as_told_in_all_directions() {
        let mut state = 1u32;
        let mut random = |most: usize| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) as usize % most
        };
        for by in [0, 1, 2, 5, 10, 31] {
            let spans: Vec<Span> = (0..23)
                .map(|_| match random(3) {
                    0 => [random(40), 41 + random(40)],
                    _ => NOWHERE,
                })
                .collect();
            let mut wide = Vec::new();
            widen(&spans, &mut wide, by);
            for (y, wide) in wide.into_iter().enumerate() {
                let near = &spans[y - by.min(y)..(y + by + 1).min(spans.len())];
                let expected = near.iter().fold(NOWHERE, |all, span| join(all, *span));
                assert_eq!(wide, widened(expected, by), "{by} {y}");
            }
        }
    }
}
