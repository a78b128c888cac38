//! The output of commands: results, file names and progress.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use phasefront_core::runtime::error::Line;
use phasefront_io::output;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether results in words and progress are left out.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Leaves out results in words, and progress.
pub(crate) fn set_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Returns a file's name without characters that control the terminal.
pub fn name(path: &Path) -> String {
    Line(&path.display().to_string()).to_string()
}

/// Writes a figure that there may not be, with `decimals`.
pub fn figure(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.decimals$}"))
}

/// Prints a command's result: `value` on one line if `json` is set, else `text` unless --quiet is given. Replaces
/// control characters in `text` other than newlines, because names of files, networks and scenes may contain any. Where
/// an output file takes stdout, the result goes to stderr.
pub fn print(json: bool, value: &serde_json::Value, text: impl std::fmt::Display) {
    let line = if json {
        value.to_string()
    } else if is_quiet() {
        return;
    } else {
        let control = |c: char| c.is_control() && c != '\n';
        text.to_string().replace(control, "\u{fffd}")
    };
    match output::takes_stdout() {
        true => check(writeln!(std::io::stderr(), "{line}")),
        false => print_file(format!("{line}\n").as_bytes()),
    }
}

/// Prints a file on stdout.
pub fn print_file(bytes: &[u8]) {
    let mut out = std::io::stdout().lock();
    check(out.write_all(bytes).and_then(|()| out.flush()));
}

/// Ends the process if printing failed.
fn check(printed: std::io::Result<()>) {
    match printed {
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
    shown(ProgressBar::no_length().with_style(style).with_message(what.to_owned()))
}

/// Makes a progress bar that shows the time left, on stderr if that is a terminal.
pub fn progress_bar(total: u64, what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {elapsed} {eta} left")
        .expect("a well-formed template");
    shown(ProgressBar::new(total).with_style(style).with_message(what.to_owned()))
}

/// Hides progress if --quiet is given.
fn shown(bar: ProgressBar) -> ProgressBar {
    if is_quiet() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    bar
}
