//! Checks that dependencies inside the core point downward: a module names only modules listed before it.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

/// The modules, lowest first. If a group's own modules are listed one by one, they depend on each other in this order
/// too.
const LAYERS: &[&str] = &[
    "Bounds",
    "Size",
    "parallel",
    "runtime::error",
    "runtime::caught",
    "runtime::file",
    "runtime::keys",
    "runtime::cancel",
    "runtime::clock",
    "runtime::stage",
    "optics",
    "display",
    "display::response",
    "display::illumination",
    "display::panel",
    "display::registration",
    "display::lens",
    "display::model",
    "display::target",
    "frame",
    "depth",
    "method::mean_phase",
    "method::standing",
    "method::wave",
    "method::sweep",
    "method::network",
    "method::seeded",
    "method",
    "focus",
    "depth_network",
    "encode::brightness",
    "encode",
    "pipeline::shown",
    "pipeline::display_plan",
    "pipeline::field",
    "pipeline",
    "output",
    "output::modulator",
    "view::colours",
    "view::refocus",
    "view::preview",
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Returns the code of `text` without comments, up to its tests.
fn code(text: &str) -> String {
    let tests = text.find("#[cfg(test)]").unwrap_or(text.len());
    let lines = text[..tests].lines();
    lines
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect::<Vec<_>>()
        .join("\n")
}

/// Returns the paths that `code` names after `crate::`.
fn named(code: &str) -> Vec<String> {
    let mut paths = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        let end = |c: char| !(c.is_alphanumeric() || c == '_' || c == ':');
        paths.push(rest.split(end).next().unwrap_or_default().to_owned());
    }
    paths
}

/// Returns the index in [`LAYERS`] of the deepest module that contains `path`.
fn layer(path: &str) -> Option<usize> {
    let inside = |module: &str| path == module || path.strip_prefix(module).is_some_and(|rest| rest.starts_with("::"));
    let deepest = |&at: &usize| LAYERS[at].len();
    (0..LAYERS.len()).filter(|&at| inside(LAYERS[at])).max_by_key(deepest)
}

#[test]
fn modules_depend_on_lower_modules_only() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&source, &mut files);
    let mut wrong = Vec::new();
    for path in &files {
        let inside = path.strip_prefix(&source).unwrap().with_extension("");
        let module = inside.to_str().unwrap().replace(std::path::MAIN_SEPARATOR, "::");
        if ["lib", "runtime", "view"].contains(&&*module) {
            continue;
        }
        let own = layer(&module).unwrap_or_else(|| panic!("LAYERS does not list {module}"));
        for name in named(&code(&fs::read_to_string(path).unwrap())) {
            let macros = name == "stage";
            if !macros && layer(&name).is_none_or(|other| other > own) {
                wrong.push(format!("{module} depends on {name}"));
            }
        }
    }
    assert!(wrong.is_empty(), "dependencies that point upward: {wrong:#?}");
}

#[test]
fn a_dependency_that_points_upward_is_found() {
    let text = "use crate::pipeline::Pipeline;\n// use crate::view\nfn f() { crate::encode::g() }";
    let found = named(&code(text));
    assert_eq!(found, ["pipeline::Pipeline", "encode::g"]);
    assert!(layer("pipeline::Pipeline") > layer("encode::g"));
    assert!(layer("display::target::Target") > layer("display::Display"));
}
