//! The start of a command: its threads, log, trace and exit code.

use crate::{terminal, trace};
use clap::{ArgAction, Args};
use phasefront_core::method::network::Isa;
use phasefront_core::runtime::error::Line;
use phasefront_io::{Error, Result};
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;

/// The exit code of a wrong command line, which is also clap's.
const USAGE: u8 = 2;

/// The flags of every command.
#[derive(Debug, Args)]
#[command(next_help_heading = "General")]
pub struct Common {
    /// Number of threads to compute with [default: all cores]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print the result as JSON on stdout
    #[arg(long, global = true)]
    pub json: bool,
    /// Print errors only, and the result that --json asks for
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print what is decided on the way; -vv prints more
    #[arg(short, long, global = true, action = ArgAction::Count)]
    verbose: u8,
    /// Write a trace of when each stage began and ended, for Perfetto (ui.perfetto.dev) or chrome://tracing
    #[arg(long, global = true, value_name = "FILE.json", hide_short_help = true)]
    trace: Option<PathBuf>,
    /// Print help; -h prints the common flags alone
    #[arg(short, long, global = true, action = ArgAction::Help)]
    help: Option<bool>,
}

impl Common {
    /// Returns the number of threads, if given.
    pub fn threads(&self) -> Option<NonZeroUsize> {
        NonZeroUsize::new(self.threads?.into())
    }

    /// Runs `command` with these flags on the calling thread, because systems open windows only on the main thread.
    pub fn run(&self, command: impl FnOnce() -> Result<()>) -> ExitCode {
        self.log_to_stderr();
        terminal::set_quiet(self.quiet);
        match self.traced(command) {
            Ok(()) => ExitCode::SUCCESS,
            Err(e) => {
                // If the message cannot be printed, the exit code still reports the failure.
                let _ = writeln!(std::io::stderr(), "error: {e}");
                match e {
                    Error::Usage(_) => ExitCode::from(USAGE),
                    _ => ExitCode::FAILURE,
                }
            }
        }
    }

    fn traced(&self, command: impl FnOnce() -> Result<()>) -> Result<()> {
        Isa::of_variable().map_err(Error::Input)?;
        let mut pool = rayon::ThreadPoolBuilder::new();
        if let Some(threads) = self.threads {
            pool = pool.num_threads(threads.into());
        }
        pool.build_global()
            .map_err(|e| Error::Input(format!("--threads: {e}")))?;
        match &self.trace {
            None => command(),
            Some(path) => trace::traced(path, command),
        }
    }

    /// Sends messages to stderr: warnings, or what `RUST_LOG` says, or what the flags say.
    fn log_to_stderr(&self) {
        let mut log = env_logger::Builder::new();
        log.filter_level(log::LevelFilter::Warn)
            // winit warns when a modulator's desktop lacks a size in millimetres.
            .filter_module("winit", log::LevelFilter::Error)
            .parse_default_env();
        let asked = match (self.quiet, self.verbose) {
            (true, _) => Some(log::LevelFilter::Error),
            (_, 0) => None,
            (_, 1) => Some(log::LevelFilter::Info),
            _ => Some(log::LevelFilter::Debug),
        };
        if let Some(level) = asked {
            log.filter_module("phasefront", level);
            if self.quiet {
                log.filter_level(level);
            }
        }
        log.format(|out, record| {
            let level = record.level().as_str().to_lowercase();
            writeln!(out, "{level}: {}", Line(&record.args().to_string()))
        })
        .init();
    }
}
