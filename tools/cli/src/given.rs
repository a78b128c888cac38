//! The flags of a command line, with their groups of help: what a record of a run is made of.

use clap::{Arg, ArgAction, ArgMatches, Command, ValueHint};
use std::path::PathBuf;

/// The value of a flag.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Given {
    /// Whether a switch is given.
    Switch(bool),
    /// A text, or `None` if the flag is not given and has no default.
    Text(Option<String>),
    /// A file, or a name that may be that of a file.
    File(Option<PathBuf>),
}

/// A flag of a command.
#[derive(Debug, Clone)]
pub(crate) struct Flag {
    /// The name, such as `--depth-unit`.
    pub(crate) name: String,
    /// The group in help.
    pub(crate) group: String,
    pub(crate) value: Given,
}

/// Returns the flags of `command` as `matches` has them.
pub(crate) fn flags(command: &Command, matches: &ArgMatches) -> Vec<Flag> {
    command.get_arguments().filter_map(|arg| flag(arg, matches)).collect()
}

fn flag(arg: &Arg, matches: &ArgMatches) -> Option<Flag> {
    let id = arg.get_id().as_str();
    let raw = || {
        let values = matches.get_raw(id)?;
        let values: Vec<_> = values.map(|value| value.to_string_lossy().into_owned()).collect();
        Some(values.join(","))
    };
    let value = match (arg.get_action(), arg.get_value_hint()) {
        (ArgAction::SetTrue, _) => Given::Switch(matches.get_flag(id)),
        (ArgAction::Set | ArgAction::Append, ValueHint::FilePath) => Given::File(raw().map(PathBuf::from)),
        (ArgAction::Set | ArgAction::Append, _) => Given::Text(raw()),
        _ => return None,
    };
    Some(Flag {
        name: format!("--{}", arg.get_long()?),
        group: arg.get_help_heading()?.to_owned(),
        value,
    })
}
