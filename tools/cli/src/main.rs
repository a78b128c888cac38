//! The command `phasefront`.

mod command;
mod flags;
mod given;
mod limits;
mod make;
mod record;

use std::process::ExitCode;

fn main() -> ExitCode {
    let (command::Phasefront { command, common }, flags) = command::help::parse();
    common.run(|| command.run(&common, &flags))
}
