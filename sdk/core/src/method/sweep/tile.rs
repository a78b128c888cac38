//! One tile of the sweep. It processes the planes that hold points in the tile or its halo, from back to front.
//!
//! Light reaches a pixel of the hologram only from within its spread over the distance. A tile therefore needs only a
//! halo as wide as the spread from plane k, and the required field shrinks plane by plane. Likewise, there is no light
//! farther from the points behind a plane than the distance it can have spread. Each row's field is therefore computed
//! only from the leftmost to the rightmost pixel that light can reach, its [`Span`].

use super::Sweep;
use super::filters::{Filters, Optics};
use super::points::Points;
use super::shares::{Slot, in_units, round, share};
use super::spans::{NOWHERE, Span, join, widen, widen_down};
use crate::Size;
use crate::method::wave::{PixelSum, UNIT};
use phasefront_kernels::fir::{Fir, Pixel, RUN, Taps};
use phasefront_kernels::wide;
use std::ops::Range;

/// The number of pixels beyond light's reach that are also computed, because a fitted filter's light spreads slightly
/// farther.
pub const MARGIN: usize = 10;
/// The same around a tile.
const HALO_MARGIN: usize = 8;

/// The surfaces of a frame: the positions and colours of the points of each pixel.
#[derive(Clone, Copy)]
pub(super) struct Surfaces<'a> {
    /// The colours, (C, H, W).
    pub(super) rgb: &'a [f32],
    /// The position of each pixel's point among the planes, (H, W).
    pub(super) positions: &'a [f32],
    /// The planes of each pixel's point, (H, W).
    pub(super) slots: &'a [Slot],
    /// The least and the most of the slots of each [`RUN`] pixels of a row.
    pub(super) ranges: &'a [[Slot; 2]],
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
    pub(super) widest: Vec<usize>,
    /// The first plane whose points matter at each distance from the tile.
    first_planes: Vec<usize>,
    /// The distance from the edge of the buffer to the tile.
    border: usize,
    pub(super) stride: usize,
    longest: usize,
    /// The spread of light over each number of planes, for each colour.
    spread: Vec<Vec<usize>>,
}

impl Layout {
    /// Creates the layout of tiles in a frame of `size`.
    pub(super) fn new(size: Size, sweep: Sweep, optics: &[Optics], filters: &[Filters]) -> Self {
        let planes = sweep.planes;
        // Light goes from plane k to plane 0, and from there to the hologram. If that lies behind plane 0, light
        // returns to where it was, except for what points block on the way. Half of the detour holds nearly all of
        // that.
        let halo = |optics: &Optics, k: usize| {
            let (home_m, depth_m) = (optics.home_m, k as f64 * optics.step_m);
            let direct_m = home_m.abs().max((home_m + depth_m).abs());
            optics.reach((direct_m + home_m.abs() + depth_m) / 2.0) + HALO_MARGIN
        };
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
        let first_plane = |away: usize| widest.partition_point(|halo| *halo < away);
        let first_planes = (0..=widest[planes - 1]).map(first_plane).collect();
        Layout {
            tile,
            halos,
            first_planes,
            widest,
            border,
            stride: tile.width + 2 * border + RUN,
            longest: part.max(end),
            spread: optics.iter().map(spread).collect(),
        }
    }

    /// Returns the rows and columns of tiles of equal size that cover `rows` and `columns`, at least `least` down.
    pub(super) fn tiles(
        &self,
        rows: Range<usize>,
        columns: Range<usize>,
        least: usize,
    ) -> impl Iterator<Item = [Range<usize>; 2]> {
        let part = |of: Range<usize>, side: usize| {
            let starts = of.clone().step_by(side);
            starts.map(move |start| start..(start + side).min(of.end))
        };
        let height = rows.len().div_ceil(rows.len().div_ceil(self.tile.height).max(least));
        // Tiles start at whole registers.
        let columns = columns.start / RUN * RUN..columns.end;
        let width = columns.len().div_ceil(columns.len().div_ceil(self.tile.width));
        part(rows, height).flat_map(move |rows| {
            part(columns.clone(), width.next_multiple_of(RUN)).map(move |columns| [rows.clone(), columns])
        })
    }

    /// Returns the first plane whose points matter `away` pixels from the tile, or the number of planes.
    #[inline(always)]
    pub(super) fn first_plane(&self, away: usize) -> usize {
        self.first_planes.get(away).copied().unwrap_or(self.widest.len())
    }

    /// Returns the distance from a pixel within which points may matter.
    pub(super) fn reach(&self) -> usize {
        self.widest.last().copied().unwrap_or(0)
    }

    /// Returns the number of rows of the buffer.
    pub(super) fn rows(&self) -> usize {
        self.tile.height + 2 * self.border
    }
}

/// The working memory of one tile at a time.
pub(super) struct TileScratch {
    /// The wave, in rows of `stride`.
    field: Aligned,
    /// The last rows filtered along x, in rows of `stride`.
    ring: Aligned,
    pub(super) points: Points,
    /// The light of a run of points, and the shares that it takes ([`Fir::blend`]).
    emitted: Vec<Pixel>,
    blocked: Vec<Pixel>,
    /// The span of possible light in each row of the field.
    lit: Vec<Span>,
    /// The registers that hold `lit`.
    filtered: Vec<Span>,
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
    /// Creates working memory for the tiles of frames of `pixels` pixels with `hidden_layers`.
    pub(super) fn new(layout: &Layout, pixels: usize, hidden_layers: usize) -> Self {
        let (rows, stride) = (layout.rows(), layout.stride);
        let spread = layout.spread.iter().flatten().copied().max().unwrap_or(0);
        let rows_and_more = rows + 2 * layout.longest.max(spread);
        let mut lit = Vec::with_capacity(rows_and_more);
        lit.resize(rows, NOWHERE);
        TileScratch {
            field: Aligned::new(rows * stride),
            ring: Aligned::new((2 * layout.longest + 2) * stride),
            points: Points::new(layout, pixels, hidden_layers),
            emitted: vec![Pixel::ZERO; stride],
            blocked: vec![Pixel::ZERO; stride],
            lit,
            filtered: vec![NOWHERE; rows],
            wider: Vec::with_capacity(rows_and_more),
        }
    }
}

/// A tile of a frame, or a part of it.
pub(super) struct Tile<'a> {
    pub(super) layout: &'a Layout,
    pub(super) fir: Fir,
    pub(super) surfaces: Surfaces<'a>,
    /// The tile's position in the frame. Its first column is a multiple of [`RUN`].
    pub(super) rows: Range<usize>,
    pub(super) columns: Range<usize>,
}

impl Tile<'_> {
    /// Returns the rows and columns of the frame whose points may matter.
    pub(super) fn around(&self) -> (Range<usize>, Range<usize>) {
        let reach = self.layout.reach();
        let around = |side: &Range<usize>, size: usize| side.start.saturating_sub(reach)..(side.end + reach).min(size);
        let Size { width, height } = self.surfaces.size;
        (around(&self.rows, height), around(&self.columns, width))
    }

    /// Returns the row and column of the field of pixel (y, x) of the frame.
    #[inline(always)]
    pub(super) fn place(&self, y: usize, x: usize) -> (usize, usize) {
        let border = self.layout.border;
        (y + border - self.rows.start, x + border - self.columns.start)
    }

    /// Sweeps one colour over the gathered points. [`Tile::store`] reads the result.
    pub(super) fn sweep(&self, colour: usize, filters: &Filters, scratch: &mut TileScratch) {
        scratch.field.pixels().fill(Pixel::ZERO);
        scratch.lit.fill(NOWHERE);
        let planes = self.layout.widest.len();
        let Some(mut at) = (0..planes).rev().find(|k| scratch.points.are_on(*k)) else {
            return;
        };
        self.scatter(colour, at, scratch);
        while let Some(next) = (0..at).rev().find(|k| scratch.points.are_on(*k)) {
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
            widen(&scratch.lit, &mut scratch.wider, self.layout.spread[colour][steps]);
            std::mem::swap(&mut scratch.lit, &mut scratch.wider);
            self.filter(taps, self.layout.halos[colour][at], scratch);
        }
        at
    }

    /// Replaces the field's share with the points of plane `k` where they are (Eq. 3 and 4): they emit light with phase
    /// 0 and block the light from behind.
    fn scatter(&self, colour: usize, k: usize, scratch: &mut TileScratch) {
        let TileScratch {
            field,
            points,
            lit,
            emitted,
            blocked,
            ..
        } = scratch;
        for (lit, around) in lit.iter_mut().zip(points.around(k)) {
            *lit = join(*lit, *around);
        }
        let size = self.surfaces.slots.len();
        let rgb = &self.surfaces.rgb[colour * size..][..size];
        let positions = self.surfaces.positions;
        let field = field.pixels();
        for point in points.hidden(k) {
            let pixel = &mut field[point.at as usize];
            *pixel = pixel.blend(light(rgb[point.from as usize]), point.share);
        }
        wide!({
            for run in points.front(k) {
                let (at, from) = (run.at as usize, run.from as usize);
                let count = run.count as usize;
                let points = rgb[from..from + count].iter().zip(&positions[from..from + count]);
                for ((emitted, blocked), (amplitude, position)) in emitted.iter_mut().zip(&mut *blocked).zip(points) {
                    *emitted = light(*amplitude);
                    let part = -in_units(share(*position, k as f32));
                    *blocked = Pixel::new(part, part);
                }
                // A run ends within a register only at the edge of the frame.
                let whole = count.next_multiple_of(RUN);
                blocked[count..whole].fill(Pixel::ZERO);
                self.fir
                    .blend(&mut field[at..at + whole], &emitted[..whole], &blocked[..whole]);
            }
        });
    }

    /// Filters the field in place where it is lit, in the tile and `halo` around it.
    ///
    /// Each row is filtered along x into the ring. Once the rows below are there too, it is filtered along y back into
    /// the field.
    fn filter(&self, taps: &Taps, halo: usize, scratch: &mut TileScratch) {
        let &Layout { border, stride, .. } = self.layout;
        let TileScratch {
            field,
            ring,
            lit,
            filtered,
            wider,
            ..
        } = scratch;
        let radius = taps.radius();
        let rows = border - halo..border + self.rows.len() + halo;
        let (left, right) = (border - halo, border + self.columns.len() + halo);
        for (y, (lit, filtered)) in lit.iter().zip(&mut *filtered).enumerate() {
            let [from, to] = [lit[0].max(left), lit[1].min(right)];
            // Rounding to whole lines is free because they are as fast as partial ones. The light itself is not
            // rounded, or it would spread by a line in each step.
            *filtered = match rows.contains(&y) && from < to {
                true => [from / RUN * RUN, to.next_multiple_of(RUN)],
                false => NOWHERE,
            };
        }
        // Two rows are filtered together, so both take the pixels of either.
        for pair in filtered[rows.clone()].chunks_mut(2) {
            let both = pair.iter().fold(NOWHERE, |both, span| join(both, *span));
            pair.fill(both);
        }
        // Rows filtered along x are also needed by the rows around them.
        widen_down(filtered, wider, radius);
        let (field, ring) = (field.pixels(), ring.pixels());
        let slots = 2 * radius + 2;
        for row in rows.start - radius..rows.end + radius {
            let [from, to] = wider[row];
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
            let [from, to] = filtered[row];
            if from >= to {
                continue;
            }
            if is_second {
                let first = row - 1;
                let (first_out, out) = field[first * stride..].split_at_mut(stride);
                let out = [&mut first_out[from..to], &mut out[from..to]];
                self.fir.down_two(taps, ring, stride, first % slots, from, out);
            } else {
                let out = &mut field[row * stride..][from..to];
                self.fir.down(taps, ring, stride, row % slots, from, out);
            }
        }
    }

    /// Writes the swept tile into a colour's plane of the frame's wave, and keeps the sum of the plane's pixels.
    pub(super) fn store(&self, wave: &mut [Pixel], sum: &mut PixelSum, scratch: &mut TileScratch) {
        let &Layout { border, stride, .. } = self.layout;
        let field = scratch.field.pixels();
        for (i, y) in self.rows.clone().enumerate() {
            let row = &field[(border + i) * stride + border..][..self.columns.len()];
            let at = y * self.surfaces.size.width + self.columns.start;
            let wave = &mut wave[at..][..row.len()];
            // A row of the largest tile stays within 32 bits.
            let mut grown = [0_i32; 2];
            wide!(for (old, new) in wave.iter_mut().zip(row) {
                grown[0] += new.re() - old.re();
                grown[1] += new.im() - old.im();
                *old = *new;
            });
            for (sum, grown) in sum.iter_mut().zip(grown) {
                *sum += i64::from(grown);
            }
        }
    }
}

/// Returns the light of a point of phase 0, in units of [`UNIT`].
#[inline(always)]
fn light(amplitude: f32) -> Pixel {
    Pixel::new(round(amplitude * UNIT), 0)
}
