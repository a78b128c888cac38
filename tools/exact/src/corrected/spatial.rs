//! Corrects aberrations that differ over the frame. They are calibrated at a grid of points (the paper proposes 15) and
//! interpolated. A convolution in space corrects them, because no filter in the Fourier domain can (Methods).
//!
//! # The convolution
//! The light of each pixel spreads by the point spread function of its position. Nodes every [`NODE`] pixels have point
//! spread functions, which are interpolated linearly in x and y. The sum over the nodes of the field times the node's
//! hat function, convolved with the node's point spread function, is exactly this interpolation. A point spread
//! function ends `RIM` pixels beyond the farthest ray of the correction; the rest is dropped instead of wrapped around.
//! [`convolve_reference`] computes the sum over all pairs of pixels.
//!
//! # Cost
//! A correction that differs over the frame does not commute with propagation. The content of every plane therefore
//! propagates on its own: through the silhouettes in front of it, back to its plane, through the convolution and on to
//! z = 0. This takes N²/2 propagations for N planes.

use super::{MAX_PROPAGATIONS, padded_size_with};
use crate::sm_lbm::{Planes, check_planes, crop, cross, place, plane_z_m};
use ndarray::{Array2, Array3, Axis};
use num_complex::Complex32;
use phasefront::Display;
use phasefront::Size;
use phasefront::target::Aberration;
use phasefront_core::optics::asm::Transfer;
use phasefront_core::optics::fft::{ConvolveScratch, Fft2, Scratch, fast_size};
use phasefront_io::display::spatial::SpatialAberrations;
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use rayon::prelude::*;

/// The distance between nodes, in pixels.
pub const NODE: usize = 16;

/// The pixels by which a point spread function extends beyond its farthest ray.
const RIM: usize = 12;

/// The position of a field to convolve: a colour's field at z, for a frame of (H, W) pixels at the top left of a larger
/// plane.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    /// The corrections.
    pub aberrations: &'a SpatialAberrations,
    /// The display.
    pub display: &'a Display,
    /// The colour, from 0 (red) to 2 (blue).
    pub colour: usize,
    /// z of the field, in metres.
    pub z_m: f64,
    /// The size of the frame that contains the calibrated points.
    pub frame: Size,
}

impl Place<'_> {
    /// Returns the correction of node (i, j).
    fn node(&self, i: usize, j: usize) -> Aberration {
        let part = |node: usize, n: usize| ((node * NODE) as f64 + 0.5) / n as f64;
        let (x, y) = (part(j, self.frame.width), part(i, self.frame.height));
        self.aberrations.at(x, y, self.z_m)
    }

    /// Returns the number of pixels that a point's light reaches to each side.
    fn reach(&self) -> usize {
        let pitch = self.display.pitch_m();
        (self.aberrations.reach_m(pitch) / pitch).ceil() as usize + RIM
    }

    /// Returns the side of the plane for a node's convolution, which holds the node's pixels and their light.
    fn side(&self) -> usize {
        fast_size(2 * NODE + 2 * self.reach())
    }

    /// Checks whether light of pixel 0 reaches pixel `at` of a periodic axis of [`Self::side`].
    fn reaches(&self, at: usize) -> bool {
        at.min(self.side() - at) <= self.reach()
    }

    /// Returns Φ of `aberration` at the frequency bins (kx, ky) of a plane of `n`×`n`.
    fn kernel(&self, aberration: &Aberration, n: usize, kx: usize, ky: usize) -> Complex32 {
        let pitch = self.display.pitch_m();
        let frequency = |k: usize| {
            let k = if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
            k / (n as f64 * pitch)
        };
        let phase = aberration.phase(self.colour, frequency(kx), frequency(ky), pitch);
        Complex32::new(phase.cos() as f32, phase.sin() as f32)
    }
}

/// Spreads each point of the field, (H', W'), by the point spread function of its position.
pub fn convolve(field: &Array2<Complex32>, place: Place<'_>) -> Array2<Complex32> {
    let (height, width) = field.dim();
    let nodes = |n: usize| (n - 1) / NODE + 2;
    let (side, reach) = (place.side(), place.reach());
    let square = Size::from_shape((side, side));
    let fft = Fft2::new(square, square);
    let scale = 1.0 / (side * side) as f32;
    // Returns the spectrum of a node's point spread function after the cut, divided by side² because the transforms are
    // unnormalized.
    let spectrum = |i: usize, j: usize, convolve: &mut ConvolveScratch, scratch: &mut Scratch| {
        let aberration = place.node(i, j);
        let mut point = vec![Complex32::ZERO; side * side];
        point[0] = scale.into();
        let kernel = |kx: usize, column: &mut [Complex32]| {
            for (ky, value) in column.iter_mut().enumerate() {
                *value *= place.kernel(&aberration, side, kx, ky);
            }
        };
        fft.convolve(&mut point, kernel, convolve);
        for (at, value) in point.iter_mut().enumerate() {
            let inside = place.reaches(at / side) && place.reaches(at % side);
            *value *= if inside { scale } else { 0.0 };
        }
        fft.rows_forward(&point, &mut scratch.rows, &mut scratch.work);
        let mut spectrum = vec![Complex32::ZERO; side * side];
        let Scratch { rows, work, .. } = scratch;
        fft.spectrum(rows, &mut spectrum, |_, _, _| {}, work);
        spectrum
    };
    let all: Vec<(usize, usize)> = (0..nodes(height))
        .flat_map(|i| (0..nodes(width)).map(move |j| (i, j)))
        .collect();
    let mut out = Array2::from_elem((height, width), Complex32::ZERO);
    // Batches of 64 nodes keep their planes small compared with the field.
    for some in all.chunks(64) {
        let spread: Vec<Option<Vec<Complex32>>> = some
            .par_iter()
            .map_init(
                || (fft.convolve_scratch(), fft.scratch()),
                |(convolve, scratch), (i, j)| {
                    let mut plane = vec![Complex32::ZERO; side * side];
                    let mut lit = false;
                    for (y, wy) in hat(*i, height) {
                        for (x, wx) in hat(*j, width) {
                            let value = field[(y, x)] * (wy * wx);
                            lit |= value != Complex32::ZERO;
                            // Pixel (i − 1)·NODE of the field is at position `reach` of the plane.
                            let (v, u) = (y + NODE + reach - i * NODE, x + NODE + reach - j * NODE);
                            plane[v * side + u] = value;
                        }
                    }
                    if !lit {
                        return None;
                    }
                    let spectrum = spectrum(*i, *j, convolve, scratch);
                    fft.convolve(
                        &mut plane,
                        |kx, column| {
                            let factors = &spectrum[kx * side..][..side];
                            (column.iter_mut().zip(factors)).for_each(|(v, f)| *v *= f);
                        },
                        convolve,
                    );
                    Some(plane)
                },
            )
            .collect();
        for ((i, j), plane) in some.iter().zip(&spread) {
            let Some(plane) = plane else { continue };
            for v in 0..side {
                let Some(y) = (v + i * NODE).checked_sub(NODE + reach).filter(|y| *y < height) else {
                    continue;
                };
                for u in 0..side {
                    let x = (u + j * NODE).checked_sub(NODE + reach);
                    if let Some(x) = x.filter(|x| *x < width) {
                        out[(y, x)] += plane[v * side + u];
                    }
                }
            }
        }
    }
    out
}

/// Returns the pixels of an axis of `n` between the neighbours of a node, each with its weight for the node.
fn hat(node: usize, n: usize) -> impl Iterator<Item = (usize, f32)> {
    let centre = node * NODE;
    ((centre + 1).saturating_sub(NODE)..(centre + NODE).min(n))
        .map(move |at| (at, 1.0 - at.abs_diff(centre) as f32 / NODE as f32))
}

/// Computes [`convolve`] as the sum over all pairs of pixels, with point spread functions from direct sums. It suits
/// small fields only.
pub fn convolve_reference(field: &Array2<Complex32>, place: Place<'_>) -> Array2<Complex32> {
    use num_complex::Complex64;
    let (height, width) = field.dim();
    let side = place.side();
    // Returns F⁻¹(Φ) of a node, centred at (0, 0) and periodic in `side`.
    let spread = |i: usize, j: usize| {
        let aberration = place.node(i, j);
        let kernel = Array2::from_shape_fn((side, side), |(ky, kx)| {
            let v = place.kernel(&aberration, side, kx, ky);
            Complex64::new(v.re.into(), v.im.into())
        });
        phasefront_core::optics::reference::dft(&kernel, 1.0) / (side * side) as f64
    };
    let mut out = Array2::from_elem((height, width), Complex64::ZERO);
    for i in 0..(height - 1) / NODE + 2 {
        for j in 0..(width - 1) / NODE + 2 {
            let psf = spread(i, j);
            for (y, wy) in hat(i, height) {
                for (x, wx) in hat(j, width) {
                    let value = field[(y, x)] * (wy * wx);
                    let value = Complex64::new(value.re.into(), value.im.into());
                    let reach = place.reach() as isize;
                    for dy in -reach..=reach {
                        for dx in -reach..=reach {
                            let (v, u) = (y as isize + dy, x as isize + dx);
                            if v >= 0 && u >= 0 && (v as usize) < height && (u as usize) < width {
                                let n = side as isize;
                                let at = (dy.rem_euclid(n) as usize, dx.rem_euclid(n) as usize);
                                out[(v as usize, u as usize)] += value * psf[at];
                            }
                        }
                    }
                }
            }
        }
    }
    out.mapv(|v| Complex32::new(v.re as f32, v.im as f32))
}

/// Returns the midpoint hologram of `ldi`, (C, H, W), at z = 0, from `planes` planes, with a correction that differs
/// over the frame. `progress` receives the number of finished propagations and their total.
///
/// # Errors
/// Returns an error if there are no planes, or if a colour needs more propagations than [`MAX_PROPAGATIONS`].
pub fn hologram(
    ldi: &Ldi,
    display: &Display,
    planes: usize,
    aberrations: &SpatialAberrations,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Array3<Complex32>> {
    check_planes(planes)?;
    let frame @ Size { width, height } = ldi.size();
    let pitch_m = display.pitch_m();
    let padded = padded_size_with(frame, display, aberrations.reach_m(pitch_m))?;
    let Size {
        width: padded_width,
        height: padded_height,
    } = padded;
    let colours = display.colours();
    let scene = Planes::of(&ldi.for_display(display), planes);
    let z = |k: usize| plane_z_m(k, planes, display);
    let Some(front) = scene.occupied.last().map(|(k, _)| *k) else {
        return Ok(Array3::zeros((colours, height, width)));
    };
    let count = scene.occupied.len();
    let propagations = count * (count + 3) / 2;
    if propagations > MAX_PROPAGATIONS {
        return Err(Error::Input(format!(
            "{propagations} propagations a colour for {planes} planes; at most {MAX_PROPAGATIONS} are done: fewer planes are needed"
        )));
    }
    let fft = Fft2::new(padded, padded);
    let mut scratch = fft.scratch();
    let mut plane = vec![Complex32::ZERO; padded_height * padded_width];
    let mut sum = plane.clone();
    let mut hologram = Array3::zeros((colours, height, width));
    let step_m = display.volume_depth_m() / planes as f64;
    let mut done = 0;
    for (colour, &wavelength_m) in display.wavelengths_m().iter().enumerate() {
        let transfer = |distance_m| Transfer::new(padded, pitch_m, wavelength_m, distance_m, |_, _| true);
        sum.fill(Complex32::ZERO);
        for first in 0..count {
            let (k, points) = &scene.occupied[first];
            let points = &scene.points[points.clone()];
            place(points, &mut plane, padded_width, |point| point.rgb[colour].into());
            fft.rows_forward(&plane, &mut scratch.rows, &mut scratch.work);
            let mut at = *k;
            for (next, points) in &scene.occupied[first + 1..] {
                let across = transfer((at - next) as f64 * step_m);
                let points = &scene.points[points.clone()];
                cross(&fft, &mut scratch, &across, points, |_| Complex32::ZERO);
                at = *next;
                done += 1;
                progress(done, colours * propagations);
            }
            let here = Place {
                aberrations,
                display,
                colour,
                z_m: z(*k),
                frame,
            };
            // The wave goes back to the plane of its content, where its points spread.
            let back = transfer(z(*k) - z(front));
            spread(&fft, &mut scratch, &back, here);
            let home = transfer(-z(*k));
            fft.spectrum(
                &scratch.rows,
                &mut scratch.columns,
                |x, column, _| home.apply(x, column),
                &mut scratch.work,
            );
            (sum.par_iter_mut().zip(&scratch.columns)).for_each(|(sum, v)| *sum += v);
            done += 2;
            progress(done, colours * propagations);
        }
        fft.columns_inverse(&mut sum, |_, _| {}, &mut scratch.work);
        fft.rows_inverse(&sum, &mut scratch.rows, &mut scratch.work);
        let frame = hologram.index_axis_mut(Axis(0), colour);
        crop(&scratch.rows, padded_width, frame);
    }
    Ok(hologram)
}

/// Propagates the wave, whose transformed rows are in `scratch`, by `back` and spreads it as `here` says.
fn spread(fft: &Fft2, scratch: &mut Scratch, back: &Transfer, here: Place<'_>) {
    fft.columns(
        &scratch.rows,
        &mut scratch.columns,
        |x, column| back.apply(x, column),
        &mut scratch.work,
    );
    fft.rows_inverse(&scratch.columns, &mut scratch.rows, &mut scratch.work);
    let field =
        Array2::from_shape_vec(fft.padded_size().shape(), scratch.rows.clone()).expect("a plane of the padded shape");
    let field = convolve(&field, here);
    let field = field.as_slice().expect("standard layout");
    fft.rows_forward(field, &mut scratch.rows, &mut scratch.work);
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use phasefront_core::optics::zernike::Aberrations;

    fn grid() -> SpatialAberrations {
        let points = (0..15)
            .map(|i| {
                let (x, y) = (f64::from(i % 5) / 4.0, f64::from(i / 5) / 2.0);
                let a = [0.4 * x, -0.8 * y, 0.3, 0.9 * (x - 0.5), 0.5 * x * y];
                let a = Aberration::new([a, a.map(|v| 1.2 * v), a.map(|v| 1.4 * v)]).unwrap();
                ([x, y], Aberrations::new(vec![(0.0, a)]).unwrap())
            })
            .collect();
        SpatialAberrations::new(points).unwrap()
    }

    #[test]
    fn fifteen_points_are_interpolated_and_wrong_sets_refused() {
        let grid = grid();
        let at = |x: f64, y: f64| grid.at(x, y, 1e-3).coefficients()[0];
        assert!((at(0.6, 0.0)[0] - 0.24).abs() < 1e-12);
        assert!((at(0.1, 0.75)[1] + 0.6).abs() < 1e-12);
        assert_eq!(at(1.0, 1.0)[4], 0.5);
        let one = Aberrations::new(vec![(0.0, Aberration::none(3))]).unwrap();
        let alone = SpatialAberrations::new(vec![([0.3, 0.3], one.clone())]).unwrap();
        assert_eq!(alone.at(0.9, 0.1, 0.0), Aberration::none(3));
        for points in [
            vec![[0.1, 0.1], [0.2, 0.2]],
            vec![[0.1, 0.1], [0.1, 0.1]],
            vec![[-0.1, 0.5]],
            vec![],
        ] {
            let points = points.into_iter().map(|p| (p, one.clone())).collect();
            assert!(SpatialAberrations::new(points).is_err());
        }
    }

    #[test]
    fn the_convolution_is_the_sum_over_pairs() {
        let grid = grid();
        let display = Display::default();
        let place = Place {
            aberrations: &grid,
            display: &display,
            colour: 1,
            z_m: 0.0,
            frame: Size { width: 45, height: 37 },
        };
        let field = Array2::from_shape_fn((37, 45), |(y, x)| {
            let t = (y * 45 + x) as f32;
            Complex32::from_polar((t * 0.7).sin().abs(), t * 0.11)
        });
        let (ours, naive) = (convolve(&field, place), convolve_reference(&field, place));
        let square = |a: &Array2<Complex32>| a.iter().map(|v| v.norm_sqr()).sum::<f32>();
        let error = (square(&(&ours - &naive)) / square(&naive)).sqrt();
        assert!(error < 1e-4, "{error}");
    }
}
