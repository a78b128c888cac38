//! One tile of the sweep. It processes the planes that hold points in the tile or its halo, from back to front.
//!
//! Light reaches a pixel of the hologram only from within its spread over the distance. A tile therefore needs only a
//! halo as wide as the spread from plane k, and the required field shrinks plane by plane to the tile itself. Likewise,
//! there is no light farther from the points behind a plane than the distance it can have spread. Each row's field is
//! therefore computed only from the leftmost to the rightmost pixel that light can reach, its [`Span`].

use super::Sweep;
use super::filters::{Filters, Optics};
use super::hidden::NOTHING;
use super::shares::{Slot, share};
use crate::Size;
use num_complex::Complex32;
use phasefront_kernels::fir::{Fir, Pixel, RUN, Taps};
use phasefront_kernels::wide;
use std::ops::Range;

/// The number of pixels beyond light's reach that are also computed, because a fitted filter's light spreads slightly
/// farther.
pub const MARGIN: usize = 10;

/// The units of a wave of amplitude 1. Parts of more than 2 saturate.
const UNIT: f32 = 8192.0;

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
    /// The position of each pixel's point among the planes, (H, W).
    pub(super) positions: &'a [f32],
    /// The planes of each pixel's point, (H, W).
    pub(super) slots: &'a [Slot],
    /// The pixels that the hidden layers continue, (layers, H, W).
    pub(super) hidden: &'a [u32],
    pub(super) size: Size,
}

/// The properties that all tiles of a plan share.
pub(super) struct Layout {
    /// The size of a tile.
    tile: Size,
    /// The distance around the tile within which the points of each plane matter, for each colour.
    halos: Vec<Vec<usize>>,
    /// The same for any colour.
    widest: Vec<usize>,
    /// The distance from the edge of the buffer to the tile.
    border: usize,
    stride: usize,
    longest: usize,
    /// The spread of light over each number of planes, for each colour.
    spread: Vec<Vec<usize>>,
}

impl Layout {
    /// Creates the layout of tiles in a frame of `size`.
    pub(super) fn new(size: Size, sweep: Sweep, optics: &[Optics], filters: &[Filters]) -> Self {
        let planes = sweep.planes;
        // Light passes from plane k to plane 0, and from there to the hologram.
        let halo = |optics: &Optics, k: usize| optics.reach(optics.home_m.abs() + k as f64 * optics.step_m) + MARGIN;
        let halos: Vec<Vec<usize>> = (optics.iter())
            .map(|optics| (0..planes).map(|k| halo(optics, k)).collect())
            .collect();
        let widest: Vec<usize> = (0..planes)
            .map(|k| halos.iter().map(|halos| halos[k]).max().unwrap_or(0))
            .collect();
        let part = filters.iter().map(Filters::longest_part).max().unwrap_or(0);
        let ends = (0..planes).flat_map(|k| filters.iter().map(move |f| f.end(k - f.before_end(k)).radius()));
        let end = ends.max().unwrap_or(0);
        let border = (widest[planes - 1] + part).max(end).next_multiple_of(RUN);
        // Tiles of equal size, because the halo of a small rest costs as much as that of a whole tile.
        let side = |size: usize| size.div_ceil(size.div_ceil(sweep.tile));
        let tile = Size {
            width: side(size.width).next_multiple_of(RUN),
            height: side(size.height),
        };
        let spread = |optics: &Optics| (0..planes).map(|k| optics.reach(k as f64 * optics.step_m)).collect();
        Layout {
            tile,
            halos,
            widest,
            border,
            stride: tile.width + 2 * border + RUN,
            longest: part.max(end),
            spread: optics.iter().map(spread).collect(),
        }
    }

    /// Returns the number of tiles down and across a frame.
    pub(super) fn count(&self, size: Size) -> (usize, usize) {
        let Size { width, height } = size;
        (height.div_ceil(self.tile.height), width.div_ceil(self.tile.width))
    }

    /// Returns the number of rows of the buffer.
    fn rows(&self) -> usize {
        self.tile.height + 2 * self.border
    }
}

/// The working memory of one tile at a time.
pub(super) struct TileScratch {
    /// The wave, in rows of `stride`.
    field: Aligned,
    /// The last rows filtered along x, in rows of `stride`.
    ring: Aligned,
    /// The start of each plane's points, and the end.
    starts: Vec<u32>,
    found: Vec<(u16, Points)>,
    /// The index in `found` of the latest points of each plane.
    latest: Vec<u32>,
    points: Vec<Points>,
    /// The span of each plane's points in each row.
    point_spans: Vec<Span>,
    /// The span of possible light in each row of the field.
    lit: Vec<Span>,
    wider: Vec<Span>,
}

/// Pixels that start at a cache line, which makes the kernels faster.
struct Aligned(Vec<Pixel>);

impl Aligned {
    const LINE: usize = 64;

    fn new(length: usize) -> Self {
        Aligned(vec![Pixel::ZERO; length + Self::LINE / size_of::<Pixel>()])
    }

    fn pixels(&mut self) -> &mut [Pixel] {
        let start = self.0.as_ptr().align_offset(Self::LINE);
        &mut self.0[start.min(Self::LINE / size_of::<Pixel>())..]
    }
}

impl TileScratch {
    /// Creates working memory for the tiles of frames of `pixels` pixels in `layers` layers.
    pub(super) fn new(layout: &Layout, pixels: usize, layers: usize) -> Self {
        let (rows, stride, planes) = (layout.rows(), layout.stride, layout.widest.len());
        // Each point can be on two planes. Most of a small frame's buffer lies outside the frame.
        let points = 2 * layers * pixels.min(rows * stride);
        TileScratch {
            field: Aligned::new(rows * stride),
            ring: Aligned::new((2 * layout.longest + 2) * stride),
            starts: vec![0; planes + 1],
            found: Vec::with_capacity(points),
            latest: vec![0; planes],
            points: Vec::with_capacity(points),
            point_spans: vec![NOWHERE; planes * rows],
            lit: vec![NOWHERE; rows],
            wider: vec![NOWHERE; rows],
        }
    }
}

/// Neighbouring points in a row, some of which are on a plane.
#[derive(Clone, Copy, Default)]
struct Points {
    /// The position of the first point in the field.
    at: u32,
    /// The index of the first point's colour and position in the frame. Those of the others follow it.
    from: u32,
    count: u32,
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
        let (_, across) = layout.count(surfaces.size);
        let part = |i: usize, side: usize, size: usize| i * side..((i + 1) * side).min(size);
        Tile {
            layout,
            fir,
            surfaces,
            rows: part(index / across, layout.tile.height, surfaces.size.height),
            columns: part(index % across, layout.tile.width, surfaces.size.width),
        }
    }

    /// Sorts the points that the tile needs by plane. Within a plane, hidden layers come first, so that the front is
    /// written last.
    pub(super) fn gather(&self, scratch: &mut TileScratch) {
        scratch.starts.fill(0);
        scratch.found.clear();
        scratch.latest.fill(u32::MAX);
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
        starts.copy_within(0..self.layout.widest.len(), 1);
        starts[0] = 0;
    }

    /// Finds the points of a layer, where 0 is the front.
    fn find(&self, layer: usize, scratch: &mut TileScratch) {
        let Surfaces {
            slots,
            hidden,
            size: Size { width, height },
            ..
        } = self.surfaces;
        let widest = self.layout.widest.last().copied().unwrap_or(0);
        let around =
            |side: &Range<usize>, size: usize| side.start.saturating_sub(widest)..(side.end + widest).min(size);
        let columns = around(&self.columns, width);
        for y in around(&self.rows, height) {
            let row = y * width;
            if layer == 0 {
                // Runs of whole registers cost less than runs of the points that are on one plane.
                let slots = &slots[row..][..width];
                let planes = |x: usize| match slots[x..].first_chunk::<RUN>() {
                    Some(run) => range(run),
                    None => range(&slots[x..]),
                };
                let mut x = columns.start / RUN * RUN;
                while x < columns.end {
                    let of = planes(x);
                    let more = (x + RUN..columns.end).step_by(RUN).take_while(|x| planes(*x) == of);
                    let end = (x + RUN + more.count() * RUN).min(width);
                    let run = &slots[x..end];
                    if of[1] - of[0] <= 2 {
                        self.add(of, (y, x), row + x, run.len(), scratch);
                    } else {
                        for slot in run.chunk_by(|a, b| a == b) {
                            self.add([slot[0]; 2], (y, x), row + x, run.len(), scratch);
                        }
                    }
                    x = end;
                }
            } else {
                let sources = &hidden[(layer - 1) * slots.len() + row..][..width];
                for (x, source) in sources[columns.clone()]
                    .iter()
                    .enumerate()
                    .filter(|(_, s)| **s != NOTHING)
                {
                    let source = *source as usize;
                    self.add([slots[source]; 2], (y, columns.start + x), source, 1, scratch);
                }
            }
        }
    }

    /// Adds `count` points from pixel (y, x) of the frame on to the planes from the least to the most of two slots. The
    /// colour and position of the first point are at `from`.
    fn add(
        &self,
        [least, most]: [Slot; 2],
        (y, x): (usize, usize),
        from: usize,
        count: usize,
        scratch: &mut TileScratch,
    ) {
        let &Layout { border, stride, .. } = self.layout;
        for k in least as usize / 2..=(most as usize).div_ceil(2) {
            let halo = self.layout.widest[k];
            if y + halo < self.rows.start
                || y >= self.rows.end + halo
                || x + count + halo <= self.columns.start
                || x >= self.columns.end + halo
            {
                continue;
            }
            let (y, x) = (y + border - self.rows.start, x + border - self.columns.start);
            let points = Points {
                at: (y * stride + x) as u32,
                from: from as u32,
                count: count as u32,
            };
            let span = &mut scratch.point_spans[k * self.layout.rows() + y];
            *span = join(*span, [x, x + count]);
            if let Some((on, latest)) = scratch.found.get_mut(scratch.latest[k] as usize)
                && *on == k as u16
                && points.at.wrapping_sub(latest.at) == points.from.wrapping_sub(latest.from)
                && points.at - latest.at <= latest.count
            {
                latest.count = points.at - latest.at + points.count;
                continue;
            }
            scratch.latest[k] = scratch.found.len() as u32;
            scratch.found.push((k as u16, points));
            scratch.starts[k + 1] += 1;
        }
    }

    /// Sweeps one colour over the gathered points. [`Tile::store`] reads the result.
    pub(super) fn sweep(&self, colour: usize, filters: &Filters, scratch: &mut TileScratch) {
        scratch.field.pixels().fill(Pixel::ZERO);
        scratch.lit.fill(NOWHERE);
        let occupied = |starts: &[u32], k: usize| starts[k] < starts[k + 1];
        let Some(mut at) = (0..self.layout.widest.len())
            .rev()
            .find(|k| occupied(&scratch.starts, *k))
        else {
            return;
        };
        self.scatter(colour, at, scratch);
        while let Some(next) = (0..at).rev().find(|k| occupied(&scratch.starts, *k)) {
            at = self.cross(colour, [at, next], filters, scratch);
            self.scatter(colour, at, scratch);
        }
        at = self.cross(colour, [at, at - filters.before_end(at)], filters, scratch);
        // The whole tile, because unlit pixels must also be written.
        let end = self.layout.border..self.layout.border + self.rows.len();
        scratch.lit[end].fill([0, usize::MAX]);
        self.filter(filters.end(at), 0, scratch);
    }

    /// Propagates from plane `at` to plane `to` through empty space.
    fn cross(&self, colour: usize, [mut at, to]: [usize; 2], filters: &Filters, scratch: &mut TileScratch) -> usize {
        while at > to {
            let (taps, steps) = filters.part(at - to);
            at -= steps;
            widen(&mut scratch.lit, &mut scratch.wider, self.layout.spread[colour][steps]);
            self.filter(taps, self.layout.halos[colour][at], scratch);
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
        let field = scratch.field.pixels();
        let positions = self.surfaces.positions;
        wide!({
            for points in &scratch.points[points] {
                let (at, from) = (points.at as usize, points.from as usize);
                let count = points.count as usize;
                let field = &mut field[at..at + count];
                let points = rgb[from..from + count].iter().zip(&positions[from..from + count]);
                for (pixel, (light, position)) in field.iter_mut().zip(points) {
                    *pixel = blend(*pixel, round(light * UNIT), share(*position, k as f32));
                }
            }
        });
    }

    /// Filters the field in place where it is lit, in the tile and `halo` around it.
    ///
    /// Each row is filtered along x into the ring. Once the rows below are there too, it is filtered along y back into
    /// the field.
    fn filter(&self, taps: &Taps, halo: usize, scratch: &mut TileScratch) {
        let &Layout { border, stride, .. } = self.layout;
        let radius = taps.radius();
        let rows = border - halo..border + self.rows.len() + halo;
        let (left, right) = (border - halo, border + self.columns.len() + halo);
        for (y, span) in scratch.lit.iter_mut().enumerate() {
            let [from, to] = [span[0].max(left), span[1].min(right)];
            // Rounding to whole lines is free because they are as fast as partial ones.
            *span = match rows.contains(&y) && from < to {
                true => [from / RUN * RUN, to.next_multiple_of(RUN)],
                false => NOWHERE,
            };
        }
        // Rows filtered along x are also needed by the rows around them.
        widen_down(&scratch.lit, &mut scratch.wider, radius);
        let (field, ring) = (scratch.field.pixels(), scratch.ring.pixels());
        let slots = 2 * radius + 2;
        for row in rows.start - radius..rows.end + radius {
            let [from, to] = scratch.wider[row];
            if from < to {
                let slot = &mut ring[row % slots * stride..][..stride];
                let source = &field[row * stride + from - radius..row * stride + to + radius];
                self.fir.along(taps, source, &mut slot[from..to]);
            }
            // Row r needs rows up to r + radius, which is the latest one.
            let Some(row) = row.checked_sub(radius).filter(|row| rows.contains(row)) else {
                continue;
            };
            let is_second = (row - rows.start) % 2 == 1;
            if !is_second && row + 1 < rows.end {
                // It is filtered with the next row.
                continue;
            }
            let first = row - usize::from(is_second);
            let [from, to] = scratch.lit[first];
            if is_second && from < to && scratch.lit[row] == scratch.lit[first] {
                let (first_out, out) = field[first * stride..].split_at_mut(stride);
                let out = [&mut first_out[from..to], &mut out[from..to]];
                self.fir.down_two(taps, ring, stride, first % slots, from, out);
                continue;
            }
            for row in first..=row {
                let [from, to] = scratch.lit[row];
                if from < to {
                    let out = &mut field[row * stride..][from..to];
                    self.fir.down(taps, ring, stride, row % slots, from, out);
                }
            }
        }
    }

    /// Writes the swept tile into a colour's plane of the frame.
    pub(super) fn store(&self, plane: &mut [Complex32], scratch: &mut TileScratch) {
        let &Layout { border, stride, .. } = self.layout;
        let field = scratch.field.pixels();
        for (i, y) in self.rows.clone().enumerate() {
            let at = (border + i) * stride + border;
            let out = &mut plane[y * self.surfaces.size.width..][self.columns.clone()];
            wide!(for (out, pixel) in out.iter_mut().zip(&field[at..]) {
                *out = Complex32::new(pixel.re() as f32, pixel.im() as f32) * (1.0 / UNIT);
            });
        }
    }
}

/// Returns the least and the most of slots.
#[inline(always)]
fn range(slots: &[Slot]) -> [Slot; 2] {
    let least = slots.iter().fold(Slot::MAX, |least, slot| least.min(*slot));
    let most = slots.iter().fold(0, |most, slot| most.max(*slot));
    [least, most]
}

/// Rounds a value of 0 to 2¹⁶ to the nearest integer.
#[inline(always)]
fn round(value: f32) -> i32 {
    // With this addend, the integer is in the lower bits of the sum. A conversion would not be vectorised as well.
    const ADDEND: f32 = (3 << 22) as f32;
    (value + ADDEND).to_bits().cast_signed() - ADDEND.to_bits().cast_signed()
}

/// Replaces a share of `pixel` with the same share of `light`.
#[inline(always)]
fn blend(pixel: Pixel, light: i32, share: f32) -> Pixel {
    let share = round(share * 32768.0);
    let part = |part: i32, light: i32| part + ((share * (light - part) + 16384) >> 15);
    Pixel::new(part(pixel.re(), light), part(pixel.im(), 0))
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
