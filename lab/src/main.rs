//! The command `phasefront`.

mod command;

use clap::Parser;
use phasefront::unstable::error::Line;
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    // clap leaves with 2 where the command line is wrong.
    let command = command::Phasefront::parse();
    env_logger::Builder::new()
        .filter_level(log::LevelFilter::Warn)
        // It warns of what a modulator's desktop lacks, as a size in millimetres.
        .filter_module("winit", log::LevelFilter::Error)
        .parse_default_env()
        .format(|out, record| {
            let level = record.level().as_str().to_lowercase();
            writeln!(out, "{level}: {}", Line(&record.args().to_string()))
        })
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
