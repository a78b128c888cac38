//! `phasefront encode`: makes a phase-only hologram of a complex field that comes from elsewhere.

use crate::flags::encoder::EncoderFlags;
use crate::flags::outputs::OutputFlags;
use crate::make::HologramResult;
use crate::make::field::{self, Stage};
use clap::Args;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::Size;
use phasefront::input::RgbEncoding;
use phasefront::{Brightness, EncoderOptions};
use phasefront_command::flags::DisplayFlags;
use phasefront_core::pipeline;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_core::view::colours::ViewColours;
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::{self, HologramInfo};
use phasefront_io::{Error, Result, output};
use std::path::PathBuf;
use std::time::Instant;

/// Make a phase-only hologram of your own complex field
///
/// The field is a NumPy array, complex64 or complex128, (H, W) for one laser or (C, H, W) for C lasers, red first. It
/// propagates from its z to the modulator, is corrected for the display's optics, and is encoded.
#[derive(Args)]
pub(crate) struct Encode {
    /// The complex field
    #[arg(value_name = "FIELD.npy")]
    field: PathBuf,
    /// z of the field from the middle of the volume, mm [default: 0; a field of --complex, with its .json beside it, is
    /// at the modulator and corrected already]
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    z_mm: Option<f64>,
    #[command(flatten)]
    display: DisplayFlags,
    #[command(flatten)]
    encoder: EncoderFlags,
    /// Amplitude that full light stands for [default: the largest of the field]
    #[arg(long, value_name = "A", help_heading = "Expert")]
    scale: Option<f32>,
    #[command(flatten)]
    outputs: OutputFlags,
    /// Also write the phases of the modulator, float32 in radians, (C, H, W), before they become levels
    #[arg(long, value_name = "FILE.npy", help_heading = "Output")]
    phases: Option<PathBuf>,
    /// Output: a PNG of modulator levels
    #[arg(short, long, value_name = "OUT.png")]
    output: PathBuf,
}

impl Encode {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::file(&self.output, &["png"])?;
        (self.phases.iter()).try_for_each(|path| output::file(path, &["npy"]))?;
        let display = self.display.read()?;
        self.outputs.declare(&display)?;
        self.encoder.check_focus(false)?;
        let encoder = self.encoder.read()?;
        let start = Instant::now();
        let field = hologram::read_field(&self.field, &display)?;
        let target = display.corrected()?;
        let (_, height, width) = field.dim();
        let values = field.as_slice().expect("standard layout");
        pipeline::field::check(values, Size { width, height }, &target).map_err(|e| Error::file(&self.field, e))?;
        if is_phase_map(values) {
            log::warn!(
                "{}: its amplitude is the same everywhere, as of exp(iφ); encode makes other levels than those of φ. For a phase map give it to `pack`, `refocus` or `show` with --display",
                self.field.display()
            );
        }
        let stage = Stage {
            name: "field",
            time: start.elapsed(),
        };
        let said = self.said(&display)?;
        let is_at_modulator = self.z_mm.is_none() && said.is_some();
        let z_m = match is_at_modulator {
            true => target.display.offset_m(),
            false => self.z_mm.unwrap_or(0.0) / 1e3,
        };
        let options = EncoderOptions {
            brightness: self.scale.map_or(Brightness::FrameMax, Brightness::Fixed),
            ..encoder.options.clone()
        };
        let plan = DisplayPlan::from_z(Size { width, height }, z_m, &target, &options)?;
        if let Some(path) = &self.phases {
            hologram::write_phases(path, phases(&plan, field.clone(), is_at_modulator).view())?;
        }
        let encoding = field::Encoding {
            plan: &plan,
            display: &target.display,
            encoder,
            is_at_modulator,
            keeps_field: self.outputs.need_field(),
        };
        let made = HologramResult {
            // Light that nothing is said of is seen as it looks.
            view_colours: said.map_or_else(
                || ViewColours::new(RgbEncoding::Srgb, &target.display),
                |info| info.view_colours(),
            ),
            ..encoding.of(field, stage)
        };
        self.outputs.finish(&self.output, &display, &made, None, None, json)
    }

    /// Returns what the `.json` beside the field says, as `--complex` writes it for a field at the modulator.
    fn said(&self, display: &DisplayFile) -> Result<Option<HologramInfo>> {
        if !self.field.with_extension("json").is_file() {
            return Ok(None);
        }
        let hologram = hologram::read_hologram(&self.field)?;
        hologram
            .check_display(display)
            .map_err(|e| Error::file(&self.field, e))?;
        Ok(Some(hologram.info().clone()))
    }
}

/// Checks whether `field` has one amplitude and several phases.
fn is_phase_map(field: &[Complex32]) -> bool {
    let first = field.first().copied().unwrap_or_default();
    let one = |value: &Complex32| (value.norm() - first.norm()).abs() <= 1e-4 * first.norm();
    field.iter().all(one) && field.iter().any(|value| (value - first).norm() > 0.1 * first.norm())
}

/// Returns the phases of `field`, (C, H, W), in radians.
fn phases(plan: &DisplayPlan, mut field: Array3<Complex32>, is_at_modulator: bool) -> Array3<f32> {
    let mut scratch = plan.scratch();
    let mut phases = Array3::zeros(field.dim());
    let values = field.as_slice_mut().expect("standard layout");
    if !is_at_modulator {
        plan.propagate(values, &mut scratch);
    }
    let out = phases.as_slice_mut().expect("standard layout");
    plan.phases(None, values, out, &mut scratch);
    phases
}
