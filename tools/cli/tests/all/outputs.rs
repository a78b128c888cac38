//! Tests that a command never destroys an input or an unrelated file, whatever names its outputs have.
use crate::folder;
use crate::ldi;
use phasefront::Size;

use folder::{Folder, SMALL_HOLOGRAM};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::Path;
use std::time::{Duration, SystemTime};

/// Creates a folder with a small frame, `rgb.png` and `depth.png`, and its hologram, `h.png`, `h.npy` and `h.json`.
fn folder() -> Folder {
    let folder = Folder::new().with_frame();
    folder.succeeds(&with(&SMALL_HOLOGRAM, &["--complex", "h.npy", "-o", "h.png"]));
    folder
}

fn with<'a>(call: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    [call, more].concat()
}

/// Returns everything below `at`: files with their bytes, and other entries with their kind.
fn contents(at: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(at).unwrap() {
        let path = entry.unwrap().path();
        let about = path.symlink_metadata().unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if about.is_dir() {
            let inner = contents(&path).into_iter();
            all.extend(inner.map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
            all.insert(name + "/", Vec::new());
        } else if about.is_file() {
            all.insert(name, fs::read(&path).unwrap());
        } else {
            all.insert(name, format!("{:?}", about.file_type()).into_bytes());
        }
    }
    all
}

/// Asserts that the command fails with one line that contains each of `words` and changes nothing.
fn refuses(folder: &Folder, arguments: &[&str], words: &[&str]) {
    let before = contents(folder.0.path());
    let errors = folder.fails(arguments, 1);
    let last = errors.lines().last().unwrap_or_default();
    assert!(last.starts_with("error: "), "{arguments:?}: {errors}");
    for word in words {
        assert!(last.contains(word), "{arguments:?}: no {word:?} in {errors}");
    }
    assert!(contents(folder.0.path()) == before, "{arguments:?} changed a file");
}

/// Makes a file or a folder look an hour old.
fn an_hour_old(path: &Path) {
    let then = SystemTime::now() - Duration::from_secs(3600);
    File::open(path).unwrap().set_modified(then).unwrap();
}

#[test]
fn only_temporary_files_of_killed_runs_are_removed() {
    let folder = folder();
    let left = [".phasefront-0aZ9bY8cX7dW.tmp"];
    let kept = [
        ".phasefront-notes.txt",
        ".phasefront-notes.tmp",
        ".phasefront-left",
        ".phasefront-0aZ9bY8cX7d-.tmp",
        ".phasefront-0aZ9bY8cX7dWe.tmp",
        ".phasefront-my-calibrations/lut.txt",
        ".phasefront-1aZ9bY8cX7dW.tmp/lut.txt",
    ];
    for name in left.iter().chain(&kept) {
        let path = folder.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "mine").unwrap();
        an_hour_old(&path);
        an_hour_old(path.parent().unwrap());
    }
    let held = File::create(folder.path(".phasefront-held5678901.tmp")).unwrap();
    held.lock().unwrap();
    an_hour_old(&folder.path(".phasefront-held5678901.tmp"));
    fs::write(folder.path(".phasefront-new456789012.tmp"), "").unwrap();
    folder.succeeds(&with(&SMALL_HOLOGRAM, &["-o", "out.png"]));
    folder.succeeds(&["refocus", "h.png", "--stack", "2", "-o", "stack"]);
    for name in left {
        assert!(!folder.path(name).exists(), "{name}");
    }
    for name in kept {
        assert!(folder.path(name).exists(), "{name}");
    }
    assert!(folder.path(".phasefront-held5678901.tmp").exists());
    assert!(folder.path(".phasefront-new456789012.tmp").exists());
}

#[cfg(unix)]
#[test]
fn pipes_and_links_with_names_of_temporary_files_are_left_alone() {
    let folder = folder();
    fs::write(folder.path("mine.txt"), "mine").unwrap();
    an_hour_old(&folder.path("mine.txt"));
    std::os::unix::fs::symlink("mine.txt", folder.path(".phasefront-link56789012.tmp")).unwrap();
    let names = [".phasefront-pipe", ".phasefront-pipe56789012.tmp"];
    for name in names {
        let path = folder.path(name);
        let made = std::process::Command::new("mkfifo").arg(&path).status().unwrap();
        assert!(made.success());
        let touched = std::process::Command::new("touch")
            .args(["-d", "2 hours ago"])
            .arg(&path)
            .status()
            .unwrap();
        assert!(touched.success());
    }
    folder.succeeds(&with(&SMALL_HOLOGRAM, &["-o", "out.png"]));
    assert!(names.iter().all(|name| folder.path(name).exists()));
    assert!(folder.path("mine.txt").exists() && folder.path(".phasefront-link56789012.tmp").is_symlink());
}

#[test]
fn an_input_is_never_an_output() {
    let folder = folder();
    fs::hard_link(folder.path("rgb.png"), folder.path("hard.png")).unwrap();
    fs::create_dir(folder.path("sub")).unwrap();
    fs::write(
        folder.path("lut.txt"),
        (0..256).map(|i| format!("{i} ")).collect::<String>(),
    )
    .unwrap();
    fs::write(folder.path("lut.toml"), "lut = \"lut.txt\"").unwrap();
    folder.succeeds(&["view", "h.png", "--views", "2", "-o", "page.html"]);
    folder.succeeds(&["pack", "h.png", "-o", "frame.png"]);
    ldi::write(&folder.path("ldi"), 1, Size { width: 48, height: 32 }, 2);
    fs::write(folder.path("model.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::create_dir_all(folder.path("captures/blue")).unwrap();
    fs::copy(folder.path("rgb.png"), folder.path("captures/blue/diffuser.png")).unwrap();
    let capture = "captures/blue/diffuser.png";
    let calls: &[&[&str]] = &[
        &[
            "calibrate",
            "lut",
            "--captures",
            "captures",
            "--overwrite",
            "-o",
            capture,
        ],
        &["calibrate", "laser", "captures", "--overwrite", "-o", capture],
        &with(&SMALL_HOLOGRAM, &["-o", "rgb.png"]),
        &with(&SMALL_HOLOGRAM, &["-o", "depth.png"]),
        &with(&SMALL_HOLOGRAM, &["-o", "./sub/../rgb.png"]),
        &with(&SMALL_HOLOGRAM, &["-o", "hard.png"]),
        &with(&SMALL_HOLOGRAM, &["-o", "new.png", "--packed", "rgb.png"]),
        &["hologram", "--ldi", "ldi", "--planes", "8", "-o", "ldi/layer_0.png"],
        &["refocus", "h.png", "--z-mm", "0", "-o", "h.png"],
        &["refocus", "h.npy", "--z-mm", "0", "-o", "v.png", "--trace", "h.json"],
        &["view", "page.html", "h.png", "-o", "page.html"],
        &["pack", "h.png", "-o", "h.png"],
        &["unpack", "frame.png", "--size", "48x32", "-o", "frame.png"],
        &[
            "calibrate",
            "pack",
            "--display",
            "lut.toml",
            "--overwrite",
            "-o",
            "lut.txt",
        ],
        &[
            "calibrate",
            "pack",
            "--display",
            "lut.toml",
            "--overwrite",
            "-o",
            "lut.toml",
        ],
    ];
    for call in calls {
        refuses(&folder, call, &["is the input "]);
    }
}

#[cfg(unix)]
#[test]
fn a_link_stays_and_the_file_that_it_points_to_is_replaced() {
    let folder = folder();
    std::os::unix::fs::symlink("rgb.png", folder.path("to_input.png")).unwrap();
    refuses(
        &folder,
        &with(&SMALL_HOLOGRAM, &["-o", "to_input.png"]),
        &["to_input.png", "is the input "],
    );
    std::os::unix::fs::symlink("nowhere.png", folder.path("to_nothing.png")).unwrap();
    refuses(
        &folder,
        &with(&SMALL_HOLOGRAM, &["-o", "to_nothing.png"]),
        &["to_nothing.png", "link"],
    );
    fs::write(folder.path("old.png"), "old").unwrap();
    std::os::unix::fs::symlink("old.png", folder.path("latest.png")).unwrap();
    folder.succeeds(&with(&SMALL_HOLOGRAM, &["-o", "latest.png"]));
    assert!(folder.path("latest.png").is_symlink());
    assert_eq!(
        fs::read(folder.path("old.png")).unwrap(),
        fs::read(folder.path("h.png")).unwrap()
    );
}

#[test]
fn two_outputs_never_have_one_name() {
    let folder = folder();
    let calls: &[&[&str]] = &[
        &with(&SMALL_HOLOGRAM, &["-o", "new.png", "--packed", "new.png"]),
        &with(&SMALL_HOLOGRAM, &["-o", "new.png", "--packed", "./new.png"]),
        &with(
            &SMALL_HOLOGRAM,
            &["-o", "new.png", "--complex", "new.npy", "--trace", "new.json"],
        ),
        &with(&SMALL_HOLOGRAM, &["-o", "h.png", "--packed", "h.png"]),
    ];
    for call in calls {
        refuses(&folder, call, &["is an output already"]);
    }
    refuses(
        &folder,
        &with(&SMALL_HOLOGRAM, &["-o", "h.png", "--trace", "h.png"]),
        &["h.png", ".json"],
    );
}

#[cfg(unix)]
#[test]
fn folders_and_special_files_are_never_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let folder = folder();
    fs::create_dir(folder.path("folder.png")).unwrap();
    let socket = std::os::unix::net::UnixListener::bind(folder.path("socket.png")).unwrap();
    let made = std::process::Command::new("mkfifo")
        .arg(folder.path("pipe.json"))
        .status()
        .unwrap();
    assert!(made.success());
    std::os::unix::fs::symlink("/dev/null", folder.path("null.json")).unwrap();
    refuses(
        &folder,
        &with(&SMALL_HOLOGRAM, &["-o", "folder.png"]),
        &["folder.png", "is a folder"],
    );
    refuses(
        &folder,
        &with(&SMALL_HOLOGRAM, &["-o", "socket.png"]),
        &["socket.png", "regular file"],
    );
    for name in ["pipe.json", "null.json"] {
        refuses(
            &folder,
            &["compare", "rgb.png", "rgb.png", "--trace", name],
            &[name, "regular file"],
        );
    }
    let null = fs::metadata("/dev/null").unwrap();
    assert!(null.file_type().is_char_device());
    // A packed hologram has three files.
    fs::create_dir(folder.path("frame-blue.png")).unwrap();
    let pack = ["pack", "h.png", "--display", "holoeye-pluto", "-o", "frame.png"];
    refuses(&folder, &pack, &["frame-blue.png", "is a folder"]);
    fs::write(folder.path("file"), "mine").unwrap();
    let stack = ["refocus", "h.png", "--stack", "2", "-o"];
    refuses(&folder, &with(&stack, &["file"]), &["file", "is a file"]);
    refuses(&folder, &with(&stack, &["file/in"]), &["file/in", "cannot be written"]);
    drop(socket);
}

#[test]
fn a_description_that_is_not_a_holograms_is_kept() {
    let folder = folder();
    fs::write(folder.path("notes.json"), r#"{"mine": true}"#).unwrap();
    let call = with(&SMALL_HOLOGRAM, &["--complex", "notes.npy", "-o", "new.png"]);
    refuses(&folder, &call, &["notes.json", "another name"]);
    // The files of an earlier hologram are replaced.
    folder.succeeds(&with(
        &SMALL_HOLOGRAM,
        &["--complex", "h.npy", "-o", "new.png", "--offset-mm", "1"],
    ));
    assert!(
        fs::read_to_string(folder.path("h.json"))
            .unwrap()
            .contains("\"offset_mm\": 1.0")
    );
}

/// Calls with invalid outputs, and a word of each error.
const BAD_OUTPUTS: &[(&str, &str)] = &[
    (
        "hologram --rgb none.png --depth none.png -o missing/h.png",
        "there is no folder missing",
    ),
    ("hologram --rgb none.png --depth none.png -o h.jpg", ".png"),
    (
        "hologram --rgb none.png --depth none.png -o h.png --complex missing/h.npy",
        "there is no folder missing",
    ),
    (
        "hologram --rgb none.png --depth none.png -o h.png --complex h.png",
        ".npy",
    ),
    ("refocus none.png --z-mm 0 -o v.tif", ".webp"),
    (
        "refocus none.png --z-mm 0 -o missing/v.png",
        "there is no folder missing",
    ),
    ("refocus none.png --stack 2 -o v.png", "a folder"),
    ("refocus none.png --stack 2 -o full", "--overwrite"),
    (
        "refocus none.png --stack 2 -o missing/v.gif",
        "there is no folder missing",
    ),
    ("view none.png -o v.htm", ".html"),
    ("view none.png -o missing/v.html", "there is no folder missing"),
    (
        "judge --rgb none.png --depth none.png -o missing/v.html",
        "there is no folder missing",
    ),
    (
        "bench --network none.onnx --plot missing/b.svg",
        "there is no folder missing",
    ),
    ("multiplex --rgb none.png --depth none.png -o full", "--overwrite"),
    ("multiplex --rgb none.png --depth none.png --packed p.bmp", ".png"),
    ("pack none.png -o missing/f.png", "there is no folder missing"),
    ("pack none.png -o f.bmp", ".png"),
    ("unpack none.png -o f.bmp", ".png"),
    ("link pattern -o missing/f.png", "there is no folder missing"),
    ("calibrate lut --patterns full --display none.toml", "--overwrite"),
    ("calibrate lut --captures none -o full/mine.txt", "--overwrite"),
    ("calibrate lut --captures none -o t.pfp --report full", "--overwrite"),
    ("calibrate laser none -o l.jpg", ".png"),
    ("calibrate pack --display none.toml -o full/mine.txt", "--overwrite"),
    ("calibrate rehearse -o full", "--overwrite"),
    (
        "calibrate aberration none --z-mm 1 --colour red -o missing/a.toml",
        "there is no folder missing",
    ),
    (
        "compare none.png none.png --trace missing/t.json",
        "there is no folder missing",
    ),
];

/// Errors in outputs are reported before an input is read, and therefore before any computation.
#[test]
fn outputs_are_checked_before_any_work() {
    let folder = Folder::new();
    fs::create_dir(folder.path("full")).unwrap();
    fs::write(folder.path("full/mine.txt"), "mine").unwrap();
    for (call, word) in BAD_OUTPUTS {
        refuses(&folder, &call.split(' ').collect::<Vec<_>>(), &[word]);
    }
}

/// A place where not even the superuser can create files.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_cannot_be_written_to_is_told_before_any_work() {
    let folder = Folder::new();
    for call in [
        &["refocus", "none.png", "--z-mm", "0", "-o", "/proc/v.png"][..],
        &["refocus", "none.png", "--stack", "2", "-o", "/proc/stack"],
    ] {
        refuses(&folder, call, &["/proc/", "cannot be written"]);
    }
}

#[test]
fn a_folder_that_is_filled_is_new_or_empty_or_overwritten() {
    let folder = folder();
    let maps = [
        "multiplex",
        "--rgb",
        "rgb.png",
        "--depth",
        "depth.png",
        "-o",
        "maps",
        "--maps",
    ];
    folder.succeeds(&with(&maps, &["3"]));
    fs::write(folder.path("maps/notes.txt"), "mine").unwrap();
    refuses(&folder, &with(&maps, &["2"]), &["--overwrite"]);
    folder.succeeds(&with(&maps, &["2", "--overwrite"]));
    let names: Vec<_> = contents(&folder.path("maps")).into_keys().collect();
    assert_eq!(names, ["notes.txt", "phase_000.png", "phase_001.png"]);
    for (from, to) in [
        ("rgb.png", "frames/color_0.png"),
        ("depth.png", "frames/depth_0.png"),
        ("rgb.png", "colours/one.png"),
        ("depth.png", "depths/one.png"),
    ] {
        fs::create_dir_all(folder.path(to).parent().unwrap()).unwrap();
        fs::copy(folder.path(from), folder.path(to)).unwrap();
    }
    let video = ["video", "frames", "-o"];
    let stills = ["hologram", "--rgb", "colours", "--depth", "depths", "-o"];
    for call in [&video[..], &stills] {
        refuses(&folder, &with(call, &["maps"]), &["maps", "a new or empty folder"]);
    }
}

#[test]
fn names_that_begin_with_a_dash_or_hold_control_characters_are_names() {
    let folder = folder();
    assert!(
        folder
            .succeeds(&with(&SMALL_HOLOGRAM, &["-o=-x.png"]))
            .starts_with("-x.png: ")
    );
    assert!(folder.path("-x.png").exists());
    if !cfg!(unix) {
        return;
    }
    let name = "a\n\u{1b}[31m\u{9b}b.png";
    let shown = "a\u{fffd}\u{fffd}[31m\u{fffd}b.png";
    let said = folder.succeeds(&with(&SMALL_HOLOGRAM, &["-o", name]));
    assert!(
        said.starts_with(&format!("{shown}: 48×32")) && said.lines().count() == 1,
        "{said:?}"
    );
    let said = folder.succeeds(&["refocus", name, "--z-mm", "0", "-o", "v\n\u{1b}.png"]);
    assert_eq!(said, "v\u{fffd}\u{fffd}.png\n");
    let said = folder.succeeds(&["pack", name, "-o", "f\u{1b}.png"]);
    assert!(said.starts_with("f\u{fffd}.png: "), "{said:?}");
}

#[test]
fn the_rule_is_in_the_help() {
    let help = Folder::new().succeeds(&["--help"]);
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        help.contains("An input is never replaced") && help.contains("--overwrite"),
        "{help}"
    );
}
