//! The output of commands: results, file names and progress.

use indicatif::{ProgressBar, ProgressStyle};
use phasefront_core::runtime::error::Line;
use std::io::Write;
use std::path::Path;

/// Returns a file's name without characters that control the terminal.
pub fn name(path: &Path) -> String {
    Line(&path.display().to_string()).to_string()
}

/// Prints a command's result: `value` on one line if `json` is set, else `text`. Replaces control characters in `text`
/// other than newlines, because names of files, networks and scenes may contain any.
pub fn print(json: bool, value: &serde_json::Value, text: impl std::fmt::Display) {
    let mut out = std::io::stdout().lock();
    let printed = if json {
        writeln!(out, "{value}")
    } else {
        let control = |c: char| c.is_control() && c != '\n';
        writeln!(out, "{}", text.to_string().replace(control, "\u{fffd}"))
    };
    match printed.and_then(|()| out.flush()) {
        Ok(()) => {}
        // The reader closed the pipe: exit silently, as other programs do.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => std::process::exit(0),
        Err(e) => {
            let _ = writeln!(std::io::stderr(), "error: the result cannot be printed: {e}");
            std::process::exit(1);
        }
    }
}

/// Makes a counter on stderr for work of unknown length.
pub fn progress_count(what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {pos} {elapsed}, {per_sec}").expect("a well-formed template");
    ProgressBar::no_length().with_style(style).with_message(what.to_owned())
}

/// Makes a progress bar that shows the time left, on stderr if that is a terminal.
pub fn progress_bar(total: u64, what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {elapsed} {eta} left")
        .expect("a well-formed template");
    ProgressBar::new(total).with_style(style).with_message(what.to_owned())
}
