//! `phasefront pattern`: phase maps of one optical element each, to align a bench before the first picture.

use clap::{Args, Subcommand};
use ndarray::Array3;
use phasefront::{Display, Size};
use phasefront_command::flags::DisplayFlags;
use phasefront_command::terminal;
use phasefront_io::hologram::{self, Hologram, HologramInfo};
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Write a phase map that does one thing to light, to align a bench
///
/// The output is a hologram PNG of the modulator's size, for `show`, `pack` and `refocus`.
#[derive(Subcommand)]
pub(crate) enum Pattern {
    /// One phase everywhere: the panel as a mirror
    Flat {
        #[command(flatten)]
        to: To,
    },
    /// A blazed grating, which turns light right, or left if the period is negative
    Grating {
        /// Pixels in which the phase rises by 2π
        #[arg(long, value_name = "PX", default_value_t = 16.0, allow_negative_numbers = true)]
        period: f64,
        #[command(flatten)]
        to: To,
    },
    /// Squares of phase 0 and π, which take the light out of the zero order
    Checkerboard {
        /// Side of a square, pixels
        #[arg(long, value_name = "PX", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=4096))]
        square: u32,
        #[command(flatten)]
        to: To,
    },
    /// A lens
    Lens {
        /// Focal length, mm; positive makes light converge toward the viewer
        #[arg(long, value_name = "F", default_value_t = 500.0, allow_negative_numbers = true)]
        focal_mm: f64,
        #[command(flatten)]
        to: To,
    },
    /// A vortex, whose focus is a ring
    Vortex {
        /// Turns of 2π around the middle
        #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
        charge: i32,
        #[command(flatten)]
        to: To,
    },
}

#[derive(Args)]
pub(crate) struct To {
    #[command(flatten)]
    display: DisplayFlags,
    /// Output hologram: a PNG of modulator levels
    #[arg(short, long, value_name = "OUT.png")]
    output: PathBuf,
}

impl Pattern {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let (Pattern::Flat { to }
        | Pattern::Grating { to, .. }
        | Pattern::Checkerboard { to, .. }
        | Pattern::Lens { to, .. }
        | Pattern::Vortex { to, .. }) = &self;
        output::file(&to.output, &["png"])?;
        let file = to.display.read_with_lens()?;
        let display = &file.target.display;
        self.check(display)?;
        let size @ Size { width, height } = display.size();
        let shape = (display.colours(), height, width);
        let phases = Array3::from_shape_fn(shape, |(colour, y, x)| {
            let middle = |at: usize, of: usize| at as f64 - (of as f64 - 1.0) / 2.0;
            let turns = self.turns((y, x), (middle(y, height), middle(x, width)), display, colour);
            (turns.rem_euclid(1.0) * TAU) as f32
        });
        let levels = hologram::levels_of_phases(phases, &file)?;
        let info = HologramInfo::of_levels(&file);
        hologram::write_hologram(&to.output, &Hologram::Levels(levels, info))?;
        let mrad = self.mrad(display);
        let mut text = format!("{}: {size}", terminal::name(&to.output));
        if let Some(mrad) = &mrad {
            let each: Vec<_> = mrad.iter().map(|mrad| format!("{mrad:.2}")).collect();
            text += &format!(", turns light right by {} mrad", each.join(", "));
        }
        terminal::print(
            json,
            &json!({ "output": to.output, "width": width, "height": height, "mrad": mrad }),
            text,
        );
        Ok(())
    }

    /// Returns the phase in turns at a pixel `(y, x)`, whose place from the middle is `(v, u)`, in pixels.
    ///
    /// Light is exp(+i2πz/λ), so a wave that travels right at the angle θ is exp(i2πx·sin θ/λ), and a wave that
    /// converges at the distance f is exp(−iπ(x² + y²)/(λf)).
    fn turns(&self, (y, x): (usize, usize), (v, u): (f64, f64), display: &Display, colour: usize) -> f64 {
        match self {
            Pattern::Flat { .. } => 0.0,
            Pattern::Grating { period, .. } => x as f64 / period,
            Pattern::Checkerboard { square, .. } => {
                let square = *square as usize;
                ((x / square + y / square) % 2) as f64 / 2.0
            }
            Pattern::Lens { focal_mm, .. } => {
                let squared_m2 = (u * u + v * v) * display.pitch_m().powi(2);
                -squared_m2 / (2.0 * display.wavelengths_m()[colour] * focal_mm / 1e3)
            }
            Pattern::Vortex { charge, .. } => f64::from(*charge) * v.atan2(u) / TAU,
        }
    }

    /// Checks that neighbouring pixels can show the pattern: their phases may differ by half a turn.
    fn check(&self, display: &Display) -> Result<()> {
        match self {
            Pattern::Grating { period, .. } if !(period.abs() >= 2.0 && period.is_finite()) => Err(Error::Usage(
                format!("--period {period}: pixels show periods of 2 or more, or of -2 or less"),
            )),
            Pattern::Lens { focal_mm, .. } => {
                let (size, pitch_m) = (display.size(), display.pitch_m());
                let shortest_m = display.wavelengths_m().iter().copied().fold(f64::INFINITY, f64::min);
                let least_mm = size.width.max(size.height) as f64 * pitch_m.powi(2) / shortest_m * 1e3;
                if focal_mm.is_finite() && focal_mm.abs() >= least_mm {
                    return Ok(());
                }
                Err(Error::Usage(format!(
                    "--focal-mm {focal_mm}: the pixels show lenses of {least_mm:.0} mm or more, or of -{least_mm:.0} mm or less"
                )))
            }
            _ => Ok(()),
        }
    }

    /// Returns the angle by which a grating turns each laser's light, in mrad.
    fn mrad(&self, display: &Display) -> Option<Vec<f64>> {
        let Pattern::Grating { period, .. } = self else {
            return None;
        };
        let angle = |wavelength_m: &f64| (wavelength_m / (period * display.pitch_m())).asin() * 1e3;
        Some(display.wavelengths_m().iter().map(angle).collect())
    }
}
