//! `phasefront calibrate pack`: a display and all its files in one file.

use clap::Args;
use phasefront_command::flags::{DisplayFlags, OverwriteFlag};
use phasefront_command::terminal;
use phasefront_io::Result;
use phasefront_io::output;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;

/// Put a display's file and all files that it refers to into one file for an app
#[derive(Args)]
pub(crate) struct Pack {
    #[command(flatten)]
    display: DisplayFlags,
    /// Output file for the app
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

impl Pack {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::new_file(&self.output, &[], self.overwrite.is_given())?;
        let file = self.display.read()?;
        let bytes = file.corrected()?.to_bytes()?;
        output::write_atomically(&self.output, |file| file.write_all(&bytes))?;
        terminal::print(
            json,
            &json!({"file": self.output.display().to_string(), "bytes": bytes.len()}),
            format!("{}: {} bytes", terminal::name(&self.output), bytes.len()),
        );
        Ok(())
    }
}
