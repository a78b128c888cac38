//! `phasefront refocus`: writes the view of a hologram file that an eye focused at z sees.

use crate::limits::Limits;
use clap::Args;
use phasefront::Display;
use phasefront_command::flags::{DisplayFlags, OverwriteFlag};
use phasefront_command::terminal;
use phasefront_io::picture::export;
use phasefront_io::{Error, Result, hologram, output};
use serde_json::json;
use std::path::PathBuf;

/// Write the view of a hologram that an eye focused at z sees
#[derive(Args)]
#[command(mut_arg("display", |display| display.help(
    "TOML file of the display that the hologram was made for, or a modulator's name [default: what the hologram says of it]"
)))]
pub(crate) struct Refocus {
    /// A hologram PNG, or a complex .npy with its .json; with --display also a phase map of other software: a PNG, BMP
    /// or TIFF of levels, a .npy of levels or radians
    hologram: PathBuf,
    /// Focus, mm from the middle of the volume, positive toward the viewer
    #[arg(
        long,
        value_name = "Z",
        allow_negative_numbers = true,
        required_unless_present = "stack",
        conflicts_with = "stack",
        help_heading = "Output"
    )]
    z_mm: Option<f64>,
    /// Number of views from the near end of the volume to the far end
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1000), help_heading = "Output")]
    stack: Option<u32>,
    #[command(flatten)]
    display: DisplayFlags,
    /// Width of the pictures, pixels; they keep their proportions [default: the hologram's width]
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(1..=16384), help_heading = "Output")]
    width: Option<u32>,
    /// Output: a .png, .jpg or .webp for one z; a folder, or an animated .gif or .webp, for a stack
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

impl Refocus {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        self.check_output()?;
        let display = self.display.read_if_given_with_lens()?;
        let hologram = hologram::read_for(&self.hologram, display.as_ref())?;
        let z_mm: Vec<f64> = match (self.z_mm, self.stack) {
            (Some(z), _) => vec![z],
            (None, count) => {
                let count = count.unwrap_or(2);
                let depth_mm = hologram.info().display.volume_depth_m() * 1e3;
                let at = |i: u32| depth_mm * (0.5 - f64::from(i) / f64::from(count - 1));
                (0..count).map(at).collect()
            }
        };
        let z_m: Vec<f64> = z_mm.iter().map(|z| z / 1e3).collect();
        let views = match display {
            None => hologram.views(&z_m),
            Some(display) => hologram.views_on(&display, &z_m),
        }
        .map_err(|e| Error::file(&self.hologram, e))?;
        if !hologram.info().is_in_focal_plane() {
            self.warn(&hologram.info().display);
        }
        let colours = hologram.info().view_colours();
        let views: Vec<_> = (views.iter())
            .map(|view| export::of_view(view.view(), &colours))
            .map(|view| export::at_width(view, self.width.unwrap_or(u32::MAX)))
            .collect();
        let mut written = Vec::new();
        if self.stack.is_none() {
            export::write(&self.output, &views[0])?;
            written.push(self.output.clone());
        } else if export::moves(&self.output) {
            export::write_moving(&self.output, &views)?;
            written.push(self.output.clone());
        } else {
            output::make_folder(&self.output)?;
            for (i, (view, z)) in views.iter().zip(&z_mm).enumerate() {
                let path = self.output.join(format!("view_{i:03}_{z:+.3}mm.png"));
                export::write(&path, view)?;
                written.push(path);
            }
        }
        let names: Vec<_> = written.iter().map(|path| path.display().to_string()).collect();
        let text: Vec<_> = written.iter().map(|path| terminal::name(path)).collect();
        terminal::print(json, &json!({"z_mm": z_mm, "files": names}), text.join("\n"));
        Ok(())
    }

    /// Warns if the display keeps no details at --z-mm.
    fn warn(&self, display: &Display) {
        let lost = self.z_mm.map(|z_mm| (z_mm, Limits::of(display).lost_at(z_mm / 1e3)));
        if let Some((z_mm, Some(lost))) = lost {
            log::warn!("z = {z_mm:.1} mm: {lost}");
        }
    }

    fn check_output(&self) -> Result<()> {
        if self.stack.is_none() {
            return output::file(&self.output, &["png", "jpg", "jpeg", "webp"]);
        }
        if export::moves(&self.output) {
            return output::file(&self.output, &[]);
        }
        let is = |extension: &&str| output::has_extension(&self.output, extension);
        if ["png", "jpg", "jpeg"].iter().any(is) {
            return Err(Error::file(
                &self.output,
                "a stack is written into a folder, or moves as .gif or .webp",
            ));
        }
        output::folder(&self.output, self.overwrite.holding())
    }
}
