//! Layers of the int8 chain in tiles of 4×4 outputs, by the minimal filtering F(4×4, 3×3) of Lavin and Gray, "Fast
//! Algorithms for Convolutional Neural Networks" (CVPR 2016), with a quarter of the products and the same bits.
//!
//! A tile's outputs are `Aᵀ[(G g Gᵀ) ⊙ (Bᵀ d B)]A` of its 6×6 inputs `d` and the weights `g`. The `G` of the paper has
//! fractions. Here its rows are scaled to integers so that the 36 transformed weights and inputs fit 16 bits:
//!
//! - `Bᵀ d B` of activations 0…255 is within ±68·255 = ±17,340;
//! - `G g Gᵀ` of weights −128…127 is within ±144·128 = ±18,432.
//!
//! A tile then has 576 = 24² times its sums. These are computed modulo 2³², where 9 has an inverse: multiplied by it,
//! they are 64 times the sums, which a shift divides. So each sum is exact whatever overflowed on the way, as long as
//! it is below [`LARGEST`].
//!
//! An instruction set computes [`Tiles::TILES`] adjacent tiles at once, one a lane, in any order of lanes. All
//! functions are inlined into its copy. Closures might not be, and would then lack its instructions, so loops take
//! their place.

use crate::OUTPUTS;
use crate::int8::{GROUP, Packed, SkipSum, Taps};
use crate::wavefront::{Geometry, LastRows, SlotsMut};
use std::ops::{Add, Range, Sub};

/// The outputs along each side of a tile.
pub(crate) const SIDE: usize = 4;
/// The inputs along each side of a tile.
pub(crate) const REACH: usize = SIDE + 2;
/// The products of a tile.
const POINTS: usize = REACH * REACH;
/// The most pairs of input channels that are transformed at once.
const MOST_PAIRS: usize = 24;
/// The most filters that an instruction set multiplies together.
const MOST_FILTERS: usize = 12;

/// The transform of weights: one row a point.
const G: [[i32; 3]; REACH] = [[6, 0, 0], [-4, -4, -4], [-4, 4, -4], [1, 2, 4], [1, -2, 4], [0, 0, 12]];
/// The inverse of 9 modulo 2³².
pub(crate) const NINTH: i32 = 954_437_177;
/// The binary logarithm of 576 / 9.
pub(crate) const SHIFT: u32 = 6;
/// The bound on the magnitude of a tile's sums.
pub(crate) const LARGEST: i64 = 1 << (31 - SHIFT);

/// The most tiles that an instruction set computes at once.
const MOST_TILES: usize = 8;

/// The kernels of an instruction set.
#[derive(Clone, Copy)]
#[allow(clippy::type_complexity)]
pub(crate) struct Kernels {
    /// [`Tiles::FILTERS`].
    pub(crate) filters: usize,
    /// [`hidden_rows`], compiled for the instruction set.
    pub(crate) hidden_rows: fn(&Packed, &Rows<'_>, Option<[&[u8]; SIDE]>, SlotsMut<'_, u8>, Geometry),
    /// [`last_rows`], compiled for the instruction set.
    pub(crate) last_rows: fn(&Packed, &Rows<'_>, LastRows<'_>, usize, Geometry),
}

/// The rows of a layer's input, from one above the tiles to one below them.
pub(crate) type Rows<'a> = [&'a [u8]; REACH];

/// Integers, whose operations wrap around.
pub(crate) trait Register: Copy + Add<Output = Self> + Sub<Output = Self> {
    fn zero() -> Self;
    fn times_4(self) -> Self;
}

/// Defines a [`Register`] `$name` of `$register`, which only code for its instruction set makes.
macro_rules! register {
    ($name:ident, $register:ty, $zero:expr, $add:ident, $sub:ident, |$value:ident| $times_4:expr) => {
        #[derive(Clone, Copy)]
        struct $name($register);

        impl std::ops::Add for $name {
            type Output = $name;

            #[inline(always)]
            #[allow(unused_unsafe, reason = "some instruction sets have safe operations")]
            fn add(self, other: $name) -> $name {
                // SAFETY: the register exists.
                $name(unsafe { $add(self.0, other.0) })
            }
        }

        impl std::ops::Sub for $name {
            type Output = $name;

            #[inline(always)]
            #[allow(unused_unsafe, reason = "some instruction sets have safe operations")]
            fn sub(self, other: $name) -> $name {
                // SAFETY: the register exists.
                $name(unsafe { $sub(self.0, other.0) })
            }
        }

        impl $crate::winograd::Register for $name {
            #[inline(always)]
            #[allow(unused_unsafe, reason = "some instruction sets have safe operations")]
            fn zero() -> $name {
                // SAFETY: only code that is compiled for the instruction set calls it.
                $name(unsafe { $zero })
            }

            #[inline(always)]
            #[allow(unused_unsafe, reason = "some instruction sets have safe operations")]
            fn times_4(self) -> $name {
                let $value = self.0;
                // SAFETY: the register exists.
                $name(unsafe { $times_4 })
            }
        }
    };
}
pub(crate) use register;

/// What tiles take from an instruction set. A value shows that the processor has it.
pub(crate) trait Tiles: Copy {
    /// The tiles computed at once.
    const TILES: usize;
    /// The filters multiplied together, as far as there are so many: 12, 8 or 4.
    const FILTERS: usize;
    /// Two 16-bit integers of each tile: those of a pair of channels.
    type Pairs: Register;
    /// A 32-bit integer of each tile.
    type Sums: Register;

    /// Returns the inputs of a row of tiles, of a group of four channels: for its two pairs, the tiles' columns.
    /// `pixels` starts with the first tile's first column.
    fn row(self, pixels: &[u8]) -> [[Self::Pairs; REACH]; 2];

    /// Adds the products of `O` filters over pairs of channels at one point. `weights` has `O` words for each pair.
    fn multiply<const O: usize>(self, sums: &mut [Self::Sums; O], inputs: &[Self::Pairs], weights: &[i32]);

    /// Returns `bias + sums / 576`.
    fn divided(self, sums: Self::Sums, bias: i32) -> Self::Sums;

    /// Writes a row of the tiles of one filter: `f32(sum) · multiplier` of its pixels.
    fn finish_last(self, sums: [Self::Sums; SIDE], multiplier: f32, out: &mut [f32]);

    /// Requantises a row of the tiles, `sums[filter][column]`, and writes its pixels.
    fn finish(
        self,
        sums: &[[Self::Sums; SIDE]; GROUP],
        multiplier: &[f32],
        zero_point: u8,
        skip: Option<(SkipSum, &[u8])>,
        out: &mut [u8],
    );
}

/// Packs transformed weights, `most` filters together, as words of two: `[filters together][pairs at once][point][pair
/// of channels][filter]`. Filters that pad a group have weight 0.
pub(crate) fn pack(taps: &Taps<'_>, most: usize) -> Vec<i32> {
    let (outputs, pairs) = (taps.outputs().next_multiple_of(GROUP), 2 * taps.groups());
    let mut words = Vec::new();
    for first in (0..outputs).step_by(most) {
        let filters = first..outputs.min(first + most);
        let transformed: Vec<_> = filters.map(|filter| transformed(taps, filter)).collect();
        for from in (0..pairs).step_by(MOST_PAIRS) {
            for (point, pair) in product(POINTS, from..pairs.min(from + MOST_PAIRS)) {
                words.extend(transformed.iter().map(|filter| {
                    let [low, high] = [0, 1].map(|k| filter[2 * pair + k][point]);
                    low & 0xffff | high << 16
                }));
            }
        }
    }
    words
}

/// Returns all points with all pairs.
fn product(points: usize, pairs: Range<usize>) -> impl Iterator<Item = (usize, usize)> {
    (0..points).flat_map(move |point| pairs.clone().map(move |pair| (point, pair)))
}

/// Returns `G g Gᵀ` of each channel of a filter.
fn transformed(taps: &Taps<'_>, filter: usize) -> Vec<[i32; POINTS]> {
    (0..GROUP * taps.groups())
        .map(|channel| {
            let weight = |ky, kx| i32::from(taps.group(filter, channel / GROUP, ky, kx)[channel % GROUP]);
            std::array::from_fn(|point| {
                let (y, x) = (G[point / REACH], G[point % REACH]);
                (0..9).map(|k| y[k / 3] * x[k % 3] * weight(k / 3, k % 3)).sum()
            })
        })
        .collect()
}

/// Computes rows of a hidden layer. Inlined into the copy of each instruction set.
#[inline(always)]
pub(crate) fn hidden_rows<T: Tiles>(
    set: T,
    layer: &Packed,
    rows: &Rows<'_>,
    skip: Option<[&[u8]; SIDE]>,
    mut out: SlotsMut<'_, u8>,
    geometry: Geometry,
) {
    let columns = SIDE * T::TILES;
    each_group(set, layer, rows, 0..geometry.width, geometry, |group, x, halves| {
        let bias = &layer.bias[group * GROUP..][..GROUP];
        let multiplier = &layer.multiplier[group * GROUP..][..GROUP];
        let at = group * geometry.stride() + geometry.start() + x * GROUP;
        for row in out.valid.clone() {
            let mut sums = [[T::Sums::zero(); SIDE]; GROUP];
            for ((sums, half), bias) in sums.iter_mut().zip(halves).zip(bias) {
                *sums = divided(set, apply_at(half[row]), *bias);
            }
            let skip = (layer.skip.zip(skip)).map(|(factors, rows)| (factors, &rows[row][at..][..columns * GROUP]));
            let out = &mut out.row_mut(row)[at..][..columns * GROUP];
            set.finish(&sums, multiplier, layer.zero_point, skip, out);
        }
    });
}

/// Computes the pixels `from..` of rows of the last layer. Inlined into the copy of each instruction set.
#[inline(always)]
pub(crate) fn last_rows<T: Tiles>(
    set: T,
    layer: &Packed,
    rows: &Rows<'_>,
    mut out: LastRows<'_>,
    from: usize,
    geometry: Geometry,
) {
    let (columns, to) = (SIDE * T::TILES, from + out.count);
    let mut values = [0.0; SIDE * MOST_TILES];
    each_group(
        set,
        layer,
        rows,
        from / columns * columns..to,
        geometry,
        |group, x, halves| {
            let (start, end) = (x.max(from), (x + columns).min(to));
            for row in out.valid.clone() {
                let planes = out.planes(row);
                for (o, half) in (group * GROUP..OUTPUTS).zip(halves) {
                    let sums = divided(set, apply_at(half[row]), layer.bias[o]);
                    set.finish_last(sums, layer.multiplier[o], &mut values);
                    planes[o][start - from..end - from].copy_from_slice(&values[start - x..end - x]);
                }
            }
        },
    );
}

#[inline(always)]
fn divided<T: Tiles>(set: T, [a, b, c, d]: [T::Sums; SIDE], bias: i32) -> [T::Sums; SIDE] {
    [
        set.divided(a, bias),
        set.divided(b, bias),
        set.divided(c, bias),
        set.divided(d, bias),
    ]
}

/// Calls `done(group, x, halves)` with `Aᵀ m` of each group of four filters, for the tiles from each `x` of `range` on.
#[inline(always)]
fn each_group<T: Tiles>(
    set: T,
    layer: &Packed,
    rows: &Rows<'_>,
    range: Range<usize>,
    geometry: Geometry,
    mut done: impl FnMut(usize, usize, &[[[T::Sums; REACH]; SIDE]; GROUP]),
) {
    assert!(geometry.group == GROUP);
    let pairs = 2 * layer.groups;
    let mut inputs = [T::Pairs::zero(); POINTS * MOST_PAIRS];
    let mut d = [[[T::Pairs::zero(); REACH]; REACH]; 2];
    let mut sums = [[T::Sums::zero(); POINTS]; MOST_FILTERS];
    let mut halves = [[[T::Sums::zero(); REACH]; SIDE]; GROUP];
    for x in range.step_by(SIDE * T::TILES) {
        let (mut weights, mut group, mut ready) = (&layer.weights[..], 0, None);
        while group < layer.outputs.div_ceil(GROUP) {
            let size = T::FILTERS.min(layer.outputs.next_multiple_of(GROUP) - group * GROUP);
            for from in (0..pairs).step_by(MOST_PAIRS) {
                let part = from..pairs.min(from + MOST_PAIRS);
                if ready.replace(from) != Some(from) {
                    read::<T>(set, rows, part.clone(), x, geometry, &mut d, &mut inputs);
                }
                let (words, inputs) = (POINTS * part.len() * size, &inputs[..POINTS * part.len()]);
                match size {
                    12 => multiply::<T, 12>(set, from == 0, inputs, &weights[..words], &mut sums),
                    8 => multiply::<T, 8>(set, from == 0, inputs, &weights[..words], &mut sums),
                    _ => multiply::<T, 4>(set, from == 0, inputs, &weights[..words], &mut sums),
                }
                weights = &weights[words..];
            }
            for sums in sums[..size].as_chunks::<GROUP>().0 {
                for (half, sums) in halves.iter_mut().zip(sums) {
                    half_transform::<T>(sums, half);
                }
                done(group, x, &halves);
                group += 1;
            }
        }
    }
}

/// Reads and transforms `pairs` of channels: `inputs[point][pair]`.
#[inline(always)]
fn read<T: Tiles>(
    set: T,
    rows: &Rows<'_>,
    pairs: Range<usize>,
    x: usize,
    geometry: Geometry,
    d: &mut [[[T::Pairs; REACH]; REACH]; 2],
    inputs: &mut [T::Pairs],
) {
    for group in pairs.start / 2..pairs.end / 2 {
        // One pixel before the tiles and those after them.
        let from = group * geometry.stride() + geometry.start() + x * GROUP - GROUP;
        for (y, row) in rows.iter().enumerate() {
            let [first, second] = set.row(&row[from..][..(SIDE * T::TILES + SIDE) * GROUP]);
            (d[0][y], d[1][y]) = (first, second);
        }
        for (k, d) in d.iter_mut().enumerate() {
            transform_inputs::<T>(d, &mut inputs[2 * group + k - pairs.start..], pairs.len());
        }
    }
}

/// Writes the sums of `O` filters at all points, or adds to those of pairs before.
#[inline(always)]
fn multiply<T: Tiles, const O: usize>(
    set: T,
    is_first: bool,
    inputs: &[T::Pairs],
    weights: &[i32],
    sums: &mut [[T::Sums; POINTS]; MOST_FILTERS],
) {
    let pairs = inputs.len() / POINTS;
    let points = inputs.chunks_exact(pairs).zip(weights.chunks_exact(O * pairs));
    for (point, (inputs, weights)) in points.take(POINTS).enumerate() {
        let mut totals = [T::Sums::zero(); O];
        if !is_first {
            for (total, sums) in totals.iter_mut().zip(&*sums) {
                *total = sums[point];
            }
        }
        set.multiply(&mut totals, inputs, weights);
        for (sums, total) in sums.iter_mut().zip(totals) {
            sums[point] = total;
        }
    }
}

/// Writes `Bᵀ d B`, the points `pairs` apart.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
fn transform_inputs<T: Tiles>(d: &mut [[T::Pairs; REACH]; REACH], inputs: &mut [T::Pairs], pairs: usize) {
    for x in 0..REACH {
        let column = apply_bt([d[0][x], d[1][x], d[2][x], d[3][x], d[4][x], d[5][x]]);
        for (y, value) in column.into_iter().enumerate() {
            d[y][x] = value;
        }
    }
    for (row, inputs) in d.iter().zip(inputs.chunks_mut(REACH * pairs)) {
        for (value, input) in apply_bt(*row).into_iter().zip(inputs.iter_mut().step_by(pairs)) {
            *input = value;
        }
    }
}

/// Writes `Aᵀ m` of one filter.
#[inline(always)]
fn half_transform<T: Tiles>(m: &[T::Sums; POINTS], half: &mut [[T::Sums; REACH]; SIDE]) {
    for x in 0..REACH {
        let column = apply_at([m[x], m[6 + x], m[12 + x], m[18 + x], m[24 + x], m[30 + x]]);
        for (y, value) in column.into_iter().enumerate() {
            half[y][x] = value;
        }
    }
}

/// Returns `Bᵀ d`.
#[inline(always)]
fn apply_bt<R: Register>(d: [R; REACH]) -> [R; REACH] {
    let (c, e) = (d[4] - d[2], d[3] - d[1]);
    let (a, b) = (d[4] - d[2].times_4(), d[3] - d[1].times_4());
    let twice = e + e;
    [
        c - (d[2] - d[0]).times_4(),
        a + b,
        a - b,
        c + twice,
        c - twice,
        d[5] - d[3] - e.times_4(),
    ]
}

/// Returns `Aᵀ m`. The columns of `Aᵀ` are those that go with the rows of [`G`].
#[inline(always)]
fn apply_at<R: Register>(m: [R; REACH]) -> [R; SIDE] {
    let (s, u) = (m[1] + m[2], m[1] - m[2]);
    let (v, w) = (m[3] + m[4], m[3] - m[4]);
    let twice = w + w;
    [
        m[0] + s + v,
        u + twice,
        s + v.times_4(),
        u + twice.times_4() + (m[5] + m[5]),
    ]
}
