//! `phasefront-lab stacks` computes what incoherent light shows of a data set's scenes.

use clap::Args;
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::output::{self, Holding};
use phasefront_io::{Error, Result};
use phasefront_lab::dataset::Manifest;
use phasefront_lab::stacks;
use serde_json::json;
use std::path::PathBuf;

/// Compute what incoherent light shows of a data set's scenes at several depths of focus
///
/// Networks for natural focus are trained on these stacks. If it is called again, it resumes.
#[derive(Args)]
pub(crate) struct Stacks {
    /// Folder of the data set
    data: PathBuf,
    /// Depths of focus of each scene, spread over the volume
    #[arg(long, value_name = "N", default_value_t = 8)]
    depths: usize,
    /// Folder of the stacks
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
}

impl Stacks {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if !(1..=64).contains(&self.depths) {
            return Err(Error::Usage(format!(
                "--depths is {}; it must lie in 1..=64",
                self.depths
            )));
        }
        output::reading(&self.data)?;
        output::folder(&self.output, Holding::Anything)?;
        let manifest = Manifest::read(&self.data)?;
        output::make_folder(&self.output)?;
        let bar = progress_bar(manifest.scenes as u64, "scenes");
        stacks::make(&manifest, &self.data, &self.output, self.depths, &|| bar.inc(1))?;
        bar.finish_and_clear();
        terminal::print(
            json,
            &json!({"folder": self.output.display().to_string(), "depths": self.depths}),
            format!("{}: stacks of {} depths", terminal::name(&self.output), self.depths),
        );
        Ok(())
    }
}
