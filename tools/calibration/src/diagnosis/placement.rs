//! Where the hologram's picture lies in a photograph, without the assumption that it is right: any orientation, size
//! and place, with views from several distances.

use super::scene::{Rect, Scene};
use super::score::{Comparison, Sampled, map_of, plain};
use super::state::State;
use crate::camera::photograph::Photograph;
use crate::diagnosis::Shown;
use crate::learned::register;
use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use phasefront::Size;
use phasefront_core::optics::fft::{Fft2, fast_size};
use phasefront_io::Result;
use rayon::prelude::*;

/// The longer side of the canvas on which pictures are compared first, in pixels.
const CANVAS: usize = 80;
/// The sizes of the picture as shares of the photograph's width or height.
const SIZES: [f64; 2] = [0.33, 1.15];
/// The ratio of neighbouring sizes.
const STEP: f64 = 1.07;
/// The turns of the camera that are tried, in degrees, around each of the eight orientations.
const TURNS: [f64; 7] = [-9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0];
/// The number of coarse places that are refined.
const REFINED: usize = 4;
/// The longer sides of the modulator, in pixels, on which a place is refined.
const LEVELS: [usize; 3] = [40, 80, 160];
/// The steps of refinement on each of them.
const STEPS: usize = 8;

/// How a picture is turned in a photograph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Orientation {
    pub mirrored: bool,
    /// The clockwise turns by 90° after mirroring left to right.
    pub quarters: usize,
}

impl Orientation {
    pub(super) fn all() -> impl Iterator<Item = Orientation> {
        (0..8).map(|n| Orientation {
            mirrored: n >= 4,
            quarters: n % 4,
        })
    }

    /// Returns the orientation of a picture whose corners lie at `corners`.
    pub(super) fn of([a, b, c, _]: [[f64; 2]; 4]) -> Self {
        let (right, down) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let mirrored = right[0] * down[1] - right[1] * down[0] < 0.0;
        let right = if mirrored { right.map(|v| -v) } else { right };
        let quarters = (right[1].atan2(right[0]) / std::f64::consts::FRAC_PI_2).round();
        Orientation {
            mirrored,
            quarters: quarters.rem_euclid(4.0) as usize,
        }
    }

    /// Returns the vectors to the picture's right and down.
    fn axes(self) -> [[f64; 2]; 2] {
        let turn = |[x, y]: [f64; 2]| match self.quarters {
            0 => [x, y],
            1 => [-y, x],
            2 => [-x, -y],
            _ => [y, -x],
        };
        [turn([if self.mirrored { -1.0 } else { 1.0 }, 0.0]), turn([0.0, 1.0])]
    }

    /// Returns the name of a wrong orientation.
    pub(super) fn fault(self) -> Option<&'static str> {
        Some(match (self.mirrored, self.quarters) {
            (false, 0) => return None,
            (true, 0) => "mirrored left to right",
            (true, 2) => "mirrored top to bottom",
            (false, 2) => "rotated by 180°",
            (false, _) => "rotated by 90°",
            (true, _) => "mirrored and rotated by 90°",
        })
    }
}

/// A place of the modulator in the photographs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// Its corners.
    pub corners: [[f64; 2]; 4],
    /// The correlation of the photographs with the picture there.
    pub fits: f64,
}

/// Finds the places of the modulator whose picture is that of one of `states`, the best one first, one for each
/// orientation at most.
pub(super) fn places(
    shown: &Shown<'_>,
    photographs: &[Photograph],
    states: &[State],
    reach_m: f64,
) -> Result<Vec<Place>> {
    let whole = Rect {
        x: 0,
        y: 0,
        size: shown.size,
    };
    let comparison = Comparison {
        scene: Scene::new(shown, whole, reach_m)?,
        photographs,
    };
    let canvas = Canvas::new(photographs);
    let mut best: Vec<Place> = Vec::new();
    for state in states {
        let lights: Vec<_> = (0..comparison.lasers())
            .map(|laser| comparison.scene.light(state, laser))
            .collect();
        let coarse = canvas.search(&lights);
        for place in coarse.into_iter().take(REFINED) {
            let place = refined(&lights, photographs, place)?;
            let orientation = Orientation::of(place.corners);
            match best
                .iter_mut()
                .find(|other| Orientation::of(other.corners) == orientation)
            {
                Some(other) if other.fits < place.fits => *other = place,
                Some(_) => (),
                None => best.push(place),
            }
        }
        best.sort_by(|a, b| b.fits.total_cmp(&a.fits));
        // The first state is the likely one.
        if best.first().is_some_and(|place| place.fits > 0.93) {
            break;
        }
    }
    Ok(best)
}

/// Refines a place on coarse pixels, then on finer ones.
fn refined(lights: &[Array2<f32>], photographs: &[Photograph], place: Place) -> Result<Place> {
    let (height, width) = lights[0].dim();
    let mut best = place;
    for level in LEVELS {
        let factor = (width.max(height) / level).max(1);
        let small: Vec<_> = lights.iter().map(|light| shrunk(light, factor)).collect();
        let size = Size::from_shape(small[0].dim());
        // Incomplete blocks at the right and lower edges are left out.
        let (w, h) = ((size.width * factor) as f64, (size.height * factor) as f64);
        let whole = Size { width, height };
        let at = |map: &crate::camera::homography::Homography, w: f64, h: f64| {
            [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]].map(|corner| map.map(corner))
        };
        let mut corners = at(&map_of(best.corners, whole)?, w, h);
        for _ in 0..STEPS {
            let (mut seen, mut expected) = (Array2::zeros(small[0].dim()), Array2::zeros(small[0].dim()));
            for (light, photo) in small.iter().zip(photographs) {
                let sampled = Sampled::new(photo, corners, size)?;
                expected += &plain(light, &sampled).0;
                seen += &sampled.light;
            }
            let map = register::refined(&map_of(corners, size)?, &seen, &expected, 1)?;
            corners = at(&map, size.width as f64, size.height as f64);
        }
        let mut fits = 0.0;
        for (light, photo) in small.iter().zip(photographs) {
            fits += plain(light, &Sampled::new(photo, corners, size)?).1 / lights.len() as f64;
        }
        let map = map_of(corners, Size::from_shape(small[0].dim()))?;
        let (right, down) = (width as f64 / factor as f64, height as f64 / factor as f64);
        let next = Place {
            corners: at(&map, right, down),
            fits,
        };
        // A step too far is no place.
        if !is_plausible(next.corners, best.corners) {
            break;
        }
        best = next;
    }
    Ok(best)
}

/// Returns whether the corners `after` refinement are those of a camera that looks at about the place `before`.
fn is_plausible(after: [[f64; 2]; 4], before: [[f64; 2]; 4]) -> bool {
    let length = |[a, b]: [[f64; 2]; 2]| (b[0] - a[0]).hypot(b[1] - a[1]);
    let sides = |[a, b, c, d]: [[f64; 2]; 4]| [[a, b], [c, d], [a, c], [b, d]].map(length);
    let (now, then) = (sides(after), sides(before));
    let near = |a: f64, b: f64| (0.8..1.25).contains(&(a / b));
    let far = (after.iter().zip(before)).any(|(a, b)| length([*a, b]) > 0.2 * then[0].max(then[2]));
    near(now[0], now[1]) && near(now[2], now[3]) && now.iter().zip(then).all(|(a, b)| near(*a, b)) && !far
}

/// Averages blocks of `factor`² pixels and drops incomplete ones.
fn shrunk(light: &Array2<f32>, factor: usize) -> Array2<f32> {
    let (height, width) = light.dim();
    Array2::from_shape_fn((height / factor, width / factor), |(y, x)| {
        let block = light.slice(ndarray::s![y * factor..(y + 1) * factor, x * factor..(x + 1) * factor]);
        block.mean().unwrap_or_default()
    })
}

/// The photographs of all lasers together, small, as amplitudes without their mean.
struct Canvas {
    size: Size,
    /// The photographs' pixels for each of the canvas.
    factor: usize,
    fft: Fft2,
    /// Its spectrum, (W', H').
    spectrum: Vec<Complex32>,
    norm: f32,
}

impl Canvas {
    fn new(photographs: &[Photograph]) -> Self {
        let factor = photographs[0].width.max(photographs[0].height).div_ceil(CANVAS);
        let (height, width, _) = photographs[0].shrunk(factor);
        let mut values = vec![0.0; height * width];
        for photo in photographs {
            let (.., small) = photo.shrunk(factor);
            // Lasers count alike.
            let mean = small.iter().sum::<f32>() / small.len() as f32;
            (values.iter_mut().zip(small)).for_each(|(sum, value)| *sum += value / mean.max(f32::MIN_POSITIVE));
        }
        let size = Size { width, height };
        let padded = Size {
            width: fast_size(width + width / 2),
            height: fast_size(height + height / 2),
        };
        let fft = Fft2::new(size, padded);
        let norm = centred(&mut values);
        let spectrum = spectrum_of(&fft, &values);
        Canvas {
            size,
            factor,
            fft,
            spectrum,
            norm,
        }
    }

    /// Returns the places where the canvas looks most like `lights`, the best one first, one for each orientation.
    fn search(&self, lights: &[Array2<f32>]) -> Vec<Place> {
        let (height, width) = lights[0].dim();
        let factor = (width.max(height) / 48).max(1);
        let mut small = Array2::zeros((height / factor, width / factor));
        for light in lights {
            let light = shrunk(light, factor);
            let mean = light.mean().unwrap_or(1.0).max(f32::MIN_POSITIVE);
            small += &(light / mean);
        }
        let small = small.mapv(f32::sqrt);
        let (w, h) = (width as f64, height as f64);
        let mut best: Vec<Place> = Orientation::all()
            .map(|orientation| {
                let [right, down] = orientation.axes();
                let turned = |turn: f64, [x, y]: [f64; 2]| {
                    let (sin, cos) = turn.to_radians().sin_cos();
                    [x * cos - y * sin, x * sin + y * cos]
                };
                // The size at which the picture fills the canvas.
                let (wide, high) = (
                    right[0].abs() * w + down[0].abs() * h,
                    right[1].abs() * w + down[1].abs() * h,
                );
                let whole = (self.size.width as f64 / wide).min(self.size.height as f64 / high);
                let count = ((SIZES[1] / SIZES[0]).ln() / STEP.ln()) as i32;
                let all: Vec<_> = (0..=count)
                    .flat_map(|n| TURNS.map(|turn| (SIZES[0] * STEP.powi(n) * whole, turn)))
                    .collect();
                let tried = all.par_iter().map(|(zoom, turn)| {
                    let axes = [turned(*turn, right), turned(*turn, down)].map(|axis| axis.map(|v| v * zoom));
                    let (fits, [x, y]) = self.at(&small, factor, axes);
                    let corner = |u: f64, v: f64| {
                        let along = |axis: usize| axes[0][axis] * u * w + axes[1][axis] * v * h;
                        [x + along(0), y + along(1)].map(|v| v * self.factor as f64)
                    };
                    Place {
                        corners: [
                            corner(-0.5, -0.5),
                            corner(0.5, -0.5),
                            corner(-0.5, 0.5),
                            corner(0.5, 0.5),
                        ],
                        fits,
                    }
                });
                let best = tried.max_by(|a, b| a.fits.total_cmp(&b.fits));
                best.expect("there are sizes to try")
            })
            .collect();
        best.sort_by(|a, b| b.fits.total_cmp(&a.fits));
        best
    }

    /// Returns the best correlation with the picture `small`, whose pixels are `factor` wide, and where its middle
    /// lies then. `axes` are the vectors of one pixel of the modulator to the right and down on the canvas.
    fn at(&self, small: &Array2<f32>, factor: usize, axes: [[f64; 2]; 2]) -> (f64, [f64; 2]) {
        let Size { width, height } = self.size;
        let [[a, b], [c, d]] = axes;
        let determinant = a * d - b * c;
        let (rows, columns) = small.dim();
        let f = factor as f64;
        let mut values: Vec<f32> = (0..width * height)
            .map(|at| {
                let (y, x) = (
                    (at / width) as f64 + 0.5 - height as f64 / 2.0,
                    (at % width) as f64 + 0.5 - width as f64 / 2.0,
                );
                let (u, v) = ((d * x - c * y) / determinant, (a * y - b * x) / determinant);
                let (u, v) = (u / f + columns as f64 / 2.0 - 0.5, v / f + rows as f64 / 2.0 - 0.5);
                if u < -0.5 || v < -0.5 || u > columns as f64 - 0.5 || v > rows as f64 - 0.5 {
                    return 0.0;
                }
                let value = |y: f64, x: f64| {
                    small[(
                        y.clamp(0.0, rows as f64 - 1.0) as usize,
                        x.clamp(0.0, columns as f64 - 1.0) as usize,
                    )]
                };
                let (v0, u0) = (v.floor(), u.floor());
                let row = |y: f64| value(y, u0) + (value(y, u0 + 1.0) - value(y, u0)) * (u - u0) as f32;
                row(v0) + (row(v0 + 1.0) - row(v0)) * (v - v0) as f32
            })
            .collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        values.iter_mut().for_each(|value| *value -= mean);
        let norm = values.iter().map(|value| value * value).sum::<f32>().sqrt();
        let mut product = spectrum_of(&self.fft, &values);
        product
            .iter_mut()
            .zip(&self.spectrum)
            .for_each(|(template, seen)| *template = template.conj() * seen);
        let mut scratch = self.fft.scratch();
        let padded = self.fft.padded_size();
        // Only the shifts up to half of the canvas: its middle lies in the photograph.
        let whole = Fft2::new(padded, padded);
        let mut rows = whole.scratch();
        whole.columns_inverse(&mut product, |_, _| (), &mut scratch.work);
        whole.rows_inverse(&product, &mut rows.rows, &mut scratch.work);
        let best = rows.rows.iter().map(|value| value.re).enumerate();
        let (at, most) = best.fold((0, f32::MIN), |best, next| if next.1 > best.1 { next } else { best });
        let signed = |k: usize, n: usize| if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
        let (y, x) = (at / padded.width, at % padded.width);
        let middle = [
            width as f64 / 2.0 + signed(x, padded.width),
            height as f64 / 2.0 + signed(y, padded.height),
        ];
        let area = padded.pixels() as f32;
        (
            f64::from(most / area / (norm * self.norm).max(f32::MIN_POSITIVE)),
            middle,
        )
    }
}

/// Turns light into amplitudes without their mean. Returns their norm.
fn centred(values: &mut [f32]) -> f32 {
    values.iter_mut().for_each(|value| *value = value.max(0.0).sqrt());
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    values.iter_mut().for_each(|value| *value -= mean);
    values.iter().map(|value| value * value).sum::<f32>().sqrt()
}

/// Returns the spectrum of `values`, (W', H').
fn spectrum_of(fft: &Fft2, values: &[f32]) -> Vec<Complex32> {
    let plane: Vec<_> = values.iter().map(|value| Complex32::from(*value)).collect();
    let mut scratch = fft.scratch();
    fft.rows_forward(&plane, &mut scratch.rows, &mut scratch.work);
    fft.spectrum(&scratch.rows, &mut scratch.columns, |_, _, _| (), &mut scratch.work);
    scratch.columns
}

/// Returns the state of a flat panel's light beside a dim picture.
pub(super) fn washed_out(right: &State) -> State {
    State {
        undiffracted: vec![Complex64::from(0.6); right.range.len()],
        ..right.clone()
    }
}

/// Returns the corners of `roi` where the modulator of `size` has the corners `whole`.
pub(super) fn corners_of(roi: Rect, whole: [[f64; 2]; 4], size: Size) -> Result<[[f64; 2]; 4]> {
    let map = map_of(whole, size)?;
    let (x, y) = (roi.x as f64, roi.y as f64);
    let (right, down) = (x + roi.size.width as f64, y + roi.size.height as f64);
    Ok([[x, y], [right, y], [x, down], [right, down]].map(|corner| map.map(corner)))
}
