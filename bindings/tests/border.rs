//! Checks that no panic escapes to the other languages: each exported function that can fail runs inside `guard`, and
//! the others are few and listed here.
#![allow(clippy::unwrap_used)]

use std::path::Path;

/// The calls that only read what exists already, and the end of a session, which has no error to report.
const PLAIN: [&str; 16] = [
    "colours",
    "display",
    "height",
    "info",
    "modulator_names",
    "output_size",
    "pixel_bytes",
    "plane_len",
    "share",
    "shut_down",
    "srgb_of_light",
    "statistics",
    "target",
    "version",
    "width",
    "z_at",
];

/// Returns the exported functions of a file, each from its name to its end.
fn exported(source: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let exports = source.match_indices("#[uniffi::export").peekable();
    for (at, _) in exports {
        // The block ends with the exported function or `impl`, whose closing brace is not indented.
        let block = &source[at..][..source[at..].find("\n}\n").unwrap()];
        if block.contains("pub trait ") {
            continue;
        }
        let mut functions = block.split("pub fn ");
        functions.next();
        found.extend(functions);
    }
    found
}

#[test]
fn every_exported_call_is_guarded() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut calls = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let source = std::fs::read_to_string(&path).unwrap();
        for function in exported(&source) {
            calls += 1;
            let name = function.split('(').next().unwrap();
            let body = function.split_once("{\n").unwrap().1;
            let first = body.lines().find(|line| !line.trim().is_empty()).unwrap().trim();
            assert!(
                first.starts_with("guard(|| ") || PLAIN.contains(&name),
                "{}: {name} is not inside guard: {first}",
                path.display()
            );
        }
    }
    assert!(calls > 30, "{calls} calls were found");
}

#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    use phasefront_ffi::{Network, Target};
    let device = || "/dev/zero".to_owned();
    let refusals = [
        Network::from_file(device()).unwrap_err(),
        Target::from_file(device()).unwrap_err(),
    ];
    for why in refusals {
        let why = why.to_string();
        assert!(why.contains("/dev/zero") && why.contains("not a regular file"), "{why}");
    }
}
