//! Runs the commands of README and of guides as a reader pastes them: in a clone, after `samples/run`.
use crate::folder::Folder;
use image::imageops::FilterType;
use std::path::Path;

/// Returns the arguments of the commands `phasefront` in the blocks of shell code of a document.
fn commands(document: &str) -> Vec<Vec<String>> {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(document)).unwrap();
    let blocks = page
        .split("```sh\n")
        .skip(1)
        .filter_map(|rest| rest.split("```").next());
    let lines = blocks.flat_map(str::lines).map(|line| line.split(" #").next().unwrap());
    lines
        .filter_map(|line| line.strip_prefix("phasefront "))
        .map(|line| line.split_whitespace().map(str::to_owned).collect())
        .collect()
}

/// Returns the paths of the files in `folder` and in `out`, and their sizes in bytes.
fn files(folder: &Folder) -> impl Iterator<Item = (String, u64)> {
    let of = |name: &'static str, before: &'static str| {
        let entries = std::fs::read_dir(folder.path(name)).unwrap().map(Result::unwrap);
        entries.map(move |entry| {
            let name = entry.file_name().into_string().unwrap();
            (format!("{before}{name}"), entry.metadata().unwrap().len())
        })
    };
    of(".", "").chain(of("out", "out/"))
}

/// Runs the commands of `document` in a folder that has the samples, a third as wide and high if `small`, and what
/// `samples/run` makes of them.
fn runs(document: &str, least: usize, small: bool) {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("samples")).unwrap();
    std::fs::create_dir(folder.path("out")).unwrap();
    for name in ["scene_rgb.jpg", "scene_depth.png"] {
        let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples").join(name);
        let to = folder.path("samples").join(name);
        match small {
            false => std::fs::copy(sample, to).map(|_| ()).unwrap(),
            true => (image::open(sample).unwrap())
                .resize_exact(640, 360, FilterType::Nearest)
                .save(to)
                .unwrap(),
        }
    }
    let colour = [
        "hologram",
        "--rgb",
        "samples/scene_rgb.jpg",
        "--depth",
        "samples/scene_depth.png",
    ];
    folder.succeeds(&[&colour[..], &["-o", "out/hologram.png"]].concat());
    let commands = commands(document);
    assert!(commands.len() >= least, "{commands:?}");
    for command in &commands {
        let command: Vec<_> = command.iter().map(String::as_str).collect();
        folder.succeeds(&command);
        let is_output = |pair: &&[&str]| ["-o", "--packed", "--complex"].contains(&pair[0]);
        for output in command.windows(2).filter(is_output) {
            // A modulator that takes one colour after another has a file for each.
            let (stem, ending) = output[1].split_once('.').unwrap();
            let made = files(&folder).filter(|(name, _)| name.starts_with(stem) && name.ends_with(ending));
            let made: Vec<_> = made.collect();
            assert!(
                !made.is_empty() && made.iter().all(|(_, bytes)| *bytes > 10_000),
                "{command:?} {made:?}"
            );
        }
    }
}

#[test]
#[ignore = "slow: 40 seconds of a core"]
fn the_first_commands_run_as_they_stand() {
    runs("README.md", 3, false);
}

#[test]
#[ignore = "slow: a minute of a core"]
fn the_commands_of_the_guide_to_pages_run_as_they_stand() {
    runs("docs/view.md", 6, true);
}

#[test]
#[ignore = "slow: a minute of a core"]
fn the_commands_of_the_reference_pages_run_as_they_stand() {
    for (page, least) in [("docs/command.md", 2), ("docs/devices.md", 3), ("docs/focus.md", 1)] {
        runs(page, least, true);
    }
}
