//! What `devices` says that a display shows at most, against the light of a simulated display.

use crate::folder;
use folder::{Folder, SMALL_HOLOGRAM};
use ndarray::{Array2, Axis};
use num_complex::Complex64;
use phasefront::Display;
use phasefront_calibration::simulated_display::{Curves, SimulatedDisplay};
use phasefront_io::hologram::{self, Hologram, Levels};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fs;

const SIDE: usize = 96;
const DISPLAY: &str = "width = 96\nheight = 96\nvolume_depth_mm = 80\nwavelengths_nm = [520]\n";

/// Makes a hologram of a picture on one plane, whose values are amplitudes; `--display` and `-o` follow.
const FLAT_AMPLITUDES: [&str; 9] = [
    "hologram",
    "--rgb",
    "rgb.png",
    "--rgb-encoding",
    "amplitude",
    "--depth",
    "flat",
    "--method",
    "sweep",
];

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// Makes the hologram of stripes of `pixels` each at `z_mm`, and returns the light at this z.
fn stripes(folder: &Folder, display: &str, pixels: usize, z_mm: f64) -> Array2<f32> {
    fs::write(folder.path("d.toml"), display).unwrap();
    let value = |x: u32| {
        if (x as usize / pixels).is_multiple_of(2) {
            240
        } else {
            40
        }
    };
    image::GrayImage::from_fn(SIDE as u32, SIDE as u32, |x, _| image::Luma([value(x)]))
        .save(folder.path("rgb.png"))
        .unwrap();
    let z = z_mm.to_string();
    folder.succeeds(
        &[
            &FLAT_AMPLITUDES[..],
            &["--z-mm", &z, "--display", "d.toml", "-o", "h.png"],
        ]
        .concat(),
    );
    let straight = Curves {
        range: vec![255.0 / 256.0],
        unevenness: 0.0,
        steepness: 0.0,
        bend: 0.0,
    };
    let bench = SimulatedDisplay::new(&Display::from_toml(display).unwrap(), 1.0, 5).unwrap();
    let fine = bench
        .with_curves(straight)
        .intensity(levels(folder).view(), 0, z_mm / 1e3);
    // Twice as fine; every second value is a pixel's.
    fine.unwrap().slice(ndarray::s![..;2, ..;2]).to_owned()
}

fn levels(folder: &Folder) -> Array2<u8> {
    let Hologram::Levels(Levels::Bytes(levels), _) = hologram::read_hologram(&folder.path("h.png")).unwrap() else {
        panic!("levels of 8 bits");
    };
    levels.index_axis(Axis(0), 0).to_owned()
}

/// Returns the contrast of stripes of `pixels` each in the columns `from`..`to`, whole periods of them.
fn contrast(light: &Array2<f32>, pixels: usize, from: usize, to: usize) -> f64 {
    let to = from + (to - from) / (2 * pixels) * 2 * pixels;
    let column = |x: usize| {
        light
            .column(x)
            .iter()
            .skip(SIDE / 4)
            .take(SIDE / 2)
            .map(|v| f64::from(*v))
            .sum::<f64>()
    };
    let wave = |x: usize| Complex64::cis(TAU * x as f64 / (2 * pixels) as f64);
    let sum: Complex64 = (from..to).map(|x| wave(x) * column(x)).sum();
    sum.norm() / (from..to).map(column).sum::<f64>()
}

#[test]
fn details_are_lost_where_devices_says() {
    let folder = Folder::new();
    fs::write(folder.path("d.toml"), DISPLAY).unwrap();
    // At 35.4 mm the middle keeps details of 24 um, 3 pixels.
    let told = json(&folder.succeeds(&["devices", "d.toml", "--z-mm", "35.4", "--json"]));
    let detail_um = told["at_z"]["detail_um"].as_f64().unwrap();
    assert!((detail_um - 24.0).abs() < 0.1, "{told}");
    assert!((told["reach_mm"].as_f64().unwrap() - 11.8).abs() < 0.1, "{told}");
    let middle = |pixels: usize, z_mm: f64| {
        contrast(
            &stripes(&folder, DISPLAY, pixels, z_mm),
            pixels,
            SIDE / 2 - 12,
            SIDE / 2 + 12,
        )
    };
    let (coarse, fine, fine_near) = (middle(4, 35.4), middle(2, 35.4), middle(2, 8.0));
    assert!(
        coarse > 0.4 && fine_near > 0.4 && fine < 0.1,
        "{coarse} {fine} {fine_near}"
    );
    let said = folder.succeeds(&["devices", "d.toml", "--z-mm", "60"]);
    for words in [
        "from z = -11.8 to 11.8 mm",
        "too far      z = 40.0 mm: details below 27 um are lost there",
        "outside the volume, from -40.0 to 40.0 mm",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn the_part_of_the_frame_with_all_details_is_the_one_that_devices_says() {
    let folder = Folder::new();
    // Half of the aperture passes details of 2 pixels.
    let display = &format!("{DISPLAY}aperture_radius = 0.5\n");
    fs::write(folder.path("d.toml"), display).unwrap();
    let told = json(&folder.succeeds(&["devices", "d.toml", "--z-mm", "14", "--json"]));
    let part = told["at_z"]["sharp_mm"][0].as_f64().unwrap() / 8e-3;
    assert!((part - 39.0).abs() < 1.0, "{told}");
    let light = stripes(&folder, display, 3, 14.0);
    let from = (SIDE - part as usize) / 2;
    let inside = contrast(&light, 3, from, SIDE - from);
    let beside = contrast(&light, 3, 0, 12).max(contrast(&light, 3, SIDE - 12, SIDE));
    assert!(inside > 0.4 && beside < 0.75 * inside, "{inside} {beside}");
}

#[test]
fn the_light_in_the_picture_is_that_of_the_aperture() {
    let folder = Folder::new();
    fs::write(folder.path("d.toml"), DISPLAY).unwrap();
    let ramp = |x: u32, y: u32| image::Luma([((x + y) * 255 / 190) as u8]);
    image::GrayImage::from_fn(SIDE as u32, SIDE as u32, ramp)
        .save(folder.path("rgb.png"))
        .unwrap();
    let light = |more: &[&str]| {
        let to = ["--display", "d.toml", "-o", "h.png", "--json"];
        let told = json(&folder.succeeds(&[&FLAT_AMPLITUDES[..], &to, more].concat()))["light"]
            .as_f64()
            .unwrap();
        let levels = levels(&folder);
        let wave = |at: usize, k: usize| Complex64::cis(-TAU * (at * k) as f64 / SIDE as f64);
        let rows = Array2::from_shape_fn((SIDE, SIDE), |(y, k)| {
            (0..SIDE)
                .map(|x| Complex64::cis(TAU * f64::from(levels[(y, x)]) / 256.0) * wave(x, k))
                .sum::<Complex64>()
        });
        let signed = |k: usize| if 2 * k < SIDE { k as f64 } else { k as f64 - SIDE as f64 };
        let (mut passed, mut all) = (0.0, 0.0);
        for ky in 0..SIDE {
            for kx in 0..SIDE {
                let part = (0..SIDE)
                    .map(|y| rows[(y, kx)] * wave(y, ky))
                    .sum::<Complex64>()
                    .norm_sqr();
                all += part;
                if signed(ky).hypot(signed(kx)) <= SIDE as f64 / 2.0 {
                    passed += part;
                }
            }
        }
        (told, passed / all)
    };
    let (told, passed) = light(&[]);
    assert!((told - passed).abs() < 0.05, "{told} {passed}");
    let (brighter, passed) = light(&["--scale", "0.7"]);
    assert!(
        (brighter - passed).abs() < 0.05 && brighter > 1.3 * told,
        "{told} {brighter} {passed}"
    );
}

#[test]
fn a_request_beyond_the_limits_is_told() {
    let folder = Folder::new().with_frame();
    let display = "width = 48\nheight = 32\noffset_mm = -30\nwavelengths_nm = [520]\n";
    fs::write(folder.path("d.toml"), display).unwrap();
    let warned = |arguments: &[&str]| {
        let output = folder.run(arguments);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let on = ["--display", "d.toml"];
    let make = [&SMALL_HOLOGRAM[..], &["-o", "h.png"]].concat();
    let said = warned(&[&make[..], &on].concat());
    assert!(
        said.contains("the volume reaches z = 3.0 mm: details below 67 um are lost there"),
        "{said}"
    );
    let said = warned(&["refocus", "h.png", "--z-mm", "-29", "-o", "v.png"]);
    assert!(said.is_empty(), "{said}");
    let said = warned(&["refocus", "h.png", "--z-mm", "1", "-o", "v.png"]);
    assert!(
        said.contains("z = 1.0 mm: details below 63 um are lost there"),
        "{said}"
    );
    fs::write(
        folder.path("d.toml"),
        "width = 48\nheight = 32\nwavelengths_nm = [520]\nvolume_depth_mm = 4\n",
    )
    .unwrap();
    let said = warned(&[&make[..], &on].concat());
    assert!(!said.contains("are lost"), "{said}");
}
