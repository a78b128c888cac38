//! Finds whether depth was enlarged from a coarser grid, and reads that grid again.
//!
//! Depth of a picture's size is often the readings of a sensor or the output of a network that an app, a data set or an
//! image program enlarged. Its edges are blocks or ramps, which conditioning cannot tell from surfaces. Read on the
//! grid that it came from, it is conditioned as a sensor's depth is.
//!
//! A factor and a way of enlarging are a linear map from a line of readings to a line of pixels. The least squares fit
//! of such a map leaves only noise and rounding of a line that it made, at edges too. It does so at one place of the
//! grid: a grid that is shifted by a part of a reading leaves much more. Depth of full resolution, sharp or soft, is
//! not fitted better at one place than at the others. So the ratio of both, the contrast, decides. It must be high
//! along rows and along columns.

mod fit;

use crate::Bounds;
use crate::Size;
use crate::depth::fill_nearest;
use crate::parallel::prelude::*;
use fit::{Fit, Kernel, LANES, Limits};
use ndarray::{Array2, ArrayView2};

/// The ratios of the depth's size to the grid's that are tried. A ratio that is not whole is tried only where it
/// divides both sides.
const FACTORS: [f64; 14] = [2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 5.25, 5.5, 6.0, 6.5, 7.0, 7.5, 8.0];
/// The least side of depth that is examined, in pixels.
const LEAST_SIDE: usize = 64;
/// The number of rows, and of columns, that are examined.
const LINES: usize = 64;
/// The change of depth at an edge, as a share of the range between the 1st and 99th percentile.
const EDGE: f32 = 0.06;
/// The pixels on both sides of a pixel among which an edge counts.
const REACH: usize = 4;
/// The pixels at the ends of a line, and beside holes, that do not count: how programs treat the border differs.
const MARGIN: usize = 16;
/// The least number of different places of edges along rows, and along columns. A few straight edges may lie on a
/// grid by chance.
const LEAST_PLACES: usize = 8;
/// The share of the squared errors at edges that counts: the largest are overshoots of bicubic maps that were cut off.
const KEPT: f64 = 0.98;
/// Maps whose error is at most this many times the least are compared by their contrast.
const COMPARABLE: f64 = 3.0;
/// The error, as a squared share of the range, below which maps fit exactly.
const EXACT: f64 = 1e-10;
/// The least contrast of enlarged depth.
const CONTRAST: f64 = 2.0;
/// Contrasts from here on are alike.
const HIGH_CONTRAST: f64 = 50.0;
/// Contrasts within this factor are alike.
const ALIKE: f64 = 1.5;
/// The share of the largest number below which a reading is 0, which may mean no reading. Rounding leaves less.
const ZERO: f32 = 2e-3;

/// A way of enlarging a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Enlarging {
    /// Each pixel is the nearest reading.
    Nearest,
    /// Linear between two readings along each axis.
    Bilinear,
    /// Cubic between four readings along each axis (Keys, IEEE Trans. ASSP 29, 1981).
    Bicubic,
}

/// The grid from which depth was enlarged, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Enlarged {
    /// The ratio of the depth's size to the grid's.
    pub factor: f64,
    /// The way of enlarging.
    pub by: Enlarging,
    /// The size of the grid.
    pub grid: Size,
    kernel: Kernel,
}

impl std::fmt::Display for Enlarged {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let by = match self.by {
            Enlarging::Nearest => "nearest",
            Enlarging::Bilinear => "bilinear",
            Enlarging::Bicubic => "bicubic",
        };
        write!(f, "enlarged {} times ({by}) from {}", self.factor, self.grid)
    }
}

/// Returns from which grid `depth`, (H, W), was enlarged, or `None` if it has its full resolution, or if it has too few
/// edges to tell. `depth` is on any scale; values that are not finite are no readings. A side below 64 pixels is not
/// examined.
///
/// Runs on the current rayon pool.
pub fn find(depth: ArrayView2<'_, f32>) -> Option<Enlarged> {
    let size = Size::from_shape(depth.dim());
    if size.width.min(size.height) < LEAST_SIDE {
        return None;
    }
    let lines = [Lines::new(depth)?, Lines::new(depth.reversed_axes())?];
    let tried: Vec<Enlarged> = candidates(size);
    let errors: Vec<[f64; 2]> = tried.par_iter().map(|map| map.errors(&lines, false)).collect();
    let joint = |errors: &[f64; 2]| errors[0] + errors[1];
    let least = errors.iter().map(joint).fold(f64::INFINITY, f64::min);
    let comparable = tried.into_iter().zip(errors);
    let comparable: Vec<_> = comparable
        .filter(|(_, errors)| joint(errors) <= COMPARABLE * least + 2.0 * EXACT)
        .collect();
    let contrasts: Vec<(Enlarged, f64)> = (comparable.into_par_iter())
        .filter_map(|(map, errors)| Some((map, map.contrast(&lines, errors)?)))
        .collect();
    let best = contrasts.iter().map(|(_, contrast)| *contrast).fold(0.0, f64::max);
    let alike = contrasts
        .into_iter()
        .filter(|(_, contrast)| *contrast >= best.min(HIGH_CONTRAST) / ALIKE);
    // Blocks of 8 pixels are blocks of 4 and of 2 as well.
    let blocks = |map: &Enlarged| if map.by == Enlarging::Nearest { map.factor } else { 0.0 };
    alike
        .max_by(|(a, a_contrast), (b, b_contrast)| {
            blocks(a).total_cmp(&blocks(b)).then(a_contrast.total_cmp(b_contrast))
        })
        .map(|(map, _)| map.where_cut_off(&lines))
}

/// Returns the maps from coarser grids to depth of `size`.
fn candidates(size: Size) -> Vec<Enlarged> {
    let mut all = Vec::new();
    for factor in FACTORS {
        let side = |pixels: usize| pixels as f64 / factor;
        let is_whole = factor.fract() == 0.0;
        if !is_whole && (side(size.width).fract() != 0.0 || side(size.height).fract() != 0.0) {
            continue;
        }
        let grid = Size {
            width: side(size.width).round() as usize,
            height: side(size.height).round() as usize,
        };
        let kernels = Kernel::ALL.iter().filter(|kernel| match kernel {
            Kernel::NearestAtCorner => !is_whole,
            // The same pixels as the linear map's, whose readings are sharper.
            Kernel::CubicHalf => factor != 2.0,
            _ => true,
        });
        all.extend(kernels.map(|kernel| Enlarged {
            factor,
            by: kernel.enlarging(),
            grid,
            kernel: *kernel,
        }));
    }
    all
}

/// The lines along one axis that are examined.
struct Lines {
    /// The lines with edges, without holes, as shares of the range.
    values: Vec<Vec<f32>>,
    /// Which pixels of each line count, because they lie at an edge.
    edges: Vec<Vec<bool>>,
    /// The ends of all depth, as shares of the range.
    limits: Limits,
}

impl Lines {
    /// Takes rows of `depth`, or returns `None` if they have too few edges.
    fn new(depth: ArrayView2<'_, f32>) -> Option<Self> {
        let (height, width) = depth.dim();
        let count = height.min(LINES);
        let rows = (0..count).map(|i| depth.row((2 * i + 1) * height / (2 * count)));
        let rows: Vec<Vec<f32>> = rows.map(|row| row.to_vec()).collect();
        let mut sorted: Vec<f32> = rows.iter().flatten().copied().filter(|v| v.is_finite()).collect();
        if sorted.is_empty() {
            return None;
        }
        let last = sorted.len() - 1;
        let [low, high] =
            [last / 100, last - last / 100].map(|at| *sorted.select_nth_unstable_by(at, f32::total_cmp).1);
        let range = high - low;
        if !(range > 0.0 && range.is_finite()) {
            return None;
        }
        let mut lines = Lines {
            values: Vec::new(),
            edges: Vec::new(),
            limits: Limits::of(depth).scaled(low, range),
        };
        let mut places = vec![false; width];
        for row in rows {
            let Some((values, holes)) = filled(&row) else { continue };
            let values: Vec<f32> = values.iter().map(|v| (v - low) / range).collect();
            let edges = edges(&values, &holes);
            for x in MARGIN..width - MARGIN {
                let step = |at: usize| (values[at + 1] - values[at]).abs();
                if edges[x] && step(x) > 0.2 * EDGE && step(x) >= step(x - 1) && step(x) >= step(x + 1) {
                    places[x] = true;
                }
            }
            if edges.contains(&true) {
                lines.values.push(values);
                lines.edges.push(edges);
            }
        }
        (places.iter().filter(|place| **place).count() >= LEAST_PLACES).then_some(lines)
    }
}

/// Returns `row` with each hole filled by the reading before it, or the first one, and where the holes are; `None`
/// without a reading.
fn filled(row: &[f32]) -> Option<(Vec<f32>, Vec<bool>)> {
    let mut last = *row.iter().find(|v| v.is_finite())?;
    let holes = row.iter().map(|v| !v.is_finite()).collect();
    let values = row.iter().map(|v| {
        if v.is_finite() {
            last = *v;
        }
        last
    });
    Some((values.collect(), holes))
}

/// Returns which pixels of a line lie at an edge, away from its ends and from holes.
fn edges(values: &[f32], holes: &[bool]) -> Vec<bool> {
    let width = values.len();
    let is_edge = |x: usize| {
        let near = &values[x - REACH..=x + REACH];
        let (least, most) = near.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), v| {
            (v.at_most(a), v.at_least(b))
        });
        most - least > EDGE && !holes[x - MARGIN..=x + MARGIN].contains(&true)
    };
    (0..width)
        .map(|x| (MARGIN..width - MARGIN).contains(&x) && is_edge(x))
        .collect()
}

impl Enlarged {
    /// Returns the mean squared errors of the fit at edges along rows and along columns. With `cut`, what lies beyond
    /// the ends of the depth was cut off.
    fn errors(&self, lines: &[Lines; 2], cut: bool) -> [f64; 2] {
        std::array::from_fn(|axis| self.error(lines, axis, 0.0, cut))
    }

    /// Returns the mean squared error along an axis, with the grid shifted by `shift` readings.
    fn error(&self, lines: &[Lines; 2], axis: usize, shift: f64, cut: bool) -> f64 {
        let grid = [self.grid.width, self.grid.height][axis];
        let lines = &lines[axis];
        let pixels = lines.values[0].len();
        let fit = Fit::new(pixels, grid, self.kernel, shift);
        let mut squares = Vec::new();
        let mut scratch = fit.scratch();
        let limits = if cut { lines.limits } else { Limits::NONE };
        for (values, edges) in lines.values.chunks(LANES).zip(lines.edges.chunks(LANES)) {
            let errors = fit.errors(values, limits, &mut scratch);
            for (lane, edges) in edges.iter().enumerate() {
                let at_edges = errors.iter().zip(edges).filter(|(_, is_edge)| **is_edge);
                squares.extend(at_edges.map(|(errors, _)| errors[lane] * errors[lane]));
            }
        }
        let kept = ((KEPT * squares.len() as f64).ceil() as usize).clamp(1, squares.len());
        squares.select_nth_unstable_by(kept - 1, f64::total_cmp);
        // A fit of n pixels by m readings leaves (n − m)/n of white noise.
        let left = 1.0 - grid as f64 / pixels as f64;
        squares[..kept].iter().sum::<f64>() / kept as f64 / left
    }

    /// Returns this map, with that of Keys' cubics which fits better where overshoots are cut off: they hide which one
    /// made the depth.
    fn where_cut_off(self, lines: &[Lines; 2]) -> Self {
        if self.by != Enlarging::Bicubic || self.factor == 2.0 {
            return self;
        }
        let cubics = [Kernel::CubicHalf, Kernel::CubicThreeQuarters].map(|kernel| Enlarged { kernel, ..self });
        let error = |map: &Enlarged| map.errors(lines, true).iter().sum::<f64>();
        let [half, other] = cubics.each_ref().map(error);
        cubics[usize::from(other < half)]
    }

    /// Returns the least ratio of the errors of shifted grids, along rows and along columns, to `errors`, those of this
    /// grid. Returns `None` at the first that is below [`CONTRAST`].
    fn contrast(&self, lines: &[Lines; 2], errors: [f64; 2]) -> Option<f64> {
        let parts = match self.by {
            Enlarging::Nearest => self.factor.round() as usize,
            _ => 4,
        };
        let mut least = f64::INFINITY;
        for shift in (1..parts).map(|part| part as f64 / parts as f64) {
            for (axis, error) in errors.into_iter().enumerate() {
                let ratio = self.error(lines, axis, shift, false) / error.max(EXACT);
                if ratio < CONTRAST {
                    return None;
                }
                least = least.min(ratio);
            }
        }
        Some(least)
    }

    /// Returns the readings of the grid, (h, w), of `depth`, (H, W), which [`find`] examined: those whose enlargement
    /// is nearest to it. A reading is NaN where most of its pixels are not finite.
    ///
    /// # Panics
    /// Panics if `depth` has another size than the depth that was examined, within the rounding of the grid's size.
    pub fn readings(&self, depth: ArrayView2<'_, f32>) -> Array2<f32> {
        let mut known = depth.mapv(|v| if v.is_finite() { v } else { f32::NAN });
        let holes = known.mapv(|v| v.is_nan());
        if holes.iter().all(|hole| *hole) {
            return Array2::from_elem(self.grid.shape(), f32::NAN);
        }
        if holes.iter().any(|hole| *hole) {
            // A hole's pixels must not pull at the readings beside it.
            let _ = fill_nearest(&mut known);
        }
        let limits = Limits::of(known.view());
        let Limits { least, most } = limits;
        let narrow = along_rows(known.view(), self.grid.width, self.kernel, limits);
        let mut readings = along_columns(narrow.view(), self.grid.height, self.kernel, limits);
        let ratio = |pixels: usize, cells: usize| pixels as f64 / cells as f64;
        let (down, across) = (
            ratio(depth.dim().0, self.grid.height),
            ratio(depth.dim().1, self.grid.width),
        );
        for ((y, x), reading) in readings.indexed_iter_mut() {
            let span = |at: usize, ratio: f64| {
                (at as f64 * ratio).round() as usize..((at + 1) as f64 * ratio).round() as usize
            };
            let cell = holes.slice(ndarray::s![span(y, down), span(x, across)]);
            let missing = cell.iter().filter(|hole| **hole).count();
            *reading = match 2 * missing > cell.len() {
                true => f32::NAN,
                false if least >= 0.0 && *reading < ZERO * most => 0.0,
                false => reading.clamp(least.at_most(0.0), most),
            };
        }
        readings.as_standard_layout().into_owned()
    }
}

/// Returns the readings, (H, w), of each row of `depth`, (H, W).
fn along_rows(depth: ArrayView2<'_, f32>, grid: usize, kernel: Kernel, limits: Limits) -> Array2<f32> {
    let (height, width) = depth.dim();
    let fit = Fit::new(width, grid, kernel, 0.0);
    let mut readings = vec![0.0; height * grid];
    (readings.par_chunks_mut(LANES * grid)).enumerate().for_each_init(
        || fit.scratch(),
        |scratch, (group, to)| {
            let rows = LANES * group..(LANES * (group + 1)).min(height);
            let rows: Vec<Vec<f32>> = rows.map(|y| depth.row(y).to_vec()).collect();
            let found = fit.readings(&rows, limits, scratch);
            for (lane, to) in to.chunks_exact_mut(grid).enumerate() {
                to.iter_mut()
                    .zip(found)
                    .for_each(|(to, readings)| *to = readings[lane] as f32);
            }
        },
    );
    Array2::from_shape_vec((height, grid), readings).expect("rows of the grid")
}

/// Returns the readings, (h, W), of each column of `depth`, (H, W).
fn along_columns(depth: ArrayView2<'_, f32>, grid: usize, kernel: Kernel, limits: Limits) -> Array2<f32> {
    along_rows(depth.reversed_axes(), grid, kernel, limits).reversed_axes()
}

#[cfg(test)]
mod tests;
