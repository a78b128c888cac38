//! The depth of display pixels. Each pixel at an edge takes the surface that covers its place and has its colour. Then
//! pixels that are nearly undecided follow their neighbours of the same colour. In video, earlier choices count.

use super::axis::AxisMap;
use super::edges::Kind;
use super::history::{self, History};
use super::lanes::{self, LANES, Lanes, STRIDE, lanes, load, store};
use super::surfaces::{MOST, Places, Readings, Surface};
use crate::Bounds;
use crate::Size;
use crate::parallel::{self, prelude::*};
use phasefront_kernels::wide;
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
/// The lead of a first depth that lost the vote.
const OUTVOTED: f32 = f32::NEG_INFINITY;
/// The number of rows of readings that are decided together.
const BAND: usize = 8;
/// The number of lines of pixels whose votes are counted together.
const CHUNK: usize = 32;
const SIDE: usize = 2 * REACH + 1;

/// The working memory for readings and pixels of one shape, and the choices of earlier frames.
pub(super) struct Pixels {
    /// The alternative to the depth of each pixel at an edge.
    second: Vec<f32>,
    /// The lead of the first depth, infinite if there is no second.
    lead: Vec<f32>,
    history: History,
    /// Two rows of readings, interpolated along the row, for each band.
    stretched: Vec<f32>,
    /// The first depths of the lines above and below each chunk.
    beside: Vec<f32>,
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
    /// Creates the memory for `rows` rows of readings and the pixels of a size.
    pub(super) fn new(rows: usize, Size { width, height }: Size) -> Self {
        let square = |i: usize| (i as f32 - REACH as f32) * (i as f32 - REACH as f32);
        Pixels {
            second: vec![0.0; height * width],
            lead: vec![0.0; height * width],
            history: History::new(height * width),
            stretched: vec![0.0; rows.div_ceil(BAND) * 2 * width],
            beside: vec![0.0; height.div_ceil(CHUNK) * 2 * width],
            near: std::array::from_fn(|i| quarter(square(i / SIDE) + square(i % SIDE), NEAR)),
        }
    }

    /// Forgets earlier choices.
    pub(super) fn reset(&mut self) {
        self.history.reset();
    }

    /// Writes the depth of each pixel to `to`.
    pub(super) fn decide(&mut self, decider: Decider<'_>, to: &mut [f32]) {
        let width = decider.x.cell.len();
        let lines = Lines {
            depth: to,
            second: &mut self.second,
            lead: &mut self.lead,
            stretched: &mut self.stretched,
        };
        decider.bands(0..decider.y.pixels.len().div_ceil(BAND), lines, &self.history);
        self.copy_beside(to, width);
        let chunk = CHUNK * width;
        (to.par_chunks_mut(chunk))
            .zip(self.second.par_chunks(chunk).zip(self.lead.par_chunks_mut(chunk)))
            .zip((self.history.chunks(CHUNK, width)).zip(self.beside.par_chunks_exact_mut(2 * width)))
            .enumerate()
            .for_each(|(i, ((first, (second, lead)), (history, beside)))| {
                decider.settle(i * CHUNK, (first, second, lead), history, beside, &self.near);
            });
    }

    /// Copies the first depths of the lines beside each chunk, because chunks change at the same time.
    fn copy_beside(&mut self, first: &[f32], width: usize) {
        for (i, beside) in self.beside.chunks_exact_mut(2 * width).enumerate() {
            let (above, below) = beside.split_at_mut(width);
            if let Some(line) = (i * CHUNK).checked_sub(1) {
                above.copy_from_slice(&first[line * width..][..width]);
            }
            if let Some(line) = first
                .get((i + 1) * CHUNK * width..)
                .and_then(|lines| lines.get(..width))
            {
                below.copy_from_slice(line);
            }
        }
    }
}

/// The surfaces of a reading at an edge, and its pixels along the row: the first, and one past the last.
#[derive(Clone, Copy, Default)]
struct Cell {
    surfaces: [Surface; MOST],
    count: usize,
    first: usize,
    end: usize,
}

/// Lines of the display, and two stretched rows for each band of readings in them.
struct Lines<'a> {
    depth: &'a mut [f32],
    second: &'a mut [f32],
    lead: &'a mut [f32],
    stretched: &'a mut [f32],
}

impl Lines<'_> {
    /// Returns the depth, the alternative and the lead of line `line` of `width` pixels.
    fn line(&mut self, line: usize, width: usize) -> [&mut [f32]; 3] {
        [&mut *self.depth, &mut *self.second, &mut *self.lead].map(|lines| &mut lines[line * width..][..width])
    }

    /// Splits after `pixels` pixels and `stretched` values of stretched rows.
    fn split(&mut self, pixels: usize, stretched: usize) -> (Lines<'_>, Lines<'_>) {
        let (depth, below_depth) = self.depth.split_at_mut(pixels);
        let (second, below_second) = self.second.split_at_mut(pixels);
        let (lead, below_lead) = self.lead.split_at_mut(pixels);
        let (stretched, below_stretched) = self.stretched.split_at_mut(stretched);
        let above = Lines {
            depth,
            second,
            lead,
            stretched,
        };
        let below = Lines {
            depth: below_depth,
            second: below_second,
            lead: below_lead,
            stretched: below_stretched,
        };
        (above, below)
    }
}

impl Decider<'_> {
    /// Decides the pixels of `bands` of readings, half of them on another thread.
    fn bands(&self, bands: Range<usize>, mut lines: Lines<'_>, history: &History) {
        if bands.len() <= 1 {
            return bands.for_each(|band| {
                let rows = band * BAND..((band + 1) * BAND).min(self.y.pixels.len());
                wide!(self.interpolate(self.lines(rows.clone()), &mut lines));
                let first = self.lines(rows.clone()).start;
                let mut cells = [Cell::default(); STRIDE];
                rows.for_each(|row| wide!(self.row(row, first, &mut lines, history, &mut cells)));
            });
        }
        let (width, middle) = (self.x.cell.len(), (bands.start + bands.end) / 2);
        let pixels = self.lines(bands.start * BAND..middle * BAND).len() * width;
        let (above, below) = lines.split(pixels, 2 * width * (middle - bands.start));
        parallel::join(
            || self.bands(bands.start..middle, above, history),
            || self.bands(middle..bands.end, below, history),
        );
    }

    /// Returns the lines of the display in `rows` of readings.
    fn lines(&self, rows: Range<usize>) -> Range<usize> {
        let line = |row: usize| self.y.cell.partition_point(|cell| (*cell as usize) < row);
        line(rows.start)..line(rows.end)
    }

    /// Interpolates the depth of `lines` between the readings.
    #[inline(always)]
    fn interpolate(&self, which: Range<usize>, lines: &mut Lines<'_>) {
        let (w, width) = (self.x.pixels.len(), self.x.cell.len());
        let (even, odd) = lines.stretched.split_at_mut(width);
        // The row of readings that each of the two holds.
        let mut held = [usize::MAX; 2];
        for (y, to) in which.zip(lines.depth.chunks_exact_mut(width)) {
            let (above, below, share) = self.y.beside(y);
            for row in [above, below] {
                if held[row % 2] != row {
                    let stretched = if row.is_multiple_of(2) { &mut *even } else { &mut *odd };
                    self.stretch(&self.readings.depth[row * w..][..w], stretched);
                    held[row % 2] = row;
                }
            }
            let of = |row: usize| if row.is_multiple_of(2) { &even[..] } else { &odd[..] };
            for ((to, a), b) in to.iter_mut().zip(of(above)).zip(of(below)) {
                *to = (a + share * (b - a)).clamp(0.0, 1.0);
            }
        }
    }

    /// Interpolates a row of readings at the places of pixels.
    #[inline(always)]
    fn stretch(&self, row: &[f32], to: &mut [f32]) {
        if let Some((from, left)) = self.x.straight {
            // Pixels beyond the readings repeat the outermost ones.
            let row = &row[from..row.len().min(from + to.len() - left)];
            let (before, to) = to.split_at_mut(left);
            let (to, after) = to.split_at_mut(row.len());
            before.fill(row[0]);
            to.copy_from_slice(row);
            return after.fill(row[row.len() - 1]);
        }
        for (x, to) in to.iter_mut().enumerate() {
            let (left, right, share) = self.x.beside(x);
            let (a, b) = (row[left], row[right]);
            *to = a + share * (b - a);
        }
    }

    /// Decides the pixels at the edges of a row of readings. The `lines` begin with the display's line `first`. `cells`
    /// is working memory.
    #[inline(always)]
    fn row(&self, row: usize, first: usize, lines: &mut Lines<'_>, history: &History, cells: &mut [Cell; STRIDE]) {
        let (h, w) = (self.y.pixels.len(), self.x.pixels.len());
        let (inside, width) = (self.y.inside(row), self.x.cell.len());
        if inside.is_empty() {
            return;
        }
        let rows = [row.saturating_sub(1), row, (row + 1).min(h - 1)];
        let kinds = &self.readings.kinds[row * w..][..w];
        for stride in lanes::strides(w).filter(|stride| lanes::any(&kinds[stride.clone()], Kind::is_at_edge)) {
            let mut found = 0;
            for column in stride.filter(|column| kinds[*column].is_at_edge()) {
                let pixels = self.x.inside(column);
                if !pixels.is_empty() {
                    let columns = [column.saturating_sub(1), column, (column + 1).min(w - 1)];
                    let around: [usize; 9] = std::array::from_fn(|k| rows[k / 3] * w + columns[k % 3]);
                    let cell = &mut cells[found];
                    cell.count = self.readings.surfaces(&around, &mut cell.surfaces);
                    (cell.first, cell.end) = (pixels.start, pixels.end);
                    found += 1;
                }
            }
            // Line by line, in the order of memory.
            for y in inside.clone() {
                let mut lines = lines.line(y - first, width);
                let history = history.line(y, width);
                for cell in &cells[..found] {
                    match cell.end - cell.first {
                        1 => self.cell::<1>(cell, y, &mut lines, &history),
                        2..=4 => self.cell::<4>(cell, y, &mut lines, &history),
                        _ => self.cell::<LANES>(cell, y, &mut lines, &history),
                    }
                }
            }
        }
    }

    /// Decides the pixels of a reading in line `y`, `N` at a time.
    #[inline(always)]
    fn cell<const N: usize>(
        &self,
        cell: &Cell,
        y: usize,
        [depths, seconds, leads]: &mut [&mut [f32]; 3],
        history: &history::Line<&[f32], &[u8]>,
    ) {
        for x in (cell.first..cell.end).step_by(N) {
            let colours: [Lanes<N>; 3] = self.colours(y * self.x.cell.len() + x);
            let places = Places::new(&load(&self.x.offset, x, 0.0), self.y.offset[y]);
            let surfaces = &cell.surfaces[..cell.count];
            let [depth, second, lead] = choose(surfaces, &places, &colours, &history.held(x, &colours));
            let end = (x + N).min(cell.end);
            store(&depth, &mut depths[x..end]);
            store(&second, &mut seconds[x..end]);
            store(&lead, &mut leads[x..end]);
        }
    }

    /// Returns the first and the number of neighbouring pixels of line `y` at edges, up to [`LANES`].
    #[inline(always)]
    fn edge_pixels(&self, y: usize) -> EdgePixels<'_> {
        let w = self.x.pixels.len();
        EdgePixels {
            kinds: &self.readings.kinds[self.y.cell[y] as usize * w..][..w],
            x: self.x,
            column: 0,
            run: 0..0,
        }
    }

    /// Returns the red, green and blue amplitudes of the pixels from `at` on.
    #[inline(always)]
    fn colours<const N: usize>(&self, at: usize) -> [Lanes<N>; 3] {
        let size = self.rgb.len() / 3;
        let (red, others) = self.rgb.split_at(size);
        let (green, blue) = others.split_at(size);
        [load(red, at, 0.0), load(green, at, 0.0), load(blue, at, 0.0)]
    }

    /// Counts the votes of the pixels in lines from `y` on and gives them their depth. `beside` has the first depths of
    /// the lines above and below.
    fn settle<'a>(
        &self,
        y: usize,
        (first, second, lead): (&mut [f32], &[f32], &mut [f32]),
        history: impl Iterator<Item = history::Line<&'a mut [f32], &'a mut [u8]>>,
        beside: &mut [f32],
        near: &[f32; SIDE * SIDE],
    ) {
        let width = self.x.cell.len();
        let (above, after) = beside.split_at_mut(width);
        let lines = second
            .chunks_exact(width)
            .zip(lead.chunks_exact_mut(width))
            .zip(history);
        for (line, ((second, lead), mut history)) in lines.enumerate() {
            let (own, rest) = first[line * width..].split_at_mut(width);
            let below = rest.get(..width).unwrap_or(after);
            wide!({
                self.vote([above, own, below], second, y + line, near, lead);
                above.copy_from_slice(own);
                self.finish(y + line, (second, lead), &mut history, own);
            });
        }
    }

    /// Marks the pixels of line `y` that lose the vote of their neighbours as [`OUTVOTED`]. `first` has the line and
    /// those beside it.
    #[inline(always)]
    fn vote(&self, first: [&[f32]; SIDE], second: &[f32], y: usize, near: &[f32; SIDE * SIDE], lead: &mut [f32]) {
        let (width, height) = (self.x.cell.len(), self.y.cell.len());
        if y < REACH || y + REACH >= height {
            return;
        }
        for (x, count) in self.edge_pixels(y) {
            // Pixels at the border keep their depth.
            let (x, count) = (
                x.max(REACH),
                (x + count).min(width - REACH).saturating_sub(x.max(REACH)),
            );
            if !lead[x..x + count].iter().any(|lead| *lead < NEIGHBOURS) {
                continue;
            }
            let votes = self.votes(first, &load(second, x, 0.0), (y, x), near);
            for (lead, vote) in lead[x..x + count].iter_mut().zip(votes) {
                if *lead < NEIGHBOURS && *lead + NEIGHBOURS * vote <= 0.0 {
                    *lead = OUTVOTED;
                }
            }
        }
    }

    /// Gives the pixels of line `y` that were outvoted their `second` depth, and all at edges a share of their history.
    #[inline(always)]
    fn finish(
        &self,
        y: usize,
        (second, lead): (&[f32], &[f32]),
        line: &mut history::Line<&mut [f32], &mut [u8]>,
        to: &mut [f32],
    ) {
        for (x, count) in self.edge_pixels(y) {
            let (first, second, lead): (Lanes, Lanes, Lanes) =
                (load(to, x, 0.0), load(second, x, 0.0), load(lead, x, 0.0));
            let depth: Lanes = lanes(|i| if lead[i] == OUTVOTED { second[i] } else { first[i] });
            let depth = line.follow((x, count), &self.colours(y * self.x.cell.len() + x), &depth);
            store(&depth, &mut to[x..x + count]);
        }
    }

    /// Returns the mean votes of the neighbours of the pixels from (`y`, `x`) on, 1 for their `first` depth and −1 for
    /// their `second`.
    #[inline(always)]
    fn votes(&self, first: [&[f32]; SIDE], second: &Lanes, (y, x): (usize, usize), near: &[f32; SIDE * SIDE]) -> Lanes {
        let width = self.x.cell.len();
        let (own, colours): (Lanes, [Lanes; 3]) = (load(first[REACH], x, 0.0), self.colours(y * width + x));
        let (mut sum, mut weights) = ([0.0; LANES], [0.0; LANES]);
        for (k, near) in near.iter().enumerate() {
            let (line, x) = (k / SIDE, x + k % SIDE - REACH);
            let theirs: [Lanes; 3] = self.colours((y + line - REACH) * width + x);
            let depth: Lanes = load(first[line], x, 0.0);
            let weight: Lanes = lanes(|i| {
                let [r, g, b] = [
                    theirs[0][i] - colours[0][i],
                    theirs[1][i] - colours[1][i],
                    theirs[2][i] - colours[2][i],
                ];
                near * quarter(r * r + g * g + b * b, ALIKE).at_least(LEAST_ALIKE)
            });
            sum = lanes(|i| {
                let for_first = (depth[i] - own[i]).abs() <= (depth[i] - second[i]).abs();
                sum[i] + if for_first { weight[i] } else { -weight[i] }
            });
            weights = lanes(|i| weights[i] + weight[i]);
        }
        // The pixel itself has no vote.
        lanes(|i| (sum[i] - 1.0) / (weights[i] - 1.0))
    }
}

/// The pixels of a line at edges, up to [`LANES`] at a time: the first, and their number.
struct EdgePixels<'a> {
    kinds: &'a [Kind],
    x: &'a AxisMap,
    column: usize,
    /// The pixels of the present run of readings at edges.
    run: Range<usize>,
}

impl Iterator for EdgePixels<'_> {
    type Item = (usize, usize);

    #[inline(always)]
    fn next(&mut self) -> Option<(usize, usize)> {
        while self.run.is_empty() {
            let rest = &self.kinds[self.column..];
            let start = self.column + lanes::first(rest, Kind::is_at_edge)?;
            let length = self.kinds[start..].iter().position(|kind| *kind == Kind::Inside);
            self.column = length.map_or(self.kinds.len(), |length| start + length);
            self.run = self.x.inside_all(start..self.column);
        }
        let (x, count) = (self.run.start, LANES.min(self.run.len()));
        self.run.start += count;
        Some((x, count))
    }
}

/// Chooses among `surfaces` for pixels with earlier depths `held`, and returns the depth of the first and of the second
/// surface, and the lead of the first.
#[inline(always)]
fn choose<const N: usize>(
    surfaces: &[Surface],
    places: &Places<N>,
    colours: &[Lanes<N>; 3],
    held: &Lanes<N>,
) -> [Lanes<N>; 3] {
    if let [surface] = surfaces {
        return [surface.depth_at(places), [0.0; N], [f32::INFINITY; N]];
    }
    let mut likelihoods = [[0.0; N]; MOST];
    let (mut most, mut nearest) = ([f32::NEG_INFINITY; N], [f32::INFINITY; N]);
    for (surface, likelihood) in surfaces.iter().zip(&mut likelihoods) {
        *likelihood = surface.likelihood(colours);
        most = lanes(|i| {
            if likelihood[i] > most[i] {
                likelihood[i]
            } else {
                most[i]
            }
        });
        let apart: Lanes<N> = lanes(|i| (surface.depth - held[i]).abs());
        nearest = lanes(|i| if apart[i] < nearest[i] { apart[i] } else { nearest[i] });
    }
    let (mut first, mut second) = ([f32::NEG_INFINITY; N], [f32::NEG_INFINITY; N]);
    let (mut depth, mut depth_of_second) = ([0.0; N], [0.0; N]);
    for (surface, likelihood) in surfaces.iter().zip(&likelihoods) {
        let covers = places.of(&surface.covers);
        let leads = history::leads(surface.depth, held, &nearest);
        let theirs = surface.depth_at(places);
        let score: Lanes<N> = lanes(|i| {
            let evidence = (likelihood[i] - most[i]).at_least(-MOST_EVIDENCE);
            PLACE * covers[i] + evidence + leads[i]
        });
        // The former first surface, or this one, may be the second.
        let lost: Lanes<N> = lanes(|i| if score[i] > first[i] { first[i] } else { score[i] });
        let lost_depth: Lanes<N> = lanes(|i| if score[i] > first[i] { depth[i] } else { theirs[i] });
        depth_of_second = lanes(|i| {
            if score[i] > second[i] {
                lost_depth[i]
            } else {
                depth_of_second[i]
            }
        });
        second = lanes(|i| if score[i] > second[i] { lost[i] } else { second[i] });
        depth = lanes(|i| if score[i] > first[i] { theirs[i] } else { depth[i] });
        first = lanes(|i| if score[i] > first[i] { score[i] } else { first[i] });
    }
    [depth, depth_of_second, lanes(|i| first[i] - second[i])]
}

/// Returns a weight that falls from 1 to a quarter where `square` is that of `distance`.
#[inline(always)]
fn quarter(square: f32, distance: f32) -> f32 {
    let fall = 1.0 + square * (1.0 / (distance * distance));
    1.0 / (fall * fall)
}
