//! `phasefront link`: checks whether pixels reach the modulator unchanged.

use clap::{Args, Subcommand};
use phasefront::Size;
use phasefront_calibration::link;
use phasefront_command::flags::parse_size;
use phasefront_command::terminal;
use phasefront_io::hologram::packed;
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::path::PathBuf;

/// Find out whether the link to the modulator scales, filters, turns, covers or recolours pixels, which ruins phase
#[derive(Subcommand)]
pub(crate) enum Link {
    Pattern(Pattern),
    Read(Read),
}

/// Write the pattern to show
#[derive(Args)]
pub(crate) struct Pattern {
    /// Size of the screen
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "1920x1080")]
    size: Size,
    /// Output pattern
    #[arg(short, long, value_name = "OUT.png")]
    output: PathBuf,
}

/// Read a capture of the pattern, saved by a frame grabber in the modulator's place or as a screenshot
///
/// Exits with 1 if the link changes pixels.
#[derive(Args)]
pub(crate) struct Read {
    /// The captured image, PNG or BMP
    capture: PathBuf,
    /// Size of the pattern that was shown
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "1920x1080")]
    size: Size,
}

impl Link {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        match self {
            Link::Pattern(command) => command.run(json),
            Link::Read(command) => command.run(json),
        }
    }
}

fn checked(size: Size) -> Result<Size> {
    if size.width >= 512 && size.height >= 96 {
        Ok(size)
    } else {
        Err(Error::Input(format!(
            "a pattern of {size}; its 256 steps and eight bands need at least 512×96"
        )))
    }
}

impl Pattern {
    fn run(self, json: bool) -> Result<()> {
        output::file(&self.output, &["png"])?;
        let size = checked(self.size)?;
        link::pattern(size).write(&self.output)?;
        let text = format!("{}: {size}", terminal::name(&self.output));
        terminal::print(
            json,
            &json!({ "output": self.output, "width": size.width, "height": size.height }),
            text,
        );
        Ok(())
    }
}

impl Read {
    fn run(self, json: bool) -> Result<()> {
        let capture = packed::Image::read(&self.capture)?;
        checked(capture.size).map_err(|e| Error::file(&self.capture, e))?;
        let sent = checked(self.size)?;
        let reading = link::read(&capture, sent).ok_or_else(|| {
            Error::file(
                &self.capture,
                format!(
                    "does not show the pattern that `phasefront link pattern --size {}x{}` writes",
                    sent.width, sent.height
                ),
            )
        })?;
        let text = match reading.faults.is_empty() {
            true if reading.noise < 0.05 => "every pixel arrives as it is".into(),
            true => format!(
                "every pixel arrives as it is, to the capture's noise of {:.1} levels",
                reading.noise
            ),
            false => reading.faults.join("\n"),
        };
        terminal::print(json, &json!(reading), text);
        match reading.faults.len() {
            0 => Ok(()),
            1 => Err(Error::file(
                &self.capture,
                "the link does not pass pixels as they are: a fault",
            )),
            n => Err(Error::file(
                &self.capture,
                format!("the link does not pass pixels as they are: {n} faults"),
            )),
        }
    }
}
