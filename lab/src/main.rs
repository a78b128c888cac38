//! The command `phasefront`.

mod command;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    // clap leaves with 2 where the command line is wrong.
    let command = command::Phasefront::parse();
    env_logger::Builder::new()
        .filter_level(log::LevelFilter::Warn)
        .parse_default_env()
        .format(|out, record| {
            use std::io::Write;
            writeln!(out, "{}: {}", record.level().as_str().to_lowercase(), record.args())
        })
        .init();
    match command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        }
    }
}
