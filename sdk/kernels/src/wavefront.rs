//! The schedule: bands run in parallel, and within a band every layer runs one row behind the previous one.
//!
//! `x[i]` is layer `i`'s input. When row `r + 1` of `x[i]` is written, row `r` of `x[i+1]` can be computed: it needs
//! rows `r−1 … r+1` of `x[i]`, and row `r` of `x[i−1]` for a skip. A ring of three rows of each `x[i]` is therefore
//! enough. A chain that computes its layers in tiles advances by the rows of a tile instead of one, and its rings have
//! three rows more. A row is stored group by group (see [`Geometry`]) with [`MARGIN`] pixels before and after it, which
//! hold the padding value at the frame's edges.
//!
//! At a band's inner edges the rows beyond are computed again, one more for each remaining layer, so that the result is
//! bit-identical however the frame is cut. The same holds for columns if a band is cut into strips.

use crate::OUTPUTS;
use crate::Size;
use crate::parallel;
use crate::places::{Places, runs};
use crate::rows::{Band, Rows, grown};
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// The pixels before a row's first and after its last pixel. Kernels may read one and write up to this many past the
/// end.
pub(crate) const MARGIN: usize = 16;
/// The divisor of the length of rows in pixels, so that kernels write whole blocks.
pub(crate) const BLOCK: usize = 64;

/// The division of a frame into bands and strips. The result does not depend on it. Rows and columns are those of the
/// chain's places: pixels, or squares of two by two at half the resolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tiling {
    /// The rows of a band. A band is one task.
    pub band_rows: usize,
    /// The columns of a strip within a band.
    pub strip_columns: usize,
}

/// Returns a tiling for `chain` on the current pool: up to three bands per thread, so that a slower core gets fewer of
/// them, if at most a sixteenth is computed twice; and strips whose rings fit in [`Chain::cache`].
pub(crate) fn tiling_for<C: Chain>(chain: &C, size: Size) -> Tiling {
    let places = Places {
        side: chain.side(),
        frame: size,
    };
    let Size { width, height } = places.size();
    let layers = chain.layers();
    let ring_column: usize = (0..layers)
        .map(|i| (chain.step() + 2) * chain.groups(i) * C::GROUP * size_of::<C::Element>())
        .sum();
    let threads = parallel::current_num_threads();
    // At each edge between two bands layer i computes layers − 1 − i rows on both sides.
    let bands = 1 + height / (16 * layers.max(2) - 16);
    let bands_a_thread = (bands / threads).clamp(1, 3);
    let band_rows = height
        .div_ceil(threads * bands_a_thread)
        .max((4 * layers).min(height))
        .max(1);
    let widest = (chain.cache() / ring_column.max(1)).max(24 * layers).max(4 * BLOCK);
    let strip_columns = width.div_ceil(width.div_ceil(widest).max(1)).max(1);
    Tiling {
        band_rows,
        strip_columns,
    }
}

/// Checks whether `x[i]` is a sum with `x[i−2]`.
pub(crate) fn has_skip(i: usize) -> bool {
    i >= 3 && i % 2 == 1
}

/// Runs `block` on the whole blocks of a row that contain pixels `from..`, and copies those pixels to the output's
/// rows.
#[cfg(any(
    target_arch = "x86_64",
    target_arch = "aarch64",
    all(target_arch = "wasm32", target_feature = "simd128")
))]
pub(crate) fn last_row_by_blocks(
    mut out: [&mut [f32]; OUTPUTS],
    from: usize,
    mut block: impl FnMut(usize, &mut [[f32; BLOCK]; OUTPUTS]),
) {
    let to = from + out[0].len();
    let mut values = [[0.0; BLOCK]; OUTPUTS];
    for x in (from / BLOCK * BLOCK..to).step_by(BLOCK) {
        block(x, &mut values);
        let (start, end) = (x.max(from), (x + BLOCK).min(to));
        for (out, values) in out.iter_mut().zip(&values) {
            out[start - from..end - from].copy_from_slice(&values[start - x..end - x]);
        }
    }
}

/// The layout of a row: `groups` runs of `stride` elements, each of [`MARGIN`] pixels, the row, and the margin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Geometry {
    /// The elements of one pixel in a group: 4 for the int8 chain, 1 for f32.
    pub(crate) group: usize,
    /// The pixels of a row in whole blocks.
    pub(crate) padded: usize,
    /// The pixels of a row that belong to the strip.
    pub(crate) width: usize,
}

impl Geometry {
    fn new(group: usize, width: usize) -> Geometry {
        Geometry {
            group,
            padded: width.next_multiple_of(BLOCK),
            width,
        }
    }

    /// Returns the number of elements from one group of a row to the next.
    pub(crate) fn stride(&self) -> usize {
        (self.padded + 2 * MARGIN) * self.group
    }

    /// Returns the element of pixel 0 in a row's group.
    pub(crate) fn start(&self) -> usize {
        MARGIN * self.group
    }
}

/// A chain that the schedule can run. Rows are slices of `groups(i) · geometry.stride()` elements.
pub(crate) trait Chain: Sync {
    /// An element of a row.
    type Element: Copy + Default + Send + Sync;
    /// The channels of a group: the adjacent elements of one pixel.
    const GROUP: usize;

    fn layers(&self) -> usize;
    /// Returns the rows by which the chain advances.
    fn step(&self) -> usize;
    /// Returns the bytes that the rings of a strip may occupy.
    fn cache(&self) -> usize;
    /// Returns the pixels along each side of a place: 1, or 2 at half the resolution.
    fn side(&self) -> usize;
    /// Returns the channels of a place of the network's input.
    fn inputs(&self) -> usize;
    /// Returns the groups of `x[i]`, including the concatenated network input of the last layer.
    fn groups(&self, i: usize) -> usize;
    /// Returns the element that represents 0 in `x[i]`.
    fn zero(&self, i: usize) -> Self::Element;
    /// Writes a row of `x[0]` from the network input's planes.
    fn input_row(&self, source: SourceRow<'_>, out: &mut [Self::Element], geometry: Geometry);
    /// Writes the concatenated part of a row of `x[last]`. `out` is the whole row.
    fn concatenated_row(&self, source: SourceRow<'_>, out: &mut [Self::Element], geometry: Geometry);
    /// Runs layer `i` and writes the features of rows of `x[i+1]`. `rows` of `x[i]` start one row above them, and those
    /// of `skip`, in `x[i−1]`, with the first.
    fn hidden_rows(
        &self,
        i: usize,
        rows: Slots<'_, Self::Element>,
        skip: Option<Slots<'_, Self::Element>>,
        out: SlotsMut<'_, Self::Element>,
        geometry: Geometry,
    );
    /// Runs the last layer for one pixel of each place (see [`crate::places`]) and writes the places `from..` of the
    /// rows in `out` to the output planes' rows. `rows` start one row above.
    fn last_rows(
        &self,
        pixel: usize,
        rows: Slots<'_, Self::Element>,
        out: LastRows<'_>,
        from: usize,
        geometry: Geometry,
    );
}

/// Rows in a ring: the first is in slot `first` and the next rows in the following slots, modulo the ring's.
#[derive(Clone, Copy)]
pub(crate) struct Slots<'a, E> {
    pub(crate) slots: &'a [E],
    /// The elements of a row.
    pub(crate) row: usize,
    pub(crate) first: usize,
}

impl<'a, E> Slots<'a, E> {
    /// Returns the element at which row `k` starts.
    pub(crate) fn start(&self, k: usize) -> usize {
        (self.first + k) * self.row % self.slots.len()
    }

    /// Returns the first `N` rows.
    pub(crate) fn rows<const N: usize>(&self) -> [&'a [E]; N] {
        std::array::from_fn(|k| &self.slots[self.start(k)..][..self.row])
    }
}

/// Rows in a ring, to be written.
pub(crate) struct SlotsMut<'a, E> {
    pub(crate) slots: &'a mut [E],
    pub(crate) row: usize,
    pub(crate) first: usize,
    /// The rows to write, of those that the chain advances by.
    pub(crate) valid: Range<usize>,
}

impl<E> SlotsMut<'_, E> {
    /// Returns row `k`.
    pub(crate) fn row_mut(&mut self, k: usize) -> &mut [E] {
        let start = (self.first + k) * self.row % self.slots.len();
        &mut self.slots[start..][..self.row]
    }
}

/// Rows of the output planes, to be written.
pub(crate) struct LastRows<'a> {
    /// The rows to write, of those that the chain advances by.
    pub(crate) valid: Range<usize>,
    /// The first row's planes, one after another.
    pub(crate) values: &'a mut [f32],
    /// The number of elements from one row to the next.
    pub(crate) row: usize,
    /// The places of a row.
    pub(crate) count: usize,
}

impl LastRows<'_> {
    /// Returns the planes' rows of row `k`.
    pub(crate) fn planes(&mut self, k: usize) -> [&mut [f32]; OUTPUTS] {
        runs(&mut self.values[k * self.row..][..OUTPUTS * self.count], self.count)
    }
}

/// One row of the network's input, planar.
#[derive(Clone, Copy)]
pub(crate) struct SourceRow<'a> {
    pub(crate) planes: &'a [f32],
    /// The number of elements from one plane to the next.
    pub(crate) plane: usize,
}

impl<'a> SourceRow<'a> {
    /// Returns `count` pixels of channel `c`.
    pub(crate) fn channel(&self, c: usize, count: usize) -> &'a [f32] {
        &self.planes[c * self.plane..][..count]
    }
}

/// Planar input and output in memory.
pub(crate) struct Planar<'a> {
    pub(crate) input: &'a [f32],
    pub(crate) size: Size,
}

impl Rows<OUTPUTS> for Planar<'_> {
    type Value = f32;

    fn read(&self, row: usize, from: usize, _: &Band<'_, f32, OUTPUTS>, into: &mut [f32]) {
        let Size { width, height } = self.size;
        let planes = self.input.chunks_exact(height * width);
        let count = into.len() / planes.len();
        for (into, plane) in into.chunks_exact_mut(count).zip(planes) {
            into.copy_from_slice(&plane[row * width + from..][..count]);
        }
    }

    fn write(&self, row: usize, from: usize, values: [&mut [f32]; OUTPUTS], band: &mut Band<'_, f32, OUTPUTS>) {
        let out = band.rows_mut(row, from, values[0].len());
        for (out, values) in out.into_iter().zip(values) {
            out.copy_from_slice(values);
        }
    }
}

/// Working memory for all bands that run at once. It grows in the first frame and is then kept.
#[derive(Debug)]
pub struct Scratch<E> {
    free: Mutex<Vec<Memory<E>>>,
}

impl<E> Default for Scratch<E> {
    fn default() -> Self {
        Scratch {
            free: Mutex::new(Vec::new()),
        }
    }
}

impl<E> Scratch<E> {
    /// Returns the bytes held between frames.
    pub fn bytes(&self) -> usize {
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        free.iter()
            .map(|memory| {
                let rings: usize = memory.rings.iter().map(|r| r.memory.capacity()).sum();
                let rows = memory.input.capacity() + memory.output.capacity() + memory.pixels.capacity();
                rings * size_of::<E>() + rows * size_of::<f32>()
            })
            .sum()
    }
}

/// The working memory of one band.
#[derive(Debug)]
struct Memory<E> {
    /// One ring per layer.
    rings: Vec<Ring<E>>,
    /// A row of the network's input.
    input: Vec<f32>,
    /// A row of the network's output.
    output: Vec<f32>,
    /// A row of input or output pixels, before or after the conversion to places.
    pixels: Vec<f32>,
}

impl<E> Default for Memory<E> {
    fn default() -> Self {
        Memory {
            rings: Vec::new(),
            input: Vec::new(),
            output: Vec::new(),
            pixels: Vec::new(),
        }
    }
}

/// The last rows of one layer's input, with row `r` in slot `r` modulo their number.
#[derive(Debug, Default)]
struct Ring<E> {
    memory: Vec<E>,
    /// The start of the first slot, aligned to a cache line for speed.
    start: usize,
    row: usize,
    count: usize,
}

impl<E: Copy + Default> Ring<E> {
    fn prepare(&mut self, count: usize, row: usize, zero: E) {
        const LINE: usize = 64;
        let needed = count * row + LINE;
        if self.memory.len() < needed {
            self.memory.resize(needed, zero);
        }
        self.memory.fill(zero);
        self.start = self.memory.as_ptr().align_offset(LINE).min(LINE);
        (self.count, self.row) = (count, row);
    }

    fn slot(&self, row: isize) -> usize {
        row.rem_euclid(self.count as isize) as usize
    }

    /// Returns the rows from `row` on.
    fn rows(&self, row: isize) -> Slots<'_, E> {
        Slots {
            slots: &self.memory[self.start..][..self.count * self.row],
            row: self.row,
            first: self.slot(row),
        }
    }

    /// Returns the rows from `row` on, of which `valid` are to be written.
    fn rows_mut(&mut self, row: isize, valid: Range<usize>) -> SlotsMut<'_, E> {
        let first = self.slot(row);
        SlotsMut {
            slots: &mut self.memory[self.start..][..self.count * self.row],
            row: self.row,
            first,
            valid,
        }
    }
}

/// Returns the part of `rows` in the `count` rows from `first` on, relative to `first`.
fn part(first: isize, count: usize, rows: Range<isize>) -> Range<usize> {
    let from = first.max(rows.start);
    let to = (first + count as isize).min(rows.end).max(from);
    (from - first) as usize..(to - first) as usize
}

/// Runs `chain` on a frame, reading input from `rows` and writing output through them to `planes`, each (H, W).
pub(crate) fn run<C: Chain, R: Rows<PLANES>, const PLANES: usize>(
    chain: &C,
    rows: &R,
    planes: [&mut [R::Value]; PLANES],
    size: Size,
    tiling: Tiling,
    scratch: &Scratch<C::Element>,
) {
    let area = size.pixels();
    let places = Places {
        side: chain.side(),
        frame: size,
    };
    assert!(
        PLANES > 0 && planes.iter().all(|plane| plane.len() == area),
        "planes of the output"
    );
    if area == 0 {
        return;
    }
    let Size {
        width: place_columns,
        height: place_rows,
    } = places.size();
    let frame = Frame {
        chain,
        rows,
        places,
        height: place_rows,
        width: place_columns,
        tiling,
        scratch,
    };
    let bands = place_rows.div_ceil(tiling.band_rows.max(1));
    let whole = Band {
        top: 0,
        width: size.width,
        planes,
    };
    frame.bands(0, bands, whole);
}

struct Frame<'a, C: Chain, R> {
    chain: &'a C,
    rows: &'a R,
    places: Places,
    /// The number of rows of places.
    height: usize,
    width: usize,
    tiling: Tiling,
    scratch: &'a Scratch<C::Element>,
}

impl<C: Chain, R> Frame<'_, C, R> {
    /// Runs bands `from..to`, which `band` contains, and divides them among the pool's threads.
    fn bands<const PLANES: usize>(&self, from: usize, to: usize, band: Band<'_, R::Value, PLANES>)
    where
        R: Rows<PLANES>,
    {
        if to - from == 1 {
            return self.band(band);
        }
        let middle = (from + to) / 2;
        let rows = (middle - from) * self.tiling.band_rows.max(1) * self.places.side;
        let width = self.places.frame.width;
        let mut halves = band.planes.map(|plane| plane.split_at_mut(rows * width));
        let second = halves.each_mut().map(|half| std::mem::take(&mut half.1));
        let first = halves.map(|half| half.0);
        let part = |top, planes| Band { top, width, planes };
        parallel::join(
            || self.bands(from, middle, part(band.top, first)),
            || self.bands(middle, to, part(band.top + rows, second)),
        );
    }

    /// Runs a band, strip by strip.
    fn band<const PLANES: usize>(&self, mut band: Band<'_, R::Value, PLANES>)
    where
        R: Rows<PLANES>,
    {
        let free = || self.scratch.free.lock().unwrap_or_else(PoisonError::into_inner);
        let mut memory = free().pop().unwrap_or_default();
        let columns = self.tiling.strip_columns.max(1);
        for left in (0..self.width).step_by(columns) {
            let right = (left + columns).min(self.width);
            let pixels = self.places.pixels(left..right);
            if let Some(needed) = self.rows.needed(band.rows(), pixels) {
                let [rows, columns] = needed.map(|pixels| self.places.of(pixels));
                self.strip(rows, columns, &mut band, &mut memory);
            }
        }
        free().push(memory);
    }

    /// Computes these rows and columns of places.
    fn strip<const PLANES: usize>(
        &self,
        rows: Range<usize>,
        Range {
            start: left,
            end: right,
        }: Range<usize>,
        band: &mut Band<'_, R::Value, PLANES>,
        Memory {
            rings,
            input,
            output,
            pixels,
        }: &mut Memory<C::Element>,
    ) where
        R: Rows<PLANES>,
    {
        let chain = self.chain;
        let (layers, advance) = (chain.layers(), chain.step());
        // The strip with the halo that its last layer needs, one pixel per layer, within the frame.
        let start = left.saturating_sub(layers);
        let end = (right + layers).min(self.width);
        let geometry = Geometry::new(C::GROUP, end - start);
        if rings.len() < layers {
            rings.resize_with(layers, Ring::default);
        }
        for (i, ring) in rings.iter_mut().take(layers).enumerate() {
            ring.prepare(advance + 2, chain.groups(i) * geometry.stride(), chain.zero(i));
        }
        let columns = end - start;
        let input = grown(input, chain.inputs() * columns);
        let side = self.places.side;
        let count = right - left;
        let row_values = side * side * OUTPUTS * count;
        let output = grown(output, advance * row_values);
        let (top, bottom) = (rows.start as isize, rows.end as isize);
        let (height, depth) = (self.height as isize, layers as isize);
        for step in (top - depth..bottom + depth).step_by(advance) {
            if self.rows.given_up() {
                return;
            }
            for (i, reach) in (1..=depth).rev().enumerate() {
                let first = step - i as isize;
                let needed = part(first, advance, top - reach..bottom + reach);
                let inside = part(first, advance, (top - reach).max(0)..(bottom + reach).min(height));
                let (before, ring) = rings.split_at_mut(i);
                let mut out = ring[0].rows_mut(first, inside.clone());
                for k in needed.filter(|k| !inside.contains(k)) {
                    out.row_mut(k).fill(chain.zero(i));
                }
                if i > 0 && !inside.is_empty() {
                    let skip = has_skip(i).then(|| before[i - 2].rows(first));
                    chain.hidden_rows(i - 1, before[i - 1].rows(first - 1), skip, out, geometry);
                }
                for k in inside {
                    let mut out = ring[0].rows_mut(first + k as isize, 0..1);
                    let out = out.row_mut(0);
                    if i == 0 || i == layers - 1 {
                        let run = ((first + k as isize) as usize, start, columns);
                        self.places.read(self.rows, run, band, pixels, input);
                    }
                    let source = SourceRow {
                        planes: input,
                        plane: columns,
                    };
                    if i == 0 {
                        chain.input_row(source, out, geometry);
                    }
                    if i == layers - 1 {
                        chain.concatenated_row(source, out, geometry);
                    }
                    // The next layer reads one pixel past the row, which is padding at the frame's edge.
                    let past = geometry.start() + geometry.width * geometry.group;
                    for group in out.chunks_exact_mut(geometry.stride()) {
                        group[past..past + geometry.group].fill(chain.zero(i));
                    }
                }
            }
            let first = step - depth;
            let valid = part(first, advance, top..bottom);
            if valid.is_empty() {
                continue;
            }
            for pixel in 0..side * side {
                let out = LastRows {
                    valid: valid.clone(),
                    values: &mut output[pixel * OUTPUTS * count..],
                    row: row_values,
                    count,
                };
                chain.last_rows(pixel, rings[layers - 1].rows(first - 1), out, left - start, geometry);
            }
            for k in valid {
                let run = ((first + k as isize) as usize, left, count);
                let values = &mut output[k * row_values..][..row_values];
                self.places.write(self.rows, run, band, pixels, values);
            }
        }
    }
}
