//! Tests the command as a user runs it: its outputs, and the one-line error for each wrong input.
use crate::driver;
use crate::folder;
use crate::ldi;
use crate::skip;
use phasefront::Size;

use folder::Folder;
use ndarray::{Array2, Array3, s};
use ndarray_npy::WriteNpyExt;
use phasefront_core::optics::metrics;
use phasefront_io::{hologram, picture};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

const SAMPLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples");
const MODELS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models");

impl Folder {
    /// Asserts that the command fails with `code` and one line that contains each of `words`, and leaves no file
    /// behind.
    #[track_caller]
    fn refuses(&self, arguments: &[&str], code: i32, words: &[&str]) {
        self.refuses_as(&arguments.join(" "), arguments, code, words);
    }

    #[track_caller]
    fn refuses_as(&self, name: &str, arguments: &[&str], code: i32, words: &[&str]) {
        let before = self.files();
        let errors = self.fails(arguments, code);
        let is_of_clap = errors.contains("For more information");
        if !is_of_clap {
            let last = errors.lines().last().unwrap_or_default();
            assert!(last.starts_with("error: "), "{name}: {errors}");
            let count = errors.lines().filter(|l| l.starts_with("error")).count();
            assert_eq!(count, 1, "{name}: {errors}");
        }
        for word in words {
            assert!(errors.contains(word), "{name}: no {word:?} in {errors}");
        }
        assert_eq!(self.files(), before, "{name} left a file behind");
    }

    fn files(&self) -> Vec<PathBuf> {
        let mut files: Vec<_> = fs::read_dir(self.0.path())
            .unwrap()
            .map(|e| e.unwrap().path())
            .collect();
        files.sort();
        files
    }

    fn depth_npy(&self, name: &str, depth: &Array2<f32>) {
        depth.write_npy(File::create(self.path(name)).unwrap()).unwrap();
    }
}

const FRAME: [&str; 5] = ["hologram", "--rgb", "rgb.png", "--depth", "depth.png"];

fn with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    FRAME.iter().chain(more).copied().collect()
}

fn psnr(a: &Array3<f32>, b: &Array3<f32>, y: std::ops::Range<usize>, x: std::ops::Range<usize>) -> f64 {
    let part = s![.., y, x];
    metrics::compare(a.slice(part), b.slice(part)).unwrap().psnr_overall
}

#[test]
fn a_trace_has_the_stages_of_the_work() {
    let folder = Folder::new().with_frame();
    let hologram = [
        "hologram",
        "--rgb",
        "rgb.png",
        "--depth",
        "depth.png",
        "-o",
        "out.png",
        "--trace",
    ];
    folder.succeeds(&[&hologram[..], &["trace.json"]].concat());
    let events: serde_json::Value = serde_json::from_slice(&fs::read(folder.path("trace.json")).unwrap()).unwrap();
    let names = |phase: &str| -> Vec<_> {
        let of_phase = events.as_array().unwrap().iter().filter(|event| event["ph"] == phase);
        of_phase
            .map(|event| event["name"].as_str().unwrap().to_owned())
            .collect()
    };
    let of_depth = ["register", "narrow", "fill", "smooth", "edges", "surfaces"];
    let of_frame = ["method", "propagate", "encode"];
    assert_eq!(names("B"), [&["depth"][..], &of_depth, &of_frame].concat());
    assert_eq!(names("E"), [&of_depth[..], &["depth"], &of_frame].concat());
    let nowhere = [&hologram[..], &["nowhere/trace.json"]].concat();
    folder.refuses(&nowhere, 1, &["there is no folder nowhere"]);
}

#[test]
fn a_hologram_travels_with_all_that_refocus_needs() {
    let folder = Folder::new().with_frame();
    fs::write(
        folder.path("display.toml"),
        "pitch_um = 8\noffset_mm = 3\nlut = \"lut.txt\"",
    )
    .unwrap();
    let lut: String = (0..256).map(|i| format!("{}\n", 255 - i)).collect();
    fs::write(folder.path("lut.txt"), lut).unwrap();
    for method in ["network", "layers", "points"] {
        folder.succeeds(&with(&[
            "--method",
            method,
            "--display",
            "display.toml",
            "--complex",
            "h.npy",
            "-o",
            "h.png",
        ]));
        folder.succeeds(&["refocus", "h.png", "--z-mm", "1", "-o", "view.png"]);
        folder.succeeds(&["refocus", "h.npy", "--z-mm", "1", "-o", "field.png"]);
        let view = picture::read_rgb(&folder.path("view.png")).unwrap();
        let field = picture::read_rgb(&folder.path("field.png")).unwrap();
        let alike = psnr(&view, &field, 4..28, 4..44);
        assert!(alike > 20.0, "{method}: phase-only and complex differ: {alike} dB");
    }
}

#[test]
fn json_is_one_object_on_stdout() {
    let folder = Folder::new().with_frame();
    let made: serde_json::Value = serde_json::from_str(&folder.succeeds(&with(&["-o", "h.png", "--json"]))).unwrap();
    assert_eq!(made["width"], 48);
    for stage in ["sweep", "propagate", "encode"] {
        assert!(made["stage_ms"][stage].is_number(), "{made}");
    }
    let compared: serde_json::Value =
        serde_json::from_str(&folder.succeeds(&["compare", "rgb.png", "rgb.png", "--json"])).unwrap();
    assert_eq!(compared["ssim_overall"], 1.0);
}

#[test]
fn layered_depth_images_become_holograms_and_stacks() {
    let folder = Folder::new();
    ldi::write(&folder.path("a"), 5, Size { width: 61, height: 47 }, 3);
    folder.succeeds(&["hologram", "--ldi", "a", "--planes", "20", "-o", "h.png"]);
    folder.succeeds(&["refocus", "h.png", "--stack", "3", "-o", "stack"]);
    assert_eq!(fs::read_dir(folder.path("stack")).unwrap().count(), 3);
    for mode in ["none", "input", "geometric"] {
        let points = ["hologram", "--ldi", "a", "--method", "points", "--occlusion", mode];
        folder.succeeds(&[&points[..], &["-o", "h.png"]].concat());
    }
}

#[test]
fn pictures_are_what_their_names_say() {
    let folder = Folder::new().with_frame();
    folder.succeeds(&made(&[]));
    let kinds: [(&str, &[u8]); 4] = [
        ("v.png", b"\x89PNG"),
        ("v.jpg", &[0xFF, 0xD8, 0xFF]),
        ("v.JPEG", &[0xFF, 0xD8, 0xFF]),
        ("v.webp", b"RIFF"),
    ];
    for (name, magic) in kinds {
        folder.succeeds(&["refocus", "h.png", "--z-mm", "0", "-o", name]);
        assert!(fs::read(folder.path(name)).unwrap().starts_with(magic), "{name}");
    }
    for (name, magic) in [("s.gif", &b"GIF89a"[..]), ("s.webp", b"RIFF")] {
        folder.succeeds(&["refocus", "h.png", "--stack", "3", "--width", "24", "-o", name]);
        let bytes = fs::read(folder.path(name)).unwrap();
        assert!(bytes.starts_with(magic), "{name}");
    }
    let gif = fs::File::open(folder.path("s.gif")).unwrap();
    let decoder = image::codecs::gif::GifDecoder::new(std::io::BufReader::new(gif)).unwrap();
    let frames = image::AnimationDecoder::into_frames(decoder).collect_frames().unwrap();
    // The animation runs forward and back.
    assert_eq!(frames.len(), 4);
    assert_eq!(frames[0].buffer().dimensions(), (24, 16));
    let moving = fs::read(folder.path("s.webp")).unwrap();
    let moving = webp::AnimDecoder::new(&moving).decode().unwrap();
    assert!(moving.has_animation() && moving.len() == 4);
    assert_eq!(
        (
            moving.get_frame(0).unwrap().width(),
            moving.get_frame(0).unwrap().height()
        ),
        (24, 16)
    );
    let view = ["refocus", "h.png", "--z-mm", "0", "-o"];
    let stack = ["refocus", "h.png", "--stack", "3", "-o"];
    for (call, name, word) in [
        (&view, "v.gif", ".png, .jpg, .jpeg or .webp"),
        (&view, "v.tif", ".png, .jpg, .jpeg or .webp"),
        (&stack, "v2.png", "a folder"),
        (&stack, "v2.jpg", ".gif or .webp"),
    ] {
        folder.refuses(&[&call[..], &[name]].concat(), 1, &[name, word]);
    }
}

#[test]
fn an_image_is_fitted_to_the_modulator() {
    let folder = Folder::new().with_frame();
    fs::write(folder.path("display.toml"), "width = 96\nheight = 96").unwrap();
    let call = made(&["--display", "display.toml"]);
    let warned = folder.run(&call);
    assert!(String::from_utf8(warned.stderr).unwrap().contains("--fit"));
    assert_eq!(
        hologram::read_hologram(&folder.path("h.png")).unwrap().size(),
        Size { width: 48, height: 32 }
    );
    for fit in ["contain", "cover", "centre"] {
        let output = folder.run(&[&call[..], &["--fit", fit]].concat());
        assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
        assert_eq!(
            hologram::read_hologram(&folder.path("h.png")).unwrap().size(),
            Size { width: 96, height: 96 }
        );
        folder.succeeds(&["refocus", "h.png", "--z-mm", "0", "-o", "v.png"]);
        let view = picture::read_rgb(&folder.path("v.png")).unwrap();
        let light = |y: usize, x: usize| view.slice(s![.., y..y + 6, x..x + 6]).mean().unwrap();
        // The space above the picture is black, or the picture fills it.
        assert_eq!(light(2, 46) > 0.1, fit == "cover", "{fit}");
        assert!(light(46, 46) > 0.15, "{fit}");
        assert_eq!(light(46, 4) > 0.1, fit != "centre", "{fit}");
    }
}

#[test]
fn a_hologram_of_another_size_than_its_modulator_is_told_of() {
    let folder = Folder::new().with_frame();
    for (name, (width, height)) in [("wide", (1921, 8)), ("whole", (96, 8))] {
        let rgb = image::RgbImage::from_pixel(width, height, image::Rgb([90; 3]));
        rgb.save(folder.path(&format!("{name}.png"))).unwrap();
        let depth = image::GrayImage::from_fn(width, height, |x, _| image::Luma([(x % 256) as u8]));
        depth.save(folder.path(&format!("{name}-depth.png"))).unwrap();
    }
    fs::write(folder.path("pitch.toml"), "pitch_um = 8").unwrap();
    fs::write(folder.path("same.toml"), "width = 96\nheight = 8\nvolume_depth_mm = 1").unwrap();
    let told = |name: &str, more: &[&str]| {
        let (rgb, depth) = (format!("{name}.png"), format!("{name}-depth.png"));
        let sweep = ["--method", "sweep", "--planes", "3"];
        let output = folder.run(&[&hologram(&rgb, &depth)[..], &sweep, more].concat());
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    // The default display is a placeholder, so a smaller frame gives no warning and a larger one does.
    assert_eq!(told("whole", &[]), "");
    let larger = told("wide", &[]);
    assert!(
        larger.contains("1921×8") && larger.contains("default modulator 1920×1080"),
        "{larger}"
    );
    let smaller = told("whole", &["--display", "pitch.toml"]);
    assert!(
        smaller.contains("96×8") && smaller.contains("the modulator 1920×1080: --fit"),
        "{smaller}"
    );
    assert_eq!(told("whole", &["--display", "same.toml"]), "");
    assert_eq!(told("wide", &["--fit", "contain", "--display", "same.toml"]), "");
}

#[test]
fn depth_is_turned_round() {
    let folder = Folder::new().with_frame();
    let turned = image::GrayImage::from_fn(48, 32, |x, _| image::Luma([if x < 24 { 225 } else { 35 }]));
    turned.save(folder.path("turned.png")).unwrap();
    folder.succeeds(&made(&[]));
    let straight = hologram::read_hologram(&folder.path("h.png")).unwrap();
    folder.succeeds(&[&hologram("rgb.png", "turned.png")[..], &["--invert"]].concat());
    assert_eq!(hologram::read_hologram(&folder.path("h.png")).unwrap(), straight);
    folder.succeeds(&hologram("rgb.png", "turned.png"));
    assert_ne!(hologram::read_hologram(&folder.path("h.png")).unwrap(), straight);
}

#[test]
fn names_of_networks_are_listed_and_a_deep_field_is_told() {
    let folder = Folder::new().with_frame();
    let list = folder.succeeds(&["networks"]);
    for name in ["ddpm-8", "rgbd-8", "rgbd-15"] {
        assert_eq!(
            list.lines()
                .filter(|line| line.starts_with(&format!("{name} ")))
                .count(),
            1,
            "{list}"
        );
    }
    assert!(list.contains("0 mm, with its pre-filter"), "{list}");
    let warned = |network| {
        let output = folder.run(&made(&["--network", network, "--complex", "f.npy"]));
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(warned("ddpm-8").contains("pre-filter"));
    assert!(!warned("8").contains("pre-filter"));
}

#[test]
fn the_object_in_focus_matches_the_sample_there_and_not_elsewhere() {
    let folder = Folder::new();
    let rgb = format!("{SAMPLES}/scene_rgb.jpg");
    let depth = format!("{SAMPLES}/scene_depth.png");
    folder.succeeds(&[
        "hologram",
        "--rgb",
        &rgb,
        "--depth",
        &depth,
        "--complex",
        "h.npy",
        "-o",
        "h.png",
    ]);
    let image = picture::read_rgb(Path::new(&rgb)).unwrap();
    // The board with the text lies at d ≈ 0.1 and the clock on the wall at d ≈ 0.92.
    let (near, far) = ("2.38", "-2.5");
    let board = (580..860, 130..600);
    let clock = (200..400, 1480..1680);
    for hologram in ["h.npy", "h.png"] {
        let view = |z| {
            folder.succeeds(&["refocus", hologram, "--z-mm", z, "-o", "view.png"]);
            picture::read_rgb(&folder.path("view.png")).unwrap()
        };
        let (near, far) = (view(near), view(far));
        for (what, at, sharp, blurred) in [("board", &board, &near, &far), ("clock", &clock, &far, &near)] {
            let sharp = psnr(sharp, &image, at.0.clone(), at.1.clone());
            let blurred = psnr(blurred, &image, at.0.clone(), at.1.clone());
            assert!(
                sharp > blurred + 5.0,
                "{hologram} {what}: {sharp:.2} dB in focus, {blurred:.2} dB out of it"
            );
        }
    }
}

#[test]
fn real_captures_are_filled_and_shown() {
    let tum = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/tum");
    if !tum.is_dir() {
        skip::or_fail("captured data", format!("{} is not there", tum.display()));
        return;
    }
    let folder = Folder::new();
    let (rgb, depth) = (tum.join("color.png"), tum.join("depth.png"));
    for method in [
        &["network"][..],
        &["layers", "--planes", "16"],
        &["points", "--planes", "16"],
    ] {
        let frame = [
            "hologram",
            "--rgb",
            rgb.to_str().unwrap(),
            "--depth",
            depth.to_str().unwrap(),
            "--depth-unit",
            "raw",
            "--depth-scale",
            "5000",
            "-o",
            "h.png",
            "--method",
        ];
        folder.succeeds(&[&frame[..], method].concat());
        folder.succeeds(&["refocus", "h.png", "--z-mm", "-2", "-o", "view.png"]);
    }
}

#[test]
fn depth_of_another_size_is_brought_to_that_of_the_colour() {
    let folder = Folder::new().with_frame();
    for (width, height) in [(24, 16), (96, 64)] {
        let depth = image::GrayImage::from_pixel(width, height, image::Luma([128]));
        depth.save(folder.path("depth.png")).unwrap();
        let output = folder.run(&with(&["-o", "h.png"]));
        assert!(output.status.success());
        assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
    }
}

/// Returns arguments that create a hologram from these files.
fn hologram<'a>(rgb: &'a str, depth: &'a str) -> Vec<&'a str> {
    vec!["hologram", "--rgb", rgb, "--depth", depth, "-o", "h.png"]
}

/// Returns arguments that create a hologram from the default frame, and `more`.
fn made<'a>(more: &[&'a str]) -> Vec<&'a str> {
    with(&[more, &["-o", "h.png"]].concat())
}

#[test]
fn pictures_that_cannot_be_used_are_named() {
    let folder = Folder::new().with_frame();
    let whole = fs::read(folder.path("rgb.png")).unwrap();
    fs::write(folder.path("short.png"), &whole[..whole.len() / 2]).unwrap();
    fs::write(folder.path("empty.png"), []).unwrap();
    let square = image::GrayImage::new(40, 40);
    square.save(folder.path("square.png")).unwrap();
    for (name, arguments, words) in [
        (
            "no file",
            hologram("none.png", "depth.png"),
            &["none.png", "cannot be read"][..],
        ),
        (
            "half a file",
            hologram("short.png", "depth.png"),
            &["short.png", "whole"],
        ),
        ("an empty file", hologram("empty.png", "depth.png"), &["empty.png"]),
        ("colour as depth", hologram("rgb.png", "rgb.png"), &["rgb.png", "grey"]),
        ("depth of another shape", hologram("rgb.png", "square.png"), &["aspect"]),
        (
            "pictures of two sizes",
            vec!["compare", "rgb.png", "square.png"],
            &["48×32", "40×40"],
        ),
        (
            "a picture as hologram",
            vec!["refocus", "rgb.png", "--z-mm", "0", "-o", "v.png"],
            &["rgb.png", "hologram"],
        ),
        (
            "no folder of layers",
            vec!["hologram", "--ldi", "nowhere", "-o", "h.png"],
            &["nowhere"],
        ),
    ] {
        folder.refuses_as(name, &arguments, 1, words);
    }
}

#[test]
fn a_depth_that_promises_more_than_there_is_is_named() {
    let folder = Folder::new().with_frame();
    let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000), }";
    let header = [b"\x93NUMPY\x01\x00", &[text.len() as u8, 0][..], text.as_bytes()].concat();
    fs::write(folder.path("huge.npy"), &header).unwrap();
    folder.refuses(
        &hologram("rgb.png", "huge.npy"),
        1,
        &["huge.npy", "is not a whole .npy"],
    );
    fs::write(folder.path("huge.json"), "{}").unwrap();
    folder.refuses(
        &["refocus", "huge.npy", "--z-mm", "0", "-o", "seen.png"],
        1,
        &["huge.npy", "is not a whole"],
    );
    folder.refuses(&hologram("rgb.png", "/dev/zero.npy"), 1, &["/dev/zero.npy"]);
}

/// Tests the command without a usable stdout, with unusual file names, and with restricted permissions.
#[cfg(unix)]
#[test]
fn it_lives_with_the_system_around_it() {
    use std::os::unix::ffi::OsStrExt;
    use std::os::unix::fs::PermissionsExt;
    use std::process::Stdio;
    let folder = Folder::new().with_frame();
    let arguments = with(&["-o", "out.png", "--json"]);
    let command = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_phasefront"));
        command
            .args(&arguments)
            .current_dir(folder.0.path())
            .env_remove("RUST_LOG");
        command
    };
    let ends = |mut command: Command, code: i32, words: &str| {
        let output = command
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
            .wait_with_output()
            .unwrap();
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{errors}");
        assert!(errors.contains(words) && !errors.contains("panicked"), "{errors}");
    };
    // The reader is gone: this end of the pipe is closed before anything is printed.
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut closed = command();
    closed.stdout(writer);
    ends(closed, 0, "");
    if let Ok(full) = File::options().write(true).open("/dev/full") {
        let mut disk = command();
        disk.stdout(full);
        ends(disk, 1, "the result cannot be printed");
    }
    let name = std::ffi::OsStr::from_bytes(b"out\xff.png");
    let position = arguments.iter().position(|a| *a == "-o").unwrap();
    let mut others = arguments.clone();
    others.drain(position..position + 2);
    let mut foreign = Command::new(env!("CARGO_BIN_EXE_phasefront"));
    foreign
        .args(&others)
        .args([std::ffi::OsStr::new("-o"), name])
        .current_dir(folder.0.path());
    foreign.stdout(Stdio::null());
    ends(foreign, 0, "");
    assert!(folder.0.path().join(name).exists());
    for (mask, mode) in [("077", 0o600), ("022", 0o644), ("002", 0o664)] {
        let _ = fs::remove_file(folder.path("out.png"));
        let mut masked = Command::new("sh");
        let script = format!("umask {mask}; exec \"$0\" \"$@\"");
        masked
            .args(["-c", &script, env!("CARGO_BIN_EXE_phasefront")])
            .args(&arguments);
        masked.current_dir(folder.0.path()).stdout(Stdio::null());
        ends(masked, 0, "");
        let about = fs::metadata(folder.path("out.png")).unwrap();
        assert_eq!(about.permissions().mode() & 0o777, mode, "umask {mask}");
    }
    // What is replaced keeps its permissions.
    for mode in [0o600, 0o640, 0o444] {
        fs::set_permissions(folder.path("out.png"), fs::Permissions::from_mode(mode)).unwrap();
        ends(command(), 0, "");
        let about = fs::metadata(folder.path("out.png")).unwrap();
        assert_eq!(about.permissions().mode() & 0o777, mode);
    }
}

#[test]
fn depth_that_means_nothing_is_named() {
    let folder = Folder::new().with_frame();
    let mut depth = Array2::from_elem((32, 48), 0.5f32);
    depth[(3, 4)] = f32::INFINITY;
    folder.depth_npy("infinite.npy", &depth);
    folder.depth_npy("nan.npy", &Array2::from_elem((32, 48), f32::NAN));
    folder.depth_npy("metres.npy", &Array2::from_elem((32, 48), 2.0));
    folder.depth_npy("nothing.npy", &Array2::zeros((0, 0)));
    for (name, arguments, words) in [
        (
            "infinite",
            hologram("rgb.png", "infinite.npy"),
            &["infinite.npy", "inf"][..],
        ),
        ("all holes", hologram("rgb.png", "nan.npy"), &["nan.npy", "no reading"]),
        (
            "metres as parts of the volume",
            hologram("rgb.png", "metres.npy"),
            &["metres.npy", "unit"],
        ),
        ("no pixel", hologram("rgb.png", "nothing.npy"), &["nothing.npy"]),
    ] {
        folder.refuses_as(name, &arguments, 1, words);
    }
    let millimetres = Array2::from_shape_fn((32, 48), |(_, x)| 500.0 + 70.0 * x as f32);
    folder.depth_npy("mm.npy", &millimetres);
    let near_far = |unit, near, far| {
        let more = ["--depth-unit", unit, "--near", near, "--far", far];
        [&hologram("rgb.png", "mm.npy")[..], &more].concat()
    };
    for (name, arguments, words) in [
        (
            "near and far in millimetres",
            near_far("mm", "500", "4000"),
            &["mm.npy", "near 500 m", "from 0.5 m to 3.79 m", "both are metres"][..],
        ),
        (
            "near and far of normalized depth",
            made(&["--near", "0.2", "--far", "0.8"]),
            &["depth.png", "near and far are metres"],
        ),
    ] {
        folder.refuses_as(name, &arguments, 1, words);
    }
    let told = |arguments: &[&str]| String::from_utf8(folder.run(arguments).stderr).unwrap();
    assert!(told(&near_far("mm", "0.5", "0.6")).contains("96 % of the depth"));
    assert_eq!(told(&near_far("mm", "0.5", "4")), "");
    // Holes are filled. In metres, infinity is a hole.
    depth[(3, 4)] = f32::NAN;
    folder.depth_npy("hole.npy", &depth);
    folder.succeeds(&hologram("rgb.png", "hole.npy"));
    let metres = [&hologram("rgb.png", "infinite.npy")[..], &["--depth-unit", "m"]].concat();
    folder.succeeds(&metres);
    // Nothing but 0 may be an empty reading.
    folder.depth_npy("zero.npy", &Array2::zeros((32, 48)));
    assert!(told(&hologram("rgb.png", "zero.npy")).contains("100 % of it is 0"));
    // Black colour has no edges.
    image::RgbImage::new(48, 32).save(folder.path("black.png")).unwrap();
    folder.succeeds(&hologram("black.png", "hole.npy"));
}

#[test]
fn options_that_cannot_be_meant_are_named() {
    let folder = Folder::new().with_frame();
    for (name, arguments, words) in [
        (
            "an offset out of reach",
            made(&["--offset-mm", "9000"]),
            &["9000", "smaller"][..],
        ),
        ("no planes", made(&["--method", "layers", "--planes", "0"]), &["plane"]),
        (
            "more planes than fit in memory",
            made(&["--method", "layers", "--planes", "4000000000"]),
            &["4000000000 planes", "1 to 1000000"],
        ),
        (
            "more planes than can be",
            made(&["--method", "layers", "--planes", "18446744073709551615"]),
            &["18446744073709551615 planes", "1 to 1000000"],
        ),
        (
            "more depths than planes can be",
            made(&["--method", "points", "--planes", "4000000000"]),
            &["4000000000 planes"],
        ),
        (
            "more planes than a sweep has",
            made(&["--method", "sweep", "--planes", "18446744073709551615"]),
            &["1 to 1024 are right"],
        ),
        ("no light", made(&["--scale", "0"]), &["scale"]),
        (
            "near behind far",
            made(&["--near", "2", "--far", "1", "--depth-unit", "mm"]),
            &["range"],
        ),
        (
            "a folder that is not there",
            with(&["-o", "missing/h.png"]),
            &["missing/h.png", "no folder missing"],
        ),
        (
            "a picture that loses levels",
            with(&["-o", "h.jpg"]),
            &["h.jpg", ".png"],
        ),
    ] {
        folder.refuses_as(name, &arguments, 1, words);
    }
    for (name, arguments, words) in [
        ("no frame", vec!["hologram", "-o", "h.png"], &["--rgb", "--photo"][..]),
        (
            "colour alone",
            vec!["hologram", "--rgb", "rgb.png", "-o", "h.png"],
            &["--depth", "--depth-network"],
        ),
        (
            "raw depth without a scale",
            made(&["--depth-unit", "raw"]),
            &["--depth-scale"],
        ),
        (
            "an offset that is no number",
            made(&["--offset-mm", "nan"]),
            &["offset_mm"],
        ),
        ("an unknown option", with(&["--nonsense"]), &["--nonsense"]),
        ("no distance", vec!["refocus", "rgb.png", "-o", "v.png"], &["--z-mm"]),
    ] {
        folder.refuses_as(name, &arguments, 2, words);
    }
}

#[test]
fn a_flag_that_would_change_nothing_is_refused() {
    let folder = Folder::new().with_frame();
    let file = format!("{MODELS}/rgbd-8-int8.onnx");
    for (flags, with) in [
        (&["--method", "sweep", "--network", "8"][..], "--method network or auto"),
        (&["--method", "layers", "--network", "8"], "--method network or auto"),
        (
            &["--method", "points", "--precision", "f32"],
            "--method network or auto",
        ),
        (
            &["--method", "network", "--planes", "8"],
            "sweep, auto, layers or points",
        ),
        (&["--encoder", "deep", "--taps", "9"], "--method sweep or auto"),
        (&["--method", "layers", "--taps", "9"], "--method sweep or auto"),
        (&["--method", "layers", "--occlusion", "none"], "--method points"),
        (&["--depth-scale", "5000"], "--depth-unit raw"),
        (&["--depth-unit", "mm", "--depth-scale", "5000"], "--depth-unit raw"),
        (&["--gpu", "any"], "--backend gpu"),
    ] {
        folder.refuses(
            &made(flags),
            2,
            &[*flags.iter().rfind(|flag| flag.starts_with("--")).unwrap(), with],
        );
    }
    // The file decides this.
    let precision = made(&["--network", &file, "--precision", "f32"]);
    folder.refuses(&precision, 1, &["--precision", "bundled networks"]);
    // Automatic selection may choose the network, so it accepts the network's flags.
    folder.succeeds(&made(&[
        "--method",
        "auto",
        "--network",
        "8",
        "--precision",
        "f32",
        "--planes",
        "4",
    ]));
}

#[test]
fn a_flag_of_other_calls_is_refused() {
    let folder = Folder::new().with_frame();
    ldi::write(&folder.path("ldi"), 5, Size { width: 48, height: 32 }, 1);
    folder.succeeds(&made(&["--method", "sweep", "--planes", "4"]));
    fs::rename(folder.path("h.png"), folder.path("there.png")).unwrap();
    let sweep = "multiplex --rgb rgb.png --depth depth.png --method sweep --network 8 -o maps";
    let cases = [
        (sweep, "--method network or auto"),
        ("compare rgb.png rgb.png --z-mm 1", "two images"),
        ("refocus there.png --z-mm 0 --offset-mm 3 -o v.png", "--display"),
        ("show there.png --offset-mm 3", "--display"),
        ("bench --fusion pairs", "--backend gpu"),
        ("bench --layers 0 --precision int8", "a network"),
        ("view there.png --frames 3 -o v.html", "a folder of `video`"),
    ];
    let by_clap = [
        ("hologram --ldi ldi --invert -o h.png", "--invert"),
        ("hologram --ldi ldi --depth-unit mm -o h.png", "--depth-unit"),
        ("judge --ldi ldi --near 1", "--near"),
        ("hologram --photo p.jpg --depth-unit mm -o h.png", "--depth-unit"),
        (
            "hologram --rgb rgb.png --depth-network n.onnx --near 1 -o h.png",
            "--near",
        ),
        ("view there.png --method sweep -o v.html", "--method"),
        ("view there.png --dark-threshold 0.2 -o v.html", "--dark-threshold"),
        ("show there.png --colour red", "--display"),
    ];
    for (call, word) in cases.into_iter().chain(by_clap) {
        folder.refuses(&call.split(' ').collect::<Vec<_>>(), 2, &[word]);
    }
}

#[test]
fn displays_that_cannot_be_used_are_named() {
    let folder = Folder::new().with_frame();
    let cases: [(&str, &str, &[&str]); 14] = [
        (
            "a wavelength in µm",
            "wavelengths_nm = [0.638, 520, 450]",
            &["display.toml", "0.638 nm"],
        ),
        ("12 bits", "bits = 12", &["display.toml", "bits"]),
        ("a table that is not there", "lut = \"none.txt\"", &["none.txt"]),
        ("a table of 3", "lut = \"lut.txt\"", &["lut.txt", "256"]),
        (
            "blue first",
            "wavelengths_nm = [450, 520, 638]",
            &["display.toml", "red, green, blue", "[638, 520, 450]"],
        ),
        (
            "another unit",
            "pitch_mm = 0.008",
            &["display.toml: unknown key `pitch_mm`; did you mean `pitch_um`?"],
        ),
        (
            "a slip in a file's key",
            "luts = \"a\"",
            &["unknown key `luts`; did you mean `lut`?"],
        ),
        (
            "a slip in the panel",
            "lens_m = 0.3",
            &["unknown key `lens_m`; did you mean `lens_mm`?"],
        ),
        (
            "a slip in an aberration",
            "aberration = \"lens.toml\"",
            &["lens.toml", "did you mean `green`?"],
        ),
        (
            "a table and a range",
            "lut = \"whole.txt\"\nrange_turns = 1.3",
            &["display.toml", "lut and range_turns", "give one"],
        ),
        (
            "two tables",
            "lut = \"whole.txt\"\nper_pixel = \"table.pfp\"",
            &["lut and per_pixel", "give one"],
        ),
        (
            "a table for each pixel and levels",
            "bits = 1\nper_pixel = \"table.pfp\"\nlevels_turns = [0, 0.5]",
            &["per_pixel and levels_turns", "give one"],
        ),
        (
            "a table of more bits",
            "bits = 4\nlut = \"whole.txt\"",
            &["whole.txt", "255", "4 bits"],
        ),
        (
            "an aberration of one laser and of three",
            "aberration = \"both.toml\"",
            &["both.toml", "laser", "red"],
        ),
    ];
    let whole: Vec<_> = (0..256).map(|level: u16| level.to_string()).collect();
    fs::write(folder.path("whole.txt"), whole.join(" ")).unwrap();
    fs::write(folder.path("lens.toml"), "[[at]]\nz_mm = 0\ngreeen = [0, 0, 0, 0, 0]").unwrap();
    let both = "[[at]]\nz_mm = 0\nlaser = [0, 0, 0, 0, 0]\nred = [1, 0, 0, 0, 0]";
    fs::write(folder.path("both.toml"), both).unwrap();
    fs::write(folder.path("lut.txt"), "1 2 3").unwrap();
    for (name, text, words) in cases {
        fs::write(folder.path("display.toml"), text).unwrap();
        folder.refuses_as(name, &made(&["--display", "display.toml"]), 1, words);
    }
}

#[test]
fn networks_that_cannot_be_used_are_named() {
    let folder = Folder::new().with_frame();
    let model = fs::read(format!("{MODELS}/rgbd-8.onnx")).unwrap();
    fs::write(folder.path("no.onnx"), b"not a network").unwrap();
    fs::write(folder.path("half.onnx"), &model[..model.len() / 2]).unwrap();
    for (name, arguments, words) in [
        ("no network", made(&["--network", "no.onnx"]), &["no.onnx"][..]),
        ("half a network", made(&["--network", "half.onnx"]), &["half.onnx"]),
        (
            "none that is bundled",
            made(&["--network", "9"]),
            &[
                "bundled network (rgbd-8, rgbd-15, natural-8, ddpm-8)",
                "--network FILE.onnx",
            ],
        ),
        (
            "one of the source tree",
            made(&["--network", "rgbd-30"]),
            &["rgbd-30: is not bundled", "--network models/unbundled/rgbd-30.onnx"],
        ),
    ] {
        folder.refuses_as(name, &arguments, 1, words);
    }
}

/// Runs the command on a GPU, with its cache in `folder`.
fn on_gpu(folder: &Folder, arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_phasefront"))
        .args(arguments)
        .current_dir(folder.0.path())
        .env("XDG_CACHE_HOME", folder.path("cache"))
        .env_remove("RUST_LOG")
        .output()
        .unwrap()
}

/// Returns the report of a command on the software driver.
fn report_on_gpu(folder: &Folder, arguments: &[&str]) -> serde_json::Value {
    let gpu = ["--backend", "gpu", "--gpu", "llvmpipe", "--json"];
    let made = on_gpu(folder, &[arguments, &gpu].concat());
    // Drivers write to stderr without a desktop.
    let errors = String::from_utf8(made.stderr).unwrap();
    let succeeded = if made.status.success() {
        Ok(())
    } else {
        Err(errors.trim_end())
    };
    driver::opened(succeeded.map_err(|why| why.to_owned()));
    serde_json::from_slice(&made.stdout).unwrap()
}

/// Asserts that few levels of two pictures differ by more than 1.
fn assert_nearly_equal(folder: &Folder, a: &str, b: &str) {
    let levels = |name| image::open(folder.path(name)).unwrap().into_rgb8().into_raw();
    let apart = |(a, b): (&u8, &u8)| (a.wrapping_sub(*b) as i8).unsigned_abs() > 1;
    let (a, b) = (levels(a), levels(b));
    let differing = a.iter().zip(&b).filter(|pair| apart(*pair)).count();
    assert!(differing * 100 < a.len(), "{differing} of {}", a.len());
}

#[test]
#[ignore = "slow: 30 seconds of a core in software"]
fn a_gpu_makes_the_hologram_that_the_cpu_makes() {
    let folder = Folder::new().with_frame();
    let natural = ["--focus", "natural", "--focus-steps", "2"];
    for (method, focus) in [("network", &[][..]), ("sweep", &[]), ("sweep", &natural)] {
        let more = [&["--method", method, "--scale", "1", "--offset-mm", "3"], focus].concat();
        folder.succeeds(&with(&[&more[..], &["-o", "cpu.png"]].concat()));
        let arguments = with(&[&more[..], &["-o", "gpu.png"]].concat());
        let report = report_on_gpu(&folder, &arguments);
        if method == "sweep" {
            assert!(report["stage_ms"]["sweep"].is_number(), "{report}");
        } else {
            let engine = report["engine"].as_str().unwrap();
            assert!(engine.contains("int8"), "{report}");
        }
        assert_nearly_equal(&folder, "cpu.png", "gpu.png");
    }
}

#[test]
#[ignore = "slow: 30 seconds of a core in software"]
fn a_gpu_is_measured() {
    let folder = Folder::new();
    let bench = |more: &[&str]| {
        let common = ["bench", "--seconds", "0", "--size", "48x32"];
        report_on_gpu(&folder, &[&common, more].concat())
    };
    let network = ["--layers", "8", "--precision", "int8", "--fusion", "pairs"];
    let report = bench(&network);
    let row = &report["rows"][0];
    assert_eq!(row["backend"], "gpu");
    assert!(row["total_ms"].as_f64().unwrap() > 0.0, "{report}");
    let kernels = row["kernels"].as_str().unwrap();
    assert!(kernels.contains("Pairs in 5"), "{report}");
    let report = bench(&["--layers", "0"]);
    assert_eq!(report["rows"].as_array().unwrap().len(), 1);
    assert_eq!(report["rows"][0]["method"], "sweep");
}

#[test]
fn a_gpu_that_is_not_there_or_not_meant_is_named() {
    let folder = Folder::new().with_frame();
    let gpu = ["--backend", "gpu", "--gpu", "no such card", "-o", "gpu.png"];
    let missing = on_gpu(&folder, &with(&gpu));
    let errors = String::from_utf8(missing.stderr).unwrap();
    assert_eq!(missing.status.code(), Some(1), "{errors}");
    assert!(
        errors.contains("error: no GPU") && errors.contains("--backend cpu"),
        "{errors}"
    );
    assert!(!folder.path("gpu.png").exists());
    for (name, arguments, words) in [
        (
            "a card for the CPU",
            with(&["--gpu", "x", "-o", "o.png"]),
            &["--backend gpu"][..],
        ),
        (
            "a complex field from the GPU",
            with(&["--backend", "gpu", "--complex", "c.npy", "-o", "o.png"]),
            &["--complex"],
        ),
    ] {
        folder.refuses_as(name, &arguments, 2, words);
    }
}

#[test]
fn auto_sweeps_clean_depth_and_leaves_noisy_depth_to_a_network() {
    let folder = Folder::new();
    let square = |y: usize, x: usize| (20..60).contains(&y) && (24..70).contains(&x);
    let rgb = Array3::from_shape_fn(
        (3, 80, 96),
        |(c, y, x)| if square(y, x) { 0.9 - 0.1 * c as f32 } else { 0.2 },
    );
    picture::write_amplitude(&folder.path("rgb.png"), rgb.view()).unwrap();
    for (name, ramp, stage) in [("clean.npy", 1, "sweep"), ("noisy.npy", 5, "network")] {
        let depth = Array2::from_shape_fn((80, 96), |(y, x)| {
            let inside = (0..ramp).filter(|i| square(y, x + i)).count();
            0.8 - 0.5 * inside as f32 / ramp as f32
        });
        folder.depth_npy(name, &depth);
        let made: serde_json::Value = serde_json::from_str(&folder.succeeds(&[
            "hologram", "--rgb", "rgb.png", "--depth", name, "--method", "auto", "--json", "-o", "h.png",
        ]))
        .unwrap();
        assert!(made["stage_ms"][stage].is_number(), "{name}: {made}");
    }
    folder.refuses(
        &["hologram", "--ldi", "scene", "--method", "auto", "-o", "a.png"],
        2,
        &["take --rgb and --depth"],
    );
}

#[test]
fn a_network_for_layers_takes_a_layered_depth_image() {
    let folder = Folder::new();
    ldi::write(&folder.path("a"), 5, Size { width: 61, height: 47 }, 2);
    let network = format!("{MODELS}/unbundled/ldi3-15.onnx");
    let call = ["hologram", "--ldi", "a", "--network", &network, "-o", "h.png"];
    let made: serde_json::Value = serde_json::from_str(&folder.succeeds(&[&call[..], &["--json"]].concat())).unwrap();
    assert!(made["stage_ms"]["network"].is_number(), "{made}");
    let engine = made["engine"].as_str().unwrap();
    assert!(engine.contains("15 layers of 24 filters in f32"), "{engine}");
    let ldi = ["hologram", "--ldi", "a", "-o", "h.png"];
    let method = [&ldi[..], &["--method", "network"]].concat();
    folder.refuses(&method, 2, &["--network for layered depth images"]);
    let flat = [&ldi[..], &["--network", "8"]].concat();
    folder.refuses(&flat, 1, &["takes 'rgbd'", "'ldi2' to 'ldi9'"]);
    let gpu = [&call[..], &["--backend", "gpu"]].concat();
    folder.refuses(&gpu, 2, &["on RGB-D"]);
}

#[test]
fn a_pre_filter_belongs_to_the_deep_encoder() {
    let folder = Folder::new().with_frame();
    let hologram_network = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/rgbd-8.onnx");
    let deep = with(&["-o", "h.png", "--encoder", "deep"]);
    let alone = [&deep[..], &["--network", "8"]].concat();
    folder.refuses(&alone, 2, &["--encoder deep needs --prefilter"]);
    let far = [&deep[..], &["--offset-mm", "3"]].concat();
    folder.refuses(&far, 2, &["offset of 0 mm", "--network 8 --encoder anti-alias"]);
    let pair = ["--prefilter", hologram_network];
    folder.refuses(&[&deep[..], &pair].concat(), 1, &["'field'", "'rgbd'"]);
    let other = with(&["-o", "h.png", "--encoder", "double"]);
    folder.refuses(&[&other[..], &pair].concat(), 2, &["--encoder deep"]);
    let whole = [&other[..], &["--network", "ddpm-8"]].concat();
    folder.refuses(&whole, 2, &["brings its own --encoder"]);
    assert!(!folder.path("h.png").exists());
    let made = |more: &[&str]| -> serde_json::Value {
        let call = [&with(&["-o", "h.png", "--json"])[..], more].concat();
        serde_json::from_str(&folder.succeeds(&call)).unwrap()
    };
    for more in [&["--network", "ddpm-8"][..], &["--encoder", "deep"]] {
        let made = made(more);
        assert_eq!(made["encoder"], "deep", "{more:?}: {made}");
        assert_eq!(
            (made["dark_threshold"].as_f64(), made["local_steps"].as_u64()),
            (Some(0.0), Some(0))
        );
    }
    for more in [
        &[][..],
        &["--offset-mm", "6"],
        &["--network", "8"],
        &["--method", "sweep"],
    ] {
        let made = made(more);
        assert_eq!(made["encoder"], "anti-alias", "{more:?}: {made}");
        assert!((made["dark_threshold"].as_f64().unwrap() - 0.4).abs() < 1e-6 && made["local_steps"] == 1);
    }
    let plain = made(&["--dark-threshold", "0", "--local-steps", "0"]);
    assert_eq!(
        (plain["dark_threshold"].as_f64(), plain["local_steps"].as_u64()),
        (Some(0.0), Some(0))
    );
    let call = with(&["-o", "h.png"]);
    folder.refuses(&[&call[..], &["--local-steps", "9"]].concat(), 2, &["at most 8"]);
    folder.refuses(&[&call[..], &["--dark-threshold", "1.5"]].concat(), 2, &["from 0 to 1"]);
}

#[test]
fn a_hologram_is_judged_by_its_own_wave() {
    let folder = Folder::new().with_frame();
    let judged = |more: &[&str]| {
        let call = [
            &with(&["-o", "h.png", "--judge", "--json", "--method", "sweep"])[..],
            more,
        ]
        .concat();
        let made: serde_json::Value = serde_json::from_str(&folder.succeeds(&call)).unwrap();
        let shown = &made["shown"];
        assert!(shown["ssim"].as_f64().unwrap() > 0.0 && shown["stack_psnr_db"].as_f64().unwrap() > 5.0);
        assert!((0.5..2.0).contains(&shown["brightness"].as_f64().unwrap()), "{made}");
        shown["psnr_db"].as_f64().unwrap()
    };
    let plain = judged(&["--dark-threshold", "0", "--local-steps", "0"]);
    let corrected = judged(&[]);
    assert!(corrected > plain, "{plain} {corrected}");
    folder.refuses(&with(&["-o", "h.png", "--judge", "--backend", "gpu"]), 2, &["--judge"]);
}

#[test]
fn a_display_that_no_network_was_trained_for_gets_the_sweep() {
    let folder = Folder::new().with_frame();
    fs::write(folder.path("fine.toml"), "pitch_um = 3.74").unwrap();
    let call = with(&["-o", "h.png", "--json", "--display", "fine.toml"]);
    let made: serde_json::Value = serde_json::from_str(&folder.succeeds(&call)).unwrap();
    assert_eq!(made["method"], "sweep", "{made}");
    let named = [&call[..], &["--network", "8"]].concat();
    folder.refuses(&named, 1, &["pitch"]);
}

#[test]
fn the_bench_measures_every_stage_and_draws_it() {
    let folder = Folder::new();
    let bench = [
        "bench",
        "--layers",
        "8",
        "--precision",
        "int8",
        "--size",
        "40x30",
        "--threads",
        "1",
    ];
    let more = ["--seconds", "0", "--offset-mm", "2", "--plot", "bars.svg", "--json"];
    let text = folder.succeeds(&[&bench[..], &more].concat());
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let row = &value["rows"][0];
    assert_eq!((row["width"].as_u64(), row["height"].as_u64()), (Some(40), Some(30)));
    assert_eq!(value["encoder"], "anti-alias, dark 0.4, local steps 1");
    assert_eq!(row["offset_mm"].as_f64(), Some(2.0));
    assert!(
        ["network", "propagate", "encode"]
            .iter()
            .all(|stage| row["stage_ms"][stage].as_f64() > Some(0.0))
    );
    let picture = std::fs::read_to_string(folder.path("bars.svg")).unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("8 layers int8 40×30, 1 thr."));
    folder.refuses(&[&bench[..], &["--plot", "bars.png"]].concat(), 1, &[".svg"]);
}

#[test]
fn the_bench_measures_sessions_of_scenes_and_pictures() {
    let folder = Folder::new().with_frame();
    let bench = ["bench", "--session", "--size", "40x30", "--threads", "1"];
    let measured = |more: &[&str]| -> serde_json::Value {
        let text = folder.succeeds(&[&bench[..], more, &["--json"]].concat());
        let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
        value["rows"].take()
    };
    let rows = measured(&["--method", "sweep"]);
    let measured_of: Vec<_> = (rows.as_array().unwrap().iter())
        .map(|row| [row["scene"].as_str().unwrap(), row["camera"].as_str().unwrap()])
        .collect();
    let scenes = ["balls", "leaves"];
    let right: Vec<_> = (scenes
        .iter()
        .flat_map(|scene| ["stands", "moves"].map(|camera| [*scene, camera])))
    .collect();
    assert_eq!(measured_of, right);
    for row in rows.as_array().unwrap() {
        assert_eq!((&row["method"], &row["frames"]), (&"sweep".into(), &30.into()), "{row}");
        assert_eq!((&row["width"], &row["height"]), (&40.into(), &30.into()), "{row}");
        for stage in ["colour", "depth", "method", "propagate", "encode", "total"] {
            let ms = |of: &str| row[of][stage].as_f64().unwrap();
            assert!(ms("median_ms") <= ms("p95_ms"), "{stage}: {row}");
        }
        assert!(
            row["first_ms"].as_f64() > Some(0.0) && row["start_ms"].as_f64() > Some(0.0),
            "{row}"
        );
    }
    let picture = ["--rgb", "rgb.png", "--depth", "depth.png"];
    let millimetres = ["--seconds", "0", "--depth-unit", "mm"];
    let rows = measured(&[&picture[..], &picture, &millimetres].concat());
    assert_eq!(rows.as_array().unwrap().len(), 4);
    assert_eq!(
        (&rows[1]["scene"], &rows[1]["method"], &rows[1]["frames"]),
        (&"rgb.png".into(), &"auto".into(), &5.into())
    );
    let natural = ["--focus", "natural", "--focus-steps", "0"];
    let rows = measured(&[&picture[..], &["--seconds", "0"], &natural].concat());
    assert_eq!(rows[0]["method"], "network", "{rows}");
    let one = [&bench[..], &picture, &["--rgb", "rgb.png"]].concat();
    folder.refuses(&one, 2, &["2 --rgb and 1 --depth"]);
    for alone in [
        "--method sweep",
        "--rgb rgb.png --depth depth.png",
        "--session --layers 8",
        "--session --near 1",
    ] {
        let call: Vec<_> = ["bench"].into_iter().chain(alone.split(' ')).collect();
        folder.refuses(&call, 2, &["--"]);
    }
}

#[test]
fn a_calibrated_display_is_packed_for_an_app() {
    let folder = Folder::new();
    let lut: Vec<u8> = (0..=255).map(|i| i / 2 + 30).collect();
    let text: Vec<_> = lut.iter().map(u8::to_string).collect();
    fs::write(folder.path("lut.txt"), text.join(" ")).unwrap();
    let at = |z_mm: f64, a: f64| format!("[[at]]\nz_mm = {z_mm:?}\ngreen = [0.0, {a:?}, 0.0, 0.0, 0.0]\n");
    fs::write(folder.path("same.toml"), at(-3.0, 0.5) + &at(3.0, 0.5)).unwrap();
    fs::write(folder.path("other.toml"), at(-3.0, 0.5) + &at(3.0, 0.75)).unwrap();
    for (name, aberration) in [("display.toml", "same.toml"), ("deep.toml", "other.toml")] {
        let text =
            format!("width = 64\nheight = 48\noffset_mm = 2.0\nlut = \"lut.txt\"\naberration = \"{aberration}\"\n");
        fs::write(folder.path(name), text).unwrap();
    }
    let pack = ["calibrate", "pack", "-o", "app.pfc", "--display"];
    folder.succeeds(&[&pack[..], &["display.toml"]].concat());
    let packed = phasefront::Target::from_bytes(&fs::read(folder.path("app.pfc")).unwrap()).unwrap();
    assert_eq!((packed.display.size().width, packed.display.offset_m()), (64, 2e-3));
    assert_eq!(
        packed.response,
        phasefront::target::Response::lut(lut.try_into().unwrap())
    );
    assert_eq!(packed.correction.unwrap().coefficients()[1][1], 0.5);
    folder.refuses(&[&pack[..], &["display.toml"]].concat(), 1, &["--overwrite"]);
    let deep = ["--overwrite", "deep.toml"];
    let deep = [&pack[..4], &deep[..1], &pack[4..], &deep[1..]].concat();
    folder.refuses(&deep, 1, &["changes over depth"]);
}

/// A camera's photo is far larger than any modulator.
#[test]
fn a_picture_larger_than_the_modulator_is_fitted_and_told_of() {
    let folder = Folder::new().with_frame();
    fs::write(
        folder.path("display.toml"),
        "width = 24\nheight = 24\nvolume_depth_mm = 4",
    )
    .unwrap();
    let output = folder.run(&made(&["--display", "display.toml"]));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.lines().count() == 1, "{said}");
    assert!(
        said.contains("48×32") && said.contains("24×24") && said.contains("--fit"),
        "{said}"
    );
    let size = |name: &str| hologram::read_hologram(&folder.path(name)).unwrap().size();
    assert_eq!(size("h.png"), Size { width: 24, height: 24 });
}

/// Depth that a program enlarged makes the hologram of the readings that it came from, and the command says so.
#[test]
fn depth_that_was_enlarged_is_read_on_its_own_grid() {
    let folder = Folder::new();
    let near = |x: u32, y: u32, i: u32| {
        let (dx, dy) = (
            x as i32 - (29 + 37 * i as i32) % 160,
            y as i32 - (31 + 53 * i as i32) % 120,
        );
        dx * dx + dy * dy < 30 + 40 * (i as i32 % 7)
    };
    let shade = |x: u32, y: u32| (0..24).filter(|i| near(x, y, *i)).map(|i| 9 * i).max().unwrap_or(220) as u8;
    let rgb = image::RgbImage::from_fn(160, 120, |x, y| image::Rgb([shade(x, y), 255 - shade(x, y), 80]));
    rgb.save(folder.path("rgb.png")).unwrap();
    let coarse = image::GrayImage::from_fn(40, 30, |x, y| image::Luma([shade(4 * x + 2, 4 * y + 2)]));
    coarse.save(folder.path("coarse.png")).unwrap();
    for filter in [
        image::imageops::FilterType::Nearest,
        image::imageops::FilterType::Triangle,
    ] {
        image::imageops::resize(&coarse, 160, 120, filter)
            .save(folder.path("large.png"))
            .unwrap();
        let by = |depth: &str| {
            let call = hologram("rgb.png", depth);
            let output = folder.run(&[&call[..], &["--method", "sweep"]].concat());
            let said = String::from_utf8(output.stderr).unwrap();
            assert!(output.status.success(), "{said}");
            (hologram::read_hologram(&folder.path("h.png")).unwrap(), said)
        };
        let ((small, nothing), (large, said)) = (by("coarse.png"), by("large.png"));
        assert_eq!(nothing, "");
        assert!(
            said.lines().count() == 1 && said.contains("large.png: was enlarged 4 times"),
            "{said}"
        );
        assert!(said.contains("from 40×30"), "{said}");
        let view = |hologram: &hologram::Hologram| hologram.views(&[0.0]).unwrap().remove(0);
        let apart = (view(&small) - view(&large)).mapv(f32::abs).mean().unwrap();
        assert!(apart < 0.01, "{filter:?}: {apart}");
    }
}
