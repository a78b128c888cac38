//! The commands of `phasefront-lab`. Each command has a file with its flags and its implementation.

mod dataset;
mod evaluate;
mod occlusion;
mod scene;
mod seeds;
mod sensors;
mod stacks;
mod study;

use clap::{Parser, Subcommand};
use phasefront_command::start::Common;
use phasefront_io::Result;

/// The help text on the files that outputs replace.
const FILES: &str = "\
Output files: An output file that exists is replaced, as a whole or not at all. An input is never replaced, nor a \
folder or a special file such as a device or a pipe. A folder that a command fills with numbered files must be new \
or empty unless --overwrite is given. `dataset`, `seeds` and `stacks` complete what an earlier run began. All this is checked before any work.";

/// Ground truth for phase-only holograms: scenes, data sets, evaluation and studies.
#[derive(Parser)]
#[command(name = "phasefront-lab", version, max_term_width = 100, after_help = FILES, disable_help_flag = true)]
pub(crate) struct Lab {
    #[command(subcommand)]
    pub(crate) command: Command,
    #[command(flatten)]
    pub(crate) common: Common,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    Scene(scene::Scene),
    Dataset(dataset::Dataset),
    Seeds(seeds::Seeds),
    Stacks(stacks::Stacks),
    Occlusion(occlusion::Occlusion),
    Evaluate(Box<evaluate::Evaluate>),
    Study(study::Study),
}

impl Command {
    pub(crate) fn run(self, common: &Common) -> Result<()> {
        let json = common.json;
        match self {
            Command::Scene(command) => command.run(json),
            Command::Dataset(command) => command.run(json),
            Command::Seeds(command) => command.run(json),
            Command::Stacks(command) => command.run(json),
            Command::Occlusion(command) => command.run(json),
            Command::Evaluate(command) => command.run(json),
            Command::Study(command) => command.run(json),
        }
    }
}
