//! Tests the command `phasefront-lab`: its outputs, and the inputs that it refuses before any work.
use crate::folder;

use folder::Folder;
use phasefront_io::picture;
use std::fs;
use std::path::PathBuf;

impl Folder {
    /// Asserts that the command fails with `code` and one line that contains each of `words`, and leaves no file
    /// behind.
    fn refuses(&self, arguments: &[&str], code: i32, words: &[&str]) {
        let before = self.files("");
        let errors = self.fails(arguments, code);
        if code == 1 {
            let last = errors.lines().last().unwrap_or_default();
            assert!(last.starts_with("error: "), "{arguments:?}: {errors}");
        }
        for word in words {
            assert!(errors.contains(word), "{arguments:?}: no {word:?} in {errors}");
        }
        assert_eq!(self.files(""), before, "{arguments:?} left a file behind");
    }

    /// Returns the files in the folder `name`, sorted.
    fn files(&self, name: &str) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path(name)).unwrap();
        let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    }
}

#[test]
fn a_scene_is_the_same_each_time() {
    let folder = Folder::new();
    for name in ["a", "b"] {
        folder.succeeds(&["scene", "--seed", "5", "--size", "61x47", "--layers", "3", "-o", name]);
    }
    for file in ["layer_0.png", "depth_0.png", "layer_2.png"] {
        assert_eq!(
            fs::read(folder.path("a").join(file)).unwrap(),
            fs::read(folder.path("b").join(file)).unwrap()
        );
    }
    let scene = folder.succeeds(&["scene", "--seed", "1", "--size", "64x48", "-o", "s", "--json"]);
    let scene: serde_json::Value = serde_json::from_str(&scene).unwrap();
    assert_eq!(scene["hits"].as_array().unwrap().len(), 5);
}

#[test]
fn a_data_set_resumed_or_sharded_is_the_one_made_in_one_go() {
    let folder = Folder::new();
    let make = |name: &'static str, more: &[&'static str]| {
        let mut arguments = vec![
            "dataset",
            "--scenes",
            "6",
            "--size",
            "32",
            "--planes",
            "12",
            "--ldi-layers",
            "3",
            "--seed",
            "4",
            "-o",
            name,
        ];
        arguments.extend(more);
        folder.succeeds(&arguments)
    };
    let contents = |name: &str| {
        (folder.files(name).iter())
            .map(|path| (path.file_name().unwrap().to_owned(), fs::read(path).unwrap()))
            .collect::<Vec<_>>()
    };
    make("whole", &[]);
    assert_eq!(contents("whole").len(), 7);
    for shard in ["0/4", "1/4", "2/4", "3/4"] {
        make("shards", &["--shard", shard]);
    }
    assert!(contents("whole") == contents("shards"));
    make("resumed", &[]);
    fs::remove_file(folder.path("resumed/pair_000003.npz")).unwrap();
    make("resumed", &[]);
    assert!(contents("whole") == contents("resumed"));
    folder.refuses(
        &["dataset", "--scenes", "7", "--size", "32", "-o", "whole"],
        1,
        &["manifest.json", "other parameters"],
    );
    folder.refuses(&["dataset", "--scenes", "7", "--shard", "4/4", "-o", "x"], 2, &["i/n"]);
}

#[test]
fn the_occlusion_study_writes_its_pictures_and_figures() {
    let folder = Folder::new();
    let small = ["scene", "--seed", "5", "--size", "48x40", "--layers", "3"];
    folder.succeeds(&[&small[..], &["-o", "scene"]].concat());
    let study = ["occlusion", "--ldi", "scene", "--planes", "32", "-o", "study"];
    let figures: serde_json::Value =
        serde_json::from_str(&folder.succeeds(&[&study[..], &["--json"]].concat())).unwrap();
    let settings = figures["settings"].as_array().unwrap();
    assert_eq!(settings.len(), 6);
    assert_eq!(settings[5]["front"]["ssim_overall"], 1.0);
    assert!(settings[2]["artefacts"]["geometric_inaccuracy"].is_number());
    let picture = picture::read_rgb(&folder.path("study/comparison.png")).unwrap();
    assert_eq!(picture.dim(), (3, 2 * 40 + 4, 6 * 48 + 5 * 4));
    for setting in 1..=6 {
        for focus in ["front", "rear"] {
            let view = folder.path(&format!("study/setting_{setting}_{focus}.png"));
            assert_eq!(picture::read_rgb(&view).unwrap().dim(), (3, 40, 48));
        }
    }
    let text = folder.succeeds(&study);
    assert!(
        text.contains("waves (computation)") && text.contains("study/comparison.png"),
        "{text}"
    );
    folder.refuses(&["occlusion", "--ldi", "nowhere", "-o", "other"], 1, &["nowhere"]);
    folder.refuses(
        &["occlusion", "--ldi", "scene", "--planes", "0", "-o", "other"],
        1,
        &["planes"],
    );
}

#[test]
fn what_cannot_be_made_is_refused_in_one_line() {
    let folder = Folder::new();
    let at_the_modulator = "--offset-mm goes with holograms at the modulator";
    for (call, word) in [
        ("study layers --ldi-layers 3 -o study", "the study of planes"),
        ("study layers --offset-mm 3 -o study", at_the_modulator),
        ("occlusion --offset-mm 3 -o study", at_the_modulator),
        (
            "study displays --display santec-slm-200 -o study",
            "have displays of their own",
        ),
        ("study flicker --size 64 -o study", "studies other than of flicker"),
        ("study layers --data data --sensor lidar -o study", "of flicker"),
    ] {
        folder.refuses(&call.split(' ').collect::<Vec<_>>(), 2, &[word]);
    }
    let planes = ["occlusion", "--planes", "4000000000", "-o", "study"];
    folder.refuses(&planes, 1, &["4000000000 planes"]);
    folder.refuses(&["study", "flicker", "--data", "data", "-o", "study"], 2, &["--sensor"]);
    folder.refuses(&["scene", "-o", "s"], 2, &["--model"]);
    folder.refuses(&["scene", "--seed", "1", "--size", "0x5", "-o", "s"], 2, &["WxH"]);
}

#[test]
fn outputs_are_checked_before_any_work() {
    let folder = Folder::new();
    fs::create_dir(folder.path("full")).unwrap();
    fs::write(folder.path("full/mine.txt"), "mine").unwrap();
    for (call, word) in [
        ("scene --model none.obj -o full", "--overwrite"),
        ("dataset --scenes 1 --display none.toml -o full", "manifest.json"),
        ("seeds none -o full/mine.txt", "is a file"),
        ("occlusion --ldi none -o full/mine.txt", "is a file"),
        ("evaluate none --method rgb --pictures full", "--overwrite"),
        ("study layers --display none.toml -o full/mine.txt", "is a file"),
    ] {
        folder.refuses(&call.split(' ').collect::<Vec<_>>(), 1, &[word]);
    }
    let scene = ["scene", "--seed", "1", "--size", "16x12", "-o", "ldi"];
    folder.succeeds(&scene);
    folder.refuses(
        &["occlusion", "--ldi", "ldi", "--planes", "8", "-o", "ldi"],
        1,
        &["is the input "],
    );
    assert_eq!(folder.files("full").len(), 1);
}

#[test]
fn a_folder_that_is_filled_is_new_or_empty_or_overwritten() {
    let folder = Folder::new();
    fs::create_dir(folder.path("empty")).unwrap();
    fs::write(folder.path("empty/.hidden"), "mine").unwrap();
    let scene = ["scene", "--seed", "5", "--size", "16x12", "--layers", "3", "-o"];
    folder.succeeds(&[&scene[..], &["empty"]].concat());
    folder.succeeds(&[&scene[..], &["a/new/one"]].concat());
    fs::write(folder.path("empty/notes.txt"), "mine").unwrap();
    folder.refuses(&[&scene[..], &["empty"]].concat(), 1, &["empty", "--overwrite"]);
    let fewer = [
        "scene", "--seed", "6", "--size", "16x12", "--layers", "2", "-o", "empty",
    ];
    folder.succeeds(&[&fewer[..], &["--overwrite"]].concat());
    let names: Vec<_> = (folder.files("empty").iter())
        .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
        .collect();
    assert_eq!(
        names,
        [
            ".hidden",
            "depth_0.png",
            "depth_1.png",
            "layer_0.png",
            "layer_1.png",
            "notes.txt"
        ]
    );
}

#[test]
fn a_data_set_of_one_laser_is_made_and_evaluated() {
    let folder = Folder::new();
    fs::write(
        folder.path("one.toml"),
        "width = 48\nheight = 32\noffset_mm = 2.0\nwavelengths_nm = [532]\n",
    )
    .unwrap();
    let set = [
        "dataset", "--scenes", "40", "--size", "32", "--planes", "8", "--shard", "39/40",
    ];
    folder.succeeds(&[&set[..], &["--display", "one.toml", "--offset-mm", "0", "-o", "set"]].concat());
    let evaluate = [
        "evaluate",
        "set",
        "--method",
        "rgb,visible,layers,points,sweep",
        "--network",
        "8",
        "--json",
    ];
    let told: serde_json::Value =
        serde_json::from_str(&folder.succeeds(&[&evaluate[..], &["--encoder", "anti-alias"]].concat())).unwrap();
    let rows = told["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 12);
    let psnr = |name: &str| {
        let row = rows.iter().find(|row| row["method"] == name).unwrap();
        row["mean"]["amplitude_psnr"].as_f64().unwrap_or(f64::INFINITY)
    };
    assert!(psnr("layers") > 60.0 && psnr("sweep") > psnr("rgb"), "{told}");
    folder.refuses(
        &["occlusion", "--display", "one.toml", "-o", "n"],
        1,
        &["for displays of three lasers"],
    );
}
