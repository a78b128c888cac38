//! The files that are made of a hologram beside its levels.

use crate::flags::frame::{shown_json, shown_text};
use crate::limits::share_of_light;
use crate::make::{HologramResult, Judged, infos, judge};
use clap::Args;
use phasefront::{Encoding, RgbdFrame};
use phasefront_command::terminal;
use phasefront_io::display::DisplayFile;
use phasefront_io::frame::ShownDepth;
use phasefront_io::hologram::{self, packed};
use phasefront_io::{Error, Result};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What is made of a hologram beside its levels.
#[derive(Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct OutputFlags {
    /// Also write the complex field at the modulator, with a .json beside it
    #[arg(long, value_name = "FILE.npy")]
    complex: Option<PathBuf>,
    /// Compare the displayed image with the hologram's own wave, at the midpoint and over a stack of depths; in the
    /// focal plane of a lens with the picture, in focus
    #[arg(long)]
    judge: bool,
    /// Also write what the modulator's input takes: one PNG, or FRAME-red.png, FRAME-green.png and FRAME-blue.png
    #[arg(long, value_name = "FRAME.png")]
    packed: Option<PathBuf>,
}

/// What is reported of a hologram beside its levels.
struct Reported<'a> {
    /// The share of the panel's light that is in the picture, if it is known.
    light: Option<f64>,
    /// The files of --packed.
    packed: &'a [PathBuf],
    /// The distances that depth shows.
    depth: Option<ShownDepth>,
    judged: Option<&'a Judged>,
}

impl OutputFlags {
    /// Checks whether a result must keep its field.
    pub(crate) fn need_field(&self) -> bool {
        self.complex.is_some() || self.judge
    }

    /// Declares the files.
    pub(crate) fn declare(&self, display: &DisplayFile) -> Result<()> {
        if let Some(path) = &self.complex {
            if display.lens.is_some() {
                return Err(Error::Usage(
                    "--complex is for pictures about the modulator; in the focal plane of a lens phases are searched, and there is no field"
                        .into(),
                ));
            }
            hologram::declare_complex(path)?;
        }
        self.packed.iter().try_for_each(|path| packed::declare(path, display))
    }

    /// Writes the levels of `made`, which is that of `picture`, to `output`, and the other files, and reports them and
    /// the distances that depth shows.
    pub(crate) fn finish(
        &self,
        output: &Path,
        display: &DisplayFile,
        made: &HologramResult,
        picture: Option<&RgbdFrame>,
        depth: Option<ShownDepth>,
        json: bool,
    ) -> Result<()> {
        let packed = self.write(output, display, made)?;
        let judged = self.judge.then(|| judge(display, made, picture)).transpose()?;
        let light = picture.map(|picture| share_of_light(picture.rgb().iter().copied(), made.scale));
        let reported = Reported {
            light,
            packed: &packed,
            depth,
            judged: judged.as_ref(),
        };
        self.report(output, made, reported, json);
        Ok(())
    }

    /// Writes the files and returns the paths of those that are packed.
    fn write(&self, output: &Path, display: &DisplayFile, made: &HologramResult) -> Result<Vec<PathBuf>> {
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
        let packed = match &self.packed {
            Some(path) => packed::write(path, &packed::pack(&hologram, display)?)?,
            None => Vec::new(),
        };
        hologram::write_hologram(output, &hologram)?;
        Ok(packed)
    }

    fn report(&self, output: &Path, made: &HologramResult, reported: Reported<'_>, json: bool) {
        let Reported {
            light,
            packed,
            depth,
            judged,
        } = reported;
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
                "output": output.display().to_string(), "complex": self.complex, "packed": packed,
                "width": width, "height": height,
                "method": made.method, "encoder": made.encoder.name, "dark_threshold": made.encoder.options.dark_threshold,
                "local_steps": made.encoder.options.local_steps, "scale": made.scale, "engine": made.engine,
                "light": light, "stage_ms": stages, "total_ms": ms(&total), "depth": shown_json(depth), "shown": judged,
            }),
            format!(
                "{}: {width}×{height} by {}; {}: {}{}{}{}",
                terminal::name(output),
                made.method,
                made.encoder.describe(),
                list.join(", "),
                light.map_or(String::new(), |share| format!(
                    "; {:.0} % of the light is in the picture",
                    100.0 * share
                )),
                shown_text(depth),
                judged.map_or(String::new(), Judged::describe)
            ),
        );
    }
}
