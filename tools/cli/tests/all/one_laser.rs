//! Tests the command on a display with one laser: from a picture to a hologram, to its view, to the modulator's input
//! and back, and the one-line error for unsuitable input.
use crate::folder;
use phasefront::Size;

use folder::Folder;
use ndarray::{Array3, s};
use phasefront::target::Aberration;
use phasefront::{Display, Target};
use phasefront_cli::viewer;
use phasefront_core::optics::metrics;
use phasefront_io::display::calibration;
use phasefront_io::hologram::packed::{Image, Kind};
use phasefront_io::hologram::{self, Hologram, Levels};
use phasefront_io::picture;
use serde_json::Value;
use std::fs;

/// A network that corrects the sweep's field.
const SEEDED: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../models/unbundled/seeded-8-80-int8.onnx"
);
const W: usize = 48;
const H: usize = 32;
const FRAME: [&str; 6] = ["--rgb", "rgb.png", "--depth", "depth.png", "--display", "one.toml"];

/// Creates a folder with a picture with depth, and displays with one laser.
fn folder() -> Folder {
    let folder = Folder::new();
    let rgb = image::RgbImage::from_fn(W as u32, H as u32, |x, y| {
        image::Rgb([(x * 5) as u8, (y * 7) as u8, 90])
    });
    rgb.save(folder.path("rgb.png")).unwrap();
    let depth = image::GrayImage::from_fn(W as u32, H as u32, |x, _| image::Luma([if x < 24 { 30 } else { 220 }]));
    depth.save(folder.path("depth.png")).unwrap();
    let one = format!("width = {W}\nheight = {H}\noffset_mm = 2.0\nwavelengths_nm = [532]\n");
    let cells = "{ memory = [3, 2, 1, 7, 0, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12], layout = [[2, 3], [0, 1]] }";
    let split = "{ red = [9, 8, 7], green = [6, 5, 4], blue = [3, 2, 1, 0] }";
    for (name, more) in [
        ("one.toml", String::new()),
        ("rgb.toml", "packing = \"rgb\"\n".into()),
        ("ten.toml", "bits = 10\n".into()),
        ("split.toml", format!("bits = 10\npacking = {split}\n")),
        ("plm.toml", format!("bits = 4\npacking = {cells}\n")),
    ] {
        fs::write(folder.path(name), one.clone() + &more).unwrap();
    }
    folder
}

/// Returns the arguments of `command` with the picture and the display.
fn of<'a>(command: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&[command], &FRAME[..], more].concat()
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

fn levels(folder: &Folder, name: &str) -> Array3<u16> {
    match hologram::read_hologram(&folder.path(name)).unwrap() {
        Hologram::Levels(Levels::Bytes(levels), _) => levels.mapv(u16::from),
        Hologram::Levels(Levels::Words(levels), _) => levels,
        Hologram::Complex(..) => panic!("levels were written"),
    }
}

/// Reads a grey picture as one plane.
fn seen(folder: &Folder, name: &str) -> Array3<f32> {
    let view = picture::read_rgb(&folder.path(name)).unwrap();
    assert!(
        view.outer_iter()
            .all(|plane| plane == view.index_axis(ndarray::Axis(0), 0))
    );
    view
}

#[test]
fn every_method_goes_from_a_picture_to_a_view_and_to_the_modulator_and_back() {
    let folder = folder();
    for method in ["sweep", "network", SEEDED, "auto", "layers", "points"] {
        let flag = if method == SEEDED { "--network" } else { "--method" };
        let made = [
            flag,
            method,
            "--complex",
            "h.npy",
            "--packed",
            "frame.png",
            "-o",
            "h.png",
        ];
        folder.succeeds(&of("hologram", &made));
        let hologram = levels(&folder, "h.png");
        assert_eq!(hologram.dim(), (1, H, W), "{method}");
        folder.succeeds(&["refocus", "h.png", "--z-mm", "1", "-o", "view.png"]);
        folder.succeeds(&["refocus", "h.npy", "--z-mm", "1", "-o", "field.png"]);
        let inner = s![.., 4..28, 4..44];
        let (view, field) = (seen(&folder, "view.png"), seen(&folder, "field.png"));
        let alike = metrics::compare(view.slice(inner), field.slice(inner)).unwrap();
        assert!(alike.psnr_overall > 20.0, "{method}: {}", alike.psnr_overall);
        // The frame is one grey image that contains the levels.
        let frame = Image::read(&folder.path("frame.png")).unwrap();
        assert_eq!((frame.size, frame.kind), (Size { width: W, height: H }, Kind::Grey));
        assert!(
            frame
                .bytes
                .iter()
                .zip(&hologram)
                .all(|(byte, level)| u16::from(*byte) == *level)
        );
        folder.succeeds(&["unpack", "frame.png", "--display", "one.toml", "-o", "back.png"]);
        assert_eq!(levels(&folder, "back.png"), hologram, "{method}");
    }
    let told = json(&folder.succeeds(&["compare", "h.png", "h.npy", "--json"]));
    assert_eq!(told["psnr"].as_array().unwrap().len(), 1);
}

#[test]
fn every_packing_takes_one_laser_and_gives_it_back() {
    let folder = folder();
    for (name, kind) in [
        ("rgb.toml", Kind::Rgb),
        ("ten.toml", Kind::Grey16),
        ("split.toml", Kind::Rgb),
        ("plm.toml", Kind::Rgb),
    ] {
        let image = [
            "hologram",
            "--rgb",
            "rgb.png",
            "--depth",
            "depth.png",
            "--method",
            "sweep",
        ];
        let to = ["--display", name, "--packed", "frame.png", "-o", "h.png"];
        folder.succeeds(&[&image[..], &to].concat());
        assert_eq!(Image::read(&folder.path("frame.png")).unwrap().kind, kind, "{name}");
        folder.succeeds(&["unpack", "frame.png", "--display", name, "-o", "back.png"]);
        assert_eq!(levels(&folder, "back.png"), levels(&folder, "h.png"), "{name}");
        folder.succeeds(&["pack", "h.png", "--display", name, "-o", "again.png"]);
        let [one, other] = ["frame.png", "again.png"].map(|name| fs::read(folder.path(name)).unwrap());
        assert_eq!(one, other, "{name}");
        folder.succeeds(&["refocus", "h.png", "--z-mm", "0", "-o", "view.png"]);
    }
    let maps = [
        "--display",
        "plm.toml",
        "--maps",
        "4",
        "--packed",
        "frame.png",
        "--judge",
        "--json",
        "-o",
        "maps",
    ];
    let image = ["multiplex", "--rgb", "rgb.png", "--depth", "depth.png"];
    let told = json(&folder.succeeds(&[&image[..], &maps].concat()));
    assert!(told["shown"][2]["psnr_db"].as_f64() > told["shown"][0]["psnr_db"].as_f64());
    let names: Vec<String> = (0..4).map(|n| format!("maps/phase_{n:03}.png")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    folder.succeeds(&[&["pack"], &names[..], &["--display", "plm.toml", "-o", "again.png"]].concat());
    let [one, other] = ["frame.png", "again.png"].map(|name| fs::read(folder.path(name)).unwrap());
    assert_eq!(one, other);
}

#[test]
fn holograms_are_judged_shown_on_pages_and_measured() {
    let folder = folder();
    let made = json(&folder.succeeds(&of("hologram", &["--judge", "--json", "-o", "h.png"])));
    assert!(made["shown"]["psnr_db"].as_f64().unwrap() > 15.0, "{made}");
    let said = json(&folder.succeeds(&of("judge", &["--json", "--planes", "16", "-o", "j.html"])));
    assert_eq!(said["rows"].as_array().unwrap().len(), 6, "{said}");
    folder.succeeds(&of("view", &["--views", "3", "-o", "v.html"]));
    folder.succeeds(&["view", "v.html", "h.png", "--views", "3", "-o", "all.html"]);
    let scenes = viewer::read(&folder.path("all.html")).unwrap();
    assert!(scenes.len() == 2 && scenes.iter().all(|scene| scene.phase.is_some()));
    let wavelengths = ("Wavelengths".to_owned(), "532 nm".to_owned());
    assert!(scenes[0].figures.contains(&wavelengths));
    for layers in ["0", "8"] {
        let bench = ["bench", "--layers", layers, "--size", "40x30", "--seconds", "0"];
        let told =
            json(&folder.succeeds(&[&bench[..], &["--display", "one.toml", "--threads", "1", "--json"]].concat()));
        assert!(told["rows"][0]["total_ms"].as_f64() > Some(0.0));
    }
    let told = json(&folder.succeeds(&["devices", "one.toml", "--json"]));
    assert_eq!(told["packing"], "an image a colour, grey");
    assert_eq!(told["wavelengths_nm"], serde_json::json!([532.0]));
}

#[test]
fn video_of_one_laser_is_grey() {
    let folder = folder();
    fs::create_dir(folder.path("in")).unwrap();
    for (from, to) in [("rgb.png", "color"), ("depth.png", "depth")] {
        for frame in 0..2 {
            fs::copy(folder.path(from), folder.path(&format!("in/{to}_{frame}.png"))).unwrap();
        }
    }
    let video = [
        "video",
        "in",
        "--depth-unit",
        "normalized",
        "--preview-mm",
        "1",
        "--display",
        "one.toml",
        "-o",
        "out",
    ];
    let told = json(&folder.succeeds(&[&video[..], &["--json"]].concat()));
    assert_eq!(
        (told["processed"].as_u64(), told["failed"].as_u64()),
        (Some(2), Some(0))
    );
    assert_eq!(levels(&folder, "out/phase_000001.png").dim(), (1, H, W));
    seen(&folder, "out/preview_000001.png");
    folder.succeeds(&[&video[..], &["--resume"]].concat());
    folder.succeeds(&["view", "out", "--views", "2", "-o", "v.html"]);
}

#[test]
fn what_a_bench_knows_of_one_laser_is_packed_for_an_app() {
    let folder = folder();
    let light = Array3::from_shape_fn((1, 3, 4), |(_, y, x)| 1.0 - 0.05 * (y + x) as f32);
    calibration::write_laser(&folder.path("light.png"), light.view()).unwrap();
    let flat = image::GrayImage::from_fn(W as u32, H as u32, |x, y| image::Luma([(x * 3 + y) as u8]));
    flat.save(folder.path("flat.png")).unwrap();
    let lens = "[[at]]\nz_mm = 0.0\nlaser = [0.0, 0.5, 0.0, 0.0, 0.0]\n";
    fs::write(folder.path("lens.toml"), lens).unwrap();
    let one = fs::read_to_string(folder.path("one.toml")).unwrap();
    let bench = "laser = \"light.png\"\naberration = \"lens.toml\"\nflatness = \"flat.png\"\ncarrier_mrad = [4.0, 0.0]\n\
                 shift_px = [[0.5, 0.0]]\nscale = [1.001]\n";
    fs::write(folder.path("bench.toml"), one.clone() + bench).unwrap();
    folder.succeeds(&["calibrate", "pack", "--display", "bench.toml", "-o", "app.pfc"]);
    let packed = Target::from_bytes(&fs::read(folder.path("app.pfc")).unwrap()).unwrap();
    assert_eq!(packed.display, Display::from_toml(&one).unwrap());
    assert_eq!(
        packed.correction,
        Some(Aberration::new([[0.0, 0.5, 0.0, 0.0, 0.0]]).unwrap())
    );
    assert_eq!(packed.illumination.unwrap().colours(), 1);
    assert_eq!(
        (packed.registration.shift_px, packed.registration.scale),
        (vec![[0.5, 0.0]], vec![1.001])
    );
    for method in ["sweep", "layers"] {
        let image = [
            "hologram",
            "--rgb",
            "rgb.png",
            "--depth",
            "depth.png",
            "--method",
            method,
        ];
        folder.succeeds(&[&image[..], &["--display", "bench.toml", "-o", "h.png"]].concat());
        folder.succeeds(&[
            "refocus",
            "h.png",
            "--display",
            "bench.toml",
            "--z-mm",
            "1",
            "-o",
            "view.png",
        ]);
        let input: Array3<f32> = picture::read_rgb(&folder.path("rgb.png")).unwrap();
        assert_eq!(seen(&folder, "view.png").dim(), input.dim());
    }
}

/// Tests displays that are invalid or unsuitable for the given input.
fn others(folder: &Folder) {
    let one = fs::read_to_string(folder.path("one.toml")).unwrap();
    let light = Array3::<f32>::ones((3, 3, 4));
    calibration::write_laser(&folder.path("light.png"), light.view()).unwrap();
    let lens = "[[at]]\nz_mm = 0.0\ngreen = [0.0, 0.5, 0.0, 0.0, 0.0]\n";
    fs::write(folder.path("lens.toml"), lens).unwrap();
    for (name, text) in [
        ("two.toml", "wavelengths_nm = [638, 532]\n".to_owned()),
        ("light.toml", one.clone() + "laser = \"light.png\"\n"),
        ("bent.toml", one.clone() + "aberration = \"lens.toml\"\n"),
        (
            "moved.toml",
            one.clone() + "shift_px = [[0.5, 0.0], [0.0, 0.0], [0.0, 0.0]]\n",
        ),
        ("far.toml", one.replace("[532]", "[780]")),
        ("three.toml", one.replace("wavelengths_nm = [532]", "")),
    ] {
        fs::write(folder.path(name), text).unwrap();
    }
}

#[test]
fn what_is_not_for_one_laser_is_one_line() {
    let folder = folder();
    folder.succeeds(&of("hologram", &["--method", "sweep", "-o", "h.png"]));
    others(&folder);
    let hologram = "hologram --rgb rgb.png --depth depth.png -o n.png";
    for (call, code, word) in [
        (format!("{hologram} --display two.toml"), 1, "2 lasers"),
        (
            format!("{hologram} --display light.toml"),
            1,
            "the laser's map has 3 colours, the display 1",
        ),
        (
            format!("{hologram} --display bent.toml"),
            1,
            "the aberration is of 3 colours, the display has 1",
        ),
        (
            format!("{hologram} --display moved.toml"),
            1,
            "shift_px has 3 colours, the display 1",
        ),
        (
            format!("{hologram} --network 8 --display far.toml"),
            1,
            "1.22 times the range",
        ),
        (
            "pack h.png --display three.toml -o n.png".into(),
            1,
            "for lasers of 532 nm, the display has lasers of 638/520/450 nm",
        ),
        (
            "refocus h.png --display three.toml --z-mm 0 -o n.png".into(),
            1,
            "for lasers of 532 nm, the display has lasers of 638/520/450 nm",
        ),
        ("compare h.png rgb.png".into(), 1, "of the same colours"),
        (
            "pack h.png h.png --display plm.toml --colour green -o n.png".into(),
            1,
            "one laser",
        ),
        (
            "calibrate aberration n --z-mm 1 --colour red --display one.toml -o n.toml".into(),
            2,
            "the display has one laser; leave it out",
        ),
    ] {
        let errors = folder.fails(&call.split(' ').collect::<Vec<_>>(), code);
        assert_eq!(errors.lines().count(), 1, "{call}: {errors}");
        assert!(errors.contains(word), "{call}: {errors}");
        assert!(!folder.path("n.png").exists() && !folder.path("n").exists());
    }
    let on_gpu = [
        "--method",
        "sweep",
        "--backend",
        "gpu",
        "--gpu",
        "llvmpipe",
        "-o",
        "n.png",
    ];
    let refused = folder.fails(&of("hologram", &on_gpu), 1);
    let why = ["a display of one laser, which is the CPU's", "no GPU"];
    assert!(why.iter().any(|why| refused.contains(why)), "{refused}");
}
