//! The command line: one file a command, each with its flags, defined once, and what it does with
//! the laboratory. Flags that several commands share are in [`flags`].

mod bench;
mod calibrate;
mod compare;
mod dataset;
mod devices;
mod doctor;
mod evaluate;
mod flags;
mod frame;
mod hologram;
mod judge;
mod link;
mod method;
mod multiplex;
mod networks;
mod occlusion;
mod pack;
mod refocus;
mod request;
mod scene;
mod seeds;
mod show;
mod stills;
mod study;
mod video;
mod view;

use clap::{Parser, Subcommand};
use phasefront::unstable::error::Line;
use phasefront_lab::{Result, trace};
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// The rule for what outputs replace.
const FILES: &str = "\
Output files: An output file that exists is replaced, as a whole or not at all. An input is never replaced, nor a \
folder or a special file such as a device or a pipe. A folder that a command fills with numbered files must be new \
or empty, and what `calibrate`, `video` and `hologram` with folders made is kept, unless --overwrite is given. \
`dataset`, `seeds`, `video --resume` and `hologram --resume` complete what an earlier run began. All this is checked \
before any work.";

/// RGB-D images to phase-only 3D holograms, and all that makes and judges them.
#[derive(Parser)]
#[command(name = "phasefront", version, max_term_width = 100, after_help = FILES)]
pub(crate) struct Phasefront {
    #[command(subcommand)]
    command: Command,
    /// Threads to compute with; all cores if not given.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print the result as JSON on stdout.
    #[arg(long, global = true)]
    json: bool,
    /// Write when each stage began and ended, for Perfetto (ui.perfetto.dev) or chrome://tracing.
    #[arg(long, global = true, value_name = "FILE.json")]
    trace: Option<PathBuf>,
}

#[derive(Subcommand)]
enum Command {
    Hologram(Box<hologram::Hologram>),
    Refocus(refocus::Refocus),
    View(Box<view::View>),
    Compare(compare::Compare),
    Judge(judge::Judge),
    Scene(scene::Scene),
    Dataset(dataset::Dataset),
    Seeds(seeds::Seeds),
    Networks(networks::Networks),
    Bench(bench::Bench),
    Occlusion(occlusion::Occlusion),
    Evaluate(evaluate::Evaluate),
    Study(study::Study),
    Video(video::Video),
    Multiplex(multiplex::MultiplexCommand),
    Devices(devices::Devices),
    Doctor(doctor::Doctor),
    Pack(pack::Pack),
    Unpack(pack::Unpack),
    Show(show::Show),
    Screens(show::Screens),
    #[command(subcommand)]
    Link(link::Link),
    #[command(subcommand)]
    Calibrate(calibrate::Calibrate),
}

impl Phasefront {
    pub(crate) fn run(self) -> Result<()> {
        let mut pool = rayon::ThreadPoolBuilder::new();
        if let Some(threads) = self.threads {
            pool = pool.num_threads(threads.into());
        }
        // The command itself stays on the main thread: a system opens windows on no other.
        pool.build_global()
            .map_err(|e| phasefront_lab::Error::Input(format!("--threads: {e}")))?;
        let run = || self.command.run(self.threads, self.json);
        match &self.trace {
            None => run(),
            Some(path) => trace::traced(path, run),
        }
    }
}

impl Command {
    fn run(self, threads: Option<u16>, json: bool) -> Result<()> {
        match self {
            Command::Hologram(command) => command.run(json),
            Command::Refocus(command) => command.run(json),
            Command::View(command) => command.run(json),
            Command::Compare(command) => command.run(json),
            Command::Judge(command) => command.run(json),
            Command::Scene(command) => command.run(json),
            Command::Dataset(command) => command.run(json),
            Command::Seeds(command) => command.run(json),
            Command::Networks(command) => command.run(json),
            Command::Bench(command) => command.run(threads.map(usize::from), json),
            Command::Occlusion(command) => command.run(json),
            Command::Evaluate(command) => command.run(json),
            Command::Study(command) => command.run(json),
            Command::Video(command) => {
                let threads = threads.and_then(|n| NonZeroUsize::new(n.into()));
                command.run(threads, json)
            }
            Command::Multiplex(command) => command.run(json),
            Command::Devices(command) => command.run(json),
            Command::Doctor(command) => command.run(json),
            Command::Pack(command) => command.run(json),
            Command::Unpack(command) => command.run(json),
            Command::Show(command) => command.run(json),
            Command::Screens(command) => command.run(json),
            Command::Link(command) => command.run(json),
            Command::Calibrate(command) => command.run(json),
        }
    }
}

/// A file's name in a line of text: without characters that control the terminal.
fn name(path: &Path) -> String {
    Line(&path.display().to_string()).to_string()
}

/// Prints a command's result: `json` in one line, or `text`, whose control characters other than newlines are replaced:
/// names of files, networks and scenes may have any.
fn print(json: bool, value: &serde_json::Value, text: impl std::fmt::Display) {
    let mut out = std::io::stdout().lock();
    let printed = match json {
        true => writeln!(out, "{value}"),
        false => {
            let control = |c: char| c.is_control() && c != '\n';
            writeln!(out, "{}", text.to_string().replace(control, "\u{fffd}"))
        }
    };
    match printed.and_then(|()| out.flush()) {
        Ok(()) => {}
        // Whoever read has read enough: as other programs do, end without a word.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => std::process::exit(0),
        Err(e) => {
            let _ = writeln!(std::io::stderr(), "error: the result cannot be printed: {e}");
            std::process::exit(1);
        }
    }
}
