//! What a model says that a photograph shows, how far it is off, and the gradient of that by each of the model's
//! values.

use ndarray::Array2;
use num_complex::Complex32;
use phasefront::Size;
use phasefront::Target;
use phasefront::target::Aberration;
use phasefront_core::display::model::{CURVE, ColourModel, PUPIL, around, pupil_node};
use phasefront_core::encode::modelled::way;
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::optics::fft::{Fft2, frequency};
use phasefront_io::Result;
use std::f32::consts::TAU;

/// The pixels at the border that are not compared: light from beyond the modulator reaches them.
pub(super) const BORDER: usize = 8;

/// The path of one colour from the modulator to one z.
pub(super) struct Path {
    size: Size,
    padded: Size,
    fft: Fft2,
    /// The factors of free space and the aperture, (W', H').
    factors: Vec<Complex32>,
    /// The laser's amplitude, (H, W).
    laser: Vec<f32>,
}

/// What a model says that a photograph shows.
pub(super) struct Expected {
    /// The light, in the photograph's units, (H, W).
    pub(super) light: Array2<f32>,
    /// The sum of squares by which it is off, relative to that of the photograph.
    pub(super) misfit: f64,
}

/// The intermediate fields of a model for one hologram.
struct Fields {
    responses: Vec<f32>,
    /// Λ·exp(iψ).
    phasors: Vec<Complex32>,
    /// The spectrum of the field at the modulator, (W', H').
    spectrum: Vec<Complex32>,
    /// The field at the camera's focus.
    focus: Vec<Complex32>,
}

impl Path {
    pub(super) fn new(target: &Target, colour: usize, z_m: f64) -> Result<Self> {
        let size @ Size { width, height } = target.modulator();
        let display = &target.display;
        let distance_m = z_m - display.offset_m();
        let reversed = target.correction.as_ref().map(Aberration::reversed);
        let ways = match target.propagators(size, 1, distance_m, reversed.as_ref())? {
            Some(ways) => ways,
            None => Propagator::for_colours(
                Size { width, height },
                display.pitch_m(),
                display.wavelengths_m(),
                distance_m,
                Padding::Reach,
            )?,
        };
        let free = &ways[colour];
        let padded = free.padded_size();
        let laser = |i: usize| {
            let light = target.illumination.as_ref();
            light.map_or(1.0, |light| 1.0 / light.gain(colour, i / width, i % width, size))
        };
        Ok(Path {
            size,
            padded,
            fft: Fft2::new(Size { width, height }, padded),
            factors: way(free, display.aperture_radius(), |_, _| Complex32::ONE),
            laser: (0..height * width).map(laser).collect(),
        })
    }

    /// Compares a photograph's `light`, (H, W), with what `model` says that `phases`, (H, W), show.
    pub(super) fn expected(
        &self,
        model: &ColourModel,
        nodes: (usize, usize),
        phases: &[f32],
        light: &Array2<f32>,
    ) -> Expected {
        let focus = self.fields(model, nodes, phases).focus;
        let exposure = Exposure::of(&focus, light);
        Expected {
            misfit: exposure.misfit,
            light: Array2::from_shape_fn(self.size.shape(), |(y, x)| {
                exposure.gain * focus[y * self.size.width + x].norm_sqr() + exposure.stray
            }),
        }
    }

    /// Returns the misfit of [`Self::expected`] and its gradient by [`ColourModel::values`].
    pub(super) fn gradient(
        &self,
        model: &ColourModel,
        nodes: (usize, usize),
        phases: &[f32],
        light: &Array2<f32>,
    ) -> (f64, Vec<f32>) {
        let fields = self.fields(model, nodes, phases);
        let exposure = Exposure::of(&fields.focus, light);
        let mut spectrum = self.spectrum(&exposure.slopes(&fields.focus, light));
        let mut slopes = ColourModel {
            crosstalk: [0.0; 9],
            pupil: self.by_pupil(&fields.spectrum, &spectrum),
            light: vec![Complex32::ZERO; nodes.0 * nodes.1],
            undiffracted: vec![Complex32::ZERO; nodes.0 * nodes.1],
            curve: [0.0; CURVE],
        };
        self.by_frequency(|at, fx, fy| {
            spectrum[at] *= (self.factors[at] * model.pupil_at(fx, fy)).conj();
        });
        let field = self.field(&mut spectrum);
        let mut by_psi = vec![0.0; phases.len()];
        self.by_pixel(nodes, |at, corners| {
            let (mut light, phasor) = (Complex32::ZERO, fields.phasors[at]);
            for (node, weight) in corners {
                light += model.light[node] * weight;
                slopes.light[node] += phasor.conj() * field[at] * weight;
                slopes.undiffracted[node] += field[at] * (self.laser[at] * weight);
            }
            by_psi[at] = ((light * phasor).conj() * field[at]).im;
        });
        self.by_responses(model, &by_psi, &fields.responses, phases, &mut slopes);
        (exposure.misfit, slopes.values())
    }

    fn fields(&self, model: &ColourModel, nodes: (usize, usize), phases: &[f32]) -> Fields {
        let width = self.size.width;
        let responses: Vec<f32> = phases.iter().map(|phase| model.response(*phase).0).collect();
        let mut psi = vec![0.0; phases.len()];
        for (y, row) in psi.chunks_exact_mut(width).enumerate() {
            model.spread_row(&responses, y, row);
        }
        let phasors: Vec<_> = (psi.iter().zip(&self.laser))
            .map(|(psi, laser)| Complex32::from_polar(*laser, *psi))
            .collect();
        let mut field = vec![Complex32::ZERO; phases.len()];
        self.by_pixel(nodes, |at, corners| {
            for (node, weight) in corners {
                field[at] += (model.light[node] * phasors[at] + model.undiffracted[node] * self.laser[at]) * weight;
            }
        });
        let spectrum = self.spectrum(&field);
        let mut filtered = spectrum.clone();
        self.by_frequency(|at, fx, fy| filtered[at] *= self.factors[at] * model.pupil_at(fx, fy));
        Fields {
            responses,
            phasors,
            focus: self.field(&mut filtered),
            spectrum,
        }
    }

    /// Returns the spectrum of `plane`, (H, W), as columns, (W', H').
    fn spectrum(&self, plane: &[Complex32]) -> Vec<Complex32> {
        let mut scratch = self.fft.scratch();
        self.fft.rows_forward(plane, &mut scratch.rows, &mut scratch.work);
        (self.fft).spectrum(&scratch.rows, &mut scratch.columns, |_, _, _| (), &mut scratch.work);
        scratch.columns
    }

    /// Returns the plane, (H, W), of a spectrum.
    fn field(&self, columns: &mut [Complex32]) -> Vec<Complex32> {
        let mut scratch = self.fft.scratch();
        self.fft.columns_inverse(columns, |_, _| {}, &mut scratch.work);
        self.fft.rows_inverse(columns, &mut scratch.rows, &mut scratch.work);
        let mut plane = vec![Complex32::ZERO; self.size.height * self.size.width];
        self.fft.crop(&scratch.rows, &mut plane);
        plane
    }

    /// Calls `then` with the index and the frequency, in cycles per pixel, of each value of a spectrum.
    fn by_frequency(&self, mut then: impl FnMut(usize, f64, f64)) {
        let Size { width, height } = self.padded;
        for kx in 0..width {
            for ky in 0..height {
                then(kx * height + ky, frequency(kx, width), frequency(ky, height));
            }
        }
    }

    /// Calls `then` with the index of each pixel and its four nodes with their weights.
    fn by_pixel(&self, nodes: (usize, usize), mut then: impl FnMut(usize, [(usize, f32); 4])) {
        let Size { width, height } = self.size;
        for y in 0..height {
            let (i, fy) = around(y, height, nodes.0);
            for x in 0..width {
                let (j, fx) = around(x, width, nodes.1);
                then(y * width + x, corners(i, fy, j, fx, nodes.1));
            }
        }
    }

    /// Returns the gradient by the pupil, from the spectra of the field at the modulator and of the slopes at the
    /// focus.
    fn by_pupil(&self, field: &[Complex32], slopes: &[Complex32]) -> Vec<Complex32> {
        let mut pupil = vec![Complex32::ZERO; PUPIL * PUPIL];
        self.by_frequency(|at, fx, fy| {
            let slope = (field[at] * self.factors[at]).conj() * slopes[at];
            let ((i, part_y), (j, part_x)) = (pupil_node(fy), pupil_node(fx));
            for (node, weight) in corners(i, part_y, j, part_x, PUPIL) {
                pupil[node] += slope * weight;
            }
        });
        pupil
    }

    /// Adds the gradient by crosstalk and curve to `slopes`, from that by ψ.
    fn by_responses(
        &self,
        model: &ColourModel,
        by_psi: &[f32],
        responses: &[f32],
        phases: &[f32],
        slopes: &mut ColourModel,
    ) {
        let Size { width, height } = self.size;
        let near = |at: usize, d: usize, n: usize| (at + d).saturating_sub(1).min(n - 1);
        let mut by_crosstalk = [0.0f64; 9];
        for (at, slope) in by_psi.iter().enumerate() {
            for (i, sum) in by_crosstalk.iter_mut().enumerate() {
                let (y, x) = (near(at / width, i / 3, height), near(at % width, i % 3, width));
                *sum += f64::from(slope * responses[y * width + x]);
            }
        }
        slopes.crosstalk = by_crosstalk.map(|sum| sum as f32);
        let mut row = vec![0.0; width];
        let mut by_curve = [0.0f64; CURVE];
        for (y, phases) in phases.chunks_exact(width).enumerate() {
            model.gather_row(by_psi, y, &mut row);
            for (phase, slope) in phases.iter().zip(&row) {
                let at = phase / TAU * (CURVE - 1) as f32;
                let node = (at as usize).min(CURVE - 2);
                let part = at - node as f32;
                by_curve[node] += f64::from(slope * (1.0 - part));
                by_curve[node + 1] += f64::from(slope * part);
            }
        }
        slopes.curve = by_curve.map(|sum| sum as f32);
    }
}

/// Returns the four nodes after (`i`, `j`) of a grid of `columns` and their weights.
fn corners(i: usize, fy: f32, j: usize, fx: f32, columns: usize) -> [(usize, f32); 4] {
    let at = i * columns + j;
    [
        (at, (1.0 - fy) * (1.0 - fx)),
        (at + 1, (1.0 - fy) * fx),
        (at + columns, fy * (1.0 - fx)),
        (at + columns + 1, fy * fx),
    ]
}

/// The exposure of a photograph: the gain and the stray light that bring the model's light nearest to it. The laser may
/// drift between photographs.
struct Exposure {
    gain: f32,
    stray: f32,
    misfit: f64,
    /// Σ of the photograph's squares.
    square: f64,
}

impl Exposure {
    fn of(focus: &[Complex32], light: &Array2<f32>) -> Self {
        let [mut n, mut a, mut aa, mut b, mut ab, mut bb] = [0.0f64; 6];
        inside(light, |at, light| {
            let (model, light) = (f64::from(focus[at].norm_sqr()), f64::from(light));
            n += 1.0;
            a += model;
            aa += model * model;
            b += light;
            ab += model * light;
            bb += light * light;
        });
        let variance = (n * aa - a * a).max(f64::MIN_POSITIVE);
        let gain = ((n * ab - a * b) / variance).max(0.0);
        let stray = (b - gain * a) / n;
        let square = bb.max(f64::MIN_POSITIVE);
        let left =
            bb + gain * gain * aa + stray * stray * n - 2.0 * gain * ab - 2.0 * stray * b + 2.0 * gain * stray * a;
        Exposure {
            gain: gain as f32,
            stray: stray as f32,
            misfit: left.max(0.0) / square,
            square,
        }
    }

    /// Returns the gradient of the misfit by the field at the focus. Gain and stray light are at their optimum, so
    /// their own change does not count.
    fn slopes(&self, focus: &[Complex32], light: &Array2<f32>) -> Vec<Complex32> {
        let mut slopes = vec![Complex32::ZERO; focus.len()];
        inside(light, |at, light| {
            let off = self.gain * focus[at].norm_sqr() + self.stray - light;
            slopes[at] = focus[at] * (4.0 * self.gain * off / self.square as f32);
        });
        slopes
    }
}

/// Calls `then` with the index and the value of each pixel that is compared.
fn inside(light: &Array2<f32>, mut then: impl FnMut(usize, f32)) {
    let (height, width) = light.dim();
    for y in BORDER.min(height / 4)..height - BORDER.min(height / 4) {
        for x in BORDER.min(width / 4)..width - BORDER.min(width / 4) {
            then(y * width + x, light[(y, x)]);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::Array3;
    use phasefront::Display;
    use phasefront::target::Illumination;

    const NODES: (usize, usize) = (3, 4);

    fn model() -> ColourModel {
        let wave = |i: usize, by: f32| Complex32::from_polar(1.0 + by * (i % 5) as f32, by * (i % 7) as f32);
        ColourModel {
            curve: std::array::from_fn(|k| 0.15 * (k as f32 * 0.7).sin()),
            crosstalk: [0.01, 0.05, 0.02, 0.1, 0.7, 0.04, 0.0, 0.06, 0.02],
            pupil: (0..PUPIL * PUPIL).map(|i| wave(i, 0.03)).collect(),
            light: (0..12).map(|i| wave(i, 0.02)).collect(),
            undiffracted: (0..12).map(|i| wave(i, 0.1) * 0.05).collect(),
        }
    }

    #[test]
    fn the_gradient_is_that_of_differences() {
        let display = Display::from_toml("width = 30\nheight = 22\nwavelengths_nm = [532]").unwrap();
        let beam = Array3::from_shape_fn((1, 3, 4), |(_, y, x)| 1.0 - 0.05 * (x + y) as f32);
        let target = Target {
            illumination: Some(Illumination::new(beam.view()).unwrap()),
            ..display.into()
        };
        let phases: Vec<f32> = (0..22 * 30).map(|i| 2.0 + (i * 37 % 251) as f32 / 100.0).collect();
        let light = Array2::from_shape_fn((22, 30), |(y, x)| 0.3 + 0.1 * ((x * 3 + y) as f32 * 0.2).sin());
        for z_m in [0.0, 1e-3] {
            let path = Path::new(&target, 0, z_m).unwrap();
            let model = model();
            let (misfit, slopes) = path.gradient(&model, NODES, &phases, &light);
            let expected = path.expected(&model, NODES, &phases, &light);
            assert_eq!(misfit, expected.misfit);
            let values = model.values();
            let steepest = |range: std::ops::Range<usize>| {
                range
                    .max_by(|a, b| slopes[*a].abs().total_cmp(&slopes[*b].abs()))
                    .unwrap()
            };
            let pupil = CURVE + 9..CURVE + 9 + 2 * PUPIL * PUPIL;
            let light_at = pupil.end..pupil.end + 24;
            let rest = light_at.end..values.len();
            for range in [0..CURVE, CURVE..CURVE + 4, CURVE + 5..CURVE + 9, pupil, light_at, rest] {
                let at = steepest(range);
                let of = |by: f32| {
                    let mut moved = values.clone();
                    moved[at] += by;
                    path.expected(&ColourModel::from_values(&moved), NODES, &phases, &light)
                        .misfit
                };
                let difference = (of(4e-3) - of(-4e-3)) / 8e-3;
                let slope = f64::from(slopes[at]);
                assert!(
                    (slope - difference).abs() < 0.02 * difference.abs() + 1e-4,
                    "{at}: {slope} {difference}"
                );
            }
        }
    }

    #[test]
    fn the_exposure_does_not_count() {
        let display = Display::from_toml("width = 30\nheight = 22\nwavelengths_nm = [532]").unwrap();
        let path = Path::new(&display.into(), 0, 1e-3).unwrap();
        let phases: Vec<f32> = (0..22 * 30).map(|i| 2.0 + (i * 37 % 251) as f32 / 100.0).collect();
        let dark = Array2::from_shape_fn((22, 30), |(y, x)| (x + y) as f32);
        let shown = path.expected(&model(), NODES, &phases, &dark).light;
        let brighter = shown.mapv(|v| 0.7 * v + 3.0);
        let misfit = |light: &Array2<f32>| path.expected(&model(), NODES, &phases, light).misfit;
        assert!(
            misfit(&brighter) < 1e-6 && misfit(&dark) > 1e-2,
            "{} {}",
            misfit(&brighter),
            misfit(&dark)
        );
    }
}
