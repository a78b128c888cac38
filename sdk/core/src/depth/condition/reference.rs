//! The definition of conditioning, which [`super`] describes, without its speed: it computes each reading and each
//! pixel separately. Tests compare [`super::Conditioner`] with it.

use super::edges::{BESIDE, EDGE, MIXED, MIXED_BY, SINGLE, UNEXPLAINED, WHOLE};
use super::{Misfit, contradict, fill, narrow, pixels, register, smooth, surfaces};
use crate::Bounds;
use crate::Size;
use crate::depth::{fill_nearest, sharpness};
use crate::frame::Crop;
use ndarray::{Array2, ArrayView2, ArrayView3};

/// Returns how `depth`, (h, w), lies beside `rgb`, (3, H, W).
pub fn misfit(depth: ArrayView2<'_, f32>, crop: Crop, rgb: ArrayView3<'_, f32>) -> Misfit {
    let samples = ((rgb.dim().1 as f64 / crop.height).round() as usize).clamp(1, register::MOST_SAMPLES);
    let edges = colour_edges(Size::from_shape(depth.dim()), samples, crop, rgb);
    let reach = register::REACH as isize;
    let evidence = |(y, x): (isize, isize), growth: isize| evidence(depth, samples, &edges, (y, x), growth);
    let shifts = |reach: isize| (-reach..=reach).flat_map(move |y| (-reach..=reach).map(move |x| (y, x)));
    let (mut best, mut most) = (((0, 0), 0), evidence((0, 0), 0).0);
    for growth in 0..=register::MOST_GROWTH as isize {
        let by = growth * samples as isize;
        let top = shifts(reach - by)
            .map(|shift| (shift, evidence(shift, growth).0))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let gain = f64::from(if growth == 0 { 1.0 } else { register::GROWTH_GAIN });
        if let Some((shift, sum)) = top.filter(|(_, sum)| *sum > gain * most) {
            (best, most) = ((shift, growth), sum);
        }
    }
    let (zero, weights) = evidence((0, 0), 0);
    if most <= f64::from(register::GAIN) * zero {
        (best, most) = (((0, 0), 0), zero);
    }
    let sums: Vec<f64> = shifts(reach).map(|shift| evidence(shift, 0).0).collect();
    let mean = sums.iter().sum::<f64>() / sums.len() as f64;
    let variance = sums.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / sums.len() as f64;
    let weak = weights < f64::from(register::LEAST_EDGES);
    if weak || most - mean < f64::from(register::DISTINCT) * variance.sqrt() {
        return Misfit::default();
    }
    let ((y, x), growth) = best;
    Misfit {
        shift: (y as f64 / samples as f64, x as f64 / samples as f64),
        growth: growth as usize,
    }
}

/// Returns the colour edges at the samples of (h, w) readings, along x and along y, as multiples of the mean around.
fn colour_edges(
    Size { width: w, height: h }: Size,
    samples: usize,
    crop: Crop,
    rgb: ArrayView3<'_, f32>,
) -> [Array2<f64>; 2] {
    let (_, height, width) = rgb.dim();
    let (rows, columns) = (h * samples, w * samples);
    let colour = |y: usize, x: usize| {
        let place = |i: usize, from: f64, scale: f64| ((i as f64 + 0.5) / samples as f64 - from) * scale;
        let y = place(y, crop.y, height as f64 / crop.height);
        let x = place(x, crop.x, width as f64 / crop.width);
        let inside = (0.0..height as f64).contains(&y) && (0.0..width as f64).contains(&x);
        inside.then(|| [0, 1, 2].map(|c| rgb[(c, y as usize, x as usize)]))
    };
    let change = |a: Option<[f32; 3]>, b: Option<[f32; 3]>| {
        let sum = a.zip(b).map_or(0.0, |(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()).sum());
        f64::from(sum / (sum + register::HALF))
    };
    let before = |i: usize| {
        if samples.is_multiple_of(2) {
            i.saturating_sub(1)
        } else {
            i
        }
    };
    let edges = [false, true].map(|down| {
        Array2::from_shape_fn((rows, columns), |(y, x)| match down {
            false => change(colour(y, before(x)), colour(y, (x + 1).min(columns - 1))),
            true => change(colour(before(y), x), colour((y + 1).min(rows - 1), x)),
        })
    });
    let tile = |i: usize, size: usize| {
        let first = i / register::TILE * register::TILE;
        first..(first + register::TILE).min(size)
    };
    let mean = Array2::from_shape_fn((rows, columns), |(y, x)| {
        let part = ndarray::s![tile(y, rows), tile(x, columns)];
        let means = [0, 1].map(|down| edges[down].slice(part).mean().expect("not empty"));
        (means[0] + means[1]) / 2.0
    });
    edges.map(|edges| edges / (&mean + f64::from(register::FAINT)))
}

/// Returns the sum of colour edges under the edges of `depth`, moved by a shift and outward by a growth, and the sum of
/// weights.
fn evidence(
    depth: ArrayView2<'_, f32>,
    samples: usize,
    edges: &[Array2<f64>; 2],
    (shift_y, shift_x): (isize, isize),
    growth: isize,
) -> (f64, f64) {
    let (h, w) = depth.dim();
    let (rows, columns) = edges[0].dim();
    let clamped = |i: isize, size: usize| i.clamp(0, size as isize - 1) as usize;
    let at = |y: isize, x: isize| depth[(clamped(y, h), clamped(x, w))];
    let (mut sum, mut weights) = (0.0, 0.0);
    for ((y, x), d) in depth.indexed_iter() {
        for (axis, next) in [depth.get((y, x + 1)), depth.get((y + 1, x))].into_iter().enumerate() {
            let (row, column) = (y as isize, x as isize);
            let (dy, dx) = if axis == 0 { (0, 1) } else { (1, 0) };
            let step = next.map_or(0.0, |next| next - d);
            let around = [at(row - dy, column - dx), at(row + 2 * dy, column + 2 * dx)];
            if step.is_nan() || step.abs() < *register::EDGE.start() || around.iter().any(|d| d.is_nan()) {
                continue;
            }
            let after = at(row + dx, column + dy) + at(row + dx + dy, column + dy + dx);
            let turn = after - at(row - dx, column - dy) - at(row - dx + dy, column - dy + dx);
            let (right, down) = if axis == 0 { (step, turn) } else { (turn, step) };
            let outward = |d: f32| if d < 0.0 { -growth } else { growth } * samples as isize;
            let start = |i: usize, middle: bool, shift: isize, size: usize| {
                let at = (i * samples + if middle { samples / 2 } else { 0 }) as isize - shift;
                at.clamp(0, size as isize - 1) as usize
            };
            let top = start(y, axis == 1, shift_y + outward(down), rows);
            let left = start(x, axis == 0, shift_x + outward(right), columns);
            let weight = f64::from(step.abs().at_most(*register::EDGE.end()));
            let reading = (top..(top + samples).min(rows))
                .flat_map(|y| (left..(left + samples).min(columns)).map(move |x| (y, x)));
            sum += weight * reading.map(|at| edges[axis][at]).sum::<f64>();
            weights += weight;
        }
    }
    (sum, weights)
}

/// Gives holes the depth of the surface with their colour, from their rims inward.
fn fill(readings: &mut Array2<f32>, colours: &impl Fn(usize, usize) -> Vec<[f64; 3]>) {
    for pass in 0..fill::PASSES {
        let before = readings.clone();
        for (at, value) in readings.indexed_iter_mut().filter(|(_, value)| value.is_nan()) {
            if pass >= fill::ALIKE_PASSES || has_alike(&before, at, colours) {
                *value = surface(rim(&before, at, colours)).0;
            }
        }
    }
    fill_nearest(readings).expect("there is a reading");
}

/// Conditions the part `crop` of `depth`, (h, w), which lies beside `rgb`, (3, H, W), as `misfit` says, and returns
/// (H, W). `depth` has NaN for no reading and at least one reading.
pub fn condition(depth: ArrayView2<'_, f32>, crop: Crop, rgb: ArrayView3<'_, f32>, misfit: Misfit) -> Array2<f32> {
    let shift = misfit.shift;
    let (_, height, width) = rgb.dim();
    let rows = Axis::new(crop.y + shift.0, crop.height, depth.dim().0, height);
    let columns = Axis::new(crop.x + shift.1, crop.width, depth.dim().1, width);
    let colours = |y: usize, x: usize| -> Vec<[f64; 3]> {
        let pixels = rows.pixels(y).flat_map(|y| columns.pixels(x).map(move |x| (y, x)));
        pixels
            .map(|(y, x)| [0, 1, 2].map(|c| f64::from(rgb[(c, y, x)])))
            .collect()
    };
    let mut readings = narrowed(depth, misfit.growth);
    let mut filled = readings.mapv(f32::is_nan);
    fill(&mut readings, &colours);
    let planes = (
        rgb.as_slice().expect("standard layout"),
        readings.as_slice().expect("standard layout"),
    );
    let clean = depth.dim() == (height, width) && sharpness::is_clean(planes.0, planes.1, width);
    if !clean {
        for _ in 0..smooth::PASSES {
            readings = fitted(&fitted(&readings, 0, 1), 1, 0);
        }
    }
    let mixes = mixes(&readings);
    let mut kinds = kinds_of(&readings, mixes);
    if !clean && contradict::applies(crop, Size { width, height }) {
        let before = readings.clone();
        for (at, value) in readings.indexed_iter_mut().filter(|(at, _)| !kinds[*at].1) {
            if near(Size::from_shape(depth.dim()), at, fill::REACH).any(|(at, _)| kinds[at].0)
                && let Some(depth) = contradiction(&before, &kinds, at, &colours)
            {
                (*value, filled[at]) = (depth, true);
            }
        }
        kinds = kinds_of(&readings, mixes);
    }
    let is_coarse = contradict::pixels(crop, Size { width, height }) > 1.0;
    let choices = Array2::from_shape_fn((height, width), |(y, x)| {
        let (row, column) = (rows.reading(y), columns.reading(x));
        let around: [(usize, usize); 9] = std::array::from_fn(|k| {
            let near = |i: usize, k: usize, size: usize| (i + k).saturating_sub(1).min(size - 1);
            (
                near(row, k / 3, readings.dim().0),
                near(column, k % 3, readings.dim().1),
            )
        });
        let place = place_of(columns.offset(x), rows.offset(y));
        if clean || !kinds[(row, column)].0 {
            let depth = interpolated(&place, &around.map(|at| readings[at]));
            return (depth, 0.0, f64::INFINITY);
        }
        let rounds = around.map(|at| match kinds[at] {
            (_, true) => 2,
            (is_edge, _) => usize::from(is_edge && filled[at]),
        });
        let depths = around.map(|at| readings[at]);
        let end = |k: usize, behind: bool| {
            let end = end_of_ramp(&readings, &kinds, around[k], behind).filter(|_| is_coarse && rounds[4] == 2)?;
            Some((readings[end], colours(end.0, end.1)))
        };
        let surfaces = surfaces_of(depths, rounds, &|k| colours(around[k].0, around[k].1), &end);
        let colour = [0, 1, 2].map(|c| f64::from(rgb[(c, y, x)]));
        let likelihood = |surface: &Surface| {
            let square: f64 = (0..3).map(|c| (colour[c] - surface.mean[c]).powi(2)).sum();
            -square / (2.0 * surface.variance) - 1.5 * surface.variance.ln()
        };
        let most = surfaces.iter().map(likelihood).fold(f64::NEG_INFINITY, f64::max);
        let mut scores: Vec<(f64, f32)> = (surfaces.iter())
            .map(|surface| {
                let covered = f64::from(interpolated(&place, &surface.covers));
                let colour = (likelihood(surface) - most).max(-f64::from(pixels::MOST_EVIDENCE));
                (f64::from(pixels::PLACE) * covered + colour, surface.depth_at(&place))
            })
            .collect();
        scores.sort_by(|a, b| b.0.total_cmp(&a.0));
        let second = scores.get(1).copied().unwrap_or((f64::NEG_INFINITY, scores[0].1));
        (scores[0].1, second.1, scores[0].0 - second.0)
    });
    Array2::from_shape_fn((height, width), |at| voted(&choices, rgb, at).clamp(0.0, 1.0))
}

/// The readings along one side of the display: `length` readings, starting at `from`, for `out` display pixels.
struct Axis {
    from: f64,
    length: f64,
    readings: usize,
    out: usize,
}

impl Axis {
    fn new(from: f64, length: f64, readings: usize, out: usize) -> Self {
        Axis {
            from,
            length,
            readings,
            out,
        }
    }

    fn place(&self, pixel: usize) -> f64 {
        self.from + (pixel as f64 + 0.5) * self.length / self.out as f64 - 0.5
    }

    fn reading(&self, pixel: usize) -> usize {
        self.place(pixel).round().clamp(0.0, self.readings as f64 - 1.0) as usize
    }

    fn offset(&self, pixel: usize) -> f32 {
        (self.place(pixel) - self.reading(pixel) as f64).clamp(-0.5, 0.5) as f32
    }

    /// Returns the display pixels in a reading, or the nearest pixel if there is none.
    fn pixels(&self, reading: usize) -> std::ops::Range<usize> {
        let first = (0..self.out).filter(|p| self.reading(*p) < reading).count();
        let end = (0..self.out).filter(|p| self.reading(*p) <= reading).count();
        let nearest = first.min(self.out - 1);
        if first < end { first..end } else { nearest..nearest + 1 }
    }
}

fn mean(colours: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|c| colours.iter().map(|colour| colour[c]).sum::<f64>() / colours.len() as f64)
}

/// Returns the places within `reach` of a place, with their steps from it.
fn near(
    Size { width: w, height: h }: Size,
    (y, x): (usize, usize),
    reach: usize,
) -> impl Iterator<Item = ((usize, usize), (f64, f64))> {
    let columns = x.saturating_sub(reach)..(x + reach + 1).min(w);
    (y.saturating_sub(reach)..(y + reach + 1).min(h))
        .flat_map(move |row| columns.clone().map(move |column| (row, column)))
        .map(move |at| (at, (at.0 as f64 - y as f64, at.1 as f64 - x as f64)))
}

/// Returns `depth` with near surfaces narrowed by `growth` readings, or as it is if no reading remains.
fn narrowed(depth: ArrayView2<'_, f32>, growth: usize) -> Array2<f32> {
    let narrowed = Array2::from_shape_fn(depth.dim(), |at| {
        let around = || near(Size::from_shape(depth.dim()), at, growth);
        let behind = around().filter(|(other, _)| depth[*other] - depth[at] > narrow::EDGE);
        let nearest = behind.min_by(|a, b| a.1.0.hypot(a.1.1).total_cmp(&b.1.0.hypot(b.1.1)));
        match nearest {
            Some((other, _)) => depth[other],
            None if around().any(|(other, _)| depth[other].is_nan()) => f32::NAN,
            None => depth[at],
        }
    });
    match narrowed.iter().all(|d| d.is_nan()) {
        true => depth.to_owned(),
        false => narrowed,
    }
}

/// Returns the depth and the weight of each reading around one.
fn rim(depth: &Array2<f32>, at: (usize, usize), colours: &dyn Fn(usize, usize) -> Vec<[f64; 3]>) -> Vec<(f32, f64)> {
    let own = mean(&colours(at.0, at.1));
    let around = near(Size::from_shape(depth.dim()), at, fill::REACH).map(|(at, (dy, dx))| {
        let theirs = mean(&colours(at.0, at.1));
        let apart: f64 = (0..3).map(|c| (own[c] - theirs[c]).powi(2)).sum();
        let weight = (1.0 + (dx * dx + dy * dy) / f64::from(fill::NEAR).powi(2))
            * (1.0 + apart / f64::from(fill::ALIKE).powi(2));
        (depth[at], weight.powi(-2))
    });
    around.filter(|vote| !vote.0.is_nan()).collect()
}

/// Returns whether a reading around one has nearly its colour.
fn has_alike(depth: &Array2<f32>, at: (usize, usize), colours: &dyn Fn(usize, usize) -> Vec<[f64; 3]>) -> bool {
    let own = mean(&colours(at.0, at.1));
    let known = near(Size::from_shape(depth.dim()), at, fill::REACH).filter(|(at, _)| !depth[*at].is_nan());
    known.map(|(at, _)| mean(&colours(at.0, at.1))).any(|theirs| {
        let apart: f64 = (0..3).map(|c| (own[c] - theirs[c]).powi(2)).sum();
        apart <= f64::from(fill::ALIKE).powi(2)
    })
}

/// Returns the mean and the weight of the votes that agree with their weighted median.
fn surface(mut votes: Vec<(f32, f64)>) -> (f32, f64) {
    votes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = votes.iter().map(|vote| vote.1).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    let median = votes.iter().find(|vote| {
        sum += vote.1;
        sum >= half
    });
    let Some(&(median, _)) = median else {
        return (f32::NAN, 0.0);
    };
    votes.retain(|vote| (vote.0 - median).abs() <= fill::TOLERANCE);
    let weights: f64 = votes.iter().map(|vote| vote.1).sum();
    let sum = votes.iter().map(|vote| f64::from(vote.0) * vote.1).sum::<f64>();
    ((sum / weights) as f32, weights)
}

/// Returns the depth of the surface that contradicts a reading by its colour.
fn contradiction(
    depth: &Array2<f32>,
    kinds: &Array2<(bool, bool)>,
    at: (usize, usize),
    colours: &dyn Fn(usize, usize) -> Vec<[f64; 3]>,
) -> Option<f32> {
    let mut unmixed = depth.clone();
    unmixed.zip_mut_with(kinds, |d, kind| *d = if kind.1 { f32::NAN } else { *d });
    let agrees = |vote: &(f32, f64)| (vote.0 - depth[at]).abs() <= fill::TOLERANCE;
    let (own, others): (Vec<_>, Vec<_>) = rim(&unmixed, at, colours).into_iter().partition(agrees);
    let own = own.iter().map(|vote| vote.1).sum::<f64>() + f64::from(contradict::OWN) - 1.0;
    let (value, weight) = surface(others);
    (weight > own).then_some(value)
}

/// Moves each reading onto the line that fits its neighbours in the direction (`dy`, `dx`) best.
fn fitted(depth: &Array2<f32>, dy: isize, dx: isize) -> Array2<f32> {
    Array2::from_shape_fn(depth.dim(), |(y, x)| {
        let middle = f64::from(depth[(y, x)]);
        let (mut w, mut wk, mut wkk, mut we, mut wke) = (0.0, 0.0, f64::from(smooth::STIFFNESS), 0.0, 0.0);
        for k in -(smooth::REACH as isize)..=smooth::REACH as isize {
            let at = (y.checked_add_signed(k * dy), x.checked_add_signed(k * dx));
            let Some(value) = at.0.zip(at.1).and_then(|at| depth.get(at)) else {
                continue;
            };
            let (difference, k) = (f64::from(*value) - middle, k as f64);
            let weight = (1.0 - (difference / f64::from(smooth::TOLERANCE)).powi(2))
                .max(0.0)
                .powi(2);
            w += weight;
            wk += weight * k;
            wkk += weight * k * k;
            we += weight * difference;
            wke += weight * k * difference;
        }
        (middle + (wkk * we - wk * wke) / (w * wkk - wk * wk)) as f32
    })
}

/// Returns whether readings mix surfaces: whether few edges are a single step.
fn mixes(depth: &Array2<f32>) -> bool {
    let lines = depth.rows().into_iter().chain(depth.columns());
    let windows: Vec<[f32; 4]> = lines
        .flat_map(|line| {
            line.windows(4)
                .into_iter()
                .map(|d| [d[0], d[1], d[2], d[3]])
                .collect::<Vec<_>>()
        })
        .collect();
    let steps = windows.iter().map(|d| [0, 1, 2].map(|k| (d[k + 1] - d[k]).abs()));
    let edges: Vec<bool> = (windows.iter().map(|d| (d[3] - d[0]).abs()))
        .zip(steps)
        .filter(|(whole, steps)| *whole > WHOLE && steps[1] >= steps[0].at_least(steps[2]))
        .map(|(whole, steps)| steps[0].at_least(steps[2]) < BESIDE * whole)
        .collect();
    let single = edges.iter().filter(|single| **single).count();
    edges.is_empty() || (single as f32) < SINGLE * edges.len() as f32
}

/// Returns whether each reading is at an edge, and whether it is mixed.
fn kinds_of(depth: &Array2<f32>, mixes: bool) -> Array2<(bool, bool)> {
    let range = |at: (usize, usize), reach: usize| {
        near(Size::from_shape(depth.dim()), at, reach).fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), (at, _)| {
            (depth[at].at_most(a), depth[at].at_least(b))
        })
    };
    let is_steep = |at: (usize, usize)| range(at, 1).1 - range(at, 1).0 > EDGE;
    let bent = Array2::from_shape_fn(depth.dim(), |(y, x)| {
        let (h, w) = depth.dim();
        let repeated = |i: usize, k: usize, size: usize| (i + k).saturating_sub(2).min(size - 1);
        let values: Vec<(f64, f64, f64)> = (0..25)
            .map(|k| {
                let value = depth[(repeated(y, k / 5, h), repeated(x, k % 5, w))];
                (f64::from(value), (k / 5) as f64 - 2.0, (k % 5) as f64 - 2.0)
            })
            .collect();
        let mean = values.iter().map(|v| v.0).sum::<f64>() / 25.0;
        let slope_y = values.iter().map(|v| v.0 * v.1).sum::<f64>() / 50.0;
        let slope_x = values.iter().map(|v| v.0 * v.2).sum::<f64>() / 50.0;
        let left = values
            .iter()
            .map(|v| (v.0 - mean - slope_y * v.1 - slope_x * v.2).powi(2));
        let (least, most) = range((y, x), 2);
        is_steep((y, x)) && (left.sum::<f64>() / 25.0).sqrt() > f64::from(UNEXPLAINED * (most - least))
    });
    Array2::from_shape_fn(depth.dim(), |at| {
        let (least, most) = range(at, 1);
        let is_edge = is_steep(at) && near(Size::from_shape(depth.dim()), at, 1).any(|(at, _)| bent[at]);
        let margin = (MIXED * (most - least)).at_least(MIXED_BY);
        (
            is_edge,
            mixes && is_edge && depth[at] - least >= margin && most - depth[at] >= margin,
        )
    })
}

/// Returns the end behind or before a reading of a ramp of two mixed readings, in which it is one of the two.
fn end_of_ramp(
    depth: &Array2<f32>,
    kinds: &Array2<(bool, bool)>,
    (y, x): (usize, usize),
    behind: bool,
) -> Option<(usize, usize)> {
    surfaces::ramps().find_map(|ramp| {
        let places: Vec<_> = (ramp.into_iter())
            .filter_map(|(dy, dx)| y.checked_add_signed(dy).zip(x.checked_add_signed(dx)))
            .filter(|at| depth.get(*at).is_some())
            .collect();
        let (Some(&end), 4) = (places.last(), places.len()) else {
            return None;
        };
        let sign = if behind { 1.0 } else { -1.0 };
        let rises = places
            .windows(2)
            .all(|pair| sign * (depth[pair[1]] - depth[pair[0]]) > 0.0);
        let mixed: Vec<bool> = places.iter().map(|at| kinds[*at].1).collect();
        let is_far = (depth[end] - depth[(y, x)]).abs() > surfaces::TOLERANCE;
        (rises && mixed == [false, true, true, false] && is_far).then_some(end)
    })
}

/// A surface at an edge, as in [`super::surfaces`].
struct Surface {
    depth: f32,
    count: f32,
    covers: [f32; 9],
    colours: Vec<[f64; 3]>,
    mean: [f64; 3],
    variance: f64,
    differences: [f32; 9],
    has: [f32; 9],
}

impl Surface {
    fn of(depth: f32, covers: [f32; 9], colours: Vec<[f64; 3]>) -> Self {
        Surface {
            depth,
            count: 1.0,
            covers,
            colours,
            mean: [0.0; 3],
            variance: 0.0,
            differences: [0.0; 9],
            has: [0.0; 9],
        }
    }

    fn depth_at(&self, place: &[f32; 9]) -> f32 {
        let known = interpolated(place, &self.has);
        match known > 0.05 {
            true => self.depth + interpolated(place, &self.differences) / known,
            false => self.depth,
        }
    }
}

/// Returns the bilinear weights of 3×3 readings at the offset `dx`, `dy` from the middle one.
fn place_of(dx: f32, dy: f32) -> [f32; 9] {
    let weight = |offset: f32, k: usize| (1.0 - (offset - (k as f32 - 1.0)).abs()).at_least(0.0);
    std::array::from_fn(|k| weight(dx, k % 3) * weight(dy, k / 3))
}

fn interpolated(place: &[f32; 9], values: &[f32; 9]) -> f32 {
    place.iter().zip(values).map(|(weight, value)| weight * value).sum()
}

/// The colours of a reading's pixels.
type Colours = Vec<[f64; 3]>;

/// Groups 3×3 readings with their colours: in round 0 those that are neither filled nor mixed, in round 1 the filled
/// ones, in round 2 the mixed ones. `end` is the end behind or before a reading of a ramp, with its colours.
fn surfaces_of(
    readings: [f32; 9],
    rounds: [usize; 9],
    colours: &dyn Fn(usize) -> Colours,
    end: &dyn Fn(usize, bool) -> Option<(f32, Colours)>,
) -> Vec<Surface> {
    let mut found: Vec<Surface> = Vec::new();
    for round in 0..3 {
        let mixed = round == 2;
        for at in [4, 1, 3, 5, 7, 0, 2, 6, 8]
            .into_iter()
            .filter(|at| rounds[*at] == round)
        {
            let depth = readings[at];
            found.sort_by(|a, b| a.depth.total_cmp(&b.depth));
            let apart = |surface: &Surface| (surface.depth - depth).abs();
            let nearest = (0..found.len()).min_by(|a, b| apart(&found[*a]).total_cmp(&apart(&found[*b])));
            let mut behind = found.partition_point(|surface| surface.depth < depth);
            let is_last = behind == found.len();
            if mixed
                && (is_last || behind == 0)
                && (1..surfaces::MOST).contains(&found.len())
                && nearest.is_some_and(|i| apart(&found[i]) > surfaces::TOLERANCE)
                && let Some((depth, colours)) = end(at, is_last)
            {
                let place = if is_last { found.len() } else { 0 };
                found.insert(place, Surface::of(depth, [0.0; 9], colours));
                behind = if is_last { behind } else { 1 };
            }
            if let Some(nearest) = nearest.filter(|i| apart(&found[*i]) <= surfaces::TOLERANCE) {
                let surface = &mut found[nearest];
                surface.depth += (depth - surface.depth) / (surface.count + 1.0);
                surface.count += 1.0;
                surface.covers[at] += 1.0;
                if !mixed {
                    surface.colours.extend(colours(at));
                }
            } else if mixed && behind > 0 && behind < found.len() {
                let (near, far) = (found[behind - 1].depth, found[behind].depth);
                let share = (depth - near) / (far - near);
                found[behind - 1].covers[at] += 1.0 - share;
                found[behind].covers[at] += share;
            } else if found.len() < surfaces::MOST {
                found.push(Surface::of(
                    depth,
                    std::array::from_fn(|k| f32::from(k == at)),
                    colours(at),
                ));
            }
        }
    }
    let count = found.len();
    for at in (0..9).filter(|at| rounds[*at] == 1 && count > 1) {
        let others = (1.0 - surfaces::FILLED) / (count - 1) as f32;
        for covers in found.iter_mut().map(|surface| &mut surface.covers[at]) {
            *covers = if *covers >= 1.0 { surfaces::FILLED } else { others };
        }
    }
    for surface in &mut found {
        surface.mean = mean(&surface.colours);
        let squares = surface.colours.iter().flatten().map(|v| v * v).sum::<f64>() / surface.colours.len() as f64;
        let square = surface.mean.iter().map(|v| v * v).sum::<f64>();
        surface.variance = (squares - square).max(f64::from(surfaces::LEAST_VARIANCE));
        surface.has = surface.covers.map(|covers| f32::from(covers >= 1.0));
        surface.differences = std::array::from_fn(|k| surface.has[k] * (readings[k] - surface.depth));
    }
    found
}

/// Returns the depth of a pixel after its neighbours' vote. A choice is two depths and the lead of the first.
fn voted(choices: &Array2<(f32, f32, f64)>, rgb: ArrayView3<'_, f32>, (y, x): (usize, usize)) -> f32 {
    let (first, second, lead) = choices[(y, x)];
    let reach = pixels::REACH;
    let (height, width) = choices.dim();
    let inside = y >= reach && y + reach < height && x >= reach && x + reach < width;
    let (mut sum, mut weights) = (0.0, 0.0);
    for (at, (dy, dx)) in near(Size::from_shape(choices.dim()), (y, x), reach).filter(|(at, _)| *at != (y, x)) {
        let apart: f64 = (0..3)
            .map(|c| f64::from(rgb[(c, at.0, at.1)] - rgb[(c, y, x)]).powi(2))
            .sum();
        let near = (1.0 + (dy * dy + dx * dx) / f64::from(pixels::NEAR).powi(2)).powi(-2);
        let alike = (1.0 + apart / f64::from(pixels::ALIKE).powi(2)).powi(-2);
        let weight = near * alike.max(f64::from(pixels::LEAST_ALIKE));
        let theirs = choices[at].0;
        let for_first = (theirs - first).abs() <= (theirs - second).abs();
        sum += if for_first { weight } else { -weight };
        weights += weight;
    }
    let neighbours = f64::from(pixels::NEIGHBOURS);
    match lead >= neighbours || !inside || lead + neighbours * sum / weights > 0.0 {
        true => first,
        false => second,
    }
}
