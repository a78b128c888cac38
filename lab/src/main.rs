//! The command `phasefront`.

mod command;

use clap::Parser;
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    // clap leaves with 2 where the command line is wrong.
    let command = command::Phasefront::parse();
    env_logger::Builder::new()
        .filter_level(log::LevelFilter::Warn)
        .parse_default_env()
        .format(|out, record| writeln!(out, "{}: {}", record.level().as_str().to_lowercase(), record.args()))
        .init();
    match command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            // Where even this cannot be said, the exit code says it.
            let _ = writeln!(std::io::stderr(), "error: {e}");
            ExitCode::FAILURE
        }
    }
}
