//! `phasefront show` and `phasefront screens`: show frames on a modulator that is a screen to the computer.

use clap::Args;
use phasefront_cli::modulator::show::{self, Screen, Showing};
use phasefront_command::flags::DisplayFlags;
use phasefront_command::terminal;
use phasefront_io::hologram::{self, packed};
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Show frames on a screen, full and unscaled, at its rate; Escape or Q ends it
#[derive(Args)]
pub(crate) struct Show {
    /// Images for the modulator's input, or with --display holograms and phase maps, which are packed for it; several
    /// are shown one after another, those of a folder in the order of their names
    #[arg(required = true)]
    frames: Vec<PathBuf>,
    /// The screen's number, counted from 1, as in `phasefront screens`
    #[arg(long, value_name = "N", default_value_t = 1)]
    screen: usize,
    #[command(flatten)]
    display: DisplayFlags,
    /// The one colour to show of holograms that take one image for each colour
    #[arg(long, value_parser = packed::COLOURS, requires = "display")]
    colour: Option<String>,
    /// Frames per second [default: the screen's rate]
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Stop after this many seconds
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
}

impl Show {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        for (flag, value) in [("--rate", self.rate), ("--seconds", self.seconds)] {
            if let Some(value) = value
                && !(value > 0.0 && value <= 1e6)
            {
                return Err(Error::Usage(format!(
                    "{flag} {value}: it must lie above 0 and up to 1000000"
                )));
            }
        }
        let frames = self.images()?;
        let shown = show::show(
            &frames,
            &Showing {
                screen: self.screen,
                rate_hz: self.rate,
                length: self.seconds.map(Duration::from_secs_f64),
            },
        )?;
        let text = format!(
            "screen {}: {} frames at {} Hz, {} left out",
            self.screen, shown.frames, shown.rate_hz, shown.late
        );
        terminal::print(json, &json!(shown), text);
        Ok(())
    }

    fn images(&self) -> Result<Vec<packed::Image>> {
        let display = self.display.read_if_given_with_lens()?;
        let paths = self.frames.iter().map(|path| images_of(path));
        let mut images = Vec::new();
        for path in paths.collect::<Result<Vec<_>>>()?.concat() {
            match &display {
                None => images.push(packed::Image::read(&path)?),
                Some(display) => {
                    let hologram = hologram::read_for(&path, Some(display))?;
                    let packed = packed::pack_colour(&hologram, display, self.colour.as_deref());
                    images.append(&mut packed.map_err(|e| Error::file(&path, e))?);
                }
            }
        }
        Ok(images)
    }
}

/// Returns the image files of a folder in the order of their names, or the one file.
fn images_of(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = std::fs::read_dir(path).map_err(|e| Error::file(path, format!("cannot be read: {e}")))?;
    let mut files: Vec<_> = (entries.flatten().map(|entry| entry.path()))
        .filter(|file| {
            ["png", "bmp"]
                .iter()
                .any(|extension| output::has_extension(file, extension))
        })
        .collect();
    files.sort();
    if files.is_empty() {
        Err(Error::file(path, "holds no .png and no .bmp"))
    } else {
        Ok(files)
    }
}

/// List the screens of this computer
#[derive(Args)]
pub(crate) struct Screens {}

impl Screens {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let screens = show::screens()?;
        let rows: Vec<_> = screens.iter().map(row).collect();
        terminal::print(json, &json!(screens), rows.join("\n"));
        Ok(())
    }
}

fn row(screen: &Screen) -> String {
    let rate = screen.rate_hz.map_or(String::new(), |rate| format!("  {rate} Hz"));
    let scaled = if screen.scale == 1.0 {
        String::new()
    } else {
        format!("  scaled by {}: turn this off for a modulator", screen.scale)
    };
    let [x, y] = screen.at;
    format!(
        "{}  {}  {}×{} at {x}, {y}{rate}{scaled}",
        screen.number, screen.name, screen.width, screen.height
    )
}
