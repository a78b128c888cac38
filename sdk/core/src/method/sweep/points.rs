//! The points of a tile and its halo, sorted by plane.
//!
//! Within a plane, the points of hidden layers come first, so that the front is written last. The front's points lie
//! side by side and are kept as runs of whole registers. Hidden points lie apart, so each is kept alone, with its
//! share.

use super::Sweep;
use super::hidden::NOTHING;
use super::shares::{Slot, in_units, share};
use super::spans::{NOWHERE, Span, join, widen};
use super::tile::{Layout, MARGIN, Tile};
use crate::Size;
use phasefront_kernels::fir::RUN;
use std::ops::Range;

/// Neighbouring points of the front, some of which are on a plane.
#[derive(Clone, Copy, Default)]
pub(super) struct FrontRun {
    /// The position of the first point in the tile's field.
    pub(super) at: u32,
    /// The index of the first point's colour and position in the frame. Those of the others follow it.
    pub(super) from: u32,
    pub(super) count: u32,
}

/// A point of a hidden layer on a plane.
#[derive(Clone, Copy, Default)]
pub(super) struct HiddenPoint {
    /// The position in the tile's field.
    pub(super) at: u32,
    /// The index of the point's colour in the frame.
    pub(super) from: u32,
    /// The point's share on the plane, in units of [`in_units`].
    pub(super) share: i32,
}

/// Items sorted by plane: counted first, then put in their places. Items of one plane keep their order.
struct ByPlane<T> {
    items: Vec<T>,
    /// The start of each plane's items, and the end.
    starts: Vec<u32>,
}

impl<T: Copy + Default> ByPlane<T> {
    fn new(planes: usize, most: usize) -> Self {
        ByPlane {
            items: Vec::with_capacity(most),
            starts: vec![0; planes + 1],
        }
    }

    /// Forgets all items.
    fn clear(&mut self) {
        self.items.clear();
        self.starts.fill(0);
    }

    /// Counts an item that will be on `plane`.
    #[inline(always)]
    fn count(&mut self, plane: usize) {
        self.starts[plane + 1] += 1;
    }

    /// Puts in `items`, which were counted, each with its plane.
    fn put(&mut self, items: impl Iterator<Item = (usize, T)>) {
        for k in 1..self.starts.len() {
            self.starts[k] += self.starts[k - 1];
        }
        let planes = self.starts.len() - 1;
        self.items.resize(self.starts[planes] as usize, T::default());
        // Each start advances to its plane's end, which is the next plane's start. The starts are shifted back
        // afterwards.
        for (plane, item) in items {
            let start = &mut self.starts[plane];
            self.items[*start as usize] = item;
            *start += 1;
        }
        self.starts.copy_within(0..planes, 1);
        self.starts[0] = 0;
    }

    fn of(&self, plane: usize) -> &[T] {
        &self.items[self.starts[plane] as usize..self.starts[plane + 1] as usize]
    }
}

/// A hidden point and its planes, from the first to the last.
#[derive(Clone, Copy)]
struct FoundHidden {
    at: u32,
    from: u32,
    position: f32,
    planes: [u16; 2],
}

/// The points of one tile at a time.
pub(super) struct Points {
    front: ByPlane<FrontRun>,
    hidden: ByPlane<HiddenPoint>,
    found_front: Vec<(u16, FrontRun)>,
    found_hidden: Vec<FoundHidden>,
    /// The index in `found_front` of the latest run of each plane.
    latest: Vec<u32>,
    /// The span of each plane's points in each row of the field. After [`Points::gather`], the span of all pixels
    /// within [`MARGIN`] of them.
    spans: Vec<Span>,
    wider_spans: Vec<Span>,
    rows: usize,
}

impl Points {
    /// Creates memory for the points of a tile of `layout` in frames of `pixels` pixels with `hidden_layers`.
    pub(super) fn new(layout: &Layout, pixels: usize, hidden_layers: usize) -> Self {
        let (rows, planes) = (layout.rows(), layout.widest.len());
        // Each point can be on two planes. Most of a small frame's buffer lies outside the frame.
        let points = pixels.min(rows * layout.stride);
        Points {
            front: ByPlane::new(planes, 2 * points),
            hidden: ByPlane::new(planes, 2 * hidden_layers * points),
            found_front: Vec::with_capacity(2 * points),
            found_hidden: Vec::with_capacity(hidden_layers * points),
            latest: vec![0; planes],
            spans: vec![NOWHERE; planes * rows],
            wider_spans: Vec::with_capacity(rows + 2 * MARGIN),
            rows,
        }
    }

    /// Returns whether plane `k` has points.
    pub(super) fn are_on(&self, k: usize) -> bool {
        !self.front.of(k).is_empty() || !self.hidden.of(k).is_empty()
    }

    /// Returns the runs of the front on plane `k`.
    pub(super) fn front(&self, k: usize) -> &[FrontRun] {
        self.front.of(k)
    }

    /// Returns the hidden points on plane `k`.
    pub(super) fn hidden(&self, k: usize) -> &[HiddenPoint] {
        self.hidden.of(k)
    }

    /// Returns the span of the pixels within [`MARGIN`] of plane `k`'s points in each row of the field.
    pub(super) fn around(&self, k: usize) -> &[Span] {
        &self.spans[k * self.rows..][..self.rows]
    }

    /// Sorts the points that `tile` needs by plane.
    pub(super) fn gather(&mut self, tile: &Tile<'_>) {
        self.front.clear();
        self.hidden.clear();
        self.found_front.clear();
        self.found_hidden.clear();
        self.latest.fill(u32::MAX);
        self.spans.fill(NOWHERE);
        let surfaces = tile.surfaces;
        for sources in surfaces.hidden.chunks_exact(surfaces.slots.len()).rev() {
            self.find_hidden(tile, sources);
        }
        self.find_front(tile);
        let front = self.found_front.iter();
        self.front.put(front.map(|(plane, run)| (usize::from(*plane), *run)));
        let hidden = self.found_hidden.iter();
        self.hidden.put(hidden.flat_map(|found| {
            let [first, last] = found.planes;
            (first..=last).map(|k| {
                let point = HiddenPoint {
                    at: found.at,
                    from: found.from,
                    share: in_units(share(found.position, f32::from(k))),
                };
                (usize::from(k), point)
            })
        }));
        for k in 0..self.latest.len() {
            if self.are_on(k) {
                let spans = &mut self.spans[k * self.rows..][..self.rows];
                widen(spans, &mut self.wider_spans, MARGIN);
                spans.copy_from_slice(&self.wider_spans);
            }
        }
    }

    fn find_front(&mut self, tile: &Tile<'_>) {
        let Size { width, .. } = tile.surfaces.size;
        let (rows, columns) = tile.around();
        for y in rows {
            let slots = &tile.surfaces.slots[y * width..][..width];
            let runs = width.div_ceil(RUN);
            let ranges = &tile.surfaces.ranges[y * runs..][..runs];
            let planes = |x: usize| ranges.get(x / RUN).copied().unwrap_or_default();
            // Runs of whole registers cost less than runs of the points that are on one plane.
            let mut x = columns.start / RUN * RUN;
            let mut next = planes(x);
            while x < columns.end {
                let of = next;
                let mut end = x + RUN;
                next = planes(end);
                if of[1] - of[0] <= 2 {
                    while next == of && end < columns.end {
                        end += RUN;
                        next = planes(end);
                    }
                    self.add_run(tile, of, (y, x..end.min(width)));
                } else {
                    for slot in slots[x..end.min(width)].chunk_by(|a, b| a == b) {
                        self.add_run(tile, [slot[0]; 2], (y, x..end.min(width)));
                    }
                }
                x = end;
            }
        }
    }

    /// Adds the points of columns `x` in row `y` of the frame to the planes from the least to the most of two slots.
    fn add_run(&mut self, tile: &Tile<'_>, [least, most]: [Slot; 2], (y, x): (usize, Range<usize>)) {
        let from = (y * tile.surfaces.size.width + x.start) as u32;
        let away = outside(y..y + 1, &tile.rows).max(outside(x.clone(), &tile.columns));
        let (row, column) = tile.place(y, x.start);
        let at = (row * tile.layout.stride + column) as u32;
        let first = (least as usize / 2).max(tile.layout.first_plane(away));
        for k in first..=(most as usize).div_ceil(2) {
            let span = &mut self.spans[k * self.rows + row];
            *span = join(*span, [column, column + x.len()]);
            if let Some((on, latest)) = self.found_front.get_mut(self.latest[k] as usize)
                && *on == k as u16
                && at.wrapping_sub(latest.at) == from.wrapping_sub(latest.from)
                && at - latest.at <= latest.count
            {
                latest.count = at - latest.at + x.len() as u32;
                continue;
            }
            self.latest[k] = self.found_front.len() as u32;
            let count = x.len() as u32;
            self.found_front.push((k as u16, FrontRun { at, from, count }));
            self.front.count(k);
        }
    }

    fn find_hidden(&mut self, tile: &Tile<'_>, sources: &[u32]) {
        let Size { width, .. } = tile.surfaces.size;
        let (rows, columns) = tile.around();
        for y in rows {
            let sources = &sources[y * width..][columns.clone()];
            for (block, sources) in sources.chunks(RUN).enumerate() {
                // Checking all without an early exit takes only a few instructions.
                if sources.iter().fold(true, |none, source| none & (*source == NOTHING)) {
                    continue;
                }
                let x = columns.start + block * RUN;
                for (x, source) in (x..).zip(sources).filter(|(_, source)| **source != NOTHING) {
                    self.add_hidden(tile, *source, (y, x));
                }
            }
        }
    }

    /// Adds the point at pixel (y, x) of the frame that continues pixel `source`.
    #[inline(always)]
    fn add_hidden(&mut self, tile: &Tile<'_>, source: u32, (y, x): (usize, usize)) {
        let position = tile.surfaces.positions[source as usize];
        let slot = Sweep::slot(position) as usize;
        let away = outside(y..y + 1, &tile.rows).max(outside(x..x + 1, &tile.columns));
        let (first, last) = ((slot / 2).max(tile.layout.first_plane(away)), slot.div_ceil(2));
        if first > last {
            return;
        }
        let (row, column) = tile.place(y, x);
        for k in first..=last {
            let span = &mut self.spans[k * self.rows + row];
            *span = join(*span, [column, column + 1]);
            self.hidden.count(k);
        }
        self.found_hidden.push(FoundHidden {
            at: (row * tile.layout.stride + column) as u32,
            from: source,
            position,
            planes: [first as u16, last as u16],
        });
    }
}

/// Returns the distance in pixels of `part` of a side from `whole`, or 0 if they overlap.
#[inline(always)]
fn outside(part: Range<usize>, whole: &Range<usize>) -> usize {
    (whole.start + 1)
        .saturating_sub(part.end)
        .max((part.start + 1).saturating_sub(whole.end))
}

#[cfg(test)]
mod tests {
    use super::ByPlane;

    #[test]
    fn items_are_sorted_by_plane_and_keep_their_order() {
        let mut items = ByPlane::new(4, 8);
        for _ in 0..2 {
            items.clear();
            let all = [(2, 1), (0, 2), (2, 3), (3, 4), (0, 5)];
            all.iter().for_each(|(plane, _)| items.count(*plane));
            items.put(all.into_iter());
            assert_eq!([0, 1, 2, 3].map(|k| items.of(k)), [&[2, 5][..], &[], &[1, 3], &[4]]);
        }
    }
}
