//! The command `phasefront`.

mod command;
mod flags;
mod make;
mod record;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    // clap exits with 2 if the command line is wrong.
    let command::Phasefront { command, common } = command::Phasefront::parse();
    common.run(|| command.run(&common))
}
