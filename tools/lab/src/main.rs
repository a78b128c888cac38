//! The command `phasefront-lab`.

mod command;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    // clap exits with 2 if the command line is invalid.
    let command::Lab { command, common } = command::Lab::parse();
    common.run(|| command.run(&common))
}
