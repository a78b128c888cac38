//! Tests `--focus natural` and what it goes with: the displayed image is nearer to incoherent light, and what cannot be
//! is refused in one line.
use crate::folder;
use crate::ldi;

use folder::{Folder, SMALL_HOLOGRAM};
use phasefront::Size;
use serde_json::Value;
use std::fs;

const IMAGE: [&str; 4] = ["--rgb", "rgb.png", "--depth", "depth.png"];

/// Adds a frame of 96×64 pixels with edges of colour and depth.
fn with_edges(folder: &Folder) {
    let near = |x: u32, y: u32| (30..60).contains(&x) && (20..44).contains(&y);
    let rgb = image::RgbImage::from_fn(96, 64, |x, y| match near(x, y) {
        true => image::Rgb([230, 200, 160]),
        false => image::Rgb([(x * 2) as u8, if (x / 6 + y / 6) % 2 == 0 { 150 } else { 40 }, 90]),
    });
    rgb.save(folder.path("rgb.png")).unwrap();
    let depth = image::GrayImage::from_fn(96, 64, |x, y| image::Luma([if near(x, y) { 30 } else { 220 }]));
    depth.save(folder.path("depth.png")).unwrap();
}

fn json(folder: &Folder, arguments: &[&str]) -> Value {
    serde_json::from_str(&folder.succeeds(&[arguments, &["--json"]].concat())).unwrap()
}

fn natural_db(row: &Value) -> f64 {
    row["natural"]["psnr"].as_f64().unwrap()
}

#[test]
fn natural_focus_is_nearer_to_incoherent_light_and_coherent_is_the_default() {
    let folder = Folder::new();
    with_edges(&folder);
    let judge = [
        &["judge"],
        &IMAGE[..],
        &["--method", "sweep", "--focus", "coherent,natural"],
    ]
    .concat();
    let judged = json(&folder, &judge);
    let rows = judged["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 4);
    assert!(rows[3]["encoder"].as_str().unwrap().contains("natural focus, 30 steps"));
    assert!(natural_db(&rows[3]) > natural_db(&rows[1]) + 2.0, "{rows:?}");
    let in_focus = |row: &Value| row["natural"]["in_focus_psnr"].as_f64().unwrap();
    assert!(in_focus(&rows[3]) > in_focus(&rows[1]), "{rows:?}");

    let made = |name: &str, more: &[&str]| {
        folder.succeeds(&[&SMALL_HOLOGRAM[..], more, &["-o", name]].concat());
        fs::read(folder.path(name)).unwrap()
    };
    let default = made("default.png", &[]);
    assert!(made("coherent.png", &["--focus", "coherent"]) == default);
    let natural = made("natural.png", &["--focus", "natural"]);
    assert!(natural != default);
    assert!(made("steps.png", &["--focus", "natural", "--focus-steps", "30"]) == natural);
    assert!(made("few.png", &["--focus", "natural", "--focus-steps", "2"]) != natural);
    let by_default = |name: &str, more: &[&str]| {
        folder.succeeds(&[&["hologram"], &IMAGE[..], more, &["-o", name]].concat());
        fs::read(folder.path(name)).unwrap()
    };
    let by_network = by_default("network.png", &["--focus", "natural", "--focus-steps", "0"]);
    assert!(by_default("named.png", &["--network", "natural-8"]) == by_network && by_network != natural);
}

#[test]
fn maps_with_natural_focus_are_nearer_to_incoherent_light() {
    let folder = Folder::new();
    with_edges(&folder);
    let maps = [&["multiplex"], &IMAGE[..], &["--maps", "4", "--judge"]].concat();
    let last = |more: &[&str]| {
        let told = json(&folder, &[&maps[..], more].concat());
        natural_db(told["shown"].as_array().unwrap().last().unwrap())
    };
    let (coherent, natural) = (last(&[]), last(&["--focus", "natural", "-o", "maps"]));
    assert!(natural > coherent + 4.0, "{natural} {coherent}");
    let map = |n: usize| fs::read(folder.path(&format!("maps/phase_{n:03}.png"))).unwrap();
    assert!(map(0) != map(1) && folder.path("maps/phase_003.png").is_file());
}

#[test]
fn a_resumed_video_with_natural_focus_has_the_same_frames() {
    let folder = Folder::new();
    with_edges(&folder);
    fs::create_dir(folder.path("in")).unwrap();
    for n in 0..3 {
        fs::copy(folder.path("rgb.png"), folder.path(&format!("in/color_{n}.png"))).unwrap();
        fs::copy(folder.path("depth.png"), folder.path(&format!("in/depth_{n}.png"))).unwrap();
    }
    let video = ["video", "in", "--focus", "natural", "--focus-steps", "2", "-o", "out"];
    folder.succeeds(&video);
    let frame = |n: usize| folder.path(&format!("out/phase_{n:06}.png"));
    let whole = [0, 1, 2].map(|n| fs::read(frame(n)).unwrap());
    // Steps continue where the picture stands still.
    assert!(whole[1] != whole[0]);
    fs::remove_file(frame(2)).unwrap();
    folder.succeeds(&[&video[..], &["--resume"]].concat());
    assert!([0, 1, 2].map(|n| fs::read(frame(n)).unwrap()) == whole);
}

#[test]
fn what_natural_focus_cannot_do_is_one_line() {
    let folder = Folder::new().with_frame();
    ldi::write(&folder.path("ldi"), 5, Size { width: 48, height: 32 }, 1);
    fs::write(folder.path("fine.toml"), "width = 48\nheight = 32\npitch_um = 3.74").unwrap();
    let hologram = "hologram --rgb rgb.png --depth depth.png -o h.png";
    for (call, code, word) in [
        (format!("{hologram} --focus-steps 3"), 2, "--focus natural"),
        (
            format!("{hologram} --focus natural --midpoint-steps 1"),
            2,
            "one of the two",
        ),
        (format!("{hologram} --focus natural --method layers"), 2, "RGB-D image"),
        ("hologram --ldi ldi --focus natural -o h.png".into(), 2, "RGB-D image"),
        ("encode f.npy --focus natural -o h.png".into(), 2, "RGB-D image"),
        (
            "multiplex --rgb rgb.png --depth depth.png --focus natural --method sweep -o m".into(),
            2,
            "--focus coherent",
        ),
        (
            "multiplex --rgb rgb.png --depth depth.png --focus natural --maps 25 -o m".into(),
            2,
            "at most 24",
        ),
        (
            "multiplex --rgb rgb.png --depth depth.png --focus natural --focus-steps 0 -o m".into(),
            2,
            "joint step",
        ),
        (
            format!("{hologram} --focus natural --focus-steps 0 --method sweep"),
            2,
            "without steps",
        ),
        (
            format!("{hologram} --display fine.toml --focus natural --focus-steps 0"),
            1,
            "trained for the display",
        ),
    ] {
        let said = folder.fails(&call.split(' ').collect::<Vec<_>>(), code);
        assert!(said.contains(word) && said.lines().count() == 1, "{call}: {said}");
    }
    assert!(!folder.path("h.png").exists() && !folder.path("m").exists());
}
