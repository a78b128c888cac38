//! The schedule: bands run in parallel, and within a band every layer runs one row behind the previous one.
//!
//! `x[i]` is layer `i`'s input. When row `r + 1` of `x[i]` is written, row `r` of `x[i+1]` can be computed: it needs
//! rows `r−1 … r+1` of `x[i]`, and row `r` of `x[i−1]` for a skip. A ring of three rows of each `x[i]` is therefore
//! enough. A row is stored group by group (see [`Geometry`]) with [`MARGIN`] pixels before and after it, which hold the
//! padding value at the frame's edges.
//!
//! At a band's inner edges the rows beyond are computed again, one more for each remaining layer, so that the result is
//! bit-identical however the frame is cut. The same holds for columns if a band is cut into strips.

use crate::OUTPUTS;
use crate::places::{Places, runs};
use crate::rows::{Band, Rows, grown};
use std::sync::{Mutex, PoisonError};

/// The pixels before a row's first and after its last pixel. Kernels may read one and write up to this many past the
/// end.
pub(crate) const MARGIN: usize = 16;
/// The divisor of the length of rows in pixels, so that kernels write whole blocks.
pub(crate) const BLOCK: usize = 64;
/// The number of rows kept of each layer's input.
const RING: usize = 3;

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
/// them, if at most a sixteenth is computed twice; and strips whose rings fit in [`Chain::CACHE`].
pub(crate) fn tiling_for<C: Chain>(chain: &C, height: usize, width: usize) -> Tiling {
    let places = Places {
        side: chain.side(),
        frame: (height, width),
    };
    let (height, width) = places.size();
    let layers = chain.layers();
    let ring_column: usize = (0..layers)
        .map(|i| RING * chain.groups(i) * C::GROUP * size_of::<C::Element>())
        .sum();
    let threads = rayon::current_num_threads();
    // At each edge between two bands layer i computes layers − 1 − i rows on both sides.
    let bands = 1 + height / (16 * layers.max(2) - 16);
    let bands_a_thread = (bands / threads).clamp(1, 3);
    let band_rows = height
        .div_ceil(threads * bands_a_thread)
        .max((4 * layers).min(height))
        .max(1);
    let widest = (C::CACHE / ring_column.max(1)).max(24 * layers).max(4 * BLOCK);
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
    /// The bytes that the rings of a strip may occupy.
    const CACHE: usize;

    fn layers(&self) -> usize;
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
    /// Runs layer `i` on three rows of `x[i]` and writes the features of a row of `x[i+1]`. `skip` is the row of
    /// `x[i−1]`.
    fn hidden_row(
        &self,
        i: usize,
        window: Window<'_, Self::Element>,
        skip: Option<&[Self::Element]>,
        out: &mut [Self::Element],
        geometry: Geometry,
    );
    /// Runs the last layer for one pixel of each place (see [`crate::places`]) and writes places `from..from +
    /// out[c].len()` of the row to the output planes' rows.
    fn last_row(
        &self,
        pixel: usize,
        window: Window<'_, Self::Element>,
        out: [&mut [f32]; OUTPUTS],
        from: usize,
        geometry: Geometry,
    );
}

/// Three rows of a layer's input, adjacent in memory but rotated: the row above is in slot `first` and the next rows in
/// the following slots, modulo 3.
#[derive(Clone, Copy)]
pub(crate) struct Window<'a, E> {
    pub(crate) slots: &'a [E],
    pub(crate) first: usize,
}

impl<'a, E> Window<'a, E> {
    /// Returns the rows from top to bottom.
    pub(crate) fn rows(&self) -> [&'a [E]; RING] {
        let length = self.slots.len() / RING;
        std::array::from_fn(|k| &self.slots[(self.first + k) % RING * length..][..length])
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
    pub(crate) size: (usize, usize),
}

impl Rows<OUTPUTS> for Planar<'_> {
    type Value = f32;

    fn read(&self, row: usize, from: usize, _: &Band<'_, f32, OUTPUTS>, into: &mut [f32]) {
        let (height, width) = self.size;
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

/// The last three rows of one layer's input, with row `r` in slot `r mod 3`.
#[derive(Debug, Default)]
struct Ring<E> {
    memory: Vec<E>,
    /// The start of the first slot, aligned to a cache line for speed.
    start: usize,
    row: usize,
}

impl<E: Copy + Default> Ring<E> {
    fn prepare(&mut self, row: usize, zero: E) {
        const LINE: usize = 64;
        let needed = RING * row + LINE;
        if self.memory.len() < needed {
            self.memory.resize(needed, zero);
        }
        self.memory.fill(zero);
        self.start = self.memory.as_ptr().align_offset(LINE).min(LINE);
        self.row = row;
    }

    fn slot(row: isize) -> usize {
        row.rem_euclid(RING as isize) as usize
    }

    fn row(&self, row: isize) -> &[E] {
        &self.memory[self.start + Self::slot(row) * self.row..][..self.row]
    }

    fn row_mut(&mut self, row: isize) -> &mut [E] {
        &mut self.memory[self.start + Self::slot(row) * self.row..][..self.row]
    }

    /// Returns the rows around `row`.
    fn window(&self, row: isize) -> Window<'_, E> {
        Window {
            slots: &self.memory[self.start..][..RING * self.row],
            first: Self::slot(row - 1),
        }
    }
}

/// Runs `chain` on a frame, reading input from `rows` and writing output through them to `planes`, each (H, W).
pub(crate) fn run<C: Chain, R: Rows<PLANES>, const PLANES: usize>(
    chain: &C,
    rows: &R,
    planes: [&mut [R::Value]; PLANES],
    (height, width): (usize, usize),
    tiling: Tiling,
    scratch: &Scratch<C::Element>,
) {
    let area = height * width;
    let places = Places {
        side: chain.side(),
        frame: (height, width),
    };
    assert!(
        PLANES > 0 && planes.iter().all(|plane| plane.len() == area),
        "planes of the output"
    );
    if area == 0 {
        return;
    }
    let (place_rows, place_columns) = places.size();
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
    let whole = Band { top: 0, width, planes };
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
        let width = self.places.frame.1;
        let mut halves = band.planes.map(|plane| plane.split_at_mut(rows * width));
        let second = halves.each_mut().map(|half| std::mem::take(&mut half.1));
        let first = halves.map(|half| half.0);
        let part = |top, planes| Band { top, width, planes };
        rayon::join(
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
            self.strip((left, right), &mut band, &mut memory);
        }
        free().push(memory);
    }

    fn strip<const PLANES: usize>(
        &self,
        (left, right): (usize, usize),
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
        let layers = chain.layers();
        // The strip with the halo that its last layer needs, one pixel per layer, within the frame.
        let start = left.saturating_sub(layers);
        let end = (right + layers).min(self.width);
        let geometry = Geometry::new(C::GROUP, end - start);
        if rings.len() < layers {
            rings.resize_with(layers, Ring::default);
        }
        for (i, ring) in rings.iter_mut().take(layers).enumerate() {
            ring.prepare(chain.groups(i) * geometry.stride(), chain.zero(i));
        }
        let columns = end - start;
        let input = grown(input, chain.inputs() * columns);
        let side = self.places.side;
        let output = grown(output, side * side * OUTPUTS * (right - left));
        let rows = band.rows();
        let (top, bottom) = ((rows.start / side) as isize, rows.end.div_ceil(side) as isize);
        let (height, depth) = (self.height as isize, layers as isize);
        for step in top - depth..bottom + depth {
            if self.rows.given_up() {
                return;
            }
            for (i, reach) in (1..=depth).rev().enumerate() {
                let row = step - i as isize;
                if !(top - reach..bottom + reach).contains(&row) {
                    continue;
                }
                let (before, ring) = rings.split_at_mut(i);
                let out = ring[0].row_mut(row);
                if !(0..height).contains(&row) {
                    out.fill(chain.zero(i));
                    continue;
                }
                if i == 0 || i == layers - 1 {
                    let run = (row as usize, start, columns);
                    self.places.read(self.rows, run, band, pixels, input);
                }
                let source = SourceRow {
                    planes: input,
                    plane: columns,
                };
                match i {
                    0 => chain.input_row(source, out, geometry),
                    _ => {
                        let skip = has_skip(i).then(|| before[i - 2].row(row));
                        chain.hidden_row(i - 1, before[i - 1].window(row), skip, out, geometry);
                    }
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
            let row = step - depth;
            if (top..bottom).contains(&row) {
                let window = rings[layers - 1].window(row);
                for (pixel, out) in output.chunks_exact_mut(OUTPUTS * (right - left)).enumerate() {
                    chain.last_row(pixel, window, runs(out, right - left), left - start, geometry);
                }
                let run = (row as usize, left, right - left);
                self.places.write(self.rows, run, band, pixels, output);
            }
        }
    }
}
