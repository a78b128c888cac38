//! The depth of display pixels. Each pixel at an edge takes the surface that covers its place and has its colour. Then
//! pixels that are nearly undecided follow their neighbours of the same colour. In video, earlier choices count.

use super::axis::AxisMap;
use super::edges::Kind;
use super::history::Choice;
use super::surfaces::{MOST, Place, Readings, Surface};
use rayon::prelude::*;
use std::ops::Range;

/// The weight of the share of a pixel's place that a surface covers.
pub(super) const PLACE: f32 = 6.0;
/// The largest difference that colour makes between two surfaces.
pub(super) const MOST_EVIDENCE: f32 = 4.0;
/// The weight of the neighbours' choice.
pub(super) const NEIGHBOURS: f32 = 5.0;
/// The number of neighbours on each side.
pub(super) const REACH: usize = 1;
/// The distance of neighbours, in pixels, and the difference of amplitudes at which their weight is a quarter.
pub(super) const NEAR: f32 = 3.0;
pub(super) const ALIKE: f32 = 0.15;
/// The least weight of a neighbour by its colour.
pub(super) const LEAST_ALIKE: f32 = 0.02;
const SIDE: usize = 2 * REACH + 1;

/// The alternative to the depth of a display pixel at an edge.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Second {
    depth: f32,
    /// The lead of the first depth, infinite if there is no second.
    lead: f32,
}

impl Second {
    /// The lead of a first depth that lost the vote.
    const OUTVOTED: f32 = f32::NEG_INFINITY;
}

/// The working memory for readings and pixels of one shape.
pub(super) struct Pixels {
    /// The second depth of each pixel. Only those at edges are used.
    seconds: Vec<Second>,
    /// The earlier choice of each pixel.
    history: Vec<Choice>,
    /// A row of readings between two rows, for each row.
    between: Vec<f32>,
    near: [f32; SIDE * SIDE],
}

/// What the depth of pixels is decided from.
#[derive(Clone, Copy)]
pub(super) struct Decider<'a> {
    pub(super) readings: &'a Readings<'a>,
    pub(super) x: &'a AxisMap,
    pub(super) y: &'a AxisMap,
    /// The amplitudes, (3, H, W).
    pub(super) rgb: &'a [f32],
}

impl Pixels {
    pub(super) fn new(readings: usize, pixels: usize) -> Self {
        let square = |i: usize| (i as f32 - REACH as f32) * (i as f32 - REACH as f32);
        Pixels {
            seconds: vec![Second::default(); pixels],
            history: vec![Choice::default(); pixels],
            between: vec![0.0; readings],
            near: std::array::from_fn(|i| quarter(square(i / SIDE) + square(i % SIDE), NEAR)),
        }
    }

    /// Forgets earlier choices.
    pub(super) fn reset(&mut self) {
        self.history.fill(Choice::default());
    }

    /// Writes the depth of each pixel to `to`.
    pub(super) fn decide(&mut self, decider: Decider<'_>, to: &mut [f32]) {
        let width = decider.x.cell.len();
        let lines = Lines {
            depth: to,
            seconds: &mut self.seconds,
            history: &self.history,
            between: &mut self.between,
        };
        decider.rows(0..decider.y.pixels.len(), lines);
        let first = &*to;
        self.seconds
            .par_chunks_exact_mut(width)
            .enumerate()
            .for_each(|(y, seconds)| {
                for x in decider.edge_pixels(y) {
                    let second = &mut seconds[x];
                    if second.lead < NEIGHBOURS {
                        let votes = decider.votes(first, second.depth, (y, x), &self.near);
                        if second.lead + NEIGHBOURS * votes <= 0.0 {
                            second.lead = Second::OUTVOTED;
                        }
                    }
                }
            });
        (to.par_chunks_exact_mut(width))
            .zip(self.seconds.par_chunks_exact(width))
            .zip(self.history.par_chunks_exact_mut(width))
            .enumerate()
            .for_each(|(y, ((to, seconds), history))| {
                for x in decider.edge_pixels(y) {
                    let is_outvoted = seconds[x].lead == Second::OUTVOTED;
                    let depth = if is_outvoted { seconds[x].depth } else { to[x] };
                    to[x] = history[x].follow(decider.colour(y * width + x), depth);
                }
            });
    }
}

/// Lines of the display, and one row of readings for each row of readings in them.
struct Lines<'a> {
    depth: &'a mut [f32],
    seconds: &'a mut [Second],
    history: &'a [Choice],
    between: &'a mut [f32],
}

impl Lines<'_> {
    /// Splits after `pixels` pixels and `readings` readings.
    fn split(&mut self, pixels: usize, readings: usize) -> (Lines<'_>, Lines<'_>) {
        let (depth, below_depth) = self.depth.split_at_mut(pixels);
        let (seconds, below_seconds) = self.seconds.split_at_mut(pixels);
        let (history, below_history) = self.history.split_at(pixels);
        let (between, below_between) = self.between.split_at_mut(readings);
        let above = Lines {
            depth,
            seconds,
            history,
            between,
        };
        let below = Lines {
            depth: below_depth,
            seconds: below_seconds,
            history: below_history,
            between: below_between,
        };
        (above, below)
    }
}

impl Decider<'_> {
    /// Decides the pixels of `rows` of readings, half of them on another thread.
    fn rows(&self, rows: Range<usize>, mut lines: Lines<'_>) {
        if rows.len() <= 1 {
            return rows.for_each(|row| self.row(row, &mut lines));
        }
        let line = |row: usize| self.y.cell.partition_point(|cell| (*cell as usize) < row);
        let middle = (rows.start + rows.end) / 2;
        let pixels = (line(middle) - line(rows.start)) * self.x.cell.len();
        let (above, below) = lines.split(pixels, (middle - rows.start) * self.x.pixels.len());
        rayon::join(
            || self.rows(rows.start..middle, above),
            || self.rows(middle..rows.end, below),
        );
    }

    /// Decides the pixels of a row of readings.
    fn row(&self, row: usize, lines: &mut Lines<'_>) {
        let (h, w) = (self.y.pixels.len(), self.x.pixels.len());
        let width = self.x.cell.len();
        let inside = self.y.inside(row);
        for (y, line) in inside.clone().zip(lines.depth.chunks_exact_mut(width)) {
            let (above, below, share) = self.y.beside(y);
            let [above, below] = [above, below].map(|row| &self.readings.depth[row * w..][..w]);
            for ((to, a), b) in lines.between.iter_mut().zip(above).zip(below) {
                *to = a + share * (b - a);
            }
            for (x, to) in line.iter_mut().enumerate() {
                let (left, right, share) = self.x.beside(x);
                let (a, b) = (lines.between[left], lines.between[right]);
                *to = (a + share * (b - a)).clamp(0.0, 1.0);
            }
        }
        if inside.is_empty() {
            return;
        }
        let rows = [row.saturating_sub(1), row, (row + 1).min(h - 1)];
        let mut surfaces = [Surface::default(); MOST];
        for column in self.edges(row) {
            let columns = [column.saturating_sub(1), column, (column + 1).min(w - 1)];
            let around: [usize; 9] = std::array::from_fn(|k| rows[k / 3] * w + columns[k % 3]);
            let count = self.readings.surfaces(&around, &mut surfaces);
            for y in inside.clone() {
                for x in self.x.inside(column) {
                    let at = (y - inside.start) * width + x;
                    let (first, second) = self.choose(&surfaces[..count], &lines.history[at], y, x);
                    lines.depth[at] = first;
                    lines.seconds[at] = second;
                }
            }
        }
    }

    /// Returns the readings of `row` at edges.
    fn edges(&self, row: usize) -> impl Iterator<Item = usize> {
        let w = self.x.pixels.len();
        let kinds = self.readings.kinds[row * w..][..w].iter().enumerate();
        kinds
            .filter(|(_, kind)| **kind != Kind::Inside)
            .map(|(column, _)| column)
    }

    /// Returns the pixels of line `y` at edges.
    fn edge_pixels(&self, y: usize) -> impl Iterator<Item = usize> {
        self.edges(self.y.cell[y] as usize)
            .flat_map(|column| self.x.inside(column))
    }

    /// Chooses the first and the second of `surfaces` for the pixel (`y`, `x`) with its `earlier` choice.
    fn choose(&self, surfaces: &[Surface], earlier: &Choice, y: usize, x: usize) -> (f32, Second) {
        let place = Place::new(self.x.offset[x], self.y.offset[y]);
        let colour = self.colour(y * self.x.cell.len() + x);
        let mut likelihoods = [f32::NEG_INFINITY; MOST];
        let mut most = f32::NEG_INFINITY;
        for (likelihood, surface) in likelihoods.iter_mut().zip(surfaces) {
            *likelihood = surface.likelihood(colour);
            most = likelihood.max(most);
        }
        let leads: [f32; MOST] = earlier.leads(colour, surfaces.iter().map(|surface| surface.depth));
        let (mut first, mut second) = ((f32::NEG_INFINITY, 0), (f32::NEG_INFINITY, 0));
        for (i, (surface, likelihood)) in surfaces.iter().zip(likelihoods).enumerate() {
            let score = PLACE * place.of(&surface.covers) + (likelihood - most).max(-MOST_EVIDENCE) + leads[i];
            if score > first.0 {
                second = first;
                first = (score, i);
            } else if score > second.0 {
                second = (score, i);
            }
        }
        let depth = |i: usize| surfaces[i].depth_at(&place).clamp(0.0, 1.0);
        let lead = first.0 - second.0;
        let depth_of_second = if lead < NEIGHBOURS { depth(second.1) } else { 0.0 };
        (
            depth(first.1),
            Second {
                depth: depth_of_second,
                lead,
            },
        )
    }

    fn colour(&self, at: usize) -> [f32; 3] {
        let size = self.rgb.len() / 3;
        [self.rgb[at], self.rgb[size + at], self.rgb[2 * size + at]]
    }

    /// Returns the mean vote of the neighbours of the pixel (`y`, `x`), 1 for its `first` depth and −1 for its
    /// `second`, or 1 at the border.
    fn votes(&self, first: &[f32], second: f32, (y, x): (usize, usize), near: &[f32; SIDE * SIDE]) -> f32 {
        let (width, height) = (self.x.cell.len(), self.y.cell.len());
        if y < REACH || x < REACH || y + REACH >= height || x + REACH >= width {
            return 1.0;
        }
        let (own, colour) = (first[y * width + x], self.colour(y * width + x));
        let (mut sum, mut weights) = (0.0, 0.0);
        for (dy, near) in near.chunks_exact(SIDE).enumerate() {
            let start = (y + dy - REACH) * width + x - REACH;
            for (i, near) in (start..start + SIDE).zip(near) {
                let theirs = self.colour(i);
                let [r, g, b] = [0, 1, 2].map(|c| theirs[c] - colour[c]);
                let weight = near * quarter(r * r + g * g + b * b, ALIKE).max(LEAST_ALIKE);
                let for_first = (first[i] - own).abs() <= (first[i] - second).abs();
                sum += if for_first { weight } else { -weight };
                weights += weight;
            }
        }
        // The pixel itself has no vote.
        (sum - 1.0) / (weights - 1.0)
    }
}

/// Returns a weight that falls from 1 to a quarter where `square` is that of `distance`.
fn quarter(square: f32, distance: f32) -> f32 {
    let fall = 1.0 + square * (1.0 / (distance * distance));
    1.0 / (fall * fall)
}
