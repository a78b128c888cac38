//! One tile of the sweep: the planes that hold points in the tile or its halo, back to front.
//!
//! Light reaches a pixel of the hologram from no farther than light can spread on its way, so from plane k a tile needs
//! only a halo of that many pixels, and the field that is computed shrinks plane by plane to the tile itself.

use super::filters::Filters;
use num_complex::Complex32;
use phasefront_kernels::fir::{Fir, RUN};
use std::ops::Range;

/// Rows that are filtered along x before they are filtered along y.
const BAND: usize = 32;
/// Pixels of halo beyond light's reach: a fitted filter's light runs a little ahead.
const HALO_MARGIN: usize = 4;

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
}

impl Layout {
    /// For tiles of `tile`² pixels; `reach(k)` is how far light spreads from plane k to the hologram.
    pub(super) fn new(
        tile: usize,
        planes: usize,
        reach: impl Fn(usize) -> usize,
        filters: &[Filters; 3],
    ) -> Self {
        let halos: Vec<usize> = (0..planes).map(|k| reach(k) + HALO_MARGIN).collect();
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
        }
    }

    /// Tiles down and across a frame.
    pub(super) fn count(&self, height: usize, width: usize) -> (usize, usize) {
        (height.div_ceil(self.tile), width.div_ceil(self.tile))
    }

    pub(super) fn scratch(&self) -> TileScratch {
        let rows = self.tile + 2 * self.border;
        let plane = || vec![0.0; rows * self.stride];
        let strip = || vec![0.0; (BAND + 2 * self.longest) * self.stride];
        TileScratch {
            field: [plane(), plane()],
            strip: [strip(), strip()],
            starts: vec![0; self.halos.len() + 1],
            points: Vec::new(),
        }
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
    field: [Vec<f32>; 2],
    /// Rows filtered along x.
    strip: [Vec<f32>; 2],
    /// Where each plane's points start, and the end.
    starts: Vec<u32>,
    points: Vec<Point>,
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
        let TileScratch { starts, points, .. } = scratch;
        starts.fill(0);
        self.visit(|plane, _, _| starts[plane + 1] += 1);
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        let total = starts.last().copied().unwrap_or(0) as usize;
        points.resize(total, Point::default());
        // Each start runs to its plane's end, which is the next one's start; shifted back afterwards.
        self.visit(|plane, at, from| {
            points[starts[plane] as usize] = Point {
                at: at as u32,
                from: from as u32,
            };
            starts[plane] += 1;
        });
        starts.copy_within(0..self.layout.halos.len(), 1);
        starts[0] = 0;
    }

    /// Calls `point` with plane, place in the field and pixel of colour of each point.
    fn visit(&self, mut point: impl FnMut(usize, usize, usize)) {
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
                let place = (y + border - self.rows.start) * self.layout.stride;
                let row = y * width;
                let mut add = |x: usize, from: usize| {
                    let plane = usize::from(planes[from]);
                    if halos[plane] >= above.max(outside(x, &self.columns)) {
                        point(plane, place + x + border - self.columns.start, from);
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
        scratch.field.iter_mut().for_each(|part| part.fill(0.0));
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
        let [re, im] = &mut scratch.field;
        for point in &scratch.points[points] {
            re[point.at as usize] = rgb[point.from as usize];
            im[point.at as usize] = 0.0;
        }
    }

    /// Filters the field in place, for the tile and `halo` around it: a band of rows along x, then along y.
    fn filter(&self, taps: &[[f32; 2]], halo: usize, scratch: &mut TileScratch) {
        let &Layout { border, stride, .. } = self.layout;
        let radius = taps.len() - 1;
        let top = border - halo;
        let bottom = border + self.rows.len() + halo;
        let left = border - halo;
        let run = (self.columns.len() + 2 * halo).next_multiple_of(RUN);
        let [field_re, field_im] = &mut scratch.field;
        let [strip_re, strip_im] = &mut scratch.strip;
        let mut filled = top - radius;
        for y in (top..bottom).step_by(BAND) {
            let end = (y + BAND).min(bottom);
            // Row r of the field lies filtered along x in row r − (y − radius) of the strip.
            let base = y - radius;
            if y > top {
                let kept = 2 * radius * run;
                for strip in [&mut *strip_re, &mut *strip_im] {
                    strip.copy_within(BAND * run..BAND * run + kept, 0);
                }
            }
            for row in filled..end + radius {
                let out = (row - base) * run..(row - base + 1) * run;
                self.fir.filter(
                    taps,
                    [field_re, field_im],
                    row * stride + left,
                    1,
                    [&mut strip_re[out.clone()], &mut strip_im[out]],
                );
            }
            filled = end + radius;
            for row in y..end {
                let out = row * stride + left..row * stride + left + run;
                self.fir.filter(
                    taps,
                    [strip_re, strip_im],
                    (row - base) * run,
                    run,
                    [&mut field_re[out.clone()], &mut field_im[out]],
                );
            }
        }
    }

    /// Writes the swept tile into a colour's plane of the frame.
    pub(super) fn store(&self, plane: &mut [Complex32], scratch: &TileScratch) {
        let &Layout { border, stride, .. } = self.layout;
        let [re, im] = &scratch.field;
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
