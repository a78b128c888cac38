//! The commands of `phasefront`. Each file holds one command with its flags.

mod bench;
mod calibrate;
mod compare;
mod completions;
mod devices;
mod diagnose;
mod doctor;
mod encode;
pub(crate) mod help;
mod hologram;
mod judge;
mod link;
mod multiplex;
mod networks;
mod pack;
mod pattern;
mod refocus;
mod show;
mod video;
mod view;

use crate::given::Flag;
use clap::{Parser, Subcommand};
use phasefront_command::start::Common;
use phasefront_io::Result;

/// The rules for replacing output files.
const FILES: &str = "\
Output files: An output file that exists is replaced, as a whole or not at all. An input is never replaced, nor a \
folder or a special file such as a device or a pipe. A folder that a command fills with numbered files must be new \
or empty, and what `calibrate`, `video` and `hologram` with folders made is kept, unless --overwrite is \
given. `video --resume` and `hologram --resume` complete what an earlier run began. All this is checked before any work. \
`-o -` writes to stdout where one file comes out, and the result goes to stderr.

Exit codes: 0 where all is done, 1 where something failed or a check found a fault, 2 where the command line is wrong.";

/// Make phase-only 3D holograms from RGB-D images, look at them, show them on a modulator, and calibrate it.
#[derive(Parser)]
#[command(name = "phasefront", version, max_term_width = 100, after_help = FILES, disable_help_flag = true)]
pub(crate) struct Phasefront {
    #[command(subcommand)]
    pub(crate) command: Command,
    #[command(flatten)]
    pub(crate) common: Common,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    Hologram(Box<hologram::Hologram>),
    Encode(Box<encode::Encode>),
    Refocus(refocus::Refocus),
    View(Box<view::View>),
    Compare(compare::Compare),
    Judge(judge::Judge),
    Networks(networks::Networks),
    Bench(bench::Bench),
    Video(video::Video),
    Multiplex(multiplex::MultiplexCommand),
    Devices(devices::Devices),
    Diagnose(diagnose::Diagnose),
    Doctor(doctor::Doctor),
    Completions(completions::Completions),
    Man(completions::Man),
    Pack(pack::Pack),
    Unpack(pack::Unpack),
    Show(show::Show),
    Screens(show::Screens),
    #[command(subcommand)]
    Pattern(pattern::Pattern),
    #[command(subcommand)]
    Link(link::Link),
    #[command(subcommand)]
    Calibrate(calibrate::Calibrate),
}

impl Command {
    pub(crate) fn run(self, common: &Common, flags: &[Flag]) -> Result<()> {
        let json = common.json;
        match self {
            Command::Hologram(command) => command.run(json, flags),
            Command::Encode(command) => command.run(json),
            Command::Refocus(command) => command.run(json),
            Command::View(command) => command.run(json),
            Command::Compare(command) => command.run(json),
            Command::Judge(command) => command.run(json),
            Command::Networks(command) => command.run(json),
            Command::Bench(command) => command.run(common.threads(), json),
            Command::Video(command) => command.run(common.threads(), json, flags),
            Command::Multiplex(command) => command.run(json),
            Command::Devices(command) => command.run(json),
            Command::Diagnose(command) => command.run(json),
            Command::Doctor(command) => command.run(json),
            Command::Completions(command) => command.run(),
            Command::Man(command) => command.run(json),
            Command::Pack(command) => command.run(json),
            Command::Unpack(command) => command.run(json),
            Command::Show(command) => command.run(json),
            Command::Screens(command) => command.run(json),
            Command::Pattern(command) => command.run(json),
            Command::Link(command) => command.run(json),
            Command::Calibrate(command) => command.run(json),
        }
    }
}
