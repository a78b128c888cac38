//! One tile of the sweep. It processes the planes that hold points in the tile or its halo, from back to front.
//!
//! Light reaches a pixel of the hologram only from within its spread over the distance. A tile therefore needs only a
//! halo as wide as the spread from plane k, and the required field shrinks plane by plane to the tile itself. Likewise,
//! there is no light farther from the points behind a plane than the distance it can have spread. Each row's field is
//! therefore computed only from the leftmost to the rightmost pixel that light can reach, its [`Span`].

use super::filters::Filters;
use super::hidden::NOTHING;
use super::shares::{Share, Slot};
use num_complex::Complex32;
use phasefront_kernels::fir::{Fir, RUN};
use std::ops::Range;

/// The number of pixels beyond light's reach that are also computed, because a fitted filter's light spreads slightly
/// farther.
pub const MARGIN: usize = 10;

/// A half-open range of pixels in a row. It is empty if the second bound is not greater than the first.
type Span = [usize; 2];
const NOWHERE: Span = [usize::MAX, 0];

fn join(a: Span, b: Span) -> Span {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The surfaces of a frame: the positions and colours of the points of each pixel.
#[derive(Clone, Copy)]
pub(super) struct Surfaces<'a> {
    /// The colours, (C, H, W).
    pub(super) rgb: &'a [f32],
    /// The normalized depth, (H, W).
    pub(super) depth: &'a [f32],
    /// The planes of each pixel's point, (H, W).
    pub(super) slots: &'a [Slot],
    /// The pixels that the hidden layers continue, (layers, H, W).
    pub(super) hidden: &'a [u32],
    pub(super) height: usize,
    pub(super) width: usize,
}

/// The properties that all tiles of a plan share.
pub(super) struct Layout {
    tile: usize,
    /// The distance around the tile within which the points of each plane matter.
    halos: Vec<usize>,
    /// The distance from the edge of the buffer to the tile.
    border: usize,
    stride: usize,
    longest: usize,
    /// The spread of light over each number of planes.
    spread: Vec<usize>,
}

impl Layout {
    /// Creates the layout of tiles of `tile`² pixels. `reach(k)` is the spread of light from plane k to the hologram,
    /// `spread(k)` its spread to plane 0.
    pub(super) fn new(
        tile: usize,
        planes: usize,
        reach: impl Fn(usize) -> usize,
        spread: impl Fn(usize) -> usize,
        filters: &[Filters],
    ) -> Self {
        let halos: Vec<usize> = (0..planes).map(|k| reach(k) + MARGIN).collect();
        let part = (filters.iter().map(Filters::longest_part)).max().unwrap_or(0);
        let end = (0..planes)
            .flat_map(|k| filters.iter().map(move |f| f.end(k - f.before_end(k)).len() - 1))
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

    /// Returns the number of tiles down and across a frame.
    pub(super) fn count(&self, height: usize, width: usize) -> (usize, usize) {
        (height.div_ceil(self.tile), width.div_ceil(self.tile))
    }

    pub(super) fn scratch(&self) -> TileScratch {
        let rows = self.rows();
        let plane = || Aligned::new(rows * self.stride);
        let ring = || Aligned::new(self.ring_values());
        let line = || Aligned::new(self.stride + 2 * self.longest);
        let places = || vec![[0; 2]; self.longest + 1];
        let kept = || vec![0.0; rows * self.longest];
        TileScratch {
            field: [plane(), plane()],
            line: [line(), line()],
            kept: [kept(), kept()],
            ring: [ring(), ring()],
            places: [places(), places()],
            starts: vec![0; self.halos.len() + 1],
            found: Vec::new(),
            points: Vec::new(),
            point_spans: vec![NOWHERE; self.halos.len() * rows],
            lit: vec![NOWHERE; rows],
            wider: vec![NOWHERE; rows],
        }
    }

    /// Returns the largest number of values in a ring: all rows of the longest filter.
    fn ring_values(&self) -> usize {
        (1..=self.longest)
            .map(|radius| (2 * radius + 1) * strip(radius))
            .max()
            .unwrap_or(RUN)
    }

    /// Returns the number of rows of the buffer.
    fn rows(&self) -> usize {
        self.tile + 2 * self.border
    }

    /// Returns the largest number of points that a tile of `layers` layers can hold.
    pub(super) fn most_points(&self, layers: usize) -> usize {
        let side = self.tile + 2 * self.halos.last().copied().unwrap_or(0);
        side * side * layers
    }
}

/// The working memory of one tile at a time.
pub(super) struct TileScratch {
    /// Real and imaginary parts, in rows of `stride`.
    field: [Aligned; 2],
    /// A row of a strip before it is filtered.
    line: [Aligned; 2],
    /// The unfiltered last columns of the previous strip in each row.
    kept: [Vec<f32>; 2],
    /// The last rows filtered along x.
    ring: [Aligned; 2],
    /// The positions of the taps' values along x and along y.
    places: [Vec<[usize; 2]>; 2],
    /// The start of each plane's points, and the end.
    starts: Vec<u32>,
    found: Vec<(u16, Points)>,
    points: Vec<Points>,
    /// The span of each plane's points in each row.
    point_spans: Vec<Span>,
    /// The span of possible light in each row of the field.
    lit: Vec<Span>,
    wider: Vec<Span>,
}

/// Values that start at a cache line, which makes the kernels faster.
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
        self.found.reserve_exact(points);
        self.points.reserve_exact(points);
    }
}

/// Where points are relative to a plane that they are on.
#[derive(Clone, Copy, Default, PartialEq)]
enum Side {
    #[default]
    On,
    /// Between the plane and the next one in front of it.
    Before,
    /// Between the plane and the next one behind it.
    Behind,
}

/// Neighbouring points of one plane in a row.
#[derive(Clone, Copy, Default)]
struct Points {
    /// The position of the first point in the field.
    at: u32,
    /// The index of the first point's colour in the frame. The colours of the others follow it.
    from: u32,
    count: u16,
    side: Side,
}

/// A tile of a frame.
pub(super) struct Tile<'a> {
    pub(super) layout: &'a Layout,
    pub(super) fir: Fir,
    pub(super) surfaces: Surfaces<'a>,
    /// The tile's position in the frame.
    pub(super) rows: Range<usize>,
    pub(super) columns: Range<usize>,
}

impl<'a> Tile<'a> {
    /// Returns tile `index` of a frame, counted by rows.
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

    /// Sorts the points that the tile needs by plane. Within a plane, hidden layers come first, so that the front is
    /// written last.
    pub(super) fn gather(&self, scratch: &mut TileScratch) {
        scratch.starts.fill(0);
        scratch.found.clear();
        scratch.point_spans.fill(NOWHERE);
        let Surfaces { slots, hidden, .. } = self.surfaces;
        let layers = hidden.len() / slots.len();
        for layer in (0..=layers).rev() {
            self.find(layer, scratch);
        }
        let TileScratch {
            starts, found, points, ..
        } = scratch;
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        points.resize(found.len(), Points::default());
        // Each start advances to its plane's end, which is the next plane's start. The starts are shifted back
        // afterwards.
        for (plane, found) in found {
            let start = &mut starts[usize::from(*plane)];
            points[*start as usize] = *found;
            *start += 1;
        }
        starts.copy_within(0..self.layout.halos.len(), 1);
        starts[0] = 0;
    }

    /// Finds the points of a layer, where 0 is the front.
    fn find(&self, layer: usize, scratch: &mut TileScratch) {
        let Surfaces {
            slots,
            hidden,
            height,
            width,
            ..
        } = self.surfaces;
        let widest = self.layout.halos.last().copied().unwrap_or(0);
        let around =
            |side: &Range<usize>, size: usize| side.start.saturating_sub(widest)..(side.end + widest).min(size);
        let columns = around(&self.columns, width);
        for y in around(&self.rows, height) {
            let row = y * width;
            match layer {
                0 => {
                    let slots = &slots[row..][..width];
                    let mut x = columns.start;
                    while x < columns.end {
                        let slot = slots[x];
                        let same = slots[x..columns.end].iter().take_while(|s| **s == slot);
                        let count = same.count();
                        self.add(slot, y, x..x + count, row + x, scratch);
                        x += count;
                    }
                }
                _ => {
                    let sources = &hidden[(layer - 1) * slots.len() + row..][..width];
                    let mut x = columns.start;
                    while x < columns.end {
                        let source = sources[x];
                        let mut count = 1;
                        if source != NOTHING {
                            let slot = slots[source as usize];
                            while x + count < columns.end
                                && sources[x + count] == source + count as u32
                                && slots[source as usize + count] == slot
                            {
                                count += 1;
                            }
                            self.add(slot, y, x..x + count, source as usize, scratch);
                        }
                        x += count;
                    }
                }
            }
        }
    }

    /// Adds the points of row `y` and `columns` of the frame to their planes. The colour of the first point is at
    /// `from`.
    fn add(&self, slot: Slot, y: usize, columns: Range<usize>, from: usize, scratch: &mut TileScratch) {
        let plane = slot / 2;
        if slot.is_multiple_of(2) {
            self.add_to(plane, Side::On, y, columns, from, scratch);
        } else {
            self.add_to(plane, Side::Behind, y, columns.clone(), from, scratch);
            self.add_to(plane + 1, Side::Before, y, columns, from, scratch);
        }
    }

    /// Adds points that are within the halo of `plane`.
    fn add_to(&self, plane: u16, side: Side, y: usize, columns: Range<usize>, from: usize, scratch: &mut TileScratch) {
        let &Layout { border, stride, .. } = self.layout;
        let k = usize::from(plane);
        let halo = self.layout.halos[k];
        let in_halo = y + halo >= self.rows.start && y < self.rows.end + halo;
        let start = columns.start.max(self.columns.start.saturating_sub(halo));
        let end = columns.end.min(self.columns.end + halo);
        if !in_halo || start >= end {
            return;
        }
        let y = y + border - self.rows.start;
        let x = start + border - self.columns.start;
        scratch.found.push((
            plane,
            Points {
                at: (y * stride + x) as u32,
                from: (from + start - columns.start) as u32,
                count: (end - start) as u16,
                side,
            },
        ));
        scratch.starts[k + 1] += 1;
        let span = &mut scratch.point_spans[k * self.layout.rows() + y];
        *span = join(*span, [x, x + end - start]);
    }

    /// Sweeps one colour over the gathered points. [`Tile::store`] reads the result.
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
        // The whole tile, because unlit pixels must also be written.
        let end = self.layout.border..self.layout.border + self.rows.len();
        scratch.lit[end].fill([0, usize::MAX]);
        self.filter(filters.end(at), 0, scratch);
    }

    /// Propagates from plane `at` to plane `to` through empty space.
    fn cross(&self, mut at: usize, to: usize, filters: &Filters, scratch: &mut TileScratch) -> usize {
        while at > to {
            let (taps, steps) = filters.part(at - to);
            at -= steps;
            widen(&mut scratch.lit, &mut scratch.wider, self.layout.spread[steps]);
            self.filter(taps, self.layout.halos[at], scratch);
        }
        at
    }

    /// Replaces the field's share with the points of plane `k` where they are (Eq. 3 and 4): they emit light with phase
    /// 0 and block the light from behind.
    fn scatter(&self, colour: usize, k: usize, scratch: &mut TileScratch) {
        let size = self.surfaces.slots.len();
        let rgb = &self.surfaces.rgb[colour * size..][..size];
        let points = scratch.starts[k] as usize..scratch.starts[k + 1] as usize;
        let rows = self.layout.rows();
        let spans = &scratch.point_spans[k * rows..][..rows];
        for (y, span) in spans.iter().enumerate().filter(|(_, span)| span[0] < span[1]) {
            let around = [span[0] - MARGIN.min(span[0]), span[1] + MARGIN];
            for lit in &mut scratch.lit[y - MARGIN.min(y)..(y + MARGIN + 1).min(rows)] {
                *lit = join(*lit, around);
            }
        }
        let [re, im] = scratch.field.each_mut().map(Aligned::values);
        for points in &scratch.points[points] {
            let (at, from) = (points.at as usize, points.from as usize);
            let count = usize::from(points.count);
            let (re, im) = (&mut re[at..at + count], &mut im[at..at + count]);
            let light = &rgb[from..from + count];
            if points.side == Side::On {
                re.copy_from_slice(light);
                im.fill(0.0);
                continue;
            }
            let share = Share::on(k, self.layout.halos.len(), points.side == Side::Behind);
            let depth = &self.surfaces.depth[from..from + count];
            for (((re, im), light), depth) in re.iter_mut().zip(im).zip(light).zip(depth) {
                let share = share.of(*depth);
                *re += share * (light - *re);
                *im -= share * *im;
            }
        }
    }

    /// Filters the field in place where it is lit, in the tile and `halo` around it.
    ///
    /// Columns are processed in strips, narrow enough that the rows in use stay in the nearest cache. Within a strip,
    /// each row is filtered along x into the ring. Once the neighbours below are there too, it is filtered along y back
    /// into the field.
    fn filter(&self, taps: &[[f32; 2]], halo: usize, scratch: &mut TileScratch) {
        let border = self.layout.border;
        let radius = taps.len() - 1;
        let rows = border - halo..border + self.rows.len() + halo;
        let (left, right) = (border - halo, border + self.columns.len() + halo);
        let mut columns = NOWHERE;
        for (y, span) in scratch.lit.iter_mut().enumerate() {
            let [from, to] = [span[0].max(left), span[1].min(right)];
            // Rounding to whole lines is free because they are as fast as partial ones.
            *span = match rows.contains(&y) && from < to {
                true => [from / RUN * RUN, to.next_multiple_of(RUN)],
                false => NOWHERE,
            };
            columns = join(columns, *span);
        }
        // Rows filtered along x are also needed by the rows around them.
        widen_down(&scratch.lit, &mut scratch.wider, radius);
        let step = strip(radius);
        for start in (columns[0]..columns[1]).step_by(step) {
            let strip = Strip {
                columns: start..(start + step).min(columns[1]),
                first: start == columns[0],
                last: start + step >= columns[1],
            };
            self.filter_strip(taps, rows.clone(), &strip, scratch);
        }
    }

    fn filter_strip(&self, taps: &[[f32; 2]], rows: Range<usize>, strip: &Strip, scratch: &mut TileScratch) {
        let stride = self.layout.stride;
        let radius = taps.len() - 1;
        let TileScratch {
            field,
            line,
            kept,
            ring,
            places,
            lit,
            wider,
            ..
        } = scratch;
        let mut field = field.each_mut().map(Aligned::values);
        let mut line = line.each_mut().map(Aligned::values);
        let [ring_re, ring_im] = ring.each_mut().map(Aligned::values);
        let [along, down] = places.each_mut().map(|places| &mut places[..=radius]);
        let Range { start, end } = strip.columns;
        let cut = |[from, to]: Span| [from.max(start), to.min(end)];
        let pitch = end - start;
        let slots = 2 * radius + 1;
        // The slot of `row` in the ring.
        let mut slot = 0;
        for row in rows.start - radius..rows.end + radius {
            let at = row * stride;
            let [from, to] = cut(wider[row]);
            if from < to {
                let out = slot * pitch + from - start..slot * pitch + to - start;
                let out = [&mut ring_re[out.clone()], &mut ring_im[out]];
                let centre = |along: &mut [[usize; 2]], centre: usize| {
                    for (j, place) in along.iter_mut().enumerate() {
                        *place = [centre - j, centre + j];
                    }
                };
                // The number of columns before the strip that the filter reads.
                let overwritten = (start + radius).saturating_sub(from);
                if strip.first || overwritten == 0 {
                    centre(along, at + from);
                    let [re, im] = &field;
                    self.fir.filter(taps, [re, im], along, out);
                } else {
                    for ((field, line), kept) in field.iter().zip(&mut line).zip(&*kept) {
                        let (before, rest) = line.split_at_mut(overwritten);
                        before.copy_from_slice(&kept[row * radius..][radius - overwritten..radius]);
                        let length = to - start + radius;
                        rest[..length].copy_from_slice(&field[at + start..][..length]);
                    }
                    centre(along, radius);
                    self.fir.filter(taps, [line[0], line[1]], along, out);
                }
            }
            if !strip.last {
                for (field, kept) in field.iter().zip(&mut *kept) {
                    kept[row * radius..][..radius].copy_from_slice(&field[at + end - radius..at + end]);
                }
            }
            // Row r needs rows up to r + radius, which is the latest one.
            if let Some(row) = row.checked_sub(radius).filter(|row| *row >= rows.start) {
                let [from, to] = cut(lit[row]);
                if from < to {
                    let place = |slot: usize| slot * pitch + from - start;
                    let wrapped = |i: usize| if i < slots { i } else { i - slots };
                    // The centre was filtered `radius` rows ago.
                    let centre = wrapped(slot + slots - radius);
                    for (j, places) in down.iter_mut().enumerate() {
                        *places = [centre + slots - j, centre + j].map(|i| place(wrapped(i)));
                    }
                    let out = row * stride + from..row * stride + to;
                    let [re, im] = &mut field;
                    let out = [&mut re[out.clone()], &mut im[out]];
                    self.fir.filter(taps, [ring_re, ring_im], down, out);
                }
            }
            slot = if slot + 1 < slots { slot + 1 } else { 0 };
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

/// Columns of the field that are filtered together. After the first strip, the columns that the previous strip has
/// overwritten are kept for it.
struct Strip {
    columns: Range<usize>,
    first: bool,
    last: bool,
}

/// Returns the number of columns of a strip. It lets the rows of a filter's ring stay in the nearest cache, but is at
/// least the filter's radius.
fn strip(radius: usize) -> usize {
    const RING: usize = 3072;
    (RING / (2 * radius + 1)).max(radius).max(2 * RUN).next_multiple_of(RUN)
}

/// Widens spans by `by` pixels in all directions. `wider` is working memory.
fn widen(spans: &mut Vec<Span>, wider: &mut Vec<Span>, by: usize) {
    widen_down(spans, wider, by);
    for span in wider.iter_mut().filter(|span| span[0] < span[1]) {
        *span = [span[0] - by.min(span[0]), span[1] + by];
    }
    std::mem::swap(spans, wider);
}

/// Joins each row's span with those of the rows up to `by` above and below, into `wider`.
fn widen_down(spans: &[Span], wider: &mut [Span], by: usize) {
    wider.fill(NOWHERE);
    for (y, span) in spans.iter().enumerate().filter(|(_, span)| span[0] < span[1]) {
        let rows = y - by.min(y)..(y + by + 1).min(spans.len());
        for wider in &mut wider[rows] {
            *wider = join(*wider, *span);
        }
    }
}
