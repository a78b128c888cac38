//! `phasefront calibrate rehearse`: all calibrations on a simulated display.

use clap::Args;
use phasefront::Display;
use phasefront::Size;
use phasefront_calibration::colours;
use phasefront_calibration::rehearse::learned::JUDGED;
use phasefront_calibration::rehearse::{self, Rehearsal};
use phasefront_command::flags::{OverwriteFlag, check_used, parse_size};
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::output;
use phasefront_io::{Error, Result};
use std::path::PathBuf;

/// Rehearse a calibration on a simulated display with a simulated camera
///
/// Writes the files of the calibration, a display.toml that refers to them, outcome.json, photographs and drawings.
#[derive(Args)]
pub(crate) struct Rehearse {
    /// Size of the modulator
    #[arg(long, value_name = "WxH", default_value = "320x180", value_parser = parse_size)]
    size: Size,
    /// Rehearse with one laser of this wavelength instead of three
    #[arg(long, value_name = "NM")]
    laser_nm: Option<f64>,
    /// Number of camera pixels across one pixel of the modulator
    #[arg(long, value_name = "Z", default_value_t = 2.5)]
    zoom: f64,
    /// Seed of the display's flaws and the camera's noise
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// z of the focused spot, mm
    #[arg(long, value_name = "Z", default_value_t = 12.0, allow_negative_numbers = true)]
    spot_z_mm: f64,
    /// Keep all photographs, as input for `calibrate lut` and `calibrate laser`
    #[arg(long)]
    captures: bool,
    /// Give the display faults that no calibration knows, and learn a model of them from so many photographs; needs
    /// --laser-nm, and room for larger marks: --size 400x240
    #[arg(long, value_name = "N,N", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(4..=1000))]
    learn: Vec<u16>,
    /// Output folder
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

impl Rehearse {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let Size { width, height } = self.size;
        check_used(&[("--learn", !self.learn.is_empty(), self.laser_nm.is_some(), "--laser-nm")])?;
        let laser = (self.laser_nm).map_or(String::new(), |nm| format!("wavelengths_nm = [{nm:?}]"));
        let rehearsal = Rehearsal {
            display: Display::from_toml(&(format!("width = {width}\nheight = {height}\n") + &laser))?,
            zoom: self.zoom,
            seed: self.seed,
            spot_z_m: self.spot_z_mm / 1e3,
            keep_captures: self.captures,
            learn: self.learn.iter().map(|count| usize::from(*count)).collect(),
        };
        let names = colours(&rehearsal.display).join(" / ");
        output::folder(&self.output, self.overwrite.holding())?;
        let bar = progress_bar(0, "photographs and rows");
        let outcome = rehearse::run(&rehearsal, &self.output, &|done, of| {
            bar.set_length(of as u64);
            bar.set_position(done as u64);
        })?;
        bar.finish_and_clear();
        let line = |what: &str, of: &rehearse::BeforeAfter, digits: usize| {
            let list = |values: &[f64]| {
                let all: Vec<_> = values.iter().map(|v| format!("{v:.digits$}")).collect();
                all.join(" / ")
            };
            format!("{what:<34}{:>24}   {:>24}", list(&of.before), list(&of.after))
        };
        let mut text = vec![
            format!("{:<34}{:>24}   {:>24}", names, "before", "after"),
            line("phase error, rad RMS", &outcome.phase_error_rad, 3),
            line("black against white, dB", &outcome.black_db, 1),
            line("unevenness of flat grey", &outcome.unevenness, 3),
            line("Strehl ratio of the spot", &outcome.strehl, 3),
            String::new(),
            outcome.lut.text(),
            format!("{} photographs; {}", outcome.photographs, terminal::name(&self.output)),
        ];
        if !outcome.psnr_db.is_empty() {
            text.push(learned(&outcome));
        }
        let value = serde_json::to_value(&outcome).map_err(|e| Error::file(&self.output, e))?;
        terminal::print(json, &value, text.join("\n"));
        Ok(())
    }
}

/// Returns a table of what learned models are worth.
fn learned(outcome: &rehearse::Outcome) -> String {
    let row = |name: String, misfit: String, psnr: &[f64]| {
        let all: String = psnr.iter().map(|db| format!("{db:>12.1}")).collect();
        format!("{name:<16}{misfit:>8}{all}")
    };
    let head: String = (JUDGED.iter())
        .map(|(steps, z_m)| format!("{:>12}", format!("{steps} @ {} mm", z_m * 1e3)))
        .collect();
    let mut lines = vec![
        String::new(),
        "PSNR of unseen holograms, dB, by midpoint steps and z".to_owned(),
        format!("{:<16}{:>8}{head}", "photographs", "misfit"),
        row("no model".into(), String::new(), &outcome.psnr_db),
    ];
    for one in &outcome.learned {
        lines.push(row(
            one.photographs.to_string(),
            format!("{:.3}", one.misfit[1]),
            &one.psnr_db,
        ));
    }
    lines.join("\n")
}
