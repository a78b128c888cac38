//! The command line with the flags of help in groups.

use super::Phasefront;
use crate::given::{self, Flag};
use clap::{Arg, Command, CommandFactory, FromArgMatches};
use std::mem::take;

/// The groups of flags in help, in order.
const GROUPS: [&str; 7] = ["Input", "Depth", "Method", "Display", "Output", "Expert", "General"];

/// Parses the command line. Returns it with the flags of the command that it names. Ends the process with an exit code
/// of 2 if it is wrong, and with 0 after help.
pub(crate) fn parse() -> (Phasefront, Vec<Flag>) {
    let mut command = command();
    let matches = command.get_matches_mut();
    let named = matches.subcommand();
    let flags = named.and_then(|(name, matches)| Some(given::flags(command.find_subcommand(name)?, matches)));
    let parsed = Phasefront::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
    (parsed, flags.unwrap_or_default())
}

/// Returns the command line.
pub(super) fn command() -> Command {
    in_groups(Phasefront::command())
}

/// Puts every flag into a group, sorts them, because clap prints groups in the order in which it meets them, and leaves
/// those for experts out of -h.
fn in_groups(mut command: Command) -> Command {
    let mut args: Vec<Arg> = command.get_arguments().cloned().map(grouped).collect();
    args.sort_by_key(|arg| GROUPS.iter().position(|group| arg.get_help_heading() == Some(*group)));
    let mut args = args.into_iter();
    command = command.mut_args(|arg| args.next().unwrap_or(arg));
    for command in command.get_subcommands_mut() {
        *command = in_groups(take(command));
    }
    command
}

fn grouped(arg: Arg) -> Arg {
    if arg.is_positional() {
        return arg.help_heading(None::<&str>);
    }
    if ["output", "overwrite", "resume"].contains(&arg.get_id().as_str()) {
        return arg.help_heading("Output");
    }
    match arg.get_help_heading() {
        Some("Expert") => arg.hide_short_help(true),
        Some(_) => arg,
        None => arg.help_heading("Input"),
    }
}
