//! Natural focus: the focal stack of incoherent light, as an eye sees the world.
//!
//! Light from the world is incoherent: each point of the pupil sees the scene from its own place, and intensities add.
//! [`FocalStack`] computes what a pupil as wide as the display's aperture sees of an RGB-D frame: the mean intensity
//! over pinholes spread evenly over the pupil, each with exact occlusion. A point at z moves, in the view of the
//! pinhole at u (a share of the pupil's radius) focused at z′, by u·(z − z′)·tan(θ)/p pixels, where sin θ = r·λ/2p, p
//! is the pitch and r the aperture's radius.
//!
//! Surfaces that the frame does not show are continued from beside each edge, as in the plane sweep
//! ([`crate::method::sweep::hidden`]). The surroundings of the frame are black. Rays inside the frame that meet no
//! surface are left out of the mean.
//!
//! The steps of [`crate::encode::natural`] bring the displayed light to this stack.

use crate::Size;
use crate::display::Display;
use crate::method::sweep::hidden::{Hidden, HiddenScratch, NOTHING};
use crate::method::sweep::{MAX_REACH, hidden_reach};
use crate::optics::asm::reach_m;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use phasefront_kernels::wide;
use std::f64::consts::PI;
use std::ops::Range;

/// The number of pinholes.
const PINHOLES: usize = 48;
/// The largest sideways motion between neighbouring slices, in pixels.
const STEP_PX: f64 = 0.4;
/// The points that are copied together.
const COPIED: usize = 8;
/// The value of a pixel that no surface covers. Intensities are not negative.
const UNCOVERED: f32 = -1.0;

/// A plan for one frame shape, display and list of z. It is immutable and can be shared between threads.
pub struct FocalStack {
    height: usize,
    width: usize,
    volume_m: f64,
    z_m: Vec<f64>,
    /// The number of slices in which the volume is cut; a point moves with the middle of its slice.
    slices: usize,
    /// The motions (y, x) in pixels: colour by colour, plane by plane, pinhole by pinhole, slice by slice.
    motions: Vec<(i32, i32)>,
    /// The largest motion along an axis.
    margin: usize,
    hidden: Hidden,
}

/// The working memory of a [`FocalStack`] for one frame at a time.
pub struct FocalStackScratch {
    sources: Vec<u32>,
    hidden: HiddenScratch,
    rows: Vec<Row>,
    intensity: Vec<f32>,
}

/// The points of one row of the frame, from the farthest slice to the nearest. Where two meet, the later one covers.
#[derive(Default)]
struct Row {
    runs: Vec<Run>,
    /// The first run of each slice in that order, and the number of runs.
    starts: Vec<usize>,
}

/// Points beside one another whose light is that of pixels beside one another.
#[derive(Clone, Copy)]
struct Run {
    x: u32,
    /// The pixel whose light the first point emits.
    source: u32,
    length: u32,
}

/// The points of one row, sorted as in [`Row`], while it is prepared.
#[derive(Default)]
struct Sorting {
    /// The column and the source of each point.
    points: Vec<(u32, u32)>,
    /// The end of each slice's points.
    ends: Vec<usize>,
}

/// Returns `count` points spread evenly over the unit disc, (y, x): Vogel's sunflower (Mathematical Biosciences 44,
/// 179, 1979).
pub fn disc(count: usize) -> impl Iterator<Item = (f64, f64)> {
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |k| {
        let k = k as f64 + 0.5;
        let (sin, cos) = (k * golden).sin_cos();
        let radius = (k / count as f64).sqrt();
        (radius * cos, radius * sin)
    })
}

/// Returns by how many pixels the edge of the pupil moves a point at a distance of a metre from the focus.
pub fn motion_per_m(display: &Display, wavelength_m: f64) -> f64 {
    reach_m(1.0, wavelength_m * display.aperture_radius(), display.pitch_m()) / display.pitch_m()
}

impl FocalStack {
    /// Plans the stack of frames of `size` for `display`, focused at each of `z_m`, in metres.
    ///
    /// # Errors
    /// Returns an error if light of the volume spreads over more than [`MAX_REACH`] pixels.
    pub fn new(size: Size, display: &Display, z_m: &[f64]) -> Result<Self> {
        let volume_m = display.volume_depth_m();
        let per_m = |wavelength_m: &f64| motion_per_m(display, *wavelength_m);
        let farthest_m = z_m.iter().fold(0.0, |most: f64, z| most.max(z.abs())) + volume_m / 2.0;
        let longest = per_m(&display.longest_wavelength_m());
        let margin = (longest * farthest_m).ceil();
        if margin > MAX_REACH as f64 {
            return Err(Error::Setting(format!(
                "natural focus: light spreads {margin:.0} pixels through the volume; {MAX_REACH} are the most: \
                 a volume of {:.3} mm or a larger pitch is right",
                volume_m * 1e3 * MAX_REACH as f64 / margin
            )));
        }
        let slices = ((longest * volume_m / STEP_PX).ceil() as usize).max(1);
        let mut motions = Vec::with_capacity(display.colours() * z_m.len() * PINHOLES * slices);
        for per_m in display.wavelengths_m().iter().map(per_m) {
            for z_m in z_m {
                for (y, x) in disc(PINHOLES) {
                    motions.extend((0..slices).map(|slice| {
                        let middle_m = display.z_of_depth((slice as f64 + 0.5) / slices as f64);
                        let motion = (middle_m - z_m) * per_m;
                        ((y * motion).round() as i32, (x * motion).round() as i32)
                    }));
                }
            }
        }
        Ok(FocalStack {
            height: size.height,
            width: size.width,
            volume_m,
            z_m: z_m.to_vec(),
            slices,
            motions,
            margin: margin as usize + 1,
            hidden: Hidden::new(size, hidden_reach(display)),
        })
    }

    /// Returns the planes' z, in metres.
    pub fn z_m(&self) -> &[f64] {
        &self.z_m
    }

    /// Returns the depth of the volume in metres.
    pub fn volume_m(&self) -> f64 {
        self.volume_m
    }

    /// Returns working memory for one frame at a time.
    pub fn scratch(&self) -> FocalStackScratch {
        FocalStackScratch {
            sources: vec![NOTHING; 2 * self.height * self.width],
            hidden: self.hidden.scratch(),
            rows: (0..self.height).map(|_| Row::default()).collect(),
            intensity: vec![0.0; self.height * self.width],
        }
    }

    /// Sorts the visible and hidden surfaces of normalized `depth`, (H, W), for [`Self::write`].
    ///
    /// # Panics
    /// Panics if `depth` does not have H·W values.
    pub fn prepare(&self, depth: &[f32], scratch: &mut FocalStackScratch) {
        self.hidden.find(depth, &mut scratch.sources, &mut scratch.hidden);
        let sources = &scratch.sources;
        let rows = scratch.rows.par_iter_mut().enumerate();
        rows.for_each_init(Sorting::default, |sorting, (y, row)| {
            self.sort_row(y, depth, sources, sorting);
            row.take(sorting);
        });
    }

    fn slice(&self, depth: f32) -> usize {
        ((depth * self.slices as f32) as usize).min(self.slices - 1)
    }

    /// Calls `add` with the slice, column and source of each point of row `y`. A point lies on the next slice too if a
    /// neighbour is deeper, so that slopes have no cracks. Points that cover others of their slice come later.
    fn points_of_row(&self, y: usize, depth: &[f32], sources: &[u32], mut add: impl FnMut(usize, usize, u32)) {
        let (width, plane) = (self.width, self.height * self.width);
        for behind in [true, false] {
            for layer in [Some(1), Some(0), None] {
                for x in 0..width {
                    let at = y * width + x;
                    let source = layer.map_or(at as u32, |layer| sources[layer * plane + at]);
                    if source == NOTHING {
                        continue;
                    }
                    let slice = self.slice(depth[source as usize]);
                    match behind {
                        false => add(slice, x, source),
                        true if self.has_deeper_neighbour(y, x, slice, depth) => {
                            add((slice + 1).min(self.slices - 1), x, source);
                        }
                        true => {}
                    }
                }
            }
        }
    }

    fn has_deeper_neighbour(&self, y: usize, x: usize, slice: usize, depth: &[f32]) -> bool {
        let (width, height) = (self.width, self.height);
        let deeper = |y: usize, x: usize| self.slice(depth[y * width + x]) > slice;
        (x > 0 && deeper(y, x - 1))
            || (x + 1 < width && deeper(y, x + 1))
            || (y > 0 && deeper(y - 1, x))
            || (y + 1 < height && deeper(y + 1, x))
    }

    fn sort_row(&self, y: usize, depth: &[f32], sources: &[u32], Sorting { points, ends }: &mut Sorting) {
        let last = self.slices - 1;
        ends.clear();
        ends.resize(self.slices, 0);
        self.points_of_row(y, depth, sources, |slice, _, _| ends[last - slice] += 1);
        let mut total = 0;
        for end in ends.iter_mut() {
            total += std::mem::replace(end, total);
        }
        points.resize(total, (0, 0));
        // Each start becomes the end while the slice's points are written.
        self.points_of_row(y, depth, sources, |slice, x, source| {
            points[ends[last - slice]] = (x as u32, source);
            ends[last - slice] += 1;
        });
    }

    /// Writes the amplitudes of plane `index` in `colour` into `out`, (H, W), from the colour's `amplitude`, (H, W),
    /// and the surfaces of [`Self::prepare`].
    ///
    /// # Panics
    /// Panics if there is no such colour or plane, or if a length is wrong.
    pub fn write(
        &self,
        colour: usize,
        index: usize,
        amplitude: &[f32],
        out: &mut [f32],
        scratch: &mut FocalStackScratch,
    ) {
        let (planes, width) = (self.z_m.len(), self.width);
        assert!(index < planes && out.len() == self.height * width);
        let count = PINHOLES * self.slices;
        let motions = &self.motions[(colour * planes + index) * count..][..count];
        let FocalStackScratch { rows, intensity, .. } = scratch;
        let squares = intensity.par_iter_mut().zip(amplitude);
        squares.for_each(|(square, amplitude)| *square = amplitude * amplitude);
        let (rows, intensity) = (&*rows, &*intensity);
        let line = || vec![0.0; width + 2 * self.margin];
        out.par_chunks_exact_mut(width)
            .enumerate()
            .for_each_init(line, |seen, (y, out)| {
                let mut hits = vec![0u32; width];
                out.fill(0.0);
                for motions in motions.chunks_exact(self.slices) {
                    seen.fill(UNCOVERED);
                    wide!(self.view(y, motions, rows, intensity, seen));
                    let stays = self.stays(y, motions);
                    add_view(&seen[self.margin..][..width], out, &mut hits, stays);
                }
                for ((x, sum), hits) in out.iter_mut().enumerate().zip(&hits) {
                    *sum = if *hits > 0 {
                        (*sum / *hits as f32).sqrt()
                    } else {
                        amplitude[y * width + x]
                    };
                }
            });
    }

    /// Returns the columns of row `y` whose rays through a pinhole of `motions` stay inside the frame. A row that the
    /// rays leave has none.
    fn stays(&self, y: usize, motions: &[(i32, i32)]) -> Range<usize> {
        let ends = [motions[0], motions[motions.len() - 1]];
        let inside = |(dy, _): &(i32, i32)| y.checked_add_signed(-*dy as isize).is_some_and(|y| y < self.height);
        if !ends.iter().all(inside) {
            return 0..0;
        }
        let [first, last] = ends.map(|(_, dx)| dx as isize);
        let start = first.max(last).max(0) as usize;
        start..self.width.saturating_add_signed(first.min(last).min(0))
    }

    /// Paints row `y` of a pinhole's view, from the farthest slice to the nearest.
    #[inline(always)]
    fn view(&self, y: usize, motions: &[(i32, i32)], rows: &[Row], intensity: &[f32], seen: &mut [f32]) {
        for (from_far, (dy, dx)) in motions.iter().rev().enumerate() {
            let Some(row) = y.checked_add_signed(-*dy as isize).and_then(|y| rows.get(y)) else {
                continue;
            };
            let first = self.margin.wrapping_add_signed(*dx as isize);
            for run in &row.runs[row.starts[from_far]..row.starts[from_far + 1]] {
                let [x, source, length] = [run.x, run.source, run.length].map(|value| value as usize);
                let (seen, light) = (&mut seen[first + x..][..length], &intensity[source..][..length]);
                paint(light, seen);
            }
        }
    }
}

impl Row {
    /// Stores the points of `sorting` as runs.
    fn take(&mut self, sorting: &Sorting) {
        self.runs.clear();
        self.starts.clear();
        self.starts.push(0);
        let mut from = 0;
        for end in &sorting.ends {
            let first = self.runs.len();
            for (x, source) in &sorting.points[from..*end] {
                match self.runs[first..].last_mut() {
                    Some(run) if (run.x + run.length, run.source + run.length) == (*x, *source) => run.length += 1,
                    _ => self.runs.push(Run {
                        x: *x,
                        source: *source,
                        length: 1,
                    }),
                }
            }
            self.starts.push(self.runs.len());
            from = *end;
        }
    }
}

/// Copies `light` to `seen`, of the same length. Most runs are short, so a call for each would take longest.
#[inline(always)]
fn paint(light: &[f32], seen: &mut [f32]) {
    let Some(end) = light.last_chunk::<COPIED>() else {
        return seen.iter_mut().zip(light).for_each(|(seen, light)| *seen = *light);
    };
    let (pieces, _) = seen.as_chunks_mut::<COPIED>();
    for (seen, light) in pieces.iter_mut().zip(light.as_chunks::<COPIED>().0) {
        *seen = *light;
    }
    if let Some(seen) = seen.last_chunk_mut() {
        *seen = *end;
    }
}

/// Adds the intensities `seen` through a pinhole to `sums`, and counts in `hits` the rays that meet a surface or leave
/// the frame, as all do outside the columns `stays`.
fn add_view(seen: &[f32], sums: &mut [f32], hits: &mut [u32], stays: Range<usize>) {
    let start = stays.start.min(seen.len());
    let end = stays.end.max(start);
    wide!({
        for ((seen, sum), hits) in seen.iter().zip(sums.iter_mut()).zip(hits.iter_mut()) {
            let covered = *seen >= 0.0;
            *sum += if covered { *seen } else { 0.0 };
            *hits += u32::from(covered);
        }
        for x in (0..start).chain(end..seen.len()) {
            hits[x] += u32::from(seen[x] < 0.0);
        }
    });
}

/// Computes plane `index` of `colour` naively, as the oracle for tests: for each pinhole, every point is compared with
/// what covers its place so far.
pub fn reference(stack: &FocalStack, colour: usize, index: usize, amplitude: &[f32], depth: &[f32]) -> Vec<f32> {
    let (height, width) = (stack.height, stack.width);
    let mut scratch = stack.scratch();
    stack.hidden.find(depth, &mut scratch.sources, &mut scratch.hidden);
    let (mut sums, mut hits) = (vec![0.0; height * width], vec![0; height * width]);
    for pinhole in 0..PINHOLES {
        let at = ((colour * stack.z_m.len() + index) * PINHOLES + pinhole) * stack.slices;
        let mut nearest = vec![(usize::MAX, 0.0); height * width];
        for y in 0..height {
            stack.points_of_row(y, depth, &scratch.sources, |slice, x, source| {
                let (dy, dx) = stack.motions[at + slice];
                let to = y.checked_add_signed(dy as isize).zip(x.checked_add_signed(dx as isize));
                if let Some((y, x)) = to.filter(|(y, x)| *y < height && *x < width) {
                    let here = &mut nearest[y * width + x];
                    if slice <= here.0 {
                        *here = (slice, amplitude[source as usize].powi(2));
                    }
                }
            });
        }
        let motions = &stack.motions[at..at + stack.slices];
        for (place, (slice, light)) in nearest.into_iter().enumerate() {
            sums[place] += light;
            let inside = |(dy, dx): &(i32, i32)| {
                let from = ((place / width) as i32 - dy, (place % width) as i32 - dx);
                (0..height as i32).contains(&from.0) && (0..width as i32).contains(&from.1)
            };
            hits[place] += i32::from(slice != usize::MAX || !motions.iter().all(inside));
        }
    }
    let mean = |i: usize| match hits[i] {
        0 => amplitude[i],
        hits => (sums[i] / hits as f32).sqrt(),
    };
    (0..height * width).map(mean).collect()
}
