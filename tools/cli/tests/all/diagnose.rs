//! What a photograph of a displayed hologram says, from a simulated display.

use crate::folder;
use folder::{Folder, SMALL_HOLOGRAM};
use ndarray::Axis;
use phasefront::Display;
use phasefront_calibration::simulated_display::{Curves, SimulatedDisplay};
use phasefront_io::hologram::{self, Hologram, Levels};
use std::fs;

const DISPLAY: &str = "width = 112\nheight = 80\nvolume_depth_mm = 4\noffset_mm = -5\nwavelengths_nm = [520]\n";

/// Makes the hologram `h.png` for the display `d.toml`.
fn made(folder: &Folder, display: &str) {
    fs::write(folder.path("d.toml"), display).unwrap();
    let blob = |x: u32, y: u32, u: f64, v: f64| (f64::from(x) - u).hypot(f64::from(y) - v);
    let rgb = image::RgbImage::from_fn(112, 80, |x, y| {
        let lit = |near: f64| if near < 14.0 { 230 } else { 40 + (x / 2 + y / 3) as u8 };
        let stripe = if (x / 7 + y / 5) % 4 == 0 && y > 45 { 220 } else { 30 };
        image::Rgb([lit(blob(x, y, 30.0, 25.0)), lit(blob(x, y, 80.0, 30.0)), stripe])
    });
    rgb.save(folder.path("rgb.png")).unwrap();
    image::GrayImage::from_fn(112, 80, |x, _| image::Luma([if x < 60 { 60 } else { 190 }]))
        .save(folder.path("depth.png"))
        .unwrap();
    folder.succeeds(&[&SMALL_HOLOGRAM[..], &["--display", "d.toml", "-o", "h.png"]].concat());
}

/// Photographs `h.png`, with its rows reversed or not.
fn photographed(folder: &Folder, name: &str, mirrored: bool) {
    let display = Display::from_toml(DISPLAY).unwrap();
    let Hologram::Levels(Levels::Bytes(levels), _) = hologram::read_hologram(&folder.path("h.png")).unwrap() else {
        panic!("levels of 8 bits");
    };
    let mut levels = levels.index_axis(Axis(0), 0).to_owned();
    if mirrored {
        levels.invert_axis(Axis(1));
    }
    let straight = Curves {
        range: vec![255.0 / 256.0],
        unevenness: 0.0,
        steepness: 0.0,
        bend: 0.0,
    };
    let bench = SimulatedDisplay::new(&display, 2.0, 5).unwrap().with_curves(straight);
    let photo = bench.photograph(levels.view(), 0, 0.0, 0).unwrap();
    // Half of what the scale shows is dim; the camera's exposure is set to the picture.
    let most = f64::from(photo.values.iter().copied().max().unwrap());
    let mut camera = bench.camera().clone();
    camera.exposure *= 0.8 * 65535.0 / most;
    let photo = bench.with_camera(camera).photograph(levels.view(), 0, 0.0, 0).unwrap();
    photo.write(&folder.path(name)).unwrap();
}

#[test]
fn a_photograph_is_right_or_says_why_it_is_not() {
    let folder = Folder::new();
    made(&folder, DISPLAY);
    photographed(&folder, "good.png", false);
    let said = folder.succeeds(&["diagnose", "good.png", "--hologram", "h.png"]);
    assert!(said.contains("looks as it should"), "{said}");
    photographed(&folder, "mirrored.png", true);
    let output = folder.run(&["diagnose", "mirrored.png", "--hologram", "h.png", "--display", "d.toml"]);
    let [said, errors] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!(output.status.code(), Some(1), "{said}{errors}");
    assert!(said.starts_with("mirrored left to right (99 %)"), "{said}");
    assert!(said.contains("next: set `flip_x = true`"), "{said}");
    assert!(
        errors.contains("mirrored.png: does not look as it should: one cause"),
        "{errors}"
    );
    let output = folder.run(&["diagnose", "mirrored.png", "--hologram", "h.png", "--json"]);
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(value["findings"][0]["cause"], "mirrored left to right", "{value}");
    assert!(value["explained"].as_f64().unwrap() > 0.9, "{value}");
}

#[test]
fn photographs_that_do_not_fit_are_named() {
    let folder = Folder::new();
    made(&folder, DISPLAY);
    photographed(&folder, "good.png", false);
    let said = folder.fails(&["diagnose", "good.png", "good.png", "--hologram", "h.png"], 1);
    assert!(said.contains("2 photographs; give one in colours"), "{said}");
    made(&folder, &DISPLAY.replace("[520]", "[638, 520, 450]"));
    let said = folder.fails(&["diagnose", "good.png", "--hologram", "h.png"], 1);
    assert!(said.contains("is grey, and the display has three lasers"), "{said}");
    let said = folder.fails(&["diagnose", "good.png", "--hologram", "h.png", "--z-mm", "500"], 1);
    assert!(said.contains("far outside"), "{said}");
}
