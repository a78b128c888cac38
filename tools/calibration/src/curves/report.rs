//! Numerical reports and charts of calibrated curves.

use crate::curves::chart::{self, Curve, Map, Panel};
use crate::curves::curve::{self, Basis, LEVELS};
use crate::curves::lut::{self, Curves, Errors};
use ndarray::Array2;
use phasefront::Size;
use phasefront_core::display::response::per_pixel::PerPixel;
use phasefront_io::Result;
use serde::Serialize;
use std::f32::consts::TAU;
use std::path::Path;

/// The results for one colour.
#[derive(Debug, Clone, Serialize)]
pub struct ColourReport {
    /// The name of the colour: "red", "green", "blue" or "laser".
    pub colour: &'static str,
    /// The phase of level 255, in units of 2π: minimum, median and maximum over the modulator.
    pub range_turns: [f32; 3],
    /// The fraction of pixels that do not reach 2π.
    pub under_two_pi: f64,
    /// The fraction of pixels whose light passed no minimum, so that their range is about π or less.
    pub under_pi: f64,
    /// The number of unresponsive pixels. Their curves come from their neighbours.
    pub silent_pixels: usize,
    /// The first unresponsive pixels, (x, y).
    pub silent_at: Vec<[usize; 2]>,
    /// The RMS residual of the fits, relative to the light's amplitude.
    pub residual: f64,
    /// The number of photograph pixels per modulator pixel.
    pub zoom: f64,
    /// The phase errors of the tables according to the measured curves, in radians.
    pub errors_rad: Errors,
}

/// The results for all colours and their table.
#[derive(Debug, Clone, Serialize)]
pub struct LutReport {
    /// The results for each colour.
    pub colours: Vec<ColourReport>,
    /// The size of the compact table's file, in bytes.
    pub table_bytes: usize,
    /// The size of a full table of 256 levels for each pixel and colour, in bytes.
    pub full_bytes: usize,
    /// The spacing of the table's nodes, in pixels.
    pub spacing: usize,
    /// The number of phase intervals of the table.
    pub intervals: usize,
}

/// Computes the report for these curves and their table.
pub fn report(curves: &[Curves], table: &PerPixel) -> LutReport {
    let colours = curves.iter().enumerate().map(|(index, curves)| {
        let ranges = curves.ranges();
        let under = ranges.partition_point(|r| *r < 1.0);
        let residuals = curves.residual.iter().filter(|r| !r.is_nan());
        let (sum, count) = residuals.fold((0.0, 0.0), |(s, n), r| (s + f64::from(r * r), n + 1.0));
        ColourReport {
            colour: curves.colour,
            range_turns: [ranges[0], ranges[ranges.len() / 2], ranges[ranges.len() - 1]],
            under_two_pi: under as f64 / ranges.len() as f64,
            under_pi: curves.under_pi,
            silent_pixels: curves.silent.len(),
            silent_at: curves.silent.iter().take(20).map(|(y, x)| [*x, *y]).collect(),
            residual: (sum / f64::max(count, 1.0)).sqrt(),
            zoom: curves.zoom,
            errors_rad: lut::errors(curves, index, table),
        }
    });
    let Size { width, height } = table.size();
    LutReport {
        colours: colours.collect(),
        table_bytes: table.to_bytes().len(),
        full_bytes: curves.len() * height * width * LEVELS,
        spacing: table.spacing(),
        intervals: table.intervals(),
    }
}

impl LutReport {
    /// Formats the report as text.
    pub fn text(&self) -> String {
        let mut text = String::from(
            "colour  range/2π least median most   <2π %   <π %  silent  residual   phase error, rad RMS: linear    full  compact  compact−full (99.9 %)\n",
        );
        for c in &self.colours {
            let [least, median, most] = c.range_turns;
            let e = &c.errors_rad;
            text.push_str(&format!(
                "{:<14} {least:>8.3} {median:>6.3} {most:>5.3} {:>7.1} {:>6.1} {:>7} {:>9.4} {:>29.3} {:>7.4} {:>8.4} {:>9.4} ({:.3})\n",
                c.colour,
                c.under_two_pi * 100.0,
                c.under_pi * 100.0,
                c.silent_pixels,
                c.residual,
                e.linear_rms,
                e.full_rms,
                e.compact_rms,
                e.between_rms,
                e.between_most,
            ));
        }
        text.push_str(&format!(
            "table: {} kB, a full one {:.0} MB",
            self.table_bytes.div_ceil(1000),
            self.full_bytes as f64 / 1e6
        ));
        text
    }
}

/// Draws the curves of a few pixels with their measurements, the residuals, and the maps of range and residual. Writes
/// `curves.svg`, `residuals.svg` and `maps.svg` in `folder`.
///
/// # Errors
/// Returns an error if a file cannot be written.
pub fn draw(curves: &[Curves], folder: &Path) -> Result<()> {
    let basis = Basis::new();
    let (mut fits, mut residuals, mut maps) = (Vec::new(), Vec::new(), Vec::new());
    for curves in curves {
        let name = curves.colour;
        let along = |values: &[f32]| -> Vec<(f64, f64)> {
            (values.iter().enumerate())
                .map(|(k, v)| (k as f64, f64::from(*v)))
                .collect()
        };
        let (mut lines, mut left) = (Vec::new(), Vec::new());
        for ((y, x), light) in &curves.samples {
            let Some(fitted) = curves.curve(&basis, *y, *x) else {
                continue;
            };
            if let Some((bare, _)) = curve::unfolded(light, curves.dark) {
                lines.push(Curve {
                    name: String::new(),
                    points: along(&bare),
                    dots: true,
                });
                let apart: Vec<f32> = bare.iter().zip(&fitted).map(|(a, b)| a - b).collect();
                left.push(Curve {
                    name: format!("({x}, {y})"),
                    points: along(&apart),
                    dots: true,
                });
            }
            lines.push(Curve {
                name: format!("({x}, {y})"),
                points: along(&fitted),
                dots: false,
            });
        }
        let panel = |title: String, y, curves| Panel {
            title,
            x: "level",
            y,
            curves,
        };
        fits.push(panel(format!("{name}: Eq. 12–13 (dots) and fits"), "phase, rad", lines));
        residuals.push(panel(format!("{name}: Eq. 12–13 less the fit"), "phase, rad", left));
        let range = Array2::from_shape_fn(curves.size().shape(), |at| {
            curves.coefficients[at].last().copied().unwrap_or(f32::NAN) / TAU
        });
        maps.push(Map {
            title: format!("{name}: range/2π"),
            values: range,
        });
    }
    for curves in curves {
        maps.push(Map {
            title: format!("{}: residual", curves.colour),
            values: curves.residual.clone(),
        });
    }
    let across = curves.len();
    chart::write_curves(&folder.join("curves.svg"), &fits, across)?;
    chart::write_curves(&folder.join("residuals.svg"), &residuals, across)?;
    chart::write_maps(&folder.join("maps.svg"), &maps, across)
}
