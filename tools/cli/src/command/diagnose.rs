//! `phasefront diagnose`: says why a photograph of a displayed hologram looks wrong.

use super::calibrate::channel;
use clap::Args;
use phasefront::Size;
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::diagnosis::{Diagnosis, Shown, diagnose};
use phasefront_command::flags::DisplayFlags;
use phasefront_command::terminal;
use phasefront_core::display::Display;
use phasefront_io::hologram::{self, Hologram, check_z};
use phasefront_io::output::has_extension;
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Say why a photograph of a displayed hologram looks wrong, and what to do next
///
/// Finds the picture in the photograph in any orientation, fits each cause to it, and lists those that are there, the
/// most probable one first. Exits with 1 if something is wrong.
#[derive(Args)]
#[command(mut_arg("display", |display| display.help(
    "TOML file of the display that the hologram was made for, or a modulator's name [default: what the hologram says of it]"
)))]
pub(crate) struct Diagnose {
    /// The photograph: PNG or TIFF whose values are linear in light, or a camera's JPEG; one for each laser, red, green
    /// and blue, if the camera sees no colours
    #[arg(value_name = "PHOTO", required = true, num_args = 1..=3)]
    photographs: Vec<PathBuf>,
    /// The hologram that was shown: a PNG of levels, or with --display a phase map of other software
    #[arg(long, value_name = "FILE")]
    hologram: PathBuf,
    /// z that the camera should be focused on, mm from the middle of the volume, positive toward the viewer
    #[arg(long, value_name = "Z", allow_negative_numbers = true, default_value_t = 0.0)]
    z_mm: f64,
    #[command(flatten)]
    display: DisplayFlags,
}

impl Diagnose {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let display = self.display.read_if_given()?;
        let hologram = hologram::read_for(&self.hologram, display.as_ref())?;
        let file = match display {
            Some(display) => display,
            None => hologram
                .info()
                .display_file()
                .map_err(|e| Error::file(&self.hologram, e))?,
        };
        hologram
            .check_display(&file)
            .map_err(|e| Error::file(&self.hologram, e))?;
        let Hologram::Levels(levels, _) = &hologram else {
            return Err(Error::file(
                &self.hologram,
                "is a complex field; give the hologram of levels that was shown",
            ));
        };
        let target = file.corrected()?;
        check_z(&target.display, self.z_mm / 1e3)?;
        let photographs = self.read(&target.display)?;
        let shown = Shown {
            levels: levels.view(),
            size: Size {
                width: levels.dim().2,
                height: levels.dim().1,
            },
            target: &target,
            z_m: self.z_mm / 1e3,
        };
        let first = &self.photographs[0];
        let diagnosis = diagnose(&shown, &photographs).map_err(|e| Error::file(first, e))?;
        terminal::print(json, &json!(diagnosis), describe(&diagnosis));
        match diagnosis.findings.as_slice() {
            [] => Ok(()),
            [_] => Err(Error::file(first, "does not look as it should: one cause")),
            all => Err(Error::file(
                first,
                format!("does not look as it should: {} causes", all.len()),
            )),
        }
    }

    /// Reads a photograph of each laser's light.
    fn read(&self, display: &Display) -> Result<Vec<Photograph>> {
        self.photographs.iter().try_for_each(|path| output::reading(path))?;
        let lasers = display.colours();
        let photographs: Vec<_> = match self.photographs.as_slice() {
            [path] => (0..lasers).map(|laser| read(path, channel(display, laser))).collect(),
            paths if paths.len() == lasers => (paths.iter().enumerate())
                .map(|(laser, path)| read(path, channel(display, laser)))
                .collect(),
            paths => Err(Error::Input(format!(
                "{} photographs; give one in colours, or one for each of the {lasers} lasers",
                paths.len()
            ))),
        }?;
        let grey = lasers == 3 && photographs.iter().all(|photo| photo.values == photographs[0].values);
        if grey {
            return Err(Error::file(
                &self.photographs[0],
                "is grey, and the display has three lasers; give a photograph in colours, or three, of red, green and blue",
            ));
        }
        Ok(photographs)
    }
}

/// Reads a channel of a photograph. The values of a camera's JPEG are those of sRGB and become linear in light.
fn read(path: &Path, channel: usize) -> Result<Photograph> {
    let photo = Photograph::read(path, channel)?;
    let is_encoded = ["jpg", "jpeg"].iter().any(|jpeg| has_extension(path, jpeg));
    Ok(if is_encoded { photo.linear_of_srgb() } else { photo })
}

pub(super) fn describe(diagnosis: &Diagnosis) -> String {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    if diagnosis.findings.is_empty() {
        return format!(
            "the photograph looks as it should: the hologram explains {} of it",
            percent(diagnosis.explained)
        );
    }
    let mut lines: Vec<_> = (diagnosis.findings.iter())
        .map(|finding| {
            format!(
                "{} ({}): {}\n    next: {}",
                finding.cause,
                percent(finding.confidence.min(0.99)),
                finding.evidence,
                finding.next
            )
        })
        .collect();
    lines.push(format!(
        "the hologram as it should be explains {} of the photograph, with this {}",
        percent(diagnosis.explained_right),
        percent(diagnosis.explained)
    ));
    lines.join("\n")
}
