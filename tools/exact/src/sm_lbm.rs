//! The silhouette-mask layer-based method (SM-LBM), Eq. 1–4. It computes the hologram of a layered depth image with
//! waves, plane by plane from the back to the front. The silhouette of each plane blocks the light from behind it.
//!
//! Plane k of N lies at z = V/2 − V·(k + ½)/N. A point of depth d belongs to plane min(⌊d·N⌋, N − 1). The frame is
//! padded once, by the reach of light through the whole volume, and the padded plane is periodic. Fields omit the
//! carrier, so a point's phase 2πz/λ (Eq. 1) is zero here, and the result at z = 0 equals the paper's.
//!
//! Three properties keep the cost low. A plane without points costs nothing, because two steps through empty space are
//! one step. A row without points stays in the frequency domain across its plane. The field needs only two buffers of
//! (H', W').
//!
//! The silhouette (Eq. 3) consists of the pixels at which the LDI has a hit, so black surfaces occlude too.

use ndarray::{Array3, ArrayView1, ArrayViewMut2, Axis};
use num_complex::Complex32;
use phasefront::Display;
use phasefront::Size;
use phasefront_core::optics::asm::{self, Padding, Transfer};
use phasefront_core::optics::fft::{Fft2, Scratch};
use phasefront_io::Result;
use phasefront_io::ldi::Ldi;
use std::ops::Range;

/// One point of a scene, on its plane.
#[derive(Clone, Copy)]
pub(crate) struct Point {
    pub(crate) y: u32,
    pub(crate) x: u32,
    pub(crate) rgb: [f32; 3],
}

/// A scene divided into planes.
pub(crate) struct Planes {
    /// All points, grouped by plane and sorted by row. Of two hits at one position the front one comes last and
    /// therefore wins.
    pub(crate) points: Vec<Point>,
    /// The planes that hold points, back first: the index k and the range of its points.
    pub(crate) occupied: Vec<(usize, Range<usize>)>,
}

/// The most planes of a scene. Empty planes take memory too.
pub const MOST_PLANES: usize = 1_000_000;

/// Checks the number of planes.
///
/// # Errors
/// Returns an error if there are no planes, or more than [`MOST_PLANES`].
pub(crate) fn check_planes(planes: usize) -> Result<()> {
    if !(1..=MOST_PLANES).contains(&planes) {
        return Err(phasefront::Error::Setting(format!(
            "{planes} planes to cut the scene into; 1 to {MOST_PLANES} are right"
        ))
        .into());
    }
    Ok(())
}

/// Returns the index, among `planes`, of the plane of a point of depth `d`.
pub fn plane_of_depth(d: f32, planes: usize) -> usize {
    ((f64::from(d) * planes as f64) as usize).min(planes - 1)
}

/// Returns z of plane `k` among `planes`, in metres.
pub fn plane_z_m(k: usize, planes: usize, display: &Display) -> f64 {
    display.z_of_depth((k as f64 + 0.5) / planes as f64)
}

impl Planes {
    /// Sorts the points by counting, so that no point is stored twice.
    pub(crate) fn of(ldi: &Ldi, planes: usize) -> Self {
        let mut next = vec![0; planes];
        for d in ldi.layers.iter().flat_map(|layer| &layer.depth) {
            if !d.is_nan() {
                next[plane_of_depth(*d, planes)] += 1;
            }
        }
        let mut occupied = Vec::new();
        let mut total = 0;
        for (k, next) in next.iter_mut().enumerate() {
            let count = std::mem::replace(next, total);
            if count > 0 {
                occupied.push((k, total..total + count));
            }
            total += count;
        }
        occupied.reverse();
        let nowhere = Point {
            y: 0,
            x: 0,
            rgb: [0.0; 3],
        };
        let mut points = vec![nowhere; total];
        let Size { width, height } = ldi.size();
        for y in 0..height {
            for layer in ldi.layers.iter().rev() {
                for x in 0..width {
                    let d = layer.depth[(y, x)];
                    if !d.is_nan() {
                        let place = &mut next[plane_of_depth(d, planes)];
                        points[*place] = Point {
                            y: y as u32,
                            x: x as u32,
                            rgb: std::array::from_fn(|c| layer.rgb[(c, y, x)]),
                        };
                        *place += 1;
                    }
                }
            }
        }
        Planes { points, occupied }
    }
}

/// Returns the points of row `y` among the `points` of a plane.
fn row_of(points: &[Point], y: usize) -> &[Point] {
    let start = points.partition_point(|p| (p.y as usize) < y);
    let length = points[start..].partition_point(|p| p.y as usize == y);
    &points[start..start + length]
}

/// Propagates the wave, whose transformed rows are in `scratch`, by `transfer` to the plane of `points`, and replaces
/// it at the points by `content` (Eq. 3 and 4).
pub(crate) fn cross(
    fft: &Fft2,
    scratch: &mut Scratch,
    transfer: &Transfer,
    points: &[Point],
    content: impl Fn(&Point) -> Complex32 + Sync,
) {
    fft.columns(
        &scratch.rows,
        &mut scratch.columns,
        |x, column| transfer.apply(x, column),
        &mut scratch.work,
    );
    fft.rows_there_and_back(
        &scratch.columns,
        &mut scratch.rows,
        &mut scratch.work,
        |y| !row_of(points, y).is_empty(),
        |y, row| {
            for point in row_of(points, y) {
                row[point.x as usize] = content(point);
            }
        },
    );
}

/// Fills `plane`, whose rows have `width` values, with the contents of `points` and zeros elsewhere.
pub(crate) fn place(points: &[Point], plane: &mut [Complex32], width: usize, content: impl Fn(&Point) -> Complex32) {
    plane.fill(Complex32::ZERO);
    for point in points {
        plane[point.y as usize * width + point.x as usize] = content(point);
    }
}

/// Copies the frame's part of padded `rows` of `width` values to `frame`.
pub(crate) fn crop(rows: &[Complex32], width: usize, mut frame: ArrayViewMut2<'_, Complex32>) {
    let columns = frame.ncols();
    for (mut out, row) in frame.rows_mut().into_iter().zip(rows.chunks_exact(width)) {
        out.assign(&ArrayView1::from(&row[..columns]));
    }
}

/// A plane wave of one colour, without the carrier.
#[derive(Clone, Copy)]
struct Tilted {
    /// The frequency in cycles per pixel, (y, x).
    frequency: [f64; 2],
    /// √(λ⁻² − |f|²) − λ⁻¹, in cycles per metre.
    per_m: f64,
}

impl Tilted {
    /// Creates the wave toward `tilt`, (y, x) in shares of the Nyquist frequency, on a periodic plane of `padded`
    /// pixels.
    fn new(tilt: [f64; 2], padded: Size, pitch_m: f64, wavelength_m: f64) -> Self {
        let rounded = |share: f64, n: usize| (share * 0.5 * n as f64).round() / n as f64;
        let frequency = [rounded(tilt[0], padded.height), rounded(tilt[1], padded.width)];
        let square = (frequency[0].powi(2) + frequency[1].powi(2)) / pitch_m.powi(2);
        Tilted {
            frequency,
            per_m: -wavelength_m * square / (1.0 + (1.0 - wavelength_m.powi(2) * square).sqrt()),
        }
    }

    fn at(&self, point: &Point, z_m: f64) -> Complex32 {
        let [y, x] = self.frequency;
        let turns = y * f64::from(point.y) + x * f64::from(point.x) + self.per_m * z_m;
        Complex32::cis((turns.fract() * std::f64::consts::TAU) as f32)
    }
}

/// Returns the complex midpoint hologram of `ldi`, (C, H, W), at z = 0, from `planes` planes. `progress` receives the
/// number of finished planes and the total number of planes that hold points, over all colours.
///
/// Memory: two buffers of (H', W') complex numbers, 20 bytes per point, 8 bytes per plane, and two transfer functions
/// of a quarter of a buffer each: one for neighbouring planes, one for a wider gap.
///
/// # Errors
/// Returns an error if there are no planes or more than [`MOST_PLANES`], or if the reach of the volume cannot be
/// padded.
pub fn hologram(
    ldi: &Ldi,
    display: &Display,
    planes: usize,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Array3<Complex32>> {
    tilted(ldi, display, planes, [0.0; 2], progress)
}

/// Works like [`hologram`] for a scene that is lit by plane waves toward the place `tilt` = (y, x) of the pupil, as
/// shares of the Nyquist frequency: each point starts with the phase 2π(f·x + z·(√(λ⁻² − |f|²) − λ⁻¹)) of the wave of
/// frequency f, rounded to one that the padded plane has. An eye's pupil then sees the scene from there.
///
/// # Errors
/// Returns the errors of [`hologram`].
pub fn tilted(
    ldi: &Ldi,
    display: &Display,
    planes: usize,
    tilt: [f64; 2],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Array3<Complex32>> {
    check_planes(planes)?;
    let Size { width, height } = ldi.size();
    let scene = Planes::of(&ldi.for_display(display), planes);
    let longest = display.longest_wavelength_m();
    let padded = asm::padded_size(
        ldi.size(),
        display.pitch_m(),
        longest,
        display.volume_depth_m(),
        Padding::Reach,
    )?;
    let padded_width = padded.width;
    let fft = Fft2::new(padded, padded);
    let mut scratch = fft.scratch();
    let mut hologram = Array3::zeros((display.colours(), height, width));
    let total = display.colours() * scene.occupied.len();
    let step_m = display.volume_depth_m() / planes as f64;
    for (colour, &wavelength_m) in display.wavelengths_m().iter().enumerate() {
        let transfer = |distance_m| Transfer::new(padded, display.pitch_m(), wavelength_m, distance_m, |_, _| true);
        let neighbour = transfer(step_m);
        let Some((back, points)) = scene.occupied.first() else {
            break;
        };
        let wave = Tilted::new(tilt, padded, display.pitch_m(), wavelength_m);
        // The columns are not in use yet, so their buffer holds the farthest plane.
        let plane = &mut scratch.columns;
        let z_m = |k: usize| plane_z_m(k, planes, display);
        let content = |k: usize| move |point: &Point| wave.at(point, z_m(k)) * point.rgb[colour];
        place(&scene.points[points.clone()], plane, padded_width, content(*back));
        fft.rows_forward(plane, &mut scratch.rows, &mut scratch.work);
        let mut at = *back;
        let done = colour * scene.occupied.len();
        for (i, (k, points)) in scene.occupied.iter().enumerate().skip(1) {
            let points = &scene.points[points.clone()];
            let across;
            let transfer = match at - k {
                1 => &neighbour,
                steps => {
                    across = transfer(steps as f64 * step_m);
                    &across
                }
            };
            cross(&fft, &mut scratch, transfer, points, content(*k));
            at = *k;
            progress(done + i, total);
        }
        let home = transfer(-plane_z_m(at, planes, display));
        fft.columns(
            &scratch.rows,
            &mut scratch.columns,
            |x, column| home.apply(x, column),
            &mut scratch.work,
        );
        fft.rows_inverse(&scratch.columns, &mut scratch.rows, &mut scratch.work);
        crop(&scratch.rows, padded_width, hologram.index_axis_mut(Axis(0), colour));
        progress(done + scene.occupied.len(), total);
    }
    Ok(hologram)
}
