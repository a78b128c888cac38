//! A simulated display with the flaws of a real one, and a camera in front of it. It takes levels and returns a
//! photograph. The tests and rehearsals of the calibration use it.
//!
//! The modulator is lit by a Gaussian beam, and each pixel has its own phase curve. The Fourier aperture passes the
//! first order, and the optics add an aberration in the pupil. The camera focuses at a z, is slightly rotated, and has
//! shot noise, read noise and a limited number of bits. A seed gives the same results on every machine, except for the
//! last bits of floating-point arithmetic.

mod faults;
mod strays;

use crate::camera::homography::Homography;
use crate::camera::photograph::Photograph;
use crate::curves::curve;
use faults::{Faults, PARTS};
use ndarray::{Array2, ArrayView2};
use num_complex::Complex32;
use phasefront::Display;
use phasefront::Size;
use phasefront::target::{Aberration, Response};
use phasefront_core::display::response::per_pixel;
use phasefront_core::display::response::per_pixel::PerPixel;
use phasefront_core::optics::aperture;
use phasefront_core::optics::asm::{self, Padding, Transfer};
use phasefront_core::optics::fft::{Fft2, frequency};
use phasefront_io::dice::Dice;
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
pub use strays::Strays;

/// The phase curves of pixels: level/255 = v gives 2π·range·(v − steepness·sin(2πv)/2π + bend·v(1 − v)), where range
/// varies over the panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// The mean phase of level 255 over the panel for each colour, in units of 2π.
    pub range: Vec<f64>,
    /// The maximum relative variation of the range over the panel.
    pub unevenness: f64,
    /// The S shape: 0 for straight, below 1.
    pub steepness: f64,
    /// The bow: 0 for straight, within ±0.4 for steepness up to ½.
    pub bend: f64,
}

/// A camera and its position.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// The size of a photograph.
    pub size: Size,
    /// The positions of the modulator's corners in the photograph, in pixels: top left, top right, bottom left, bottom
    /// right.
    pub corners: [[f64; 2]; 4],
    /// The fraction of the sensor's range that full light fills.
    pub exposure: f64,
    /// The number of electrons of a full pixel. Shot noise is the square root of the number of electrons.
    pub full_well: f64,
    /// The read noise, in electrons.
    pub read_noise: f64,
    /// The constant stray light, as a fraction of full light.
    pub stray: f64,
    /// The bits of a value, 8 to 16. Values of more than 8 bits use the upper bits of a 16-bit word.
    pub bits: u32,
}

/// A display with flaws, determined by its seed.
#[derive(Debug, Clone)]
pub struct SimulatedDisplay {
    display: Display,
    seed: u64,
    curves: Curves,
    /// The waves of the smooth map, within ±1, by which the curves vary over the panel.
    waves: Vec<[f64; 5]>,
    /// The centre x and y and the 1/e² intensity radius of the beam, as fractions of the panel's width.
    beam: [f64; 3],
    aberration: Aberration,
    camera: Camera,
    faults: Option<Faults>,
    strays: Strays,
}

impl SimulatedDisplay {
    /// Creates a display with the physical parameters of `display` and flaws that depend on `seed`: curves that differ
    /// from the factory's linear table by more than 0.3 rad, an off-centre beam, and a slightly rotated camera with
    /// `zoom` pixels per modulator pixel. It has no aberration; see [`Self::with_aberration`].
    ///
    /// # Errors
    /// Returns an error if the camera has more than 2³⁰ pixels or the zoom is below 1.
    pub fn new(display: &Display, zoom: f64, seed: u64) -> Result<Self> {
        let mut dice = Dice::new(seed ^ 0x0044_4953_504c_4159);
        let waves = (0..4)
            .map(|_| {
                [
                    dice.range(-0.8, 0.8),
                    dice.range(-0.8, 0.8),
                    dice.range(0.0, TAU),
                    dice.range(0.15, 0.25),
                    dice.range(-0.4, 0.4),
                ]
            })
            .collect();
        let (w, h) = (display.size().width as f64 * zoom, display.size().height as f64 * zoom);
        let border = 0.07 * w;
        let size = |n: f64| (n + 2.0 * border).round();
        if !(zoom >= 1.0 && size(w) * size(h) < f64::from(1u32 << 30)) {
            return Err(Error::Input(format!(
                "a camera that sees a pixel with {zoom} of its own; it must be 1 or more, and the photograph under 2³⁰ pixels"
            )));
        }
        let mut corner = |x: f64, y: f64| {
            let askew = 0.012 * w;
            [
                border + x * w + dice.range(-askew, askew),
                border + y * h + dice.range(-askew, askew),
            ]
        };
        let camera = Camera {
            corners: [corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0)],
            size: Size {
                width: size(w) as usize,
                height: size(h) as usize,
            },
            exposure: 0.55,
            full_well: 20_000.0,
            read_noise: 12.0,
            stray: 2e-4,
            bits: 12,
        };
        // Liquid crystal delays all light by about the same path.
        let range = match display.wavelengths_m() {
            [laser_m] => vec![1.22 * 520e-9 / laser_m],
            _ => vec![1.06, 1.22, 1.38],
        };
        let beam = [dice.range(0.42, 0.58), dice.range(0.42, 0.58), 1.1];
        Ok(SimulatedDisplay {
            display: display.clone(),
            seed,
            curves: Curves {
                range,
                unevenness: 0.1,
                steepness: 0.35,
                bend: 0.15,
            },
            waves,
            beam,
            aberration: Aberration::none(display.colours()),
            camera,
            faults: None,
            strays: Strays::default(),
        })
    }

    /// Adds the aberration that `correction` *corrects*.
    pub fn with_aberration(mut self, correction: Aberration) -> Self {
        self.aberration = correction;
        self
    }

    /// Adds faults whose form no calibration knows: crosstalk between pixels, gaps between them, a ghost, a speckled
    /// aperture, and a laser that drifts from photograph to photograph.
    pub fn with_faults(mut self) -> Self {
        self.faults = Some(Faults::new(self.seed));
        self
    }

    /// Adds light beside the picture's to a display without [faults](Self::with_faults).
    pub fn with_strays(mut self, strays: Strays) -> Self {
        self.strays = strays;
        self
    }

    /// Replaces the curves.
    pub fn with_curves(mut self, curves: Curves) -> Self {
        self.curves = curves;
        self
    }

    /// Replaces the camera.
    pub fn with_camera(mut self, camera: Camera) -> Self {
        self.camera = camera;
        self
    }

    /// Returns the physical parameters of the display.
    pub fn display(&self) -> &Display {
        &self.display
    }

    /// Returns the camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns the curves.
    pub fn curves(&self) -> &Curves {
        &self.curves
    }

    /// Returns the true phase of level `level` at pixel (`x`, `y`) relative to level 0, in radians.
    pub fn phase(&self, colour: usize, y: usize, x: usize, level: f64) -> f64 {
        let u = (x as f64 + 0.5) / self.display.size().width as f64;
        let v = (y as f64 + 0.5) / self.display.size().height as f64;
        let (mut uneven, mut bent) = (0.0, 0.0);
        for [fx, fy, start, height, other] in &self.waves {
            let wave = (TAU * (fx * u + fy * v) + start).sin();
            uneven += height * wave;
            bent += other * wave;
        }
        let c = &self.curves;
        let t = level / 255.0;
        let bend = c.bend * (1.0 + 0.5 * bent);
        let shape = t - c.steepness * (TAU * t).sin() / TAU + bend * t * (1.0 - t);
        TAU * c.range[colour] * (1.0 + c.unevenness * uneven) * shape
    }

    /// Returns the response of a perfect calibration: the table of the true curves, with a node on every pixel of small
    /// displays and 120 nodes along the longer side of large ones.
    ///
    /// # Errors
    /// Never returns an error for a display made by [`Self::new`].
    pub fn response(&self) -> Result<Response> {
        let Size { width, height } = self.display.size();
        let spacing = height.max(width).div_ceil(120);
        let intervals = per_pixel::MAX_INTERVALS;
        let (rows, columns) = per_pixel::nodes(self.display.size(), spacing);
        let (mut levels, mut turns) = (Vec::new(), Vec::new());
        for node in 0..self.display.colours() * rows * columns {
            let (colour, i, j) = (node / (rows * columns), node / columns % rows, node % columns);
            let curve = std::array::from_fn(|level| self.phase(colour, i * spacing, j * spacing, level as f64) as f32);
            let phase = |k: usize| k as f32 / intervals as f32 * std::f32::consts::TAU;
            levels.extend((0..=intervals).map(|k| curve::level_of(&curve, phase(k))));
            let end = std::f32::consts::TAU;
            turns.push(if curve[255] < end {
                0.5 * (curve[255] + end)
            } else {
                end
            });
        }
        let table = PerPixel::new(self.display.size(), spacing, intervals, &levels, &turns)?;
        Ok(Response::PerPixel(table.into()))
    }

    /// Returns the laser's amplitude at pixel (`x`, `y`), which is 1 at its brightest.
    pub fn laser(&self, colour: usize, y: f64, x: f64) -> f64 {
        let w = self.display.size().width as f64;
        let [cx, cy, radius] = self.beam;
        // Three beams are never perfectly coaxial.
        let cx = cx + 0.03 * (colour as f64 - (self.display.colours() / 2) as f64);
        let dx = (x + 0.5) / w - cx;
        let dy = (y + 0.5 - cy * self.display.size().height as f64) / w;
        (-(dx * dx + dy * dy) / (radius * radius)).exp()
    }

    /// Computes the intensity that an ideal camera focused at `z_m` would see of `levels`, (H, W), on a grid twice as
    /// fine, (2H, 2W). Value (i, j) lies at ((j + 1)/2, (i + 1)/2) in pixels of the modulator. The brightest light with
    /// a flat phase gives 1.
    ///
    /// # Errors
    /// Returns an error if the levels have another shape or if z is too far to propagate to.
    pub fn intensity(&self, levels: ArrayView2<'_, u8>, colour: usize, z_m: f64) -> Result<Array2<f32>> {
        let Size { width, height } = self.display.size();
        if levels.dim() != (height, width) {
            return Err(Error::Input(format!(
                "levels of {}×{}; the display has {width}×{height}",
                levels.dim().1,
                levels.dim().0
            )));
        }
        let (pitch, wavelength) = (self.display.pitch_m(), self.display.wavelengths_m()[colour]);
        let distance = z_m - self.display.offset_m();
        let reach = |shift: &f64| shift.abs().ceil() as usize;
        let ghost = self.strays.ghost_shift_px.iter().map(reach).max().unwrap_or_default();
        let more = (self.aberration.reach_m(pitch) / pitch).ceil() as usize + ghost + 8;
        let wider = Size {
            width: width + more,
            height: height + more,
        };
        let padded = asm::padded_size(wider, pitch, wavelength, distance, Padding::Reach)?;
        let Size { width: pw, height: ph } = padded;
        let transfer = Transfer::corrected(padded, pitch, wavelength, distance, |mu, nu| {
            -self.aberration.phase(colour, mu, nu, pitch)
        });
        let spectrum = self.spectrum(levels, colour, padded, |kx, column| {
            transfer.apply(kx, column);
            let fx = frequency(kx, pw);
            for (ky, value) in column.iter_mut().enumerate() {
                let fy = frequency(ky, ph);
                match &self.faults {
                    _ if !aperture::passes(fx, fy, self.display.aperture_radius()) => *value = Complex32::ZERO,
                    Some(faults) => *value *= faults.aperture(fx, fy),
                    None => *value *= self.strays.ghost(colour, fx, fy, pitch, wavelength),
                }
            }
        });
        // Zero padding of the spectrum to twice the samples gives band-limited interpolation.
        let wide = |k: usize, n: usize| if 2 * k < n { k } else { k + n };
        let mut columns = vec![Complex32::ZERO; 4 * ph * pw];
        for (kx, column) in spectrum.chunks_exact(ph).enumerate() {
            let to = &mut columns[wide(kx, pw) * 2 * ph..][..2 * ph];
            for (ky, value) in column.iter().enumerate() {
                to[wide(ky, ph)] = *value;
            }
        }
        let fine = Fft2::new(
            Size {
                width: 2 * width,
                height: 2 * height,
            },
            Size {
                width: 2 * pw,
                height: 2 * ph,
            },
        );
        let mut scratch = fine.scratch();
        fine.columns_inverse(&mut columns, |_, _| {}, &mut scratch.work);
        fine.rows_inverse(&columns, &mut scratch.rows, &mut scratch.work);
        Ok(Array2::from_shape_fn((2 * height, 2 * width), |(y, x)| {
            scratch.rows[y * 2 * pw + x].norm_sqr()
        }))
    }

    /// Returns the spectrum of the field at the modulator on a padded plane of (H', W') = `padded`, (W', H'). Each
    /// column is passed to `filter` with its index.
    fn spectrum(
        &self,
        levels: ArrayView2<'_, u8>,
        colour: usize,
        Size { width: pw, height: ph }: Size,
        filter: impl Fn(usize, &mut [Complex32]) + Sync,
    ) -> Vec<Complex32> {
        let (height, width) = levels.dim();
        let phase = |y: usize, x: usize| self.phase(colour, y, x, levels[(y, x)].into());
        let light = |y: usize, x: usize| self.laser(colour, y as f64, x as f64);
        let Some(faults) = &self.faults else {
            let mut plane = vec![Complex32::ZERO; height * width];
            plane.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
                for (x, value) in row.iter_mut().enumerate() {
                    let lit = self.strays.modulated(colour, phase(y, x)) * light(y, x);
                    *value = Complex32::new(lit.re as f32, lit.im as f32);
                }
            });
            let fft = Fft2::new(Size { width, height }, Size { width: pw, height: ph });
            let mut scratch = fft.scratch();
            fft.rows_forward(&plane, &mut scratch.rows, &mut scratch.work);
            let then = |kx: usize, column: &mut [Complex32], _: &mut [Complex32]| filter(kx, column);
            fft.spectrum(&scratch.rows, &mut scratch.columns, then, &mut scratch.work);
            return scratch.columns;
        };
        let plane = faults.field(Size { width, height }, phase, light);
        let fft = Fft2::new(
            Size {
                width: width * PARTS,
                height: height * PARTS,
            },
            Size {
                width: pw * PARTS,
                height: ph * PARTS,
            },
        );
        let mut scratch = fft.scratch();
        fft.rows_forward(&plane, &mut scratch.rows, &mut scratch.work);
        fft.spectrum(&scratch.rows, &mut scratch.columns, |_, _, _| (), &mut scratch.work);
        // The aperture passes the frequencies of whole pixels alone. Their phase is taken at the middle of a pixel.
        let of = |k: usize, n: usize| if 2 * k < n { k } else { k + (PARTS - 1) * n };
        let middle = |k: usize, n: usize| PI * frequency(k, n) * (PARTS - 1) as f64 / PARTS as f64;
        let mut columns = vec![Complex32::ZERO; ph * pw];
        columns.par_chunks_exact_mut(ph).enumerate().for_each(|(kx, column)| {
            let fine = &scratch.columns[of(kx, pw) * ph * PARTS..][..ph * PARTS];
            for (ky, value) in column.iter_mut().enumerate() {
                let turn = Complex32::from_polar(1.0, (middle(kx, pw) + middle(ky, ph)) as f32);
                *value = fine[of(ky, ph)] * turn / (PARTS * PARTS) as f32;
            }
            filter(kx, column);
        });
        columns
    }

    /// Takes a photograph of `levels`, (H, W), lit in one colour, with the camera focused at `z_m`. `shot` seeds the
    /// noise of the photograph.
    ///
    /// # Errors
    /// Returns the errors of [`Self::intensity`].
    pub fn photograph(&self, levels: ArrayView2<'_, u8>, colour: usize, z_m: f64, shot: u64) -> Result<Photograph> {
        let fine = self.intensity(levels, colour, z_m)?;
        let power = self.faults.as_ref().map_or(1.0, |faults| faults.power(shot));
        let (rows, columns) = fine.dim();
        let at = |y: isize, x: isize| match (y, x) {
            (0.., 0..) if (y as usize) < rows && (x as usize) < columns => f64::from(fine[(y as usize, x as usize)]),
            _ => 0.0,
        };
        self.expose(colour, shot, |x, y| {
            let (x, y) = (2.0 * x - 1.0, 2.0 * y - 1.0);
            let (x0, y0) = (x.floor(), y.floor());
            let (fx, fy) = (x - x0, y - y0);
            let (x0, y0) = (x0 as isize, y0 as isize);
            let top = at(y0, x0) * (1.0 - fx) + at(y0, x0 + 1) * fx;
            let bottom = at(y0 + 1, x0) * (1.0 - fx) + at(y0 + 1, x0 + 1) * fx;
            power * (top * (1.0 - fy) + bottom * fy)
        })
    }

    /// Takes a photograph of a diffuser in the modulator's place, lit in one colour: the beam with speckle and specks
    /// of dust.
    ///
    /// # Errors
    /// Never returns an error for a display made by [`Self::new`].
    pub fn photograph_diffuser(&self, colour: usize, shot: u64) -> Result<Photograph> {
        let Size { width, height } = self.display.size();
        let mut dice = Dice::new(self.seed ^ 0x4455_5354);
        let specks: Vec<_> = (0..40)
            .map(|_| (dice.range(0.0, width as f64), dice.range(0.0, height as f64)))
            .collect();
        self.expose(colour, shot, |x, y| {
            let inside = (0.0..width as f64).contains(&x) && (0.0..height as f64).contains(&y);
            let dusty = specks.iter().any(|(u, v)| (u - x).hypot(v - y) < 0.6);
            if !inside || dusty {
                return 0.0;
            }
            self.laser(colour, y - 0.5, x - 0.5).powi(2)
        })
    }

    /// Converts an intensity over the modulator, `light`(x, y), in pixels from its top left corner, to a photograph.
    fn expose(&self, colour: usize, shot: u64, light: impl Fn(f64, f64) -> f64 + Sync) -> Result<Photograph> {
        let camera = &self.camera;
        let Size { width, height } = camera.size;
        let (w, h) = (self.display.size().width as f64, self.display.size().height as f64);
        let panel = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]];
        let back = Homography::through(camera.corners, panel)?;
        let end = f64::from((1u32 << camera.bits) - 1);
        let shift = if camera.bits > 8 { 16 - camera.bits } else { 0 };
        let mut values = vec![0; height * width];
        let rows = values.par_chunks_exact_mut(width).enumerate();
        rows.for_each(|(row, values)| {
            let mut dice = Dice::new(
                self.seed ^ (shot << 24 | (colour as u64) << 20 | row as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15),
            );
            for (column, value) in values.iter_mut().enumerate() {
                let [x, y] = back.map([column as f64 + 0.5, row as f64 + 0.5]);
                let electrons = (light(x, y) + camera.stray) * camera.exposure * camera.full_well;
                // Shot noise and read noise are one normal random number, because there are many electrons.
                let noise = (electrons + camera.read_noise.powi(2)).sqrt();
                let counted = electrons + noise * normal(&mut dice);
                let code = (counted / camera.full_well * end).round().clamp(0.0, end);
                *value = (code as u16) << shift;
            }
        });
        Ok(Photograph {
            height,
            width,
            values,
            full: if camera.bits > 8 { 65535 } else { 255 },
        })
    }
}

/// Returns a standard normal random number (Box and Muller, 1958).
pub(crate) fn normal(dice: &mut Dice) -> f64 {
    let radius = (-2.0 * (1.0 - dice.unit()).ln()).sqrt();
    radius * (2.0 * PI * dice.unit()).cos()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use phasefront_core::optics::aperture::{Aperture, Opening};

    fn small() -> SimulatedDisplay {
        let display = Display::from_toml("width = 48\nheight = 40").unwrap();
        SimulatedDisplay::new(&display, 2.0, 5).unwrap()
    }

    #[test]
    fn a_seed_is_one_photograph() {
        let levels = Array2::from_shape_fn((40, 48), |(y, x)| (y * 5 + x) as u8);
        let shoot = |shot| small().photograph(levels.view(), 1, 1e-3, shot).unwrap();
        assert_eq!(shoot(3), shoot(3));
        assert_ne!(shoot(3), shoot(4));
    }

    #[test]
    fn curves_rise_and_leave_the_linear_table_wrong() {
        let display = small();
        let mut square = 0.0;
        for (y, x) in [(0, 0), (20, 20), (39, 47), (5, 40)] {
            for level in 0..255 {
                let (here, next) = (
                    display.phase(0, y, x, level.into()),
                    display.phase(0, y, x, f64::from(level) + 1.0),
                );
                assert!(next > here);
                let apart = here - TAU * f64::from(level) / 256.0;
                square += (TAU * (apart / TAU - (apart / TAU).round())).powi(2);
            }
        }
        let rms = (square / (4.0 * 255.0)).sqrt();
        assert!(rms > 0.3, "{rms}");
    }

    /// At the modulator and without noise, the fine grid between two samples of the filtered field equals that field.
    #[test]
    fn the_intensity_is_that_of_the_filtered_field() {
        let display = small();
        let levels = Array2::from_shape_fn((40, 48), |(y, x)| if (x + y) % 2 == 0 { 90 } else { 0 });
        let fine = display.intensity(levels.view(), 1, 0.0).unwrap();
        // Away from the border, zero padding and a periodic plane agree.
        let mut plane: Vec<_> = (0..40 * 48)
            .map(|i| {
                let (y, x) = (i / 48, i % 48);
                let phase = display.phase(1, y, x, levels[(y, x)].into());
                Complex32::from_polar(display.laser(1, y as f64, x as f64) as f32, phase as f32)
            })
            .collect();
        let plan = Aperture::new(Size { width: 48, height: 40 }, Opening::centred(1.0)).unwrap();
        plan.filter(&mut plane, &mut plan.scratch());
        for y in 12..28 {
            for x in 12..36 {
                let (a, b) = (fine[(2 * y, 2 * x)], plane[y * 48 + x].norm_sqr());
                assert!((a - b).abs() < 0.03, "{y} {x}: {a} {b}");
            }
        }
    }

    /// Without the faults' own part, a display with faults shows almost what one without shows.
    #[test]
    fn faults_change_the_light_but_not_its_place() {
        let (plain, faulty) = (small(), small().with_faults());
        let levels = Array2::from_shape_fn((40, 48), |(y, x)| if (12..28).contains(&y) && x > 20 { 90 } else { 0 });
        let levels = Array2::from_shape_fn((40, 48), |(y, x)| if (x + y) % 2 == 0 { levels[(y, x)] } else { 0 });
        for z_m in [0.0, 1e-3] {
            let [a, b] = [&plain, &faulty].map(|of| of.intensity(levels.view(), 1, z_m).unwrap());
            let (mean_a, mean_b) = (a.mean().unwrap(), b.mean().unwrap());
            let together = (&a - mean_a) * (&b - mean_b);
            let alike =
                together.sum() / ((&a - mean_a).mapv(|v| v * v).sum() * (&b - mean_b).mapv(|v| v * v).sum()).sqrt();
            assert!((0.8..0.995).contains(&alike), "{alike}");
        }
        let [one, other] = [3, 14].map(|shot| faulty.photograph(levels.view(), 1, 0.0, shot).unwrap());
        let sum = |photo: &Photograph| photo.values.iter().map(|v| f64::from(*v)).sum::<f64>();
        assert!((sum(&one) / sum(&other) - 1.0).abs() > 0.01);
    }

    #[test]
    fn the_camera_saturates_and_has_its_bits() {
        let mut camera = small().camera().clone();
        (camera.exposure, camera.bits) = (3.0, 12);
        let bright = small().with_camera(camera.clone());
        let flat = Array2::zeros((40, 48));
        let photo = bright.photograph(flat.view(), 0, 0.0, 0).unwrap();
        assert!(photo.saturated() > 0.1);
        assert!(photo.values.iter().all(|v| v % 16 == 0));
        (camera.exposure, camera.bits) = (0.5, 8);
        let photo = small().with_camera(camera).photograph(flat.view(), 0, 0.0, 0).unwrap();
        assert_eq!((photo.full, photo.saturated()), (255, 0.0));
        let middle = f64::from(photo.sample(photo.width as f64 / 2.0, photo.height as f64 / 2.0));
        assert!((middle / 255.0 - 0.5).abs() < 0.05, "{middle}");
    }
}
