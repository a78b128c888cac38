//! Checks that dependencies inside `src/session` point downward: a file names only files listed before it, and nothing
//! through `session.rs`, which is above all of them.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The files, lowest first. `sync` has a twin in `fuzz/handover`, and `no_depth_estimates` is `depth_estimates` without
/// tract.
const LAYERS: &[&str] = &[
    "sync",
    "process_id",
    "computing",
    "guarded",
    "drop_reason",
    "history",
    "statistics",
    "focus",
    "quality",
    "options",
    "queue",
    "threads",
    "hologram",
    "owned_frame",
    "no_depth_estimates",
    "depth_estimates",
    "colour_stage",
    "engine/frame_input",
    "engine/on_cpu",
    "engine/on_gpu",
    "engine",
    "stages",
    "shared",
    "event",
    "live",
    "live_work",
    "handle",
    "answering",
];

/// Returns the code of `text` without comments, up to its tests.
fn code(text: &str) -> String {
    let tests = text.find("#[cfg(test)]").unwrap_or(text.len());
    let lines = text[..tests].lines();
    let uncommented: Vec<_> = lines.map(|line| line.split("//").next().unwrap_or_default()).collect();
    uncommented.join("\n").replace("in crate::session", "")
}

/// Returns the modules of `session` that the `code` of the file `own` names.
fn named(own: &str, code: &str) -> BTreeSet<String> {
    let folder = own.rsplit_once('/').map_or("", |(folder, _)| folder);
    let inside = if folder.is_empty() {
        String::new()
    } else {
        format!("{folder}/")
    };
    let mut found = BTreeSet::new();
    for (prefix, path) in [("super::", inside.as_str()), ("crate::session::", "")] {
        for (at, _) in code.match_indices(prefix) {
            let names = code[at + prefix.len()..].split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
            let mut names = names.flat_map(|path| path.split("::"));
            let (first, second) = (names.next().unwrap_or_default(), names.next().unwrap_or_default());
            let nested = format!("{path}{first}/{second}");
            let known = LAYERS.contains(&nested.as_str());
            found.insert(if known { nested } else { format!("{path}{first}") });
        }
    }
    found
}

#[test]
fn files_of_the_session_depend_on_lower_files_only() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/session");
    let mut wrong = Vec::new();
    for (own, file) in LAYERS.iter().enumerate() {
        let text = fs::read_to_string(source.join(format!("{file}.rs"))).unwrap();
        for name in named(file, &code(&text)) {
            if !LAYERS[..own].contains(&name.as_str()) {
                wrong.push(format!("{file} depends on {name}"));
            }
        }
    }
    assert!(wrong.is_empty(), "dependencies that point upward: {wrong:#?}");
}

#[test]
fn every_file_of_the_session_has_a_layer() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/session");
    let mut files = BTreeSet::new();
    for folder in ["", "engine"] {
        for entry in fs::read_dir(source.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "rs") {
                let name = path.file_stem().unwrap().to_str().unwrap();
                files.insert(Path::new(folder).join(name).to_str().unwrap().replace('\\', "/"));
            }
        }
    }
    assert_eq!(files, LAYERS.iter().map(|&file| file.to_owned()).collect());
}

#[test]
fn a_dependency_that_points_upward_is_found() {
    let code = code(
        "use super::{SessionOptions};\nuse super::stages::Stages; // super::live\nuse crate::session::engine::on_gpu::OnGpu;",
    );
    let found: Vec<_> = named("engine/on_cpu", &code).into_iter().collect();
    assert_eq!(found, ["engine/", "engine/on_gpu", "engine/stages"]);
    let found: Vec<_> = named("queue", "use super::engine::{Engine, GpuState};")
        .into_iter()
        .collect();
    assert_eq!(found, ["engine"]);
}
