//! Tests the command as a user of a shell knows commands: help in groups, quiet and verbose runs, pipes, completions,
//! manual pages, and exit codes.
use crate::folder::{Folder, SMALL_HOLOGRAM};
use std::fs;
use std::process::Command;

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap()
}

#[test]
fn help_has_groups_and_the_short_one_the_common_flags() {
    let folder = Folder::new();
    let long = folder.succeeds(&["hologram", "--help"]);
    let groups = [
        "Input:", "Depth:", "Method:", "Display:", "Output:", "Expert:", "General:",
    ];
    let at: Vec<usize> = groups.iter().map(|group| long.find(group).expect(group)).collect();
    assert!(at.is_sorted(), "{long}");
    let group = |text: &str, flag: &str| {
        let at = text.find(flag).expect(flag);
        let mut heads = text[..at].lines().filter(|line| groups.contains(line));
        heads.next_back().unwrap_or_default().to_owned()
    };
    for (flag, head) in [
        ("--rgb", "Input:"),
        ("--ldi", "Input:"),
        ("--depth-unit", "Depth:"),
        ("--network <", "Method:"),
        ("--encoder <", "Method:"),
        ("--backend", "Method:"),
        ("--offset-mm", "Display:"),
        ("-o, --output", "Output:"),
        ("--packed", "Output:"),
        ("--local-steps", "Expert:"),
        ("--threads", "General:"),
        ("-q, --quiet", "General:"),
        ("-h, --help", "General:"),
    ] {
        assert_eq!(group(&long, flag), head, "{flag}");
    }
    let short = folder.succeeds(&["hologram", "-h"]);
    assert!(
        short.contains("--depth-unit") && short.contains("-o, --output"),
        "{short}"
    );
    assert!(
        !short.contains("Expert:") && !short.contains("--local-steps"),
        "{short}"
    );
    for command in ["video", "view", "judge", "multiplex", "encode", "refocus"] {
        let help = folder.succeeds(&[command, "--help"]);
        let heads: Vec<&str> = help.lines().filter(|line| groups.contains(line)).collect();
        let order: Vec<_> = heads
            .iter()
            .map(|head| groups.iter().position(|group| group == head))
            .collect();
        assert!(order.is_sorted() && order.len() >= 3, "{command}: {heads:?}");
        assert!(!help.contains("\nOptions:"), "{command}: {help}");
    }
}

#[test]
fn quiet_runs_say_nothing_and_verbose_ones_more() {
    let folder = Folder::new().with_frame();
    // Depth without metres, of which the command warns.
    image::GrayImage::from_pixel(48, 32, image::Luma([20]))
        .save(folder.path("depth.png"))
        .unwrap();
    let run = |more: &[&str]| {
        let output = folder.run(&[&SMALL_HOLOGRAM[..], &["--output", "h.png"], more].concat());
        assert!(output.status.success());
        (text(output.stdout), text(output.stderr))
    };
    let (out, errors) = run(&[]);
    assert!(out.contains("h.png") && errors.starts_with("warn: "), "{out}{errors}");
    assert_eq!(run(&["-q"]), (String::new(), String::new()));
    let (out, errors) = run(&["--quiet", "--json"]);
    assert!(out.starts_with('{') && errors.is_empty(), "{out}{errors}");
    let (_, errors) = run(&["-v", "--depth-unit", "mm"]);
    assert!(errors.contains("info: ") && errors.contains("near 0.020 m"), "{errors}");
    assert!(
        folder
            .fails(&["refocus", "none.png", "--z-mm", "0", "-q", "-o", "v.png"], 1)
            .contains("none.png")
    );
    folder.fails(&[&SMALL_HOLOGRAM[..], &["-o", "h.png", "-q", "-v"]].concat(), 2);
}

#[test]
fn one_file_goes_through_a_pipe() {
    let folder = Folder::new().with_frame();
    let made = |output: &str, more: &[&str]| {
        let done = folder.run(&[&SMALL_HOLOGRAM[..], &["-o", output], more].concat());
        let errors = text(done.stderr);
        assert!(done.status.success(), "{errors}");
        (done.stdout, errors)
    };
    made("h.png", &[]);
    let (piped, result) = made("-", &[]);
    assert_eq!(piped, fs::read(folder.path("h.png")).unwrap());
    assert!(result.contains("48×32"), "the result goes to stderr: {result}");
    let (piped, result) = made("-", &["--json"]);
    assert!(piped.starts_with(b"\x89PNG") && result.starts_with('{'), "{result}");
    let bytes = |arguments: &[&str]| folder.run(arguments).stdout;
    folder.succeeds(&["refocus", "h.png", "--z-mm", "1", "-o", "v.png"]);
    assert_eq!(
        bytes(&["refocus", "h.png", "--z-mm", "1", "-o", "-"]),
        fs::read(folder.path("v.png")).unwrap()
    );
    assert!(
        bytes(&["view", "h.png", "--views", "2", "-o", "-"])
            .to_ascii_lowercase()
            .starts_with(b"<!doctype html>")
    );
    assert!(bytes(&["link", "pattern", "--size", "640x96", "-o", "-"]).starts_with(b"\x89PNG"));
    // Several files do not fit into a pipe, nor do two outputs.
    let three = [&SMALL_HOLOGRAM[..], &["-o", "-", "--packed", "-"]].concat();
    assert!(folder.fails(&three, 1).contains("stdout takes one file"));
    assert!(
        folder
            .fails(&["refocus", "h.png", "--stack", "3", "-o", "-"], 1)
            .contains("the name of a folder")
    );
    assert!(!folder.path("-").exists());
}

#[test]
fn shells_get_completions_and_man_its_pages() {
    let folder = Folder::new();
    for (shell, word) in [
        ("bash", "complete -F"),
        ("zsh", "#compdef phasefront"),
        ("fish", "complete -c phasefront"),
    ] {
        let script = folder.succeeds(&["completions", shell]);
        for part in [word, "hologram", "depth-unit", "local-steps", "calibrate", "aberration"] {
            assert!(script.contains(part), "{shell}: {part}");
        }
        fs::write(folder.path(shell), script).unwrap();
    }
    // bash completes a flag and the values of another.
    let complete = |line: &str| {
        let script = format!(
            "source ./bash; COMP_WORDS=({line}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); \
             _phasefront phasefront \"${{COMP_WORDS[COMP_CWORD]}}\" \"${{COMP_WORDS[COMP_CWORD-1]}}\"; echo \"${{COMPREPLY[@]}}\""
        );
        let output = Command::new("bash")
            .args(["-c", &script])
            .current_dir(folder.0.path())
            .output()
            .unwrap();
        text(output.stdout)
    };
    assert_eq!(complete("phasefront hol"), "hologram\n");
    assert_eq!(complete("phasefront hologram --local"), "--local-steps\n");
    assert!(complete("phasefront hologram --depth-unit d").contains("disparity"));
    folder.succeeds(&["man", "-o", "man1"]);
    let page = fs::read_to_string(folder.path("man1/phasefront-hologram.1")).unwrap();
    assert!(
        page.starts_with(".ie") && page.contains(".TH") && page.contains("local\\-steps"),
        "{page}"
    );
    for name in [
        "phasefront.1",
        "phasefront-calibrate-aberration.1",
        "phasefront-video.1",
    ] {
        assert!(folder.path("man1").join(name).exists(), "{name}");
    }
}
