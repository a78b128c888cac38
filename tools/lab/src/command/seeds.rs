//! `phasefront-lab seeds` computes the sweep's fields of a data set's scenes, which seeded networks are trained on.

use clap::Args;
use phasefront_command::flags::sweep_for;
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::output::{self, Holding};
use phasefront_io::{Error, Result};
use phasefront_lab::dataset::Manifest;
use phasefront_lab::seeds;
use serde_json::json;
use std::path::PathBuf;

/// Sweep the scenes of a data set on the depths that the training package has put into a folder
///
/// `python -m phasefront_training seeds` makes the depths and calls this command. If it is called again, it resumes.
#[derive(Args)]
pub(crate) struct Seeds {
    /// Folder of the data set
    data: PathBuf,
    /// Planes of the sweep [default: suits the display]
    #[arg(long, value_name = "N")]
    planes: Option<usize>,
    /// Taps of the sweep's filter [default: suits the planes and the display]
    #[arg(long, value_name = "N")]
    taps: Option<usize>,
    /// Number of depths to add for each scene: read by a sensor with faults and refined by the core
    #[arg(long, value_name = "N", default_value_t = 0)]
    refined: usize,
    /// Folder of the depths; the command writes the fields there too
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

impl Seeds {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::reading(&self.data)?;
        // The folder already holds the depths of the training package.
        output::folder(&self.output, Holding::Anything)?;
        let manifest = Manifest::read(&self.data)?;
        if manifest.display.colours() != 3 {
            return Err(Error::Input(
                "seeds are for networks of three colours; the data set's display has one laser".into(),
            ));
        }
        let sweep = sweep_for(&manifest.display, self.planes, self.taps);
        let bar = progress_bar(manifest.scenes as u64, "scenes");
        let made = || bar.inc(1);
        seeds::make(&manifest, &self.data, &self.output, sweep, self.refined, &made)?;
        bar.finish_and_clear();
        terminal::print(
            json,
            &json!({"folder": self.output.display().to_string(), "planes": sweep.planes, "taps": sweep.taps}),
            format!(
                "{}: seeds by {} planes of {} taps",
                terminal::name(&self.output),
                sweep.planes,
                sweep.taps
            ),
        );
        Ok(())
    }
}
