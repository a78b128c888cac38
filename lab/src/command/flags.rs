//! Flags that several commands share.

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use phasefront_lab::Result;
use phasefront_lab::files::{self, DisplayFile};
use std::path::PathBuf;

/// The display that a hologram is for.
#[derive(Args)]
pub(crate) struct DisplayFlags {
    /// TOML file of the display [default: 1920×1080, 8 µm, 638/520/450 nm, 6 mm]
    #[arg(long, value_name = "FILE")]
    display: Option<PathBuf>,
    /// z of the hologram against the middle of the volume, mm, positive toward the viewer
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    offset_mm: Option<f64>,
}

impl DisplayFlags {
    pub(crate) fn read(&self) -> Result<DisplayFile> {
        let mut file = match &self.display {
            Some(path) => files::read_display(path)?,
            None => DisplayFile {
                display: phasefront::Display::default(),
                lut: None,
            },
        };
        if let Some(mm) = self.offset_mm {
            file.display = file.display.with_offset_m(mm / 1e3)?;
        }
        Ok(file)
    }
}

/// A progress bar on stderr, with the time left, where stderr is a terminal.
pub(crate) fn progress_bar(total: u64, what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {elapsed} {eta} left")
        .expect("a well-formed template");
    ProgressBar::new(total)
        .with_style(style)
        .with_message(what.to_owned())
}
