//! Refinement of depth from a sensor's resolution, with holes and noise, to the display's resolution. The depth is
//! cleaned, filled, and enlarged along the edges of the colour image. Tests compare the results with
//! [`super::refine_reference`].
//!
//! First, at the sensor's resolution, each reading is replaced by the mean of those of its 5×5 neighbours that agree
//! with their weighted median. A neighbour's weight increases with its proximity, its confidence and the similarity of
//! its colour. Readings mixed at an edge, and holes, thereby take the depth of the surface with their colour. Then each
//! display pixel is computed in the same way from the 3×3 readings around it and its own colour. If all neighbours
//! agree, no median is needed: a mean, or bilinear interpolation for display pixels, is enough. Unlike a mean across an
//! edge, a median never creates a depth that no surface has.
//!
//! For a depth image of n pixels and a display of N, of which a share e lies at edges, the cost is about 25·n + 40·e·n
//! weights at the sensor's resolution and 4·N + 9·e·N at the display's. In typical scenes, a tenth of the pixels lies
//! at edges.

use super::fill_from_nearest;
use crate::frame::Crop;
use crate::runtime::error::{Error, Result};
use rayon::prelude::*;

/// The largest depth difference within one surface, as a share of the volume.
pub(crate) const TOLERANCE: f32 = 0.03;
/// The number of neighbours on each side that clean a reading.
pub(crate) const CLEAN_REACH: usize = 2;
/// The spread of their weights, in readings.
pub(crate) const CLEAN_SIGMA: f32 = 2.0;
/// The spread of their weights in colour, as a distance of amplitudes in red, green, blue.
pub(crate) const CLEAN_COLOUR_SIGMA: f32 = 0.07;
/// The spread of the weights of the 3×3 readings around a display pixel, in readings.
pub(crate) const UP_SIGMA: f32 = 1.4;
/// The spread of these weights in colour.
pub(crate) const UP_COLOUR_SIGMA: f32 = 0.07;
/// The least weight of a neighbour by its colour, so that colour has no effect if no neighbour has a similar one.
pub(crate) const LEAST_CLOSENESS: f32 = 1e-5;
/// The number of passes that fill holes from their rims. Remaining holes take their nearest reading.
pub(crate) const FILL_PASSES: usize = 8;

/// An interpolated table of exp(−x²/2σ²) over the squared distance x².
struct Closeness {
    table: Vec<f32>,
    scale: f32,
}

impl Closeness {
    /// Creates the table of `sigma` with weights of at least `least`.
    fn new(sigma: f32, least: f32) -> Self {
        const STEPS: usize = 512;
        // Beyond 6σ, all weights equal the least.
        let scale = (STEPS - 1) as f32 / (36.0 * sigma * sigma);
        let weight = |i: usize| (-(i as f32 / scale) / (2.0 * sigma * sigma)).exp().max(least);
        Closeness {
            table: (0..STEPS).map(weight).collect(),
            scale,
        }
    }

    fn of(&self, square: f32) -> f32 {
        let place = square * self.scale;
        let step = (place as usize).min(self.table.len() - 2);
        let [a, b] = [self.table[step], self.table[step + 1]];
        a + (place - step as f32).min(1.0) * (b - a)
    }
}

/// The display pixels along one axis and the readings around them.
struct AxisMap {
    /// The reading that each display pixel lies in.
    cell: Vec<u32>,
    /// The offset of each display pixel from the middle of that reading, −½..=½.
    offset: Vec<f32>,
    /// The range of display pixels that give each reading its colour: the first, and one past the last.
    pixels: Vec<(u32, u32)>,
}

impl AxisMap {
    fn new(cells: usize, from: f64, length: f64, out: usize) -> Self {
        let at = |o: usize| {
            let centre = from + (o as f64 + 0.5) * length / out as f64 - 0.5;
            let cell = centre.round().clamp(0.0, cells as f64 - 1.0);
            (cell as u32, (centre - cell).clamp(-0.5, 0.5) as f32)
        };
        let (cell, offset): (Vec<u32>, Vec<f32>) = (0..out).map(at).unzip();
        let pixels = (0..cells as u32).map(|c| {
            let first = cell.partition_point(|v| *v < c) as u32;
            let end = cell.partition_point(|v| *v <= c) as u32;
            // Readings between or beyond the display's pixels take the colour of an adjacent pixel.
            match first < end {
                true => (first, end),
                false => (first.min(out as u32 - 1), first.min(out as u32 - 1) + 1),
            }
        });
        AxisMap {
            pixels: pixels.collect(),
            cell,
            offset,
        }
    }
}

/// A plan for one shape of depth and of colour. It is immutable and can be shared between threads.
pub struct Refiner {
    depth: (usize, usize),
    out: (usize, usize),
    x: AxisMap,
    y: AxisMap,
    clean_colour: Closeness,
    up_colour: Closeness,
    /// The spatial weights of the 5×5 neighbours.
    near: [f32; (2 * CLEAN_REACH + 1) * (2 * CLEAN_REACH + 1)],
    up_near: Closeness,
}

/// The working memory of a [`Refiner`] for one call at a time.
pub struct RefineScratch {
    /// The colour of each reading.
    guide: Vec<[f32; 3]>,
    cleaned: Vec<f32>,
    holes: Vec<u32>,
    filled: Vec<f32>,
    /// The front of readings from which holes are filled.
    front: Vec<u32>,
}

/// A neighbour in a weighted median: its depth and its weight.
type Vote = (f32, f32);

/// Returns the smallest value of `votes` at which the weights reach half of their sum. Sorts `votes`.
fn weighted_median(votes: &mut [Vote]) -> f32 {
    votes.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = votes.iter().map(|v| v.1).sum::<f32>() / 2.0;
    let mut sum = 0.0;
    for (value, weight) in votes.iter() {
        sum += weight;
        if sum >= half {
            return *value;
        }
    }
    votes.last().map_or(f32::NAN, |v| v.0)
}

/// Returns the mean of the `votes` that agree with their weighted median.
fn surface(votes: &mut [Vote]) -> f32 {
    let median = weighted_median(votes);
    let (mut sum, mut weights) = (0.0, 0.0);
    for (value, weight) in votes.iter() {
        if (value - median).abs() <= TOLERANCE {
            sum += weight * value;
            weights += weight;
        }
    }
    match weights > 0.0 {
        true => sum / weights,
        false => median,
    }
}

/// Returns the squared distance between two colours.
fn apart(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [r, g, b] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    r * r + g * g + b * b
}

impl Refiner {
    /// Plans the refinement of the part `crop` of (h, w) = `depth` readings to (H, W) = `out`.
    ///
    /// # Errors
    /// Returns an error if a side lies outside 1..=65536.
    pub fn new(depth: (usize, usize), crop: Crop, out: (usize, usize)) -> Result<Self> {
        let sides = [depth.0, depth.1, out.0, out.1];
        if sides.contains(&0) || sides.iter().any(|n| *n > 1 << 16) {
            return Err(Error::Setting(format!(
                "depth of {}×{} for a frame of {}×{}: each side must lie in 1..=65536",
                depth.1, depth.0, out.1, out.0
            )));
        }
        let spread = |i: usize| (i as f32 - CLEAN_REACH as f32).powi(2);
        let side = 2 * CLEAN_REACH + 1;
        Ok(Refiner {
            depth,
            out,
            x: AxisMap::new(depth.1, crop.x, crop.width, out.1),
            y: AxisMap::new(depth.0, crop.y, crop.height, out.0),
            clean_colour: Closeness::new(CLEAN_COLOUR_SIGMA, LEAST_CLOSENESS),
            up_colour: Closeness::new(UP_COLOUR_SIGMA, LEAST_CLOSENESS),
            near: std::array::from_fn(|i| {
                let square = spread(i % side) + spread(i / side);
                (-square / (2.0 * CLEAN_SIGMA * CLEAN_SIGMA)).exp()
            }),
            up_near: Closeness::new(UP_SIGMA, 0.0),
        })
    }

    /// Returns (H, W) of the refined depth.
    pub fn shape(&self) -> (usize, usize) {
        self.out
    }

    /// Allocates working memory for one call at a time.
    pub fn scratch(&self) -> RefineScratch {
        let size = self.depth.0 * self.depth.1;
        RefineScratch {
            guide: vec![[0.0; 3]; size],
            cleaned: vec![0.0; size],
            holes: Vec::with_capacity(size),
            filled: vec![0.0; size],
            front: Vec::with_capacity(size),
        }
    }

    /// Refines `depth` along the edges of `rgb`, (3, H, W), and writes it to `refined`, (H, W).
    ///
    /// `depth`, (h, w), is normalized, with NaN for no reading, and `confidence`, (h, w), lies in 0..=1. The result
    /// stays within the range of `depth`. Runs on the current thread pool. Does not allocate.
    ///
    /// # Errors
    /// Returns an error if there is no reading.
    ///
    /// # Panics
    /// Panics if a length does not match its shape.
    pub fn refine(
        &self,
        depth: &[f32],
        confidence: &[f32],
        rgb: &[f32],
        refined: &mut [f32],
        scratch: &mut RefineScratch,
    ) -> Result<()> {
        let (height, width) = self.out;
        assert_eq!(depth.len(), self.depth.0 * self.depth.1);
        assert_eq!(confidence.len(), depth.len());
        assert_eq!(rgb.len(), 3 * height * width);
        assert_eq!(refined.len(), height * width);
        if depth.iter().all(|d| d.is_nan()) {
            return Err(Error::Frame(
                "depth has no reading at all; at least one pixel must be valid".into(),
            ));
        }
        self.guide(rgb, &mut scratch.guide);
        self.clean(depth, confidence, &scratch.guide, &mut scratch.cleaned);
        self.fill(scratch);
        let readings = Readings {
            depth: &scratch.cleaned,
            guide: &scratch.guide,
        };
        (refined.par_chunks_exact_mut(width))
            .enumerate()
            .for_each(|(y, row)| self.up_row(y, &readings, rgb, row));
        Ok(())
    }

    /// Computes the mean colour of the display pixels in each reading.
    fn guide(&self, rgb: &[f32], guide: &mut [[f32; 3]]) {
        let (height, width) = self.out;
        let rows = guide.par_chunks_exact_mut(self.depth.1);
        rows.zip(&self.y.pixels).for_each(|(row, (top, bottom))| {
            for (colour, (left, right)) in row.iter_mut().zip(&self.x.pixels) {
                let count = ((bottom - top) * (right - left)) as f32;
                *colour = std::array::from_fn(|c| {
                    let row = |y: u32| {
                        let start = (c * height + y as usize) * width;
                        &rgb[start + *left as usize..start + *right as usize]
                    };
                    (*top..*bottom).flat_map(row).sum::<f32>() / count
                });
            }
        });
    }

    /// Cleans each reading from its neighbours. A reading without valid neighbours becomes NaN.
    fn clean(&self, depth: &[f32], confidence: &[f32], guide: &[[f32; 3]], cleaned: &mut [f32]) {
        let width = self.depth.1;
        (cleaned.par_chunks_exact_mut(width)).enumerate().for_each(|(y, row)| {
            for (x, value) in row.iter_mut().enumerate() {
                *value = self.clean_one(x, y, depth, |i| confidence[i], guide);
            }
        });
    }

    /// Cleans one reading from its neighbours.
    fn clean_one(
        &self,
        x: usize,
        y: usize,
        depth: &[f32],
        confidence: impl Fn(usize) -> f32,
        guide: &[[f32; 3]],
    ) -> f32 {
        const SIDE: usize = 2 * CLEAN_REACH + 1;
        let (height, width) = self.depth;
        let mut votes = [(0.0, 0.0); SIDE * SIDE];
        let mut from = [0; SIDE * SIDE];
        let (mut count, mut least, mut most) = (0, f32::INFINITY, f32::NEG_INFINITY);
        let top = y.saturating_sub(CLEAN_REACH);
        let left = x.saturating_sub(CLEAN_REACH);
        for row in top..(y + CLEAN_REACH + 1).min(height) {
            for column in left..(x + CLEAN_REACH + 1).min(width) {
                let i = row * width + column;
                let value = depth[i];
                if !value.is_nan() {
                    let near = (row + CLEAN_REACH - y) * SIDE + column + CLEAN_REACH - x;
                    votes[count] = (value, self.near[near] * confidence(i));
                    from[count] = i;
                    count += 1;
                    least = least.min(value);
                    most = most.max(value);
                }
            }
        }
        let votes = &mut votes[..count];
        if count == 0 {
            return f32::NAN;
        }
        if most - least > TOLERANCE {
            let colour = guide[y * width + x];
            for (vote, i) in votes.iter_mut().zip(from) {
                vote.1 *= self.clean_colour.of(apart(guide[i], colour));
            }
            return surface(votes);
        }
        let (sum, weights) = (votes.iter()).fold((0.0, 0.0), |(sum, weights), (v, w)| (sum + w * v, weights + w));
        match weights > 0.0 {
            true => sum / weights,
            false => votes[0].0,
        }
    }

    /// Fills the holes of `cleaned` from their rims, as readings are cleaned. Holes far from any reading take the
    /// nearest one.
    fn fill(&self, scratch: &mut RefineScratch) {
        let width = self.depth.1;
        let RefineScratch {
            guide,
            cleaned,
            holes,
            filled,
            front,
        } = scratch;
        holes.clear();
        holes.extend((0..cleaned.len() as u32).filter(|i| cleaned[*i as usize].is_nan()));
        for _ in 0..FILL_PASSES {
            if holes.is_empty() {
                return;
            }
            let filled = &mut filled[..holes.len()];
            (filled.par_iter_mut().with_min_len(256))
                .zip(&*holes)
                .for_each(|(value, i)| {
                    let (x, y) = (*i as usize % width, *i as usize / width);
                    *value = self.clean_one(x, y, cleaned, |_| 1.0, guide);
                });
            for (value, i) in filled.iter().zip(&*holes) {
                cleaned[*i as usize] = *value;
            }
            holes.retain(|i| cleaned[*i as usize].is_nan());
        }
        if !holes.is_empty() {
            fill_from_nearest(cleaned, width, front, holes);
        }
    }

    /// Computes row `y` of the display.
    fn up_row(&self, y: usize, readings: &Readings<'_>, rgb: &[f32], row: &mut [f32]) {
        let (out_height, out_width) = self.out;
        let (height, width) = self.depth;
        let cell_y = self.y.cell[y] as usize;
        let offset_y = self.y.offset[y];
        let rows = [cell_y.saturating_sub(1), cell_y, (cell_y + 1).min(height - 1)];
        let mut x = 0;
        while x < out_width {
            let cell_x = self.x.cell[x] as usize;
            let mut end = x + 1;
            while end < out_width && self.x.cell[end] as usize == cell_x {
                end += 1;
            }
            let columns = [cell_x.saturating_sub(1), cell_x, (cell_x + 1).min(width - 1)];
            let around: [usize; 9] = std::array::from_fn(|k| rows[k / 3] * width + columns[k % 3]);
            let depths = around.map(|i| readings.depth[i]);
            let least = depths.into_iter().fold(f32::INFINITY, f32::min);
            let most = depths.into_iter().fold(f32::NEG_INFINITY, f32::max);
            if most - least <= TOLERANCE {
                for (to, offset_x) in row[x..end].iter_mut().zip(&self.x.offset[x..end]) {
                    *to = bilinear(&depths, *offset_x, offset_y);
                }
            } else {
                let colours = around.map(|i| readings.guide[i]);
                for (x, to) in (x..end).zip(&mut row[x..end]) {
                    let at = y * out_width + x;
                    let colour = std::array::from_fn(|c| rgb[c * out_height * out_width + at]);
                    let mut votes: [Vote; 9] = std::array::from_fn(|k| {
                        let dx = (k % 3) as f32 - 1.0 - self.x.offset[x];
                        let dy = (k / 3) as f32 - 1.0 - offset_y;
                        let near = self.up_near.of(dx * dx + dy * dy);
                        (depths[k], near * self.up_colour.of(apart(colours[k], colour)))
                    });
                    *to = surface(&mut votes);
                }
            }
            x = end;
        }
    }
}

/// The cleaned readings that display pixels are computed from.
struct Readings<'a> {
    depth: &'a [f32],
    guide: &'a [[f32; 3]],
}

/// Interpolates 3×3 `depths` bilinearly at the offset `dx`, `dy` from their middle, each −½..=½.
fn bilinear(depths: &[f32; 9], dx: f32, dy: f32) -> f32 {
    let (left, right_share) = if dx < 0.0 { (0, 1.0 + dx) } else { (1, dx) };
    let (top, bottom_share) = if dy < 0.0 { (0, 1.0 + dy) } else { (1, dy) };
    let across = |row: usize| {
        let (a, b) = (depths[3 * row + left], depths[3 * row + left + 1]);
        a + right_share * (b - a)
    };
    let (a, b) = (across(top), across(top + 1));
    a + bottom_share * (b - a)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::depth::refine_reference;
    use ndarray::{Array2, Array3};
    use rand::{RngExt, SeedableRng};

    struct Case {
        depth: Array2<f32>,
        confidence: Array2<f32>,
        rgb: Array3<f32>,
        crop: Crop,
    }

    impl Case {
        /// Creates two surfaces of different colours, with noise and holes, at different resolutions of depth and
        /// colour.
        fn random(seed: u64) -> Self {
            let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let mut side = || random.random_range(1..40usize);
            let (cells, out) = ((side(), side()), (side(), side()));
            let crop = Crop::cover(cells, out);
            let mut noise = |most: f32| random.random_range(-most..most);
            let front = |x: f64, y: f64| (x - 0.4).powi(2) + (y - 0.5).powi(2) < 0.07;
            let depth = Array2::from_shape_fn(cells, |(y, x)| {
                let (x, y) = ((x as f64 + 0.5) / cells.1 as f64, (y as f64 + 0.5) / cells.0 as f64);
                let surface = if front(x, y) { 0.2 } else { 0.7 + 0.2 * y as f32 };
                match noise(1.0) {
                    n if n > 0.8 => f32::NAN,
                    _ if x > 0.7 && y < 0.5 => f32::NAN,
                    n => surface + 0.02 * n,
                }
            });
            let confidence = depth.mapv(|d| if d.is_nan() { 0.0 } else { 0.6 + 0.4 * noise(1.0) });
            let rgb = Array3::from_shape_fn((3, out.0, out.1), |(c, y, x)| {
                let x = (crop.x + (x as f64 + 0.5) * crop.width / out.1 as f64) / cells.1 as f64;
                let y = (crop.y + (y as f64 + 0.5) * crop.height / out.0 as f64) / cells.0 as f64;
                let colour = if front(x, y) { [0.9, 0.5, 0.1] } else { [0.2, 0.4, 0.6] };
                (colour[c] + 0.03 * noise(1.0)).clamp(0.0, 1.0)
            });
            Case {
                depth,
                confidence,
                rgb,
                crop,
            }
        }

        fn refine(&self) -> Result<Vec<f32>> {
            let (_, height, width) = self.rgb.dim();
            let plan = Refiner::new(self.depth.dim(), self.crop, (height, width))?;
            let mut refined = vec![9.0; height * width];
            plan.refine(
                self.depth.as_slice().unwrap(),
                self.confidence.as_slice().unwrap(),
                self.rgb.as_slice().unwrap(),
                &mut refined,
                &mut plan.scratch(),
            )?;
            Ok(refined)
        }
    }

    #[test]
    fn the_fast_form_does_as_the_definition_says() {
        let (mut all, mut differ) = (0, 0);
        for seed in 0..150 {
            let case = Case::random(seed);
            if case.depth.iter().all(|d| d.is_nan()) {
                assert!(case.refine().is_err());
                continue;
            }
            let (d, c) = (case.depth.view(), case.confidence.view());
            let naive = refine_reference::refine(d, c, case.crop, case.rgb.view());
            let fast = case.refine().unwrap();
            let count = naive
                .iter()
                .zip(&fast)
                .filter(|(a, b)| (**a - **b).abs() > 2e-4)
                .count();
            all += fast.len();
            differ += count;
        }
        // Rounding may decide if each of two surfaces has nearly half of the weight.
        assert!(all > 30_000 && differ * 1000 < all, "{differ} of {all}");
    }

    #[test]
    fn threads_make_no_difference() {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Case::random(12).refine().unwrap())
        };
        assert_eq!(run(1), run(3));
    }

    /// The depth's edge lies 2 pixels beside the colour's, with mixed readings. The edge must move to the colour's,
    /// without depths between the surfaces.
    #[test]
    fn edges_follow_the_colour() {
        let (h, w, f) = (12, 16, 4);
        let depth = Array2::from_shape_fn((h, w), |(_, x)| match x {
            0..8 => 0.2,
            8 => 0.5,
            _ => 0.8,
        });
        // The colour's edge is at pixel 36, in the middle of the reading beside reading 8.
        let rgb = Array3::from_shape_fn((3, h * f, w * f), |(_, _, x)| if x < 36 { 0.9 } else { 0.1 });
        let case = Case {
            confidence: Array2::ones((h, w)),
            crop: Crop::cover((h, w), (h * f, w * f)),
            depth,
            rgb,
        };
        let refined = case.refine().unwrap();
        for y in 0..h * f {
            let row = &refined[y * w * f..][..w * f];
            assert!(row[..36].iter().all(|d| (d - 0.2).abs() < 1e-5), "{row:?}");
            assert!(row[36..].iter().all(|d| (d - 0.8).abs() < 1e-5), "{row:?}");
        }
    }

    #[test]
    fn holes_take_the_surface_of_their_colour() {
        let (h, w) = (24, 32);
        let is_front = |x: usize| x < 16;
        // There are no readings around the edge, and the hole on the far right is larger than any neighbourhood.
        let depth = Array2::from_shape_fn((h, w), |(_, x)| match x {
            12..20 | 25.. => f32::NAN,
            x if is_front(x) => 0.1,
            _ => 0.9,
        });
        let rgb = Array3::from_shape_fn((3, h, w), |(_, _, x)| if is_front(x) { 0.8 } else { 0.3 });
        let case = Case {
            confidence: Array2::ones((h, w)),
            crop: Crop::cover((h, w), (h, w)),
            depth,
            rgb,
        };
        for (i, d) in case.refine().unwrap().iter().enumerate() {
            let expected = if is_front(i % w) { 0.1 } else { 0.9 };
            assert!((d - expected).abs() < 1e-5, "{} {d}", i % w);
        }
    }

    #[test]
    fn impossible_shapes_are_refused() {
        let crop = Crop::cover((1, 1), (1, 1));
        assert!(Refiner::new((0, 4), crop, (4, 4)).is_err());
        assert!(Refiner::new((4, 4), crop, (4, 1 << 17)).is_err());
    }
}
