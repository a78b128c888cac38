//! Reports tests that are skipped because something is missing. The tests of every crate include this file (`#[path]`).

use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::{Write, stderr};

const EXPECTED: &str = include_str!("expected-skips");

/// Notes, for `tests/run` to report, that a test or part of it does not run because `what` is missing. The test fails
/// if `tests/expected-skips` does not name `what`; `why` then says how to get it.
#[track_caller]
pub(crate) fn or_fail(what: &str, why: impl Display) {
    let named = |line: &str| line.split('|').next().is_some_and(|name| name.trim() == what);
    assert!(
        EXPECTED.lines().any(named),
        "{what} is missing ({why}), and tests/expected-skips does not name it"
    );
    // Bypasses the test harness, which captures the output of passing tests.
    let _ = writeln!(stderr(), "skipped: {what}: {why}");
    if let Some(list) = std::env::var_os("PHASEFRONT_SKIPS") {
        let mut list = OpenOptions::new()
            .append(true)
            .create(true)
            .open(list)
            .expect("PHASEFRONT_SKIPS names a file");
        let line = format!("{what}\t{why}\n");
        list.write_all(line.as_bytes()).expect("a skip is noted");
    }
}
