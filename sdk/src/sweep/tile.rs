//! One tile of the sweep: the planes that hold points in the tile or its halo, back to front.
//!
//! Light reaches a pixel of the hologram from no farther than light can spread on its way, so from plane k a tile needs
//! only a halo of that many pixels, and the field that is needed shrinks plane by plane to the tile itself. Nor is there
//! light farther from the points behind a plane than it can have spread since: each row's field is computed from the
//! leftmost to the rightmost pixel that light can be at, its [`Span`].

use super::filters::Filters;
use num_complex::Complex32;
use phasefront_kernels::fir::{Fir, RUN};
use std::ops::Range;

/// Pixels beyond light's reach that are computed, too: a fitted filter's light runs a little ahead.
const MARGIN: usize = 4;

/// The pixels of a row from one to before another; none where the second is not the greater.
type Span = [usize; 2];
const NOWHERE: Span = [usize::MAX, 0];

fn join(a: Span, b: Span) -> Span {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The surfaces of a frame: where each pixel's points lie and whose colour they have.
#[derive(Clone, Copy)]
pub(super) struct Surfaces<'a> {
    /// (3, H, W).
    pub(super) rgb: &'a [f32],
    /// The plane of each pixel, (H, W).
    pub(super) planes: &'a [u16],
    /// Pixels that the hidden layers continue, (layers, H, W).
    pub(super) hidden: &'a [u32],
    pub(super) height: usize,
    pub(super) width: usize,
}

/// What all tiles of a plan have in common.
pub(super) struct Layout {
    tile: usize,
    /// For each plane, how far around the tile its points matter.
    halos: Vec<usize>,
    /// From the edge of the buffer to the tile.
    border: usize,
    stride: usize,
    longest: usize,
    /// How far light spreads from a plane to one so many planes nearer.
    spread: Vec<usize>,
}

impl Layout {
    /// For tiles of `tile`² pixels; `reach(k)` is how far light spreads from plane k to the hologram, `spread(k)` to
    /// plane 0.
    pub(super) fn new(
        tile: usize,
        planes: usize,
        reach: impl Fn(usize) -> usize,
        spread: impl Fn(usize) -> usize,
        filters: &[Filters; 3],
    ) -> Self {
        let halos: Vec<usize> = (0..planes).map(|k| reach(k) + MARGIN).collect();
        let part = (filters.iter().map(Filters::longest_part))
            .max()
            .unwrap_or(0);
        let end = (0..planes)
            .flat_map(|k| {
                filters
                    .iter()
                    .map(move |f| f.end(k - f.before_end(k)).len() - 1)
            })
            .max()
            .unwrap_or(0);
        let widest = halos.last().copied().unwrap_or(0);
        let border = (widest + part).max(end).next_multiple_of(RUN);
        Layout {
            tile,
            halos,
            border,
            stride: (tile + 2 * border).next_multiple_of(RUN) + RUN,
            longest: part.max(end),
            spread: (0..planes).map(spread).collect(),
        }
    }

    /// Tiles down and across a frame.
    pub(super) fn count(&self, height: usize, width: usize) -> (usize, usize) {
        (height.div_ceil(self.tile), width.div_ceil(self.tile))
    }

    pub(super) fn scratch(&self) -> TileScratch {
        let rows = self.rows();
        let plane = || Aligned::new(rows * self.stride);
        let ring = || Aligned::new((2 * self.longest + 1) * self.stride);
        TileScratch {
            field: [plane(), plane()],
            ring: [ring(), ring()],
            places: vec![[0; 2]; self.longest + 1],
            starts: vec![0; self.halos.len() + 1],
            points: Vec::new(),
            point_spans: vec![NOWHERE; self.halos.len() * rows],
            lit: vec![NOWHERE; rows],
            wider: vec![NOWHERE; rows],
        }
    }

    /// Rows of the buffer.
    fn rows(&self) -> usize {
        self.tile + 2 * self.border
    }

    /// Most points that a tile of `layers` layers can hold.
    pub(super) fn most_points(&self, layers: usize) -> usize {
        let side = self.tile + 2 * self.halos.last().copied().unwrap_or(0);
        side * side * layers
    }
}

/// Working memory of one tile at a time.
pub(super) struct TileScratch {
    /// Real and imaginary part, rows of `stride`.
    field: [Aligned; 2],
    /// The last rows filtered along x.
    ring: [Aligned; 2],
    /// Where the taps' rows or columns lie.
    places: Vec<[usize; 2]>,
    /// Where each plane's points start, and the end.
    starts: Vec<u32>,
    points: Vec<Point>,
    /// Of each plane, the span of its points in each row.
    point_spans: Vec<Span>,
    /// Where there can be light in each row of the field.
    lit: Vec<Span>,
    wider: Vec<Span>,
}

/// Values that start at a cache line, which kernels are faster on.
struct Aligned(Vec<f32>);

impl Aligned {
    const LINE: usize = 64;

    fn new(length: usize) -> Self {
        Aligned(vec![0.0; length + Self::LINE / size_of::<f32>()])
    }

    fn values(&mut self) -> &mut [f32] {
        let start = self.0.as_ptr().align_offset(Self::LINE);
        &mut self.0[start.min(Self::LINE / size_of::<f32>())..]
    }
}

impl TileScratch {
    pub(super) fn reserve(&mut self, points: usize) {
        self.points.reserve_exact(points);
    }
}

/// A point of the scene on its plane.
#[derive(Clone, Copy, Default)]
struct Point {
    /// In the field.
    at: u32,
    /// Its colour's pixel in the frame.
    from: u32,
}

/// A tile of a frame.
pub(super) struct Tile<'a> {
    pub(super) layout: &'a Layout,
    pub(super) fir: Fir,
    pub(super) surfaces: Surfaces<'a>,
    /// Where it lies in the frame.
    pub(super) rows: Range<usize>,
    pub(super) columns: Range<usize>,
}

impl<'a> Tile<'a> {
    /// Tile `index` of a frame, counted by rows.
    pub(super) fn of(layout: &'a Layout, fir: Fir, surfaces: Surfaces<'a>, index: usize) -> Self {
        let (_, across) = layout.count(surfaces.height, surfaces.width);
        let side = |i: usize, size: usize| i * layout.tile..((i + 1) * layout.tile).min(size);
        Tile {
            layout,
            fir,
            surfaces,
            rows: side(index / across, surfaces.height),
            columns: side(index % across, surfaces.width),
        }
    }

    /// Sorts the points that the tile needs by planes; within one, hidden layers come first, so that what is in front
    /// is written last.
    pub(super) fn gather(&self, scratch: &mut TileScratch) {
        let TileScratch {
            starts,
            points,
            point_spans,
            ..
        } = scratch;
        let (rows, stride) = (self.layout.rows(), self.layout.stride);
        starts.fill(0);
        self.visit(|plane, _, _, _| starts[plane + 1] += 1);
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        let total = starts.last().copied().unwrap_or(0) as usize;
        points.resize(total, Point::default());
        // Each start runs to its plane's end, which is the next one's start; shifted back afterwards.
        point_spans.fill(NOWHERE);
        self.visit(|plane, y, x, from| {
            points[starts[plane] as usize] = Point {
                at: (y * stride + x) as u32,
                from: from as u32,
            };
            starts[plane] += 1;
            let span = &mut point_spans[plane * rows + y];
            *span = join(*span, [x, x + 1]);
        });
        starts.copy_within(0..self.layout.halos.len(), 1);
        starts[0] = 0;
    }

    /// Calls `point` with plane, row and column in the field, and pixel of colour, of each point.
    fn visit(&self, mut point: impl FnMut(usize, usize, usize, usize)) {
        let Surfaces {
            planes,
            hidden,
            height,
            width,
            ..
        } = self.surfaces;
        let Layout { halos, border, .. } = self.layout;
        let widest = halos.last().copied().unwrap_or(0);
        let around = |side: &Range<usize>, size: usize| {
            side.start.saturating_sub(widest)..(side.end + widest).min(size)
        };
        let outside = |i: usize, side: &Range<usize>| {
            side.start
                .saturating_sub(i)
                .max((i + 1).saturating_sub(side.end))
        };
        let columns = around(&self.columns, width);
        let layers = hidden.len() / planes.len();
        for layer in (0..=layers).rev() {
            for y in around(&self.rows, height) {
                let above = outside(y, &self.rows);
                let place = y + border - self.rows.start;
                let row = y * width;
                let mut add = |x: usize, from: usize| {
                    let plane = usize::from(planes[from]);
                    if halos[plane] >= above.max(outside(x, &self.columns)) {
                        point(plane, place, x + border - self.columns.start, from);
                    }
                };
                match layer {
                    0 => columns.clone().for_each(|x| add(x, row + x)),
                    _ => {
                        let sources = &hidden[(layer - 1) * planes.len() + row..][..width];
                        for (x, source) in columns.clone().zip(&sources[columns.clone()]) {
                            if *source != super::hidden::NOTHING {
                                add(x, *source as usize);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Sweeps one colour over the gathered points; [`Tile::store`] takes the result.
    pub(super) fn sweep(&self, colour: usize, filters: &Filters, scratch: &mut TileScratch) {
        for part in &mut scratch.field {
            part.values().fill(0.0);
        }
        scratch.lit.fill(NOWHERE);
        let occupied = |starts: &[u32], k: usize| starts[k] < starts[k + 1];
        let Some(mut at) = (0..self.layout.halos.len())
            .rev()
            .find(|k| occupied(&scratch.starts, *k))
        else {
            return;
        };
        self.scatter(colour, at, scratch);
        while let Some(next) = (0..at).rev().find(|k| occupied(&scratch.starts, *k)) {
            at = self.cross(at, next, filters, scratch);
            self.scatter(colour, at, scratch);
        }
        at = self.cross(at, at - filters.before_end(at), filters, scratch);
        // All of the tile: what is not lit must be filled as well.
        let end = self.layout.border..self.layout.border + self.rows.len();
        scratch.lit[end].fill([0, usize::MAX]);
        self.filter(filters.end(at), 0, scratch);
    }

    /// From plane `at` to plane `to`, through empty space.
    fn cross(
        &self,
        mut at: usize,
        to: usize,
        filters: &Filters,
        scratch: &mut TileScratch,
    ) -> usize {
        while at > to {
            let (taps, steps) = filters.part(at - to);
            at -= steps;
            widen(
                &mut scratch.lit,
                &mut scratch.wider,
                self.layout.spread[steps],
            );
            self.filter(taps, self.layout.halos[at], scratch);
        }
        at
    }

    /// Plane `k`'s points replace the field where they are (Eq. 3 and 4): they shine with phase 0 and block what comes
    /// from behind.
    fn scatter(&self, colour: usize, k: usize, scratch: &mut TileScratch) {
        let size = self.surfaces.planes.len();
        let rgb = &self.surfaces.rgb[colour * size..][..size];
        let points = scratch.starts[k] as usize..scratch.starts[k + 1] as usize;
        let rows = self.layout.rows();
        let spans = &scratch.point_spans[k * rows..][..rows];
        for (y, span) in spans
            .iter()
            .enumerate()
            .filter(|(_, span)| span[0] < span[1])
        {
            let around = [span[0] - MARGIN.min(span[0]), span[1] + MARGIN];
            for lit in &mut scratch.lit[y - MARGIN.min(y)..(y + MARGIN + 1).min(rows)] {
                *lit = join(*lit, around);
            }
        }
        let [re, im] = scratch.field.each_mut().map(Aligned::values);
        for point in &scratch.points[points] {
            re[point.at as usize] = rgb[point.from as usize];
            im[point.at as usize] = 0.0;
        }
    }

    /// Filters the field in place where it is lit, in the tile and `halo` around it: a row along x into the ring, and as
    /// soon as its neighbours below are there too, along y back into the field.
    fn filter(&self, taps: &[[f32; 2]], halo: usize, scratch: &mut TileScratch) {
        let &Layout { border, stride, .. } = self.layout;
        let radius = taps.len() - 1;
        let (top, bottom) = (border - halo, border + self.rows.len() + halo);
        let (left, right) = (border - halo, border + self.columns.len() + halo);
        let TileScratch {
            field,
            ring,
            places,
            lit,
            wider,
            ..
        } = scratch;
        // To whole lines: they are as fast as parts of them.
        for (y, span) in lit.iter_mut().enumerate() {
            let [from, to] = [span[0].max(left), span[1].min(right)];
            *span = match (top..bottom).contains(&y) && from < to {
                true => [from / RUN * RUN, to.next_multiple_of(RUN)],
                false => NOWHERE,
            };
        }
        // What is filtered along x serves the rows around it.
        widen_down(lit, wider, radius);
        let [field_re, field_im] = field.each_mut().map(Aligned::values);
        let [ring_re, ring_im] = ring.each_mut().map(Aligned::values);
        let places = &mut places[..=radius];
        let slot = |row: usize| row % (2 * radius + 1) * stride;
        let filtered = top - radius..bottom + radius;
        for (row, &[from, to]) in filtered.clone().zip(&wider[filtered]) {
            if from < to {
                let centre = row * stride + from;
                for (j, place) in places.iter_mut().enumerate() {
                    *place = [centre - j, centre + j];
                }
                let out = slot(row) + from..slot(row) + to;
                self.fir.filter(
                    taps,
                    [field_re, field_im],
                    places,
                    [&mut ring_re[out.clone()], &mut ring_im[out]],
                );
            }
            // Row r needs rows up to r + radius.
            let Some(row) = row.checked_sub(radius).filter(|row| *row >= top) else {
                continue;
            };
            let [from, to] = lit[row];
            if from < to {
                for (j, place) in places.iter_mut().enumerate() {
                    *place = [slot(row - j) + from, slot(row + j) + from];
                }
                let out = row * stride + from..row * stride + to;
                self.fir.filter(
                    taps,
                    [ring_re, ring_im],
                    places,
                    [&mut field_re[out.clone()], &mut field_im[out]],
                );
            }
        }
    }

    /// Writes the swept tile into a colour's plane of the frame.
    pub(super) fn store(&self, plane: &mut [Complex32], scratch: &mut TileScratch) {
        let &Layout { border, stride, .. } = self.layout;
        let [re, im] = scratch.field.each_mut().map(Aligned::values);
        for (i, y) in self.rows.clone().enumerate() {
            let at = (border + i) * stride + border;
            let out = &mut plane[y * self.surfaces.width..][self.columns.clone()];
            let parts = re[at..].iter().zip(&im[at..]);
            for (out, (re, im)) in out.iter_mut().zip(parts) {
                *out = Complex32::new(*re, *im);
            }
        }
    }
}

/// Spans `by` pixels wider in all directions; `wider` is memory.
fn widen(spans: &mut Vec<Span>, wider: &mut Vec<Span>, by: usize) {
    widen_down(spans, wider, by);
    for span in wider.iter_mut().filter(|span| span[0] < span[1]) {
        *span = [span[0] - by.min(span[0]), span[1] + by];
    }
    std::mem::swap(spans, wider);
}

/// Each row's span joined with those of the rows up to `by` above and below, into `wider`.
fn widen_down(spans: &[Span], wider: &mut [Span], by: usize) {
    wider.fill(NOWHERE);
    for (y, span) in spans
        .iter()
        .enumerate()
        .filter(|(_, span)| span[0] < span[1])
    {
        let rows = y - by.min(y)..(y + by + 1).min(spans.len());
        for wider in &mut wider[rows] {
            *wider = join(*wider, *span);
        }
    }
}
