//! `phasefront hologram`: makes a phase-only hologram of an RGB-D image or a layered depth image.

mod stills;

use crate::flags::frame::Picture;
use crate::make::{HologramRequest, HologramResult, Judged, infos, judge};
use crate::record::Before;
use clap::Args;
use phasefront::Encoding;
use phasefront_command::terminal;
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::{self, packed};
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::path::PathBuf;
use std::time::Duration;

/// Make a phase-only hologram of an RGB-D image or a layered depth image
#[derive(Args)]
pub(crate) struct Hologram {
    #[command(flatten)]
    request: HologramRequest,
    /// Also write the complex field at the modulator, with a .json beside it
    #[arg(long, value_name = "FILE.npy")]
    complex: Option<PathBuf>,
    /// Compare the displayed image with the hologram's own wave, at the midpoint and over a stack of depths
    #[arg(long)]
    judge: bool,
    /// Also write what the modulator's input takes: one PNG, or FRAME-red.png, FRAME-green.png and FRAME-blue.png
    #[arg(long, value_name = "FRAME.png")]
    packed: Option<PathBuf>,
    /// Output: a PNG of modulator levels; for folders of pictures, a folder that gets NAME.png for each picture NAME
    #[arg(short, value_name = "OUT.png|DIR")]
    output: PathBuf,
    /// For folders of pictures: keep the holograms of an earlier run with the same flags
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
    /// For folders of pictures: replace existing holograms
    #[arg(long)]
    overwrite: bool,
}

impl Hologram {
    pub(crate) fn run(mut self, json: bool) -> Result<()> {
        if let Some(pictures) = self.request.pictures()? {
            return self.stills(json, pictures);
        }
        if self.resume || self.overwrite {
            return Err(Error::Input(
                "--resume and --overwrite go with folders of pictures, as --rgb DIR --depth DIR; a file is replaced"
                    .into(),
            ));
        }
        output::file(&self.output, &["png"])?;
        if let Some(path) = &self.complex {
            hologram::declare_complex(path)?;
        }
        let display = self.request.display()?;
        if let Some(path) = &self.packed {
            packed::declare(path, &display)?;
        }
        self.request.keeps_field = self.complex.is_some() || self.judge;
        let made = self.request.make(&display, &self.request.image(&display)?)?;
        self.write(&display, &made)?;
        let judged = self.judge.then(|| judge(&display, &made)).transpose()?;
        self.report(json, &made, judged.as_ref());
        Ok(())
    }

    fn stills(self, json: bool, pictures: Vec<Picture>) -> Result<()> {
        let one = [
            (self.complex.is_some(), "--complex"),
            (self.packed.is_some(), "--packed"),
            (self.judge, "--judge"),
        ];
        if let Some((_, flag)) = one.iter().find(|(is_given, _)| *is_given) {
            return Err(Error::Input(format!(
                "{flag} goes with one picture, not with a folder of them"
            )));
        }
        let before = Before::of_flags(self.resume, self.overwrite);
        stills::run(self.request, pictures, &self.output, before, json)
    }

    fn write(&self, display: &DisplayFile, made: &HologramResult) -> Result<()> {
        let (levels, field) = infos(display, made);
        if let (Some(path), Some(values)) = (&self.complex, &made.field) {
            if matches!(made.encoder.options.encoding, Encoding::Deep(_)) {
                log::warn!(
                    "{}: a field of --encoder deep is what its pre-filter was trained to take, not the displayed wave; for that one take another --network",
                    path.display()
                );
            }
            hologram::write_complex(path, values.view(), &field)?;
        }
        let hologram = made.hologram(levels);
        if let Some(path) = &self.packed {
            packed::write(path, &packed::pack(&hologram, display)?)?;
        }
        hologram::write_hologram(&self.output, &hologram)
    }

    fn report(&self, json: bool, made: &HologramResult, judged: Option<&Judged>) {
        let ms = |time: &Duration| (time.as_secs_f64() * 1e5).round() / 100.0;
        let stages: serde_json::Map<_, _> = (made.stages.iter())
            .map(|(stage, time)| ((*stage).to_owned(), json!(ms(time))))
            .collect();
        let total: Duration = made.stages.iter().map(|(_, time)| *time).sum();
        let (_, height, width) = made.levels.dim();
        let list: Vec<_> = (made.stages.iter())
            .map(|(stage, time)| format!("{stage} {:.1} ms", ms(time)))
            .collect();
        terminal::print(
            json,
            &json!({
                "output": self.output.display().to_string(), "complex": self.complex, "width": width, "height": height,
                "method": made.method, "encoder": made.encoder.name, "dark_threshold": made.encoder.options.dark_threshold,
                "local_steps": made.encoder.options.local_steps, "scale": made.scale, "engine": made.engine,
                "stage_ms": stages, "total_ms": ms(&total), "shown": judged,
            }),
            format!(
                "{}: {width}×{height} by {}; {}: {}{}",
                terminal::name(&self.output),
                made.method,
                made.encoder.describe(),
                list.join(", "),
                judged.map_or(String::new(), Judged::describe)
            ),
        );
    }
}
