//! What commands print: results, names of files and progress.

use indicatif::{ProgressBar, ProgressStyle};
use phasefront_core::runtime::error::Line;
use std::io::Write;
use std::path::Path;

/// A file's name in a line of text: without characters that control the terminal.
pub fn name(path: &Path) -> String {
    Line(&path.display().to_string()).to_string()
}

/// Prints a command's result: `json` in one line, or `text`, whose control characters other than newlines are replaced:
/// names of files, networks and scenes may have any.
pub fn print(json: bool, value: &serde_json::Value, text: impl std::fmt::Display) {
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

/// A count on stderr of what has no known end.
pub fn progress_count(what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {pos} {elapsed}, {per_sec}").expect("a well-formed template");
    ProgressBar::no_length().with_style(style).with_message(what.to_owned())
}

/// A progress bar on stderr, with the time left, where stderr is a terminal.
pub fn progress_bar(total: u64, what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {elapsed} {eta} left")
        .expect("a well-formed template");
    ProgressBar::new(total).with_style(style).with_message(what.to_owned())
}
