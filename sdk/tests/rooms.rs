//! Imports run one way inside the core: each room names only rooms that stand before it in this list.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

/// The rooms, from the ground up. `input` and `unstable` only hand on what the others have.
const ROOMS: &[&str] = &[
    "error",
    "caught",
    "file",
    "keys",
    "cancel",
    "clock",
    "stage",
    "wave",
    "display",
    "slm",
    "illumination",
    "panel",
    "registration",
    "target",
    "frame",
    "depth",
    "sweep",
    "network",
    "seeded",
    "method",
    "brightness",
    "encode",
    "modulator",
    "pipeline",
    "output",
    "device",
    "refocus",
    "preview",
    "gpu",
    "session",
];

/// What the crate's front page hands on, by the room that it comes from.
const FRONT: &[(&str, &str)] = &[
    ("Brightness", "brightness"),
    ("Display", "display"),
    ("EncoderOptions", "encode"),
    ("Encoding", "encode"),
    ("Error", "error"),
    ("Result", "error"),
    ("RgbdFrame", "frame"),
    ("Method", "method"),
    ("Network", "network"),
    ("Pipeline", "pipeline"),
    ("ImageSession", "session"),
    ("LiveSession", "session"),
    ("VideoSession", "session"),
    ("SessionOptions", "session"),
    ("Sweep", "sweep"),
    ("Target", "target"),
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, found),
            false if path.extension().is_some_and(|e| e == "rs") => found.push(path),
            false => {}
        }
    }
}

/// The code of `text` without comments, up to its tests.
fn code(text: &str) -> String {
    let tests = text.find("#[cfg(test)]").unwrap_or(text.len());
    let lines = text[..tests].lines();
    lines
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect::<Vec<_>>()
        .join("\n")
}

/// The rooms that `code` names behind `crate::`.
fn named(code: &str) -> Vec<String> {
    let mut rooms = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        let names: Vec<&str> = match rest.strip_prefix('{') {
            None => vec![rest],
            Some(list) => list.split('}').next().unwrap().split(',').collect(),
        };
        rooms.extend(names.into_iter().map(|name| {
            let end = |c: char| !(c.is_alphanumeric() || c == '_');
            name.trim().split(end).next().unwrap_or_default().to_owned()
        }));
    }
    rooms
}

fn floor(name: &str) -> Option<usize> {
    let room = FRONT.iter().find(|(item, _)| *item == name);
    let room = room.map_or(name, |(_, room)| room);
    ROOMS.iter().position(|known| *known == room)
}

#[test]
fn rooms_name_only_rooms_below_them() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&source, &mut files);
    let mut wrong = Vec::new();
    for path in &files {
        let inside = path.strip_prefix(&source).unwrap();
        let room = inside.iter().next().unwrap().to_str().unwrap();
        let room = room.trim_end_matches(".rs");
        if ["lib", "input", "unstable"].contains(&room) {
            continue;
        }
        let own = floor(room).unwrap_or_else(|| panic!("{room} stands in no list of rooms"));
        for name in named(&code(&fs::read_to_string(path).unwrap())) {
            match floor(&name) {
                Some(other) if other <= own => {}
                _ => wrong.push(format!("{} names {name}", inside.display())),
            }
        }
    }
    assert!(wrong.is_empty(), "imports that run upwards: {wrong:#?}");
}

#[test]
fn an_import_that_runs_upwards_is_found() {
    let text = "use crate::{Error, session};\n// use crate::gpu\nfn f() { crate::encode::g() }";
    let found = named(&code(text));
    assert_eq!(found, ["Error", "session", "encode"]);
    assert!(floor("session") > floor("frame") && floor("SessionOptions") == floor("session"));
}
