//! The surfaces at an edge: groups of the 3×3 readings around a reading, with their colours.
//!
//! Readings that are not mixed form the surfaces. A mixed reading between two surfaces covers a share of each, by its
//! depth; one beyond all surfaces is the only reading of a surface of its own, such as a thin bar. Where an edge is a
//! ramp of two mixed readings, as resampling makes it, the surface behind the other one is borrowed from farther away.
//! A filled reading covers a share of every surface, since nothing is known of its place but its colour.

use super::colour::Moments;
use super::edges::Kind;
use super::lanes::{Lanes, lanes};
use crate::Bounds;

/// The largest difference between the readings of a surface and their mean, as a share of the volume.
pub(super) const TOLERANCE: f32 = 0.03;
/// The largest number of surfaces.
pub(super) const MOST: usize = 4;
/// The share of a filled reading that the surface of its depth covers.
pub(super) const FILLED: f32 = 0.6;
/// The least variance of a surface's colour, summed over red, green and blue.
pub(super) const LEAST_VARIANCE: f32 = 0.003;
/// The 3×3 readings, nearest first.
const ORDER: [usize; 9] = [4, 1, 3, 5, 7, 0, 2, 6, 8];

/// A surface at an edge.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Surface {
    /// The mean depth of its readings.
    pub(super) depth: f32,
    /// The share of each of the 3×3 readings that it covers.
    pub(super) covers: [f32; 9],
    /// The difference of each reading that is not mixed from the mean, and whether there is one.
    slopes: [f32; 9],
    has: [f32; 9],
    colour: [f32; 3],
    /// −1/2σ² and −³⁄₂·ln σ² of its colours' normal distribution.
    narrow: f32,
    peak: f32,
    count: f32,
    moments: Moments,
}

impl Surface {
    /// Begins a surface of this depth and these colours, which covers none of the 3×3 readings so far.
    fn begin(&mut self, depth: f32, colours: &Moments) {
        self.depth = depth;
        self.count = 1.0;
        self.covers = [0.0; 9];
        self.moments = *colours;
    }

    fn join(&mut self, at: usize, depth: f32) {
        self.depth += (depth - self.depth) / (self.count + 1.0);
        self.count += 1.0;
        self.covers[at] += 1.0;
    }

    /// Computes the distribution of the surface's colours.
    fn finish(&mut self) {
        let mean = self.moments.mean();
        let square = mean.iter().map(|v| v * v).sum::<f32>();
        let variance = (self.moments.squares / self.moments.count - square).at_least(LEAST_VARIANCE);
        self.colour = mean;
        self.narrow = -0.5 / variance;
        self.peak = -1.5 * libm::logf(variance);
    }

    /// Returns the logarithms of the probabilities of `colours`, plus a constant.
    #[inline(always)]
    pub(super) fn likelihood<const N: usize>(&self, colours: &[Lanes<N>; 3]) -> Lanes<N> {
        lanes(|i| {
            let [r, g, b] = [
                colours[0][i] - self.colour[0],
                colours[1][i] - self.colour[1],
                colours[2][i] - self.colour[2],
            ];
            (r * r + g * g + b * b) * self.narrow + self.peak
        })
    }

    /// Returns the depth of the surface at places.
    #[inline(always)]
    pub(super) fn depth_at<const N: usize>(&self, places: &Places<N>) -> Lanes<N> {
        let (known, slopes) = (places.of(&self.has), places.of(&self.slopes));
        lanes(|i| {
            let slope = if known[i] > 0.05 { slopes[i] / known[i] } else { 0.0 };
            (self.depth + slope).clamp(0.0, 1.0)
        })
    }
}

/// The readings at an edge.
pub(super) struct Readings<'a> {
    pub(super) depth: &'a [f32],
    pub(super) width: usize,
    /// Whether readings have several pixels, so that an edge in them may be a ramp.
    pub(super) are_coarse: bool,
    pub(super) kinds: &'a [Kind],
    pub(super) colours: &'a [Moments],
}

impl Readings<'_> {
    /// Groups the 3×3 readings at the indices `around` and returns the number of surfaces.
    pub(super) fn surfaces(&self, around: &[usize; 9], surfaces: &mut [Surface; MOST]) -> usize {
        let rounds = around.map(|i| match self.kinds[i] {
            Kind::Inside | Kind::Edge => 0,
            Kind::Filled => 1,
            Kind::Mixed => 2,
        });
        let mut count = 0;
        for round in (0..3).filter(|round| rounds.contains(round)) {
            let mixed = round == 2;
            for at in ORDER.into_iter().filter(|at| rounds[*at] == round) {
                let i = around[at];
                let depth = self.depth[i];
                let (mut nearest, mut apart) = (0, f32::INFINITY);
                for (k, surface) in surfaces[..count].iter().enumerate() {
                    let distance = (surface.depth - depth).abs();
                    (nearest, apart) = if distance < apart {
                        (k, distance)
                    } else {
                        (nearest, apart)
                    };
                }
                if apart <= TOLERANCE {
                    surfaces[nearest].join(at, depth);
                    if !mixed {
                        surfaces[nearest].moments.add(&self.colours[i]);
                    }
                } else if mixed && self.share(around[4], (i, at), surfaces, &mut count) {
                } else if count < MOST {
                    surfaces[count].begin(depth, &self.colours[i]);
                    surfaces[count].covers[at] = 1.0;
                    count += 1;
                }
            }
        }
        if count > 1 {
            for at in ORDER.into_iter().filter(|at| rounds[*at] == 1) {
                let others = (1.0 - FILLED) / (count - 1) as f32;
                for surface in &mut surfaces[..count] {
                    let own = surface.covers[at] >= 1.0;
                    surface.covers[at] = if own { FILLED } else { others };
                }
            }
        }
        for surface in &mut surfaces[..count] {
            if count > 1 {
                surface.finish();
            }
            surface.has = surface.covers.map(|covers| f32::from(covers >= 1.0));
            surface.slopes = std::array::from_fn(|at| surface.has[at] * (self.depth[around[at]] - surface.depth));
        }
        count
    }
}

impl Readings<'_> {
    /// Shares the mixed reading `i`, `at` among the 3×3 around `middle`, between the surfaces before and behind it. If
    /// the middle is mixed, one of them may be borrowed. Returns whether both exist.
    fn share(&self, middle: usize, (i, at): (usize, usize), surfaces: &mut [Surface; MOST], count: &mut usize) -> bool {
        let depth = self.depth[i];
        if split(&mut surfaces[..*count], at, depth) {
            return true;
        }
        if !self.are_coarse || self.kinds[middle] != Kind::Mixed || *count == 0 || *count == MOST {
            return false;
        }
        let Some(end) = self.end_of_ramp(i, surfaces[0].depth < depth) else {
            return false;
        };
        surfaces[*count].begin(self.depth[end], &self.colours[end]);
        *count += 1;
        split(&mut surfaces[..*count], at, depth)
    }

    /// Returns the end behind (if `behind`) or before the mixed reading `i` of a ramp of two mixed readings along a row
    /// or a column.
    fn end_of_ramp(&self, i: usize, behind: bool) -> Option<usize> {
        let (x, y) = (i % self.width, i / self.width);
        let height = self.depth.len() / self.width;
        let is_mixed = |at: usize| self.kinds[at] == Kind::Mixed;
        ramps().find_map(|ramp| {
            let at = |(dy, dx): (isize, isize)| {
                let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
                (x < self.width && y < height).then(|| y * self.width + x)
            };
            let [start, first, second, end] = [at(ramp[0])?, at(ramp[1])?, at(ramp[2])?, at(ramp[3])?];
            let depths = [start, first, second, end].map(|at| self.depth[at]);
            let rises = depths.is_sorted_by(|a, b| if behind { a < b } else { a > b });
            let is_ramp = rises && is_mixed(first) && is_mixed(second) && !is_mixed(start) && !is_mixed(end);
            (is_ramp && (self.depth[end] - self.depth[i]).abs() > TOLERANCE).then_some(end)
        })
    }
}

/// Returns the steps along y and x from a reading to the four readings of each ramp in which it is the second or the
/// third.
pub(super) fn ramps() -> impl Iterator<Item = [(isize, isize); 4]> {
    let directions = [(0, -1), (0, 1), (-1, 0), (1, 0)].into_iter();
    directions.flat_map(|(dy, dx)| [-1, -2].map(|start| [0, 1, 2, 3].map(|k| ((start + k) * dy, (start + k) * dx))))
}

/// Shares the mixed reading `at` between the surfaces before and behind its `depth`. Returns whether both exist.
fn split(surfaces: &mut [Surface], at: usize, depth: f32) -> bool {
    let (mut before, mut behind) = (None, None);
    for (i, surface) in surfaces.iter().enumerate() {
        let slot = if surface.depth < depth {
            &mut before
        } else {
            &mut behind
        };
        let is_nearer = |other: usize| (surface.depth - depth).abs() < (surfaces[other].depth - depth).abs();
        if slot.is_none_or(is_nearer) {
            *slot = Some(i);
        }
    }
    let (Some(before), Some(behind)) = (before, behind) else {
        return false;
    };
    let share = (depth - surfaces[before].depth) / (surfaces[behind].depth - surfaces[before].depth);
    surfaces[before].covers[at] += 1.0 - share;
    surfaces[behind].covers[at] += share;
    true
}

/// Places among 3×3 readings on one line, for bilinear interpolation.
pub(super) struct Places<const N: usize> {
    /// The first of the two rows of readings around the line, and their weights.
    row: usize,
    rows: [f32; 2],
    /// The weights of the three columns.
    columns: [Lanes<N>; 3],
}

impl<const N: usize> Places<N> {
    /// Returns the places at the offsets `dx`, `dy` from the middle reading, each −½..=½.
    #[inline(always)]
    pub(super) fn new(dx: &Lanes<N>, dy: f32) -> Self {
        let (row, below) = if dy < 0.0 { (0, 1.0 + dy) } else { (1, dy) };
        Places {
            row,
            rows: [1.0 - below, below],
            columns: [
                lanes(|i| (-dx[i]).at_least(0.0)),
                lanes(|i| 1.0 - dx[i].abs()),
                lanes(|i| dx[i].at_least(0.0)),
            ],
        }
    }

    /// Interpolates `values` of the readings.
    #[inline(always)]
    pub(super) fn of(&self, values: &[f32; 9]) -> Lanes<N> {
        let [above, below] = self.rows;
        let values = &values[3 * self.row..][..6];
        let left = above * values[0] + below * values[3];
        let middle = above * values[1] + below * values[4];
        let right = above * values[2] + below * values[5];
        let [l, m, r] = &self.columns;
        lanes(|i| left * l[i] + middle * m[i] + right * r[i])
    }
}
