//! The flags of a command line, with their groups of help: what a record of a run is made of.

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, Id, ValueHint};
use std::path::PathBuf;

/// The group of the flags that name the input. A flag declares `group = SOURCE` to stay out of records, because what it
/// names is identified by its content.
pub(crate) const SOURCE: &str = "source";

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
    pub(crate) id: Id,
    /// The name, such as `--depth-unit`.
    pub(crate) name: String,
    /// The group in help.
    pub(crate) group: String,
    pub(crate) value: Given,
    /// Whether the command line has the flag.
    pub(crate) is_given: bool,
    /// Whether the flag is of the group [`SOURCE`].
    pub(crate) is_source: bool,
}

/// Returns the flags of `command` as `matches` has them.
pub(crate) fn flags(command: &Command, matches: &ArgMatches) -> Vec<Flag> {
    let groups = command.get_groups().filter(|group| group.get_id() == SOURCE);
    let sources: Vec<&Id> = groups.flat_map(|group| group.get_args()).collect();
    let flag = |arg: &Arg| flag(arg, matches, sources.contains(&arg.get_id()));
    command.get_arguments().filter_map(flag).collect()
}

/// Returns the flags that `A` declares, for flags that conflict with all of them.
pub(crate) fn ids<A: Args>() -> Vec<Id> {
    let command = A::augment_args(Command::new("flags"));
    command.get_arguments().map(|arg| arg.get_id().clone()).collect()
}

fn flag(arg: &Arg, matches: &ArgMatches, is_source: bool) -> Option<Flag> {
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
        id: arg.get_id().clone(),
        name: format!("--{}", arg.get_long()?),
        group: arg.get_help_heading()?.to_owned(),
        value,
        is_given: matches.value_source(id) == Some(ValueSource::CommandLine),
        is_source,
    })
}
