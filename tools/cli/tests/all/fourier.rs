//! Pictures in the focal plane of a lens, by the far field of the levels: a sum over all pixels in f64 that shares no
//! code with what is tested.

use crate::folder;
use folder::Folder;
use image::{GrayImage, Luma, Rgb, RgbImage};
use num_complex::Complex64;
use phasefront_io::hologram::{self, Hologram, Levels};
use serde_json::Value;
use std::f64::consts::{PI, TAU};
use std::fs;

const W: usize = 96;
const H: usize = 64;
const PITCH_M: f64 = 8e-6;
const FOCAL_M: f64 = 0.2;
const RED_GREEN_BLUE_M: [f64; 3] = [638e-9, 520e-9, 450e-9];

/// Where the documents say that the picture lies: the middle up from the zero order by a quarter of the field of the
/// shortest wave, and the size of a pixel.
struct Placed {
    middle_m: [f64; 2],
    pixel_m: f64,
}

fn placed(shortest_m: f64) -> Placed {
    let field_m = shortest_m * FOCAL_M / PITCH_M;
    Placed {
        middle_m: [0.0, -field_m / 4.0],
        pixel_m: 0.9 * (field_m / W as f64).min(field_m / 2.0 / H as f64),
    }
}

fn display(folder: &Folder, more: &str) {
    let toml = format!("width = {W}\nheight = {H}\nplane = \"fourier\"\nfocal_mm = 200\n{more}");
    fs::write(folder.path("d.toml"), toml).unwrap();
}

/// Returns the levels of a colour and the amplitude of full light.
fn read(folder: &Folder, name: &str, colour: usize) -> (Vec<f64>, f64) {
    let Hologram::Levels(Levels::Bytes(levels), info) = hologram::read_hologram(&folder.path(name)).unwrap() else {
        panic!("levels of 8 bits");
    };
    let levels = levels.index_axis(ndarray::Axis(0), colour).mapv(f64::from);
    (levels.iter().copied().collect(), info.scale.unwrap().into())
}

fn middle(at: usize, count: usize) -> f64 {
    at as f64 - (count as f64 - 1.0) / 2.0
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// Returns the amplitudes, (H, W), of the light of `levels` in the focal plane, at the picture's pixels moved by
/// `moved` pixels right and down, for an amplitude of 1 of the panel's mean light in each pixel of the picture. Light
/// that travels right or down at the panel arrives there at the right or below.
fn far_field(levels: &[f64], wavelength_m: f64, placed: &Placed, z_m: f64, moved: f64) -> Vec<f64> {
    let Placed { middle_m, pixel_m } = *placed;
    let turns = |from_m: f64, to_m: f64| Complex64::cis(-TAU * from_m * to_m / (wavelength_m * FOCAL_M));
    let light = |y: usize, x: usize| {
        let squared_m2 = (middle(x, W).powi(2) + middle(y, H).powi(2)) * PITCH_M * PITCH_M;
        let defocus = -PI * z_m * squared_m2 / (wavelength_m * FOCAL_M * FOCAL_M);
        Complex64::cis(TAU * levels[y * W + x] / 256.0 + defocus)
    };
    let place = |at: usize, count: usize, axis: usize| (middle(at, count) + moved) * pixel_m + middle_m[axis];
    let mut rows = vec![Complex64::ZERO; H * W];
    for (at, value) in rows.iter_mut().enumerate() {
        let (y, to_m) = (at / W, place(at % W, W, 0));
        *value = (0..W).map(|x| light(y, x) * turns(middle(x, W) * PITCH_M, to_m)).sum();
    }
    let field_m = wavelength_m * FOCAL_M / PITCH_M;
    (0..H * W)
        .map(|at| {
            let (to_y, to_x) = (place(at / W, H, 1), place(at % W, W, 0));
            let sum: Complex64 = (0..H)
                .map(|y| rows[y * W + at % W] * turns(middle(y, H) * PITCH_M, to_y))
                .sum();
            sum.norm() * pixel_m / field_m * sinc(to_x / field_m) * sinc(to_y / field_m)
        })
        .collect()
}

fn psnr(seen: &[f64], wanted: &[f64]) -> f64 {
    let squares: f64 = seen.iter().zip(wanted).map(|(a, b)| (a - b).powi(2)).sum();
    -10.0 * (squares / seen.len() as f64).log10()
}

/// A picture of smooth and of sharp parts, the same turned no way.
fn picture(x: u32, y: u32) -> [u8; 3] {
    let (u, v) = (f64::from(x) / W as f64, f64::from(y) / H as f64);
    let disc = (u - 0.3).hypot((v - 0.4) * 0.67) < 0.15;
    let bars = u > 0.6 && v > 0.5 && (x / 6).is_multiple_of(2);
    let ground = 60.0 + 90.0 * u + 50.0 * (7.0 * v).sin();
    match (disc, bars) {
        (true, _) => [230, 200, 60],
        (_, true) => [210, 220, 235],
        _ => [ground, 200.0 - ground, 0.5 * ground].map(|value| value.max(0.0) as u8),
    }
}

fn made(folder: &Folder, more: &[&str]) -> Value {
    let make = ["hologram", "--rgb", "rgb.png", "--rgb-encoding", "amplitude"];
    let to = ["--display", "d.toml", "-o", "h.png", "--json"];
    serde_json::from_str(&folder.succeeds(&[&make[..], &to, more].concat())).unwrap()
}

const FLAT: [&str; 2] = ["--depth", "flat"];

#[test]
fn a_spot_of_every_colour_lies_where_it_should() {
    let folder = Folder::new();
    display(&folder, "");
    for (right, down) in [(70, 12), (20, 12), (70, 50), (20, 50)] {
        let spot = RgbImage::from_fn(W as u32, H as u32, |x, y| match (x, y) == (right, down) {
            true => Rgb([255; 3]),
            false => Rgb([0; 3]),
        });
        spot.save(folder.path("rgb.png")).unwrap();
        made(&folder, &FLAT);
        for (colour, wavelength_m) in RED_GREEN_BLUE_M.into_iter().enumerate() {
            let (levels, _) = read(&folder, "h.png", colour);
            let seen = far_field(&levels, wavelength_m, &placed(450e-9), 0.0, 0.0);
            let brightest = (0..seen.len()).max_by(|a, b| seen[*a].total_cmp(&seen[*b])).unwrap();
            assert_eq!(
                (brightest % W, brightest / W),
                (right as usize, down as usize),
                "{colour}"
            );
        }
    }
}

#[test]
fn the_picture_is_in_the_far_field_and_the_commands_see_it() {
    let folder = Folder::new();
    display(&folder, "");
    RgbImage::from_fn(W as u32, H as u32, |x, y| Rgb(picture(x, y)))
        .save(folder.path("rgb.png"))
        .unwrap();
    let told = made(&folder, &[&FLAT[..], &["--judge"]].concat());
    let mut dbs = Vec::new();
    for (colour, wavelength_m) in RED_GREEN_BLUE_M.into_iter().enumerate() {
        let (levels, scale) = read(&folder, "h.png", colour);
        let scaled = |moved| -> Vec<f64> {
            let seen = far_field(&levels, wavelength_m, &placed(450e-9), 0.0, moved);
            seen.iter().map(|amplitude| amplitude * scale).collect()
        };
        let wanted = |x: usize, y: usize| f64::from(picture(x as u32, y as u32)[colour]) / 255.0;
        let pixels: Vec<f64> = (0..W * H).map(|at| wanted(at % W, at / W)).collect();
        let between: Vec<f64> = (0..W * H)
            .map(|at| {
                let (x, y) = (at % W, at / W);
                let (right, down) = ((x + 1).min(W - 1), (y + 1).min(H - 1));
                (wanted(x, y) + wanted(right, y) + wanted(x, down) + wanted(right, down)) / 4.0
            })
            .collect();
        let at_pixels = psnr(&scaled(0.0), &pixels);
        let beside = psnr(&scaled(0.5), &between);
        assert!(at_pixels > 24.0 && beside > 20.0, "{colour}: {at_pixels} {beside}");
        dbs.push(at_pixels);
        // The light beside the picture, on the other side of the zero order, is the conjugate's place and holds none.
        let mirrored: Vec<f64> = pixels.iter().rev().copied().collect();
        assert!(psnr(&scaled(0.0), &mirrored) < 14.0);
    }
    // `--judge` compares the same light with the same picture.
    let mean_square = dbs.iter().map(|db| 10f64.powf(-db / 10.0)).sum::<f64>() / 3.0;
    let judged = told["shown"]["psnr_db"].as_f64().unwrap();
    assert!((judged + 10.0 * mean_square.log10()).abs() < 0.05, "{judged} {dbs:?}");
    // `refocus` writes what the model sees.
    folder.succeeds(&["refocus", "h.png", "--display", "d.toml", "--z-mm", "0", "-o", "v.png"]);
    let view = image::open(folder.path("v.png")).unwrap().to_rgb8();
    assert_eq!(view.dimensions(), (W as u32, H as u32));
    for (colour, wavelength_m) in RED_GREEN_BLUE_M.into_iter().enumerate() {
        let (levels, scale) = read(&folder, "h.png", colour);
        for (at, seen) in far_field(&levels, wavelength_m, &placed(450e-9), 0.0, 0.0)
            .into_iter()
            .enumerate()
        {
            let value = f64::from(view.get_pixel((at % W) as u32, (at / W) as u32).0[colour]);
            assert!((value - (255.0 * seen * scale).min(255.0)).abs() < 1.0, "{colour} {at}");
        }
    }
    folder.succeeds(&["view", "h.png", "--display", "d.toml", "-o", "page.html"]);
    let image = [
        "--rgb",
        "rgb.png",
        "--rgb-encoding",
        "amplitude",
        "--depth",
        "flat",
        "--display",
        "d.toml",
    ];
    folder.succeeds(&[&["view"], &image[..], &["-o", "of-image.html"]].concat());
    let judge = [&["judge"], &image[..], &["--hologram", "h.png", "--json"]].concat();
    let told: Value = serde_json::from_str(&folder.succeeds(&judge)).unwrap();
    let rows = told["rows"].as_array().unwrap();
    assert_eq!((rows.len(), &rows[0]["psnr_db"]), (2, &rows[1]["psnr_db"]));
    folder.succeeds(&["pack", "h.png", "--display", "d.toml", "-o", "frame.png"]);
}

#[test]
fn depth_lies_about_the_focal_plane() {
    let folder = Folder::new();
    // A volume of 120 mm, for the panel is small and focuses deep.
    display(&folder, "wavelengths_nm = [520]\nvolume_depth_mm = 120\n");
    let striped = |x: u32| if (x / 4).is_multiple_of(2) { 250 } else { 20 };
    RgbImage::from_fn(W as u32, H as u32, |x, _| Rgb([striped(x); 3]))
        .save(folder.path("rgb.png"))
        .unwrap();
    // The upper half is near, 40 mm toward the viewer, the lower half as far behind.
    GrayImage::from_fn(W as u32, H as u32, |_, y| Luma([if y < 32 { 43 } else { 212 }]))
        .save(folder.path("depth.png"))
        .unwrap();
    made(&folder, &["--depth", "depth.png", "--depth-unit", "normalized"]);
    let (levels, scale) = read(&folder, "h.png", 0);
    let half_db = |z_m: f64, rows: std::ops::Range<usize>| {
        let seen = far_field(&levels, 520e-9, &placed(520e-9), z_m, 0.0);
        let wanted: Vec<f64> = rows
            .clone()
            .flat_map(|_| (0..W).map(|x| f64::from(striped(x as u32)) / 255.0))
            .collect();
        let seen: Vec<f64> = seen[rows.start * W..rows.end * W].iter().map(|a| a * scale).collect();
        psnr(&seen, &wanted)
    };
    for (rows, z_mm) in [(4..28, 40.0), (36..60, -40.0)] {
        let (right, wrong) = (half_db(z_mm / 1e3, rows.clone()), half_db(-z_mm / 1e3, rows));
        assert!(right > wrong + 6.0, "{z_mm}: {right} {wrong}");
    }
}

#[test]
fn what_a_lens_does_not_take_is_told_in_one_line() {
    let folder = Folder::new().with_frame();
    display(&folder, "");
    fs::write(folder.path("plain.toml"), format!("width = {W}\nheight = {H}\n")).unwrap();
    let hologram = ["hologram", "--rgb", "rgb.png", "--depth", "depth.png", "-o", "h.png"];
    folder.succeeds(&[&hologram[..], &["--display", "d.toml"]].concat());
    let fails = |arguments: &[&str], code, word: &str| {
        let said = folder.fails(arguments, code);
        assert!(
            said.contains(word) && said.trim().lines().count() == 1,
            "{arguments:?}: {said}"
        );
    };
    fails(&["refocus", "h.png", "--z-mm", "0", "-o", "v.png"], 1, "--display FILE");
    let on_plain = [
        "refocus",
        "h.png",
        "--display",
        "plain.toml",
        "--z-mm",
        "0",
        "-o",
        "v.png",
    ];
    fails(
        &on_plain,
        1,
        "in the focal plane of a lens, that of the display about the modulator",
    );
    for more in [
        &["--method", "sweep"][..],
        &["--network", "8"],
        &["--encoder", "double"],
        &["--midpoint-steps", "1"],
        &["--focus", "natural"],
        &["--backend", "gpu"],
    ] {
        fails(
            &[&hologram[..], &["--display", "d.toml"], more].concat(),
            2,
            "in the focal plane of a lens",
        );
    }
    fails(
        &[&hologram[..], &["--display", "d.toml", "--complex", "c.npy"]].concat(),
        2,
        "there is no field",
    );
    let video = [
        "multiplex",
        "--rgb",
        "rgb.png",
        "--depth",
        "depth.png",
        "--judge",
        "--display",
        "d.toml",
    ];
    fails(&video, 1, "this command does not");
    fails(&["bench", "--display", "d.toml"], 1, "this command does not");
}

#[test]
fn a_display_file_with_a_lens_is_checked_and_described() {
    let folder = Folder::new().with_frame();
    display(&folder, "");
    let hologram = ["hologram", "--rgb", "rgb.png", "--depth", "depth.png", "-o", "h.png"];
    let fails = |arguments: &[&str], word: &str| {
        let said = folder.fails(arguments, 1);
        assert!(said.contains(word) && said.trim().lines().count() == 1, "{said}");
    };
    for (more, word) in [
        ("plane = \"fourier\"", "needs focal_mm"),
        ("plane = \"image\"\nfocal_mm = 200", "\"fourier\" is the focal plane"),
        ("focal_mm = 200", "goes with plane"),
        ("plane = \"fourier\"\nfocal_mm = \"200\"", "focal_mm"),
        (
            "plane = \"fourier\"\nfocal_mm = 200\noffset_mm = 3",
            "does not go with offset_mm",
        ),
        (
            "plane = \"fourier\"\nfocal_mm = 200\ncarrier_mrad = [28, 0]",
            "leaves no room",
        ),
        (
            "plane = \"fourier\"\nfocal_mm = 200\nshift_px = [[0, 0], [1, 0], [0, 0]]",
            "shift_px",
        ),
    ] {
        fs::write(folder.path("bad.toml"), more).unwrap();
        fails(&[&hologram[..], &["--display", "bad.toml"]].concat(), word);
    }
    let said = folder.succeeds(&["devices", "d.toml"]);
    for line in [
        "picture      7.6 x 5.1 mm in the focal plane of a lens of 200 mm, pixels of 79.1 um",
        "field        16.0, 13.0, 11.2 mm for each laser",
        "detail       166.1 x 249.2, 135.4 x 203.1, 117.2 x 175.8 um",
        "zero order   2.8 mm below the middle of the picture",
    ] {
        assert!(said.contains(line), "{line}: {said}");
    }
}
