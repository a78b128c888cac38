//! The light in the focal plane of a lens, whose front focal plane holds the modulator.
//!
//! With u the light at the modulator and f the focal length, the light at X, z behind the focal plane toward the
//! viewer, is
//!
//!   U(X, z) = ∫ u(x)·exp(−iπz·x²/(λf²))·exp(−i2πx·X/(λf)) dx,
//!
//! without constant phases: the lens transforms (Goodman, Introduction to Fourier Optics), and z is a lens in the plane
//! of the modulator, because a wave's part of the frequency −x/(λf) comes from x. Light that travels right at the
//! modulator arrives at the right, so that the picture is not mirrored.
//!
//! Pixels of the pitch p repeat the light every λf/p, the laser's field. A pixel fills its square, so that the light
//! falls towards the edges of the field as sinc(X·p/(λf)) along each axis.

use crate::Size;
use crate::display::Display;
use crate::optics::zoom::Zoom;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use num_complex::{Complex32, Complex64};
use std::f64::consts::PI;

/// The part of the field that is free beside the zero order and its copies that the picture takes at most.
const FILL: f64 = 0.9;
/// The number of columns that are transposed at a time.
const COLUMNS: usize = 8;

/// A lens in whose focal plane the picture lies. Its pixels are those of the modulator in number, and alike for all
/// lasers in size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    focal_m: f64,
    centre_m: [f64; 2],
    pixel_m: f64,
}

impl Lens {
    /// Returns the lens of the focal length `focal_m` for `display`. The carrier moves the middle of the picture from
    /// the zero order, right and down: by the focal length times the sine of each of `carrier_rad`.
    ///
    /// The picture is the largest that the field of every laser holds beside the zero order: its pixels have the size
    /// 0.9·min((F − 2|X₀|)/W, (F − 2|Y₀|)/H), where F is the field of the shortest wave and (X₀, Y₀) the middle.
    ///
    /// # Errors
    /// Returns an error if the focal length does not lie in 1 mm to 100 m, or if the carrier leaves no room.
    pub fn new(focal_m: f64, carrier_rad: [f64; 2], display: &Display) -> Result<Self> {
        if !(1e-3..=100.0).contains(&focal_m) {
            return Err(Error::Display(format!(
                "focal_mm is {}; it must lie in 1..=100000",
                focal_m * 1e3
            )));
        }
        let shortest_m = display.wavelengths_m().iter().copied().fold(f64::INFINITY, f64::min);
        let field_m = shortest_m * focal_m / display.pitch_m();
        let centre_m = carrier_rad.map(|angle| focal_m * angle.sin());
        let Size { width, height } = display.size();
        let free = |middle_m: f64, pixels: usize| (field_m - 2.0 * middle_m.abs()) / pixels as f64;
        let pixel_m = FILL * free(centre_m[0], width).min(free(centre_m[1], height));
        if pixel_m < 0.01 * field_m / width.max(height) as f64 {
            let most = (shortest_m / (2.0 * display.pitch_m())).asin() * 1e3;
            return Err(Error::Display(format!(
                "carrier_mrad leaves no room for a picture; each must lie well within ±{most:.1}"
            )));
        }
        Ok(Lens {
            focal_m,
            centre_m,
            pixel_m,
        })
    }

    /// Returns the carrier that moves the picture up, beside the zero order: a quarter of the field of the shortest
    /// wave.
    pub fn default_carrier_rad(display: &Display) -> [f64; 2] {
        let shortest_m = display.wavelengths_m().iter().copied().fold(f64::INFINITY, f64::min);
        [0.0, -(shortest_m / (4.0 * display.pitch_m())).asin()]
    }

    /// Returns the focal length in metres.
    pub fn focal_m(&self) -> f64 {
        self.focal_m
    }

    /// Returns the place of the picture's middle from the zero order, right and down, in metres.
    pub fn centre_m(&self) -> [f64; 2] {
        self.centre_m
    }

    /// Returns the size of a pixel of the picture, in metres.
    pub fn pixel_m(&self) -> f64 {
        self.pixel_m
    }

    /// Returns the side of the field of the wavelength `wavelength_m`, λf/p, in metres.
    pub fn field_m(&self, wavelength_m: f64, display: &Display) -> f64 {
        wavelength_m * self.focal_m / display.pitch_m()
    }

    /// Returns the size of a pixel of the picture over the field of the wavelength `wavelength_m`: the turns of the
    /// phase from a pixel of the modulator to the next for light of one pixel more.
    pub fn spacing(&self, wavelength_m: f64, display: &Display) -> f64 {
        self.pixel_m / self.field_m(wavelength_m, display)
    }
}

/// A plan for the light of one laser in the focal plane. It is immutable and can be shared between threads.
pub struct LensPlan {
    width: usize,
    height: usize,
    across: Lines,
    down: Lines,
}

/// The lines of a plane along one axis.
struct Lines {
    zoom: Zoom,
    /// The amplitude of the light of a pixel at each place of the picture, with the factor that keeps light.
    envelope: Vec<f32>,
    /// The phase over a metre of z at each place of the modulator, in radians.
    phase_per_m: Vec<f64>,
}

impl LensPlan {
    /// Plans the light of laser `colour` of `display`, over all of its modulator.
    pub fn new(lens: &Lens, display: &Display, colour: usize) -> Self {
        let Size { width, height } = display.size();
        let (pitch_m, wavelength_m) = (display.pitch_m(), display.wavelengths_m()[colour]);
        let spacing = lens.spacing(wavelength_m, display);
        let lines = |pixels: usize, centre_m: f64| {
            let place = |at: usize| at as f64 - (pixels as f64 - 1.0) / 2.0;
            let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
            let in_field = |at| (place(at) * lens.pixel_m + centre_m) / lens.field_m(wavelength_m, display);
            let per_m = |at| -PI * (place(at) * pitch_m / lens.focal_m).powi(2) / wavelength_m;
            Lines {
                zoom: Zoom::new(pixels, spacing),
                envelope: (0..pixels)
                    .map(|at| (spacing.sqrt() * sinc(in_field(at))) as f32)
                    .collect(),
                phase_per_m: (0..pixels).map(per_m).collect(),
            }
        };
        LensPlan {
            width,
            height,
            across: lines(width, lens.centre_m[0]),
            down: lines(height, lens.centre_m[1]),
        }
    }

    /// Turns the light at the modulator, `plane` (H, W), into that of the picture's pixels at `z_m` from the focal
    /// plane. The panel's carrier is left out, and the picture lies where it brings it. Light of the amplitude 1 that
    /// is spread evenly over the picture has the amplitude 1.
    ///
    /// # Panics
    /// Panics if `plane` does not have H·W values.
    pub fn to_picture(&self, plane: &mut [Complex32], z_m: f64) {
        self.both(plane, |lines, line, work| lines.to_picture(z_m, line, work));
    }

    /// Applies the adjoint of [`Self::to_picture`].
    ///
    /// # Panics
    /// Panics if `plane` does not have H·W values.
    pub fn to_modulator(&self, plane: &mut [Complex32], z_m: f64) {
        self.both(plane, |lines, line, work| lines.to_modulator(z_m, line, work));
    }

    /// Applies `of` to all rows and then to all columns of `plane`.
    fn both(&self, plane: &mut [Complex32], of: impl Fn(&Lines, &mut [Complex32], &mut [Complex32]) + Sync) {
        let (width, height) = (self.width, self.height);
        assert_eq!(plane.len(), width * height);
        let pass = |lines: &Lines, plane: &mut [Complex32], length: usize| {
            let all = plane.par_chunks_exact_mut(length);
            all.for_each_init(|| lines.zoom.work(), |work, line| of(lines, line, work));
        };
        pass(&self.across, plane, width);
        let mut columns = transposed(plane, width);
        pass(&self.down, &mut columns, height);
        plane.copy_from_slice(&transposed(&columns, height));
    }
}

/// Returns `plane`, whose rows have `width` values, with rows and columns exchanged.
fn transposed(plane: &[Complex32], width: usize) -> Vec<Complex32> {
    let height = plane.len() / width;
    let mut columns = vec![Complex32::ZERO; plane.len()];
    columns
        .par_chunks_mut(COLUMNS * height)
        .enumerate()
        .for_each(|(block, columns)| {
            for (y, row) in plane.chunks_exact(width).enumerate() {
                for (x, column) in columns.chunks_exact_mut(height).enumerate() {
                    column[y] = row[block * COLUMNS + x];
                }
            }
        });
    columns
}

impl Lines {
    fn to_picture(&self, z_m: f64, line: &mut [Complex32], work: &mut [Complex32]) {
        self.defocus(z_m, line);
        self.zoom.transform(line, work);
        self.dim(line);
    }

    fn to_modulator(&self, z_m: f64, line: &mut [Complex32], work: &mut [Complex32]) {
        self.dim(line);
        self.zoom.adjoint(line, work);
        self.defocus(-z_m, line);
    }

    fn dim(&self, line: &mut [Complex32]) {
        for (value, envelope) in line.iter_mut().zip(&self.envelope) {
            *value *= envelope;
        }
    }

    /// Multiplies the light at the modulator by the lens that moves the plane of focus from `z_m` to the focal plane.
    fn defocus(&self, z_m: f64, line: &mut [Complex32]) {
        if z_m == 0.0 {
            return;
        }
        for (value, per_m) in line.iter_mut().zip(&self.phase_per_m) {
            let turn = Complex64::cis(z_m * per_m);
            *value *= Complex32::new(turn.re as f32, turn.im as f32);
        }
    }
}
