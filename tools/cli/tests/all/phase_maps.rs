//! Phase maps of other software: grey and colour images, palettes and arrays, with the levels that they say.

use crate::folder;
use folder::{Folder, SMALL_HOLOGRAM};
use ndarray::Array2;
use num_complex::Complex32;
use phasefront_io::hologram::{self, Hologram, Levels};
use std::f32::consts::TAU;
use std::fs;
use std::path::Path;

const W: u32 = 64;
const H: u32 = 48;

fn levels(path: &Path) -> Vec<u8> {
    match hologram::read_hologram(path).unwrap() {
        Hologram::Levels(Levels::Bytes(levels), _) => levels.iter().copied().collect(),
        _ => panic!("levels of 8 bits"),
    }
}

/// Writes a palette PNG whose index i has the grey `255 - i`, as programs write grey with few colours.
fn palette(path: &Path, grey: &image::GrayImage) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), W, H);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette((0..=255u8).rev().flat_map(|v| [v; 3]).collect::<Vec<u8>>());
    let indices: Vec<u8> = grey.as_raw().iter().map(|v| 255 - v).collect();
    encoder.write_header().unwrap().write_image_data(&indices).unwrap();
}

fn tiff(path: &Path, grey: &image::GrayImage) {
    let mut encoder = tiff::encoder::TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
    encoder
        .write_image::<tiff::encoder::colortype::Gray8>(W, H, grey.as_raw())
        .unwrap();
}

/// Makes the hologram `h.png` of one laser or three, and returns its levels.
fn made(folder: &Folder, lasers: &str) -> Vec<u8> {
    let rgb = image::RgbImage::from_fn(W, H, |x, y| image::Rgb([(x * 4) as u8, (y * 5) as u8, 90]));
    rgb.save(folder.path("rgb.png")).unwrap();
    image::GrayImage::from_pixel(W, H, image::Luma([128]))
        .save(folder.path("depth.png"))
        .unwrap();
    let display = format!("width = {W}\nheight = {H}\nwavelengths_nm = {lasers}\noffset_mm = 2.0\n");
    fs::write(folder.path("d.toml"), display).unwrap();
    folder.succeeds(&[&SMALL_HOLOGRAM[..], &["--display", "d.toml", "-o", "h.png"]].concat());
    levels(&folder.path("h.png"))
}

/// Checks that `name` packs to the frame of the hologram and shows the view of the levels alone.
fn is_the_hologram(folder: &Folder, name: &str) {
    let display = ["--display", "d.toml"];
    let bytes = |name: &str| image::open(folder.path(name)).unwrap().into_bytes();
    folder.succeeds(&[&["pack", "h.png", "-o", "frame.png"][..], &display].concat());
    folder.succeeds(&[&["unpack", "frame.png", "-o", "back.png"][..], &display].concat());
    folder.succeeds(&["refocus", "back.png", "--z-mm", "1", "-o", "want.png"]);
    folder.succeeds(&[&["pack", name, "-o", "packed.png"][..], &display].concat());
    assert_eq!(bytes("packed.png"), bytes("frame.png"), "{name}");
    folder.succeeds(&[&["refocus", name, "--z-mm", "1", "-o", "view.png"][..], &display].concat());
    assert_eq!(bytes("view.png"), bytes("want.png"), "{name}");
    folder.succeeds(&[&["view", name, "-o", "page.html"][..], &display].concat());
}

#[test]
fn grey_maps_in_every_form_are_the_levels_that_they_say() {
    let folder = Folder::new();
    let map = made(&folder, "[532]");
    let grey = image::GrayImage::from_raw(W, H, map.clone()).unwrap();
    grey.save(folder.path("grey.png")).unwrap();
    grey.save(folder.path("grey.bmp")).unwrap();
    let rgb = image::DynamicImage::from(grey.clone());
    rgb.to_rgb8().save(folder.path("rgb.bmp")).unwrap();
    rgb.to_rgba8().save(folder.path("rgba.png")).unwrap();
    palette(&folder.path("palette.png"), &grey);
    tiff(&folder.path("grey.tif"), &grey);
    let array = Array2::from_shape_vec((H as usize, W as usize), map).unwrap();
    let radians = array.mapv(|level| f32::from(level) / 256.0 * TAU);
    ndarray_npy::write_npy(folder.path("levels.npy"), &array).unwrap();
    ndarray_npy::write_npy(folder.path("radians.npy"), &radians).unwrap();
    // Phases from -π to π, as of numpy.angle.
    let angle = radians.mapv(|phase| f64::from(if phase > TAU / 2.0 { phase - TAU } else { phase }));
    ndarray_npy::write_npy(folder.path("angle.npy"), &angle).unwrap();
    ndarray_npy::write_npy(folder.path("wave.npy"), &radians.mapv(Complex32::cis)).unwrap();
    for name in [
        "grey.png",
        "grey.bmp",
        "rgb.bmp",
        "rgba.png",
        "palette.png",
        "grey.tif",
        "levels.npy",
        "radians.npy",
        "angle.npy",
        "wave.npy",
    ] {
        is_the_hologram(&folder, name);
    }
    // Frames come back from each image that a modulator's program writes.
    let want = levels(&folder.path("h.png"));
    for name in ["grey.png", "grey.bmp", "rgb.bmp", "rgba.png", "palette.png", "grey.tif"] {
        folder.succeeds(&["unpack", name, "--display", "d.toml", "-o", "levels.png"]);
        assert_eq!(levels(&folder.path("levels.png")), want, "{name}");
    }
}

#[test]
fn colour_maps_are_a_map_for_each_laser() {
    let folder = Folder::new();
    let map = made(&folder, "[638, 520, 450]");
    let plane = (W * H) as usize;
    let rgb = image::RgbImage::from_fn(W, H, |x, y| {
        image::Rgb([0, 1, 2].map(|c| map[c * plane + (y * W + x) as usize]))
    });
    rgb.save(folder.path("rgb-map.png")).unwrap();
    rgb.save(folder.path("rgb-map.bmp")).unwrap();
    let array = ndarray::Array3::from_shape_vec((3, H as usize, W as usize), map).unwrap();
    let radians = array.mapv(|level| f32::from(level) / 256.0 * TAU);
    ndarray_npy::write_npy(folder.path("radians.npy"), &radians).unwrap();
    for name in ["rgb-map.png", "rgb-map.bmp", "radians.npy"] {
        is_the_hologram(&folder, name);
    }
}

#[test]
fn what_is_no_phase_map_is_told_in_one_line() {
    let folder = Folder::new();
    let map = made(&folder, "[532]");
    let three = format!("width = {W}\nheight = {H}\n");
    fs::write(folder.path("three.toml"), three).unwrap();
    image::GrayImage::from_raw(W, H, map)
        .unwrap()
        .save(folder.path("grey.png"))
        .unwrap();
    let shape = (H as usize, W as usize);
    let float = |name: &str, value: fn((usize, usize)) -> f32| {
        ndarray_npy::write_npy(folder.path(name), &Array2::from_shape_fn(shape, value)).unwrap();
    };
    float("whole.npy", |(y, x)| ((y * x) % 256) as f32);
    float("nan.npy", |(y, x)| if y == x { f32::NAN } else { 0.5 });
    let field = Array2::from_shape_fn(shape, |(y, x)| Complex32::from_polar(y as f32, x as f32));
    ndarray_npy::write_npy(folder.path("field.npy"), &field).unwrap();
    let high = Array2::from_shape_fn(shape, |(y, x)| (y * x) as u16);
    ndarray_npy::write_npy(folder.path("high.npy"), &high).unwrap();
    for (name, display, words) in [
        ("grey.png", None, "a phase map of other software needs --display"),
        (
            "whole.npy",
            None,
            "`refocus` and `show` take them as they are with --display",
        ),
        ("field.npy", None, "or --display for phases of other software"),
        (
            "grey.png",
            Some("three.toml"),
            "the display has 3 lasers; give an RGB image",
        ),
        ("rgb.png", Some("d.toml"), "has colours, and the display has one laser"),
        ("whole.npy", Some("d.toml"), "save levels as uint8 or uint16"),
        ("nan.npy", Some("d.toml"), "NaN"),
        (
            "field.npy",
            Some("d.toml"),
            "`phasefront encode` makes a hologram of it",
        ),
        ("high.npy", Some("d.toml"), "the display has 8 bits"),
    ] {
        let on = display.map_or(vec![], |display| vec!["--display", display]);
        let said = folder.fails(&[&["refocus", name, "--z-mm", "0", "-o", "v.png"][..], &on].concat(), 1);
        assert!(said.contains(words) && said.lines().count() == 1, "{name}: {said}");
    }
    // exp(iφ) is no field at the midpoint, and encode says so.
    let wave = Array2::from_shape_fn(shape, |(y, x)| Complex32::cis((y * x) as f32 * 0.1));
    ndarray_npy::write_npy(folder.path("wave.npy"), &wave).unwrap();
    let output = folder.run(&["encode", "wave.npy", "--display", "d.toml", "-o", "e.png"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.contains("as of exp(iφ)"), "{said}");
}

#[test]
fn judge_takes_phase_maps_of_the_image() {
    let folder = Folder::new();
    let map = made(&folder, "[532]");
    let grey = image::GrayImage::from_raw(W, H, map.clone()).unwrap();
    grey.save(folder.path("grey.png")).unwrap();
    image::imageops::flip_horizontal(&grey)
        .save(folder.path("turned.png"))
        .unwrap();
    let radians = Array2::from_shape_vec((H as usize, W as usize), map).unwrap();
    let radians = radians.mapv(|level| f32::from(level) / 256.0 * TAU);
    ndarray_npy::write_npy(folder.path("radians.npy"), &radians).unwrap();
    let judge = [
        "judge",
        "--rgb",
        "rgb.png",
        "--depth",
        "depth.png",
        "--method",
        "sweep",
        "--display",
        "d.toml",
    ];
    let files = ["h.png", "grey.png", "radians.npy", "turned.png"];
    let more: Vec<&str> = files.iter().flat_map(|file| ["--hologram", file]).collect();
    let told = folder.succeeds(&[&judge[..], &more, &["--json", "-o", "page.html"]].concat());
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    let rows = told["rows"].as_array().unwrap();
    let [of_file @ .., turned] = &rows[rows.len() - 4..] else {
        panic!("a row for each file");
    };
    let db = |row: &serde_json::Value, key: &str| row[key].as_f64().unwrap();
    for (row, name) in of_file.iter().zip(files) {
        assert_eq!((&row["method"], &row["encoder"]), (&"file".into(), &name.into()));
        assert!(
            row["wave_ms"].is_null() && row["brightness"].is_null() == (name != "h.png"),
            "{row}"
        );
        // The same levels give the same figures. Only the scale differs, which the hologram's own file says.
        let natural = |row: &serde_json::Value| row["natural"]["psnr"].as_f64().unwrap();
        assert!((natural(row) - natural(&of_file[0])).abs() < 1e-3, "{row}");
        assert!(db(row, "psnr_db") > db(&of_file[0], "psnr_db") - 1.0, "{row}");
        assert!(db(row, "psnr_db") > db(turned, "psnr_db") + 6.0, "{row}");
    }
    assert_eq!(of_file[1]["psnr_db"], of_file[2]["psnr_db"]);
    let page = fs::read_to_string(folder.path("page.html")).unwrap();
    assert!(page.contains("file, turned.png"));
    let table = folder.succeeds(&[&judge[..], &more].concat());
    assert!(table.contains("grey.png") && table.contains('–'), "{table}");
    image::imageops::resize(&grey, 32, 24, image::imageops::FilterType::Nearest)
        .save(folder.path("small.png"))
        .unwrap();
    let said = folder.fails(&[&judge[..], &["--hologram", "small.png"]].concat(), 1);
    assert!(said.contains("is 32×24, the image 64×48"), "{said}");
}
