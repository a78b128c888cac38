//! The point-based method (Maimone, Georgiou and Kollin, ACM TOG 36(4), 85, 2017). It computes the hologram of a
//! layered depth image as the sum of the sub-holograms of its points at z = 0.
//!
//! # The sub-hologram
//! A point of amplitude A at z lights the pixels of z = 0 within the diffraction cone of the pitch, whose radius is R =
//! |z|·tan(asin(λ/2p)). Its light there is the Fresnel zone pattern
//!
//! A·w(r)·exp(−i·sgn(z)·2π(√(r² + z²) − |z|)/λ)/n, w(r) = 1 − r²/R².
//!
//! The pattern omits the carrier, and with it the initial phase 2πz/λ of Eq. 1, as everywhere in this project. The
//! complex n(z, λ) is the sum of the pattern over its pixels. With this normalization a plane of constant depth and
//! amplitude A gives A at z = 0 and, refocused, A at z. (Except for the light that the cone cuts off, n contains the
//! factor p²/(iλ·(−z)) of the Fresnel integral.) The weight w removes the hard edge of the cone. With a hard edge, the
//! amplitude of a plane would oscillate between 0 and 2 over z, because the wave diffracted at the edge interferes with
//! the direct wave on the axis. Within a pixel of z = 0 (R < p), a point lights only its own pixel.
//!
//! # Occlusion
//! [`Occlusion`] lists the choices. A ray from a point through a pixel of its sub-hologram continues to the front of
//! the volume. A pixel-wide surface point on a nearer plane blocks the ray if the ray meets it. For a point in front of
//! z = 0 the ray leaves in the direction away from the pixel, as the point's light does.
//!
//! # Implementation
//! Depths are rounded to the planes of SM-LBM ([`sm_lbm::plane_z_m`]). Each plane that holds points has one table per
//! colour. Bands of rows are summed in parallel and joined in order, so the number of threads does not change a bit of
//! the result. Occlusion is computed backwards, from each surface point to the rays that it blocks, in integers: plane
//! centres are odd multiples of half a plane, so the position of a ray is a fraction.
//!
//! [`mod@reference`] computes the same hologram without tables, in f64.

pub mod reference;

use crate::sm_lbm;
use ndarray::{Array2, Array3, s};
use num_complex::{Complex32, Complex64};
use phasefront::Display;
use phasefront::Size;
use phasefront_core::optics::asm;
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The number of rows of points that are summed at a time.
const BAND_ROWS: usize = 32;

/// The most values that all tables together may hold: 1 GiB.
const MAX_TABLE_VALUES: usize = 1 << 27;

/// The way in which surfaces block light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Occlusion {
    /// Nothing blocks light: all points of all layers light their whole sub-hologram.
    None,
    /// Only layer 0, the layer that the viewer sees, has points.
    Input,
    /// Rays decide: all points of all layers light the pixels of their sub-hologram to which the ray is free.
    Geometric,
}

/// Returns half the width, in pixels, of the sub-hologram of a point at `z_m`: 0 within a pixel of z = 0.
fn radius_px(z_m: f64, wavelength_m: f64, pitch_m: f64) -> usize {
    (asm::reach_m(z_m, wavelength_m, pitch_m) / pitch_m) as usize
}

/// Returns the sub-hologram at z = 0 of a point of amplitude 1 at `z_m`: (2R + 1, 2R + 1), with the point in the
/// middle. See the [module](self).
pub fn sub_hologram(z_m: f64, wavelength_m: f64, pitch_m: f64) -> Array2<Complex64> {
    let radius = radius_px(z_m, wavelength_m, pitch_m);
    if radius == 0 {
        return Array2::from_elem((1, 1), Complex64::ONE);
    }
    let cone_m = asm::reach_m(z_m, wavelength_m, pitch_m);
    let pattern = Array2::from_shape_fn((2 * radius + 1, 2 * radius + 1), |(y, x)| {
        let across = |i: usize| (i as f64 - radius as f64) * pitch_m;
        let r2 = across(y).powi(2) + across(x).powi(2);
        let weight = (1.0 - r2 / (cone_m * cone_m)).max(0.0);
        // This form of √(r² + z²) − |z| avoids cancellation.
        let detour_m = r2 / ((r2 + z_m * z_m).sqrt() + z_m.abs());
        Complex64::from_polar(weight, -z_m.signum() * 2.0 * PI * detour_m / wavelength_m)
    });
    let sum = pattern.sum();
    pattern / sum
}

/// A sub-hologram in the form in which it is added: by rows, without the dark corners outside the cone.
struct Table {
    radius: usize,
    /// For each |dy|: half the width of the lit part, and the index of the first of its 2·half + 1 values.
    rows: Vec<(usize, usize)>,
    values: Vec<Complex32>,
}

impl Table {
    fn new(z_m: f64, wavelength_m: f64, pitch_m: f64) -> Self {
        let pattern = sub_hologram(z_m, wavelength_m, pitch_m);
        let radius = pattern.nrows() / 2;
        let mut rows = Vec::with_capacity(radius + 1);
        let mut values = Vec::new();
        for dy in 0..=radius {
            let row = pattern.row(radius + dy);
            let half = (0..=radius)
                .rev()
                .find(|half| row[radius + half] != Complex64::ZERO)
                .unwrap_or(0);
            rows.push((half, values.len()));
            let lit = row.slice(s![radius - half..=radius + half]);
            values.extend(lit.iter().map(|v| Complex32::new(v.re as f32, v.im as f32)));
        }
        Table { radius, rows, values }
    }

    /// Adds `amplitude` times the sub-hologram of a point at (`y`, `x`) to `plane`, which holds the rows `rows` of a
    /// frame of `width`. A mask in `open` limits the sum to the pixels that the point reaches.
    fn add(
        &self,
        plane: &mut [Complex32],
        rows: &Range<usize>,
        width: usize,
        (y, x): (usize, usize),
        amplitude: f32,
        open: Option<&Mask>,
    ) {
        let (top, bottom) = (
            rows.start.max(y.saturating_sub(self.radius)),
            rows.end.min(y + self.radius + 1),
        );
        for py in top..bottom {
            let (half, start) = self.rows[py.abs_diff(y)];
            let (left, right) = (x.saturating_sub(half), width.min(x + half + 1));
            let values = &self.values[start + left + half - x..][..right - left];
            let out = &mut plane[(py - rows.start) * width..][left..right];
            match open {
                None => {
                    for (out, value) in out.iter_mut().zip(values) {
                        *out += value * amplitude;
                    }
                }
                Some(mask) => {
                    let open = &mask.row(py, y)[left + mask.radius - x..];
                    for ((out, value), open) in out.iter_mut().zip(values).zip(open) {
                        *out += value * (amplitude * open);
                    }
                }
            }
        }
    }
}

/// One point of a scene on its line of sight.
struct Hit {
    plane: u32,
    rgb: [f32; 3],
}

/// The points of a scene, grouped by pixel, front first, with at most one point per plane.
struct Points {
    height: usize,
    width: usize,
    planes: usize,
    /// The index of each pixel's first hit, followed by the number of hits.
    starts: Vec<usize>,
    hits: Vec<Hit>,
    /// The plane of each pixel's front hit, or `u32::MAX` for a pixel without hits.
    nearest: Vec<u32>,
}

impl Points {
    fn of(ldi: &Ldi, planes: usize, occlusion: Occlusion) -> Self {
        let Size { width, height } = ldi.size();
        let layers = match occlusion {
            Occlusion::Input => &ldi.layers[..1],
            _ => &ldi.layers[..],
        };
        let mut starts = Vec::with_capacity(height * width + 1);
        let mut hits = Vec::new();
        let mut nearest = Vec::with_capacity(height * width);
        for y in 0..height {
            for x in 0..width {
                starts.push(hits.len());
                let mut front = None;
                for layer in layers {
                    let d = layer.depth[(y, x)];
                    if d.is_nan() {
                        continue;
                    }
                    let plane = sm_lbm::plane_of_depth(d, planes) as u32;
                    // Of two hits on one plane, the front one is the point, as in SM-LBM.
                    if front < Some(plane) {
                        front = Some(plane);
                        hits.push(Hit {
                            plane,
                            rgb: std::array::from_fn(|c| layer.rgb[(c, y, x)]),
                        });
                    }
                }
                let first = hits.get(starts[starts.len() - 1]);
                nearest.push(first.map_or(u32::MAX, |hit| hit.plane));
            }
        }
        starts.push(hits.len());
        Points {
            height,
            width,
            planes,
            starts,
            hits,
            nearest,
        }
    }

    /// Returns the hits of a pixel, front first.
    fn at(&self, y: usize, x: usize) -> &[Hit] {
        let pixel = y * self.width + x;
        &self.hits[self.starts[pixel]..self.starts[pixel + 1]]
    }
}

/// The pixels of a sub-hologram that a point reaches: 1 if the ray is free, 0 if it is blocked.
struct Mask {
    radius: usize,
    /// The mask, (2R + 1, 2R + 1).
    open: Vec<f32>,
    /// For each distance in pixels between a surface point and the point: the last plane from which the surface point
    /// can block a ray, or −1 if there is none.
    last_plane: Vec<i64>,
}

impl Mask {
    fn new() -> Self {
        Mask {
            radius: 0,
            open: Vec::new(),
            last_plane: Vec::new(),
        }
    }

    /// Returns the mask's values for pixel row `py` and a point in row `y`.
    fn row(&self, py: usize, y: usize) -> &[f32] {
        let width = 2 * self.radius + 1;
        &self.open[(py + self.radius - y) * width..][..width]
    }

    /// Casts the rays of the point at (`y`, `x`) on `plane` to the pixels within `radius`. Returns whether any ray is
    /// blocked.
    ///
    /// In units of half a plane, the point lies 2k + 1 − N behind z = 0, and a surface point on plane j lies 2(k − j)
    /// in front of the point. There, the ray to the pixel at distance dx from the point is at distance dx·2(k − j)/(2k
    /// + 1 − N) from the point. It meets the surface point at distance cx if the ray's distance rounds to cx.
    fn cast(&mut self, points: &Points, (y, x): (usize, usize), plane: u32, radius: usize) -> bool {
        let k = i64::from(plane);
        let behind = 2 * k + 1 - points.planes as i64;
        // On z = 0 the only ray is the one straight ahead.
        let distance = behind.abs().max(1);
        let sign = if behind < 0 { -1 } else { 1 };
        let reach = radius as i64;
        let blocks_from = |c: i64| match c {
            0 => k - 1,
            _ if reach == 0 => -1,
            // Solves (2c − 1)·distance ≤ 2·reach·2(k − j) for j.
            _ => k - ((2 * c - 1) * distance + 4 * reach - 1) / (4 * reach),
        };
        self.last_plane.clear();
        self.last_plane
            .extend((0..).map(blocks_from).take_while(|last| *last >= 0));
        if self.last_plane.is_empty() {
            return false;
        }
        let window = self.last_plane.len() - 1;
        let mut blocked = false;
        let (left, right) = (x.saturating_sub(window), points.width.min(x + window + 1));
        for sy in y.saturating_sub(window)..points.height.min(y + window + 1) {
            let nearest = &points.nearest[sy * points.width..][left..right];
            let dy = sy.abs_diff(y);
            for (sx, nearest) in (left..).zip(nearest) {
                let last = self.last_plane[dy.max(sx.abs_diff(x))];
                if i64::from(*nearest) > last {
                    continue;
                }
                for hit in points.at(sy, sx) {
                    let j = i64::from(hit.plane);
                    if j > last {
                        break;
                    }
                    if !blocked {
                        blocked = true;
                        self.radius = radius;
                        self.open.clear();
                        self.open.resize((2 * radius + 1).pow(2), 1.0);
                    }
                    let before = 2 * (k - j);
                    let pixels = |to: usize, from: usize| {
                        let c = to as i64 - from as i64;
                        let first = |c: i64| ceil_div((2 * c - 1) * distance, 2 * before);
                        let (low, high) = (first(c), first(c + 1) - 1);
                        let (low, high) = if sign < 0 { (-high, -low) } else { (low, high) };
                        let index = |d: i64| (d + reach).clamp(0, 2 * reach + 1) as usize;
                        index(low)..index(high + 1)
                    };
                    let columns = pixels(sx, x);
                    for row in pixels(sy, y) {
                        self.open[row * (2 * radius + 1)..][columns.clone()].fill(0.0);
                    }
                }
            }
        }
        blocked
    }
}

/// Returns ⌈a/b⌉ for b > 0.
fn ceil_div(a: i64, b: i64) -> i64 {
    -(-a).div_euclid(b)
}

/// Returns the complex midpoint hologram of `ldi`, (C, H, W), at z = 0, with its depths rounded to `planes` planes.
/// `progress` receives the number of finished rows of points and their total.
///
/// Memory: about 100 bytes per pixel, and the tables.
///
/// # Errors
/// Returns an error if there are no planes or more than [`sm_lbm::MOST_PLANES`], or if the tables of the sub-holograms
/// do not fit.
pub fn hologram(
    ldi: &Ldi,
    display: &Display,
    planes: usize,
    occlusion: Occlusion,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Array3<Complex32>> {
    sm_lbm::check_planes(planes)?;
    let points = Points::of(&ldi.for_display(display), planes, occlusion);
    let (height, width) = (points.height, points.width);
    let tables = tables(&points, display)?;
    let colours = display.colours();
    let widest = |tables: &[Table]| tables.iter().map(|t| t.radius).max().unwrap_or(0);
    let halo = tables.iter().flatten().map(|tables| widest(tables)).max().unwrap_or(0);
    let bands: Vec<_> = (0..height).step_by(BAND_ROWS).collect();
    let done = AtomicUsize::new(0);
    let parts: Vec<(Range<usize>, Vec<Complex32>)> = (bands.par_iter())
        .map(|&first| {
            let last = height.min(first + BAND_ROWS);
            let rows = first.saturating_sub(halo)..height.min(last + halo);
            let size = rows.len() * width;
            let mut part = vec![Complex32::ZERO; colours * size];
            let mut mask = Mask::new();
            for y in first..last {
                for x in 0..width {
                    for hit in points.at(y, x) {
                        let Some(tables) = &tables[hit.plane as usize] else {
                            continue;
                        };
                        let shaded =
                            occlusion == Occlusion::Geometric && mask.cast(&points, (y, x), hit.plane, widest(tables));
                        let open = shaded.then_some(&mask);
                        for (c, table) in tables.iter().enumerate() {
                            let plane = &mut part[c * size..][..size];
                            table.add(plane, &rows, width, (y, x), hit.rgb[c], open);
                        }
                    }
                }
            }
            let rows_done = done.fetch_add(last - first, Ordering::Relaxed) + last - first;
            progress(rows_done, height);
            (rows, part)
        })
        .collect();
    let mut hologram = Array3::from_elem((colours, height, width), Complex32::ZERO);
    let values = hologram.as_slice_mut().expect("standard layout");
    values
        .par_chunks_exact_mut(height * width)
        .enumerate()
        .for_each(|(c, plane)| {
            for (rows, part) in &parts {
                let size = rows.len() * width;
                let out = &mut plane[rows.start * width..][..size];
                for (out, value) in out.iter_mut().zip(&part[c * size..]) {
                    *out += value;
                }
            }
        });
    Ok(hologram)
}

/// Makes the tables of all colours for each plane that holds points.
fn tables(points: &Points, display: &Display) -> Result<Vec<Option<Vec<Table>>>> {
    let mut occupied = vec![false; points.planes];
    for hit in &points.hits {
        occupied[hit.plane as usize] = true;
    }
    let pitch_m = display.pitch_m();
    let z = |plane| sm_lbm::plane_z_m(plane, points.planes, display);
    // Each colour needs half of a square.
    let values: f64 = (occupied.iter().enumerate())
        .filter(|(_, occupied)| **occupied)
        .flat_map(|(plane, _)| display.wavelengths_m().iter().map(move |lambda| (plane, lambda)))
        .map(|(plane, lambda)| 2.0 * (radius_px(z(plane), *lambda, pitch_m) as f64 + 1.0).powi(2))
        .sum();
    if values > MAX_TABLE_VALUES as f64 {
        return Err(Error::Input(format!(
            "the sub-holograms of {} planes reach {} pixels far and do not fit in memory; \
             fewer planes, a shallower volume or a larger pitch is needed",
            occupied.iter().filter(|occupied| **occupied).count(),
            radius_px(z(0), display.longest_wavelength_m(), pitch_m),
        )));
    }
    Ok(occupied
        .into_par_iter()
        .enumerate()
        .map(|(plane, occupied)| {
            occupied.then(|| {
                let lasers = display.wavelengths_m().iter();
                lasers.map(|lambda| Table::new(z(plane), *lambda, pitch_m)).collect()
            })
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_near_the_hologram_is_its_pixel() {
        // The reach is 1 px at 8 µm / tan(asin(638 nm/16 µm)) = 200.5 µm for red.
        assert_eq!(radius_px(200.4e-6, 638e-9, 8e-6), 0);
        assert_eq!(radius_px(-200.6e-6, 638e-9, 8e-6), 1);
        assert_eq!(sub_hologram(0.0, 638e-9, 8e-6)[(0, 0)], Complex64::ONE);
        assert_eq!(sub_hologram(3e-3, 638e-9, 8e-6).dim(), (29, 29));
    }

    #[test]
    fn the_pattern_sums_to_one_and_its_mirror_is_its_conjugate() {
        for z in [0.25e-3, 1e-3, 3e-3] {
            let behind = sub_hologram(-z, 520e-9, 8e-6);
            assert!((behind.sum() - 1.0).norm() < 1e-12);
            assert_eq!(behind.mapv(|v| v.conj()), sub_hologram(z, 520e-9, 8e-6));
        }
    }

    #[test]
    fn whole_numbers_are_divided_upwards() {
        for a in -20..20 {
            for b in 1..7 {
                assert_eq!(ceil_div(a, b), (a as f64 / b as f64).ceil() as i64);
            }
        }
    }
}
