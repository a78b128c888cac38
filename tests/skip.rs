//! What a test does where something is missing. In the tests of every crate (`#[path]`).

use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::{Write, stderr};

const EXPECTED: &str = include_str!("expected-skips");

/// Notes that a test, or a part of it, does not run because `what` is missing, for `tests/run` to report. The test
/// fails where `tests/expected-skips` does not name `what`; `why` then says how to get it.
#[track_caller]
pub(crate) fn or_fail(what: &str, why: impl Display) {
    let named = |line: &str| line.split('|').next().is_some_and(|name| name.trim() == what);
    assert!(
        EXPECTED.lines().any(named),
        "{what} is missing ({why}), and tests/expected-skips does not name it"
    );
    // Past the test harness, which keeps what passing tests print.
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
