//! What incoherent light shows of a layered depth image: focal stacks as an eye sees the world, which holograms with
//! natural focus are compared with.
//!
//! Light of wavelength λ passes the pupil in directions of sine λ·u/2p, u in a disc of the aperture, and p the pixel
//! pitch. A pinhole at u sees the whole scene without blur: a point at height z' lies on the plane of focus z at
//! x + (z − z')·tan θ(u), and nearer points hide farther ones exactly there. An eye sees the mean intensity over all
//! pinholes of its pupil, because incoherent light does not interfere.
//!
//! The scene is cut into [`PLANES`] planes, which are moved by bilinear interpolation and drawn from the back to the
//! front. A point lies on its own plane and on the one behind, so that slopes have no cracks. The surroundings are
//! black. [`reference()`] follows single rays instead.

use crate::sm_lbm::plane_of_depth;
use ndarray::{Array2, Array3, Axis};
use phasefront::{Display, Size};
use phasefront_core::optics::aperture::Opening;
use phasefront_io::Result;
use phasefront_io::ldi::Ldi;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::ops::Range;

mod score;

pub use score::{Judge, Natural};

/// The number of planes that a scene is cut into.
pub const PLANES: usize = 64;
/// The least and the largest number of pinholes. Between them, each stands for some pixels of the largest blur. Four
/// times as many change views of hard scenes by −45 dB.
const PINHOLES: [f64; 2] = [24.0, 200.0];
const PIXELS_OF_PINHOLE: f64 = 3.0;

/// A disc in the plane of the aperture. Lengths are fractions of the Nyquist frequency, as in [`Opening`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pupil {
    /// The radius. 1 is the whole first order.
    pub radius: f64,
    /// The centre (x, y).
    pub centre: [f64; 2],
}

impl From<Opening> for Pupil {
    fn from(opening: Opening) -> Self {
        Pupil {
            radius: opening.radius,
            centre: [opening.shift, 0.0],
        }
    }
}

impl Pupil {
    /// Returns the pupil that fills the aperture of `display`.
    pub fn of_aperture(display: &Display) -> Self {
        Pupil {
            radius: display.aperture_radius(),
            centre: [0.0; 2],
        }
    }

    /// Checks that light passes.
    ///
    /// # Errors
    /// Returns an error if the radius is not positive or a number is not finite.
    pub fn check(self) -> Result<()> {
        let Pupil { radius, centre } = self;
        if radius > 0.0 && radius.is_finite() && centre.iter().all(|c| c.is_finite()) {
            return Ok(());
        }
        Err(phasefront::Error::Setting(format!(
            "a pupil of radius {radius} at ({}, {}) passes nothing; the radius must be above 0 (1 is the whole first order)",
            centre[0], centre[1]
        ))
        .into())
    }

    /// Returns `count` points that cover the disc evenly, in a sunflower.
    fn points(self, count: usize) -> impl Iterator<Item = [f64; 2]> {
        let Pupil { radius, centre } = self;
        let turn = PI * (3.0 - 5f64.sqrt());
        (0..count).map(move |k| {
            let k = k as f64 + 0.5;
            let (sin, cos) = (k * turn).sin_cos();
            let r = radius * (k / count as f64).sqrt();
            [centre[0] + r * cos, centre[1] + r * sin]
        })
    }
}

/// A scene cut into planes. Each row of a plane is a list of runs of pixels.
struct Planes {
    /// 1 where a pixel has a surface. Every run lies between zeros.
    coverage: Vec<f32>,
    /// The intensities of each colour, in the places of `coverage`.
    light: [Vec<f32>; 3],
    /// The first column and the places of each run.
    runs: Vec<(usize, Range<usize>)>,
    /// y and the runs of each row that has any, plane by plane.
    rows: Vec<(usize, Range<usize>)>,
    /// z in metres and the rows of each plane that has any, back first.
    planes: Vec<(f64, Range<usize>)>,
}

impl Planes {
    /// The columns without a surface that end a run.
    const GAP: usize = 12;

    fn of(ldi: &Ldi, display: &Display) -> Self {
        let Size { width, height } = ldi.size();
        let mut scene = Planes {
            coverage: vec![0.0],
            light: std::array::from_fn(|_| vec![0.0]),
            runs: Vec::new(),
            rows: Vec::new(),
            planes: Vec::new(),
        };
        for (place, layer) in Self::hits(ldi) {
            let (row, x) = (place / width, place % width);
            let (plane, y) = (PLANES - 1 - row / height, row % height);
            let z_m = display.z_of_depth((plane as f64 + 0.5) / PLANES as f64);
            let new_plane = scene.planes.last().is_none_or(|(z, _)| *z != z_m);
            if new_plane {
                scene.planes.push((z_m, scene.rows.len()..scene.rows.len()));
            }
            let new_row = new_plane || scene.rows.last().is_none_or(|(last, _)| *last != y);
            if new_row {
                scene.rows.push((y, scene.runs.len()..scene.runs.len()));
                scene.planes.last_mut().expect("one was pushed").1.end += 1;
            }
            let end = scene.runs.last().map_or(0, |(x, places)| x + places.len());
            if new_row || x > end + Self::GAP {
                scene.pad(1);
                scene.runs.push((x, scene.coverage.len()..scene.coverage.len()));
                scene.rows.last_mut().expect("one was pushed").1.end += 1;
            } else {
                scene.pad(x - end);
            }
            scene.coverage.push(1.0);
            for (c, light) in scene.light.iter_mut().enumerate() {
                light.push(ldi.layers[layer].rgb[(c, y, x)].powi(2));
            }
            scene.runs.last_mut().expect("one was pushed").1.end = scene.coverage.len();
        }
        scene.pad(1);
        scene
    }

    /// Returns the places of all hits, plane by plane and row by row from the back, each with its layer. Of two hits at
    /// one place the front one stays, and one on its own plane before one that is continued there.
    fn hits(ldi: &Ldi) -> impl Iterator<Item = (usize, usize)> {
        let Size { width, height } = ldi.size();
        let count = ldi.layers.len();
        let mut hits: Vec<(usize, usize)> = Vec::new();
        for (l, layer) in ldi.layers.iter().enumerate() {
            for ((y, x), d) in layer.depth.indexed_iter().filter(|(_, d)| !d.is_nan()) {
                for (behind, rank) in [(0, l), (1, count + l)] {
                    let plane = (plane_of_depth(*d, PLANES) + behind).min(PLANES - 1);
                    hits.push((((PLANES - 1 - plane) * height + y) * width + x, rank));
                }
            }
        }
        hits.par_sort_unstable();
        hits.dedup_by_key(|(place, _)| *place);
        hits.into_iter().map(move |(place, rank)| (place, rank % count))
    }

    /// Adds `count` pixels without a surface.
    fn pad(&mut self, count: usize) {
        for values in std::iter::once(&mut self.coverage).chain(&mut self.light) {
            values.resize(values.len() + count, 0.0);
        }
    }

    /// Returns the largest distance of a point from the plane of focus z.
    fn farthest_m(&self, z_m: f64) -> f64 {
        self.planes.iter().map(|(z, _)| (z_m - z).abs()).fold(0.0, f64::max)
    }
}

/// One row of a plane, moved sideways.
struct Line {
    coverage: Vec<f32>,
    light: Vec<f32>,
    /// The columns that are not 0.
    span: Range<usize>,
}

impl Line {
    fn new(width: usize) -> Self {
        Line {
            coverage: vec![0.0; width],
            light: vec![0.0; width],
            span: 0..0,
        }
    }

    fn clear(&mut self) {
        let span = std::mem::take(&mut self.span);
        self.coverage[span.clone()].fill(0.0);
        self.light[span].fill(0.0);
    }

    /// Draws runs whose column 0 comes to column `first` and a `part` of a pixel farther.
    fn draw(&mut self, scene: &Planes, runs: Range<usize>, colour: usize, first: usize, part: f32) {
        self.clear();
        let runs = &scene.runs[runs];
        let (Some((start, _)), Some((end, last))) = (runs.first(), runs.last()) else {
            return;
        };
        self.span = first + start..first + end + last.len() + 1;
        let moved = |from: &[f32], places: &Range<usize>, to: &mut [f32]| {
            let (here, before) = (&from[places.start..=places.end], &from[places.start - 1..places.end]);
            for ((to, here), before) in to.iter_mut().zip(here).zip(before) {
                *to = (1.0 - part) * here + part * before;
            }
        };
        for (x, places) in runs {
            let to = first + x..first + x + places.len() + 1;
            moved(&scene.coverage, places, &mut self.coverage[to.clone()]);
            moved(&scene.light[colour], places, &mut self.light[to]);
        }
    }
}

/// The picture that one pinhole sees, with a margin that takes points beyond the frame.
struct View {
    width: usize,
    margin: usize,
    seen: Vec<f32>,
    /// The row that is being drawn, and the one above.
    lines: [Line; 2],
}

impl View {
    fn new(size: Size, margin: usize) -> Self {
        let (width, height) = (size.width + 2 * margin, size.height + 2 * margin);
        View {
            width,
            margin,
            seen: vec![0.0; height * width],
            lines: [Line::new(width), Line::new(width)],
        }
    }

    /// Draws the scene as the pinhole sees it that moves points by `slope` pixels a metre, (x, y), in focus at `z_m`.
    fn draw(&mut self, scene: &Planes, colour: usize, z_m: f64, slope: [f64; 2]) {
        self.seen.fill(0.0);
        for (plane_z_m, rows) in &scene.planes {
            let moved = slope.map(|s| s * (z_m - plane_z_m));
            let part = moved.map(|m| (m - m.floor()) as f32);
            let first = moved.map(|m| (self.margin as isize + m.floor() as isize) as usize);
            let mut next = 0;
            for (y, runs) in &scene.rows[rows.clone()] {
                if *y != next {
                    self.blend(first[1] + next, part[1]);
                }
                self.lines[0].draw(scene, runs.clone(), colour, first[0], part[0]);
                self.blend(first[1] + y, part[1]);
                next = y + 1;
            }
            self.blend(first[1] + next, part[1]);
        }
    }

    /// Lays the row between the two lines, a `part` of a pixel below the second, over what lies behind it in `row`.
    /// Then the first line is the one above.
    fn blend(&mut self, row: usize, part: f32) {
        let [here, above] = &self.lines;
        let span = match (here.span.is_empty(), above.span.is_empty()) {
            (true, _) => above.span.clone(),
            (_, true) => here.span.clone(),
            _ => here.span.start.min(above.span.start)..here.span.end.max(above.span.end),
        };
        let seen = &mut self.seen[row * self.width..][span.clone()];
        let coverages = here.coverage[span.clone()].iter().zip(&above.coverage[span.clone()]);
        let lights = here.light[span.clone()].iter().zip(&above.light[span]);
        let mix = |(here, above): (&f32, &f32)| (1.0 - part) * here + part * above;
        for ((seen, coverages), lights) in seen.iter_mut().zip(coverages).zip(lights) {
            *seen = *seen * (1.0 - mix(coverages)) + mix(lights);
        }
        self.lines.swap(0, 1);
        self.lines[0].clear();
    }
}

/// Returns the amplitudes, (C, H, W), that an eye with `pupil` sees of `ldi` when it focuses on each of `z_m`, in
/// metres.
///
/// # Errors
/// Returns an error if the pupil passes nothing.
pub fn stack(ldi: &Ldi, display: &Display, pupil: Pupil, z_m: &[f64]) -> Result<Vec<Array3<f32>>> {
    pupil.check()?;
    let scene = Planes::of(&ldi.for_display(display), display);
    let colours = display.colours();
    let jobs: Vec<_> = z_m.iter().flat_map(|z| (0..colours).map(move |c| (*z, c))).collect();
    let planes: Vec<Array2<f32>> = jobs
        .into_par_iter()
        .map(|(z_m, colour)| {
            let optics = Optics::new(display, colour, pupil);
            plane(&scene, ldi.size(), optics, z_m, optics.pinholes(&scene, z_m))
        })
        .collect();
    Ok(planes
        .chunks_exact(colours)
        .map(|planes| {
            let planes: Vec<_> = planes.iter().map(|plane| plane.view()).collect();
            ndarray::stack(Axis(0), &planes).expect("planes of one shape")
        })
        .collect())
}

/// A pupil in one colour.
#[derive(Clone, Copy)]
struct Optics {
    colour: usize,
    pupil: Pupil,
    wavelength_m: f64,
    pitch_m: f64,
}

impl Optics {
    fn new(display: &Display, colour: usize, pupil: Pupil) -> Self {
        Optics {
            colour,
            pupil,
            wavelength_m: display.wavelengths_m()[colour],
            pitch_m: display.pitch_m(),
        }
    }

    /// Returns the pixels that light in the direction `u` moves sideways, (x, y), for each metre toward the viewer.
    fn slope(self, u: [f64; 2]) -> [f64; 2] {
        let [x, y] = u.map(|u| u * self.wavelength_m / (2.0 * self.pitch_m));
        let cosine = (1.0 - x * x - y * y).max(1e-6).sqrt();
        [x, y].map(|sine| sine / cosine / self.pitch_m)
    }

    /// Returns the slopes of `count` pinholes.
    fn slopes(self, count: usize) -> impl Iterator<Item = [f64; 2]> {
        self.pupil.points(count).map(move |u| self.slope(u))
    }

    /// Returns the number of pinholes that a view of `scene` in focus at z needs.
    fn pinholes(self, scene: &Planes, z_m: f64) -> usize {
        let blur = scene.farthest_m(z_m) * self.slope([self.pupil.radius, 0.0])[0];
        (PI * blur * blur / PIXELS_OF_PINHOLE).clamp(PINHOLES[0], PINHOLES[1]) as usize
    }
}

/// Returns the amplitudes of one colour, in focus at z.
fn plane(scene: &Planes, size: Size, optics: Optics, z_m: f64, pinholes: usize) -> Array2<f32> {
    let edge = optics.pupil.centre.map(|c| c.abs() + optics.pupil.radius);
    let most = optics.slope(edge).into_iter().fold(0.0, f64::max);
    let margin = (scene.farthest_m(z_m) * most).ceil() as usize + 2;
    let mut view = View::new(size, margin);
    let mut light = Array2::<f32>::zeros(size.shape());
    for slope in optics.slopes(pinholes) {
        view.draw(scene, optics.colour, z_m, slope);
        let seen = view.seen.chunks_exact(view.width).skip(margin).take(size.height);
        for (mut light, seen) in light.rows_mut().into_iter().zip(seen) {
            for (light, seen) in light.iter_mut().zip(&seen[margin..margin + size.width]) {
                *light += seen;
            }
        }
    }
    light.mapv_into(|light| (light / pinholes as f32).max(0.0).sqrt())
}

/// Returns what [`stack`] does at one z by following each ray from the front to the back: the oracle for tests.
///
/// # Errors
/// Returns an error if the pupil passes nothing.
pub fn reference(ldi: &Ldi, display: &Display, pupil: Pupil, z_m: f64, pinholes: usize) -> Result<Array3<f32>> {
    pupil.check()?;
    let Size { width, height } = ldi.size();
    // The nearest hit of each pixel on each plane: its own, or else one that is continued from the plane before.
    let on_plane = |k: usize, y: isize, x: isize| {
        let inside = (0..height as isize).contains(&y) && (0..width as isize).contains(&x);
        let at = (y as usize, x as usize);
        let of = |k: usize| {
            let plane = |d: f32| ((f64::from(d) * PLANES as f64) as usize).min(PLANES - 1);
            ldi.layers
                .iter()
                .find(|layer| plane(layer.depth[at]) == k && !layer.depth[at].is_nan())
        };
        let hit = || of(k).or_else(|| k.checked_sub(1).and_then(of));
        inside
            .then(hit)
            .flatten()
            .map(|layer| [0, 1, 2].map(|c| layer.rgb[(c, at.0, at.1)]))
    };
    let ray = |colour: usize, slope: [f64; 2], y: usize, x: usize| {
        let (mut light, mut left) = (0.0, 1.0);
        for k in 0..PLANES {
            let moved = z_m - display.z_of_depth((k as f64 + 0.5) / PLANES as f64);
            let (px, py) = (x as f64 - slope[0] * moved, y as f64 - slope[1] * moved);
            let (x0, y0) = (px.floor(), py.floor());
            let (mut here, mut covered) = (0.0, 0.0);
            for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let weight = |at: f64, to: f64| 1.0 - (at - to).abs();
                let weight = weight(py, y0 + f64::from(dy)) * weight(px, x0 + f64::from(dx));
                if let Some(rgb) = on_plane(k, y0 as isize + dy as isize, x0 as isize + dx as isize) {
                    here += weight * f64::from(rgb[colour]).powi(2);
                    covered += weight;
                }
            }
            light += left * here;
            left *= 1.0 - covered;
        }
        light
    };
    Ok(Array3::from_shape_fn(
        (display.colours(), height, width),
        |(colour, y, x)| {
            let slopes = Optics::new(display, colour, pupil).slopes(pinholes);
            let light: f64 = slopes.map(|slope| ray(colour, slope, y, x)).sum();
            (light / pinholes as f64).sqrt() as f32
        },
    ))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use phasefront_io::dice::Dice;
    use phasefront_io::ldi::LdiLayer;

    fn layer(Size { width, height }: Size, of: impl Fn(usize, usize) -> ([f32; 3], f32)) -> LdiLayer {
        LdiLayer {
            rgb: Array3::from_shape_fn((3, height, width), |(c, y, x)| of(y, x).0[c]),
            depth: Array2::from_shape_fn((height, width), |(y, x)| of(y, x).1),
        }
    }

    /// Returns the share of a disc of radius 1 at places above `x`.
    fn above(x: f64) -> f64 {
        let x = x.clamp(-1.0, 1.0);
        (x.acos() - x * (1.0 - x * x).sqrt()) / PI
    }

    #[test]
    fn the_fast_drawing_equals_rays() {
        let (display, size) = (Display::default(), Size { width: 26, height: 21 });
        let mut dice = Dice::new(7);
        let random: Vec<([f32; 3], f32)> = (0..2 * size.pixels())
            .map(|_| {
                (
                    [0, 1, 2].map(|_| dice.range(0.0, 1.0) as f32),
                    dice.range(0.0, 0.5) as f32,
                )
            })
            .collect();
        let of = |y: usize, x: usize, l: usize| random[(l * size.height + y) * size.width + x];
        let front = layer(size, |y, x| {
            (of(y, x, 0).0, if y < 14 { of(y / 5, x / 5, 0).1 } else { f32::NAN })
        });
        let back = layer(size, |y, x| {
            (of(y, x, 1).0, if y + x > 9 { 0.5 + x as f32 / 60.0 } else { f32::NAN })
        });
        let ldi = Ldi::new(vec![front, back]).unwrap();
        let pupil = Pupil {
            radius: 0.7,
            centre: [0.2, -0.1],
        };
        for z_m in [-2.5e-3, 0.4e-3, 3e-3] {
            let expected = reference(&ldi, &display, pupil, z_m, 13).unwrap();
            let scene = Planes::of(&ldi, &display);
            for colour in 0..3 {
                let seen = plane(&scene, size, Optics::new(&display, colour, pupil), z_m, 13);
                let expected = expected.index_axis(Axis(0), colour);
                let error = seen
                    .iter()
                    .zip(expected)
                    .map(|(a, b)| (a.powi(2) - b.powi(2)).abs())
                    .fold(0.0, f32::max);
                assert!(error < 1e-4, "colour {colour} at {z_m} m: {error}");
            }
        }
    }

    /// A dark edge in front of a bright wall hides the part of the pupil that geometry says.
    #[test]
    fn an_edge_hides_a_segment_of_the_pupil() {
        // So tall that no light passes above or below the edge.
        let (display, size) = (Display::default(), Size { width: 120, height: 71 });
        let near = layer(size, |_, x| ([0.0; 3], if x < 60 { 0.0 } else { f32::NAN }));
        let wall = layer(size, |_, _| ([1.0, 0.8, 0.5], 1.0));
        let ldi = Ldi::new(vec![near, wall]).unwrap();
        let z_of = |plane: usize| display.z_of_depth((plane as f64 + 0.5) / PLANES as f64);
        // The edge is on its plane and on the one behind it.
        let between_m = 0.5 * (z_of(0) + z_of(1)) - z_of(PLANES - 1);
        for (radius, centre) in [(1.0, 0.0), (0.4, 0.3)] {
            let pupil = Pupil {
                radius,
                centre: [centre, 0.0],
            };
            let seen = &stack(&ldi, &display, pupil, &[z_of(PLANES - 1)]).unwrap()[0];
            for (c, &wavelength_m) in display.wavelengths_m().iter().enumerate() {
                let per_u = between_m * wavelength_m / (2.0 * display.pitch_m()) / display.pitch_m();
                for x in 40..80 {
                    // Light from the wall at x passes the edge's plane at x + per_u·u, and 59.5 is the edge.
                    let hidden_below = (59.5 - x as f64) / per_u;
                    let open = above((hidden_below - centre) / radius);
                    let expected = open * [1.0, 0.64, 0.25][c];
                    let found = f64::from(seen[(c, 35, x)]).powi(2);
                    assert!((found - expected).abs() < 0.06, "{c} at {x}: {found} for {expected}");
                }
            }
        }
    }

    #[test]
    fn a_plane_in_focus_is_itself_and_out_of_focus_a_disc() {
        let (display, size) = (Display::default(), Size { width: 61, height: 61 });
        let depth = (20.0 + 0.5) / PLANES as f32;
        let point = layer(size, |y, x| {
            (if (y, x) == (30, 30) { [1.0; 3] } else { [0.0; 3] }, depth)
        });
        let ldi = Ldi::new(vec![point]).unwrap();
        let z_m = display.z_of_depth(f64::from(depth));
        let away_m = 2e-3;
        let seen = stack(&ldi, &display, Pupil::of_aperture(&display), &[z_m, z_m - away_m]).unwrap();
        assert!((seen[0][(1, 30, 30)] - 1.0).abs() < 1e-3 && seen[0].sum() < 3.01);
        let radius = away_m * Optics::new(&display, 1, Pupil::of_aperture(&display)).slope([1.0, 0.0])[0];
        let light = seen[1].index_axis(Axis(0), 1).mapv(|a| f64::from(a).powi(2));
        // A point on two planes shows once: the one behind it is hidden, but for its blur.
        assert!((light.sum() - 1.0).abs() < 0.1, "{}", light.sum());
        let moment: f64 = light
            .indexed_iter()
            .map(|((y, x), l)| l * ((y as f64 - 30.0).powi(2) + (x as f64 - 30.0).powi(2)))
            .sum();
        let expected = radius * radius / 2.0;
        assert!(
            (moment / light.sum() / expected - 1.0).abs() < 0.1,
            "{moment} for {expected}"
        );
    }

    #[test]
    fn a_pupil_without_an_area_is_refused() {
        let ldi = Ldi::new(vec![layer(Size { width: 4, height: 4 }, |_, _| ([0.5; 3], 0.5))]).unwrap();
        for radius in [0.0, -1.0, f64::NAN] {
            let pupil = Pupil {
                radius,
                centre: [0.0; 2],
            };
            let refused = stack(&ldi, &Display::default(), pupil, &[0.0]).unwrap_err();
            assert!(refused.to_string().contains("must be above 0"), "{refused}");
        }
    }
}
