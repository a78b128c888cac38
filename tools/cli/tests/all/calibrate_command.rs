//! Tests `phasefront calibrate` as a user runs it, on photographs of a simulated display.
use crate::folder;

use folder::Folder;
use ndarray::Array2;
use phasefront::Display;
use phasefront::target::Aberration;
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::optics::spot;
use phasefront_calibration::simulated_display::SimulatedDisplay;
use phasefront_core::optics::metrics;
use phasefront_core::optics::zernike::Coefficients;
use phasefront_io::display::calibration;
use phasefront_io::picture;
use std::fs;

/// Arguments that compute the table from the rehearsal's photographs.
const LUT: [&str; 12] = [
    "calibrate",
    "lut",
    "--captures",
    "out/captures",
    "--display",
    "bare.toml",
    "--full",
    "full",
    "--report",
    "report",
    "-o",
    "table.pfp",
];

#[test]
#[ignore = "slow: 20 seconds of a core"]
fn a_rehearsal_leaves_all_that_a_calibrated_display_needs() {
    let folder = Folder::new();
    let rehearse = [
        "calibrate",
        "rehearse",
        "--size",
        "144x64",
        "--zoom",
        "1.6",
        "--spot-z-mm",
        "5.5",
        "--captures",
        "--json",
        "-o",
        "out",
    ];
    let outcome: serde_json::Value = serde_json::from_str(&folder.succeeds(&rehearse)).unwrap();
    for colour in 0..3 {
        let number = |what: &str, when: &str| outcome[what][when][colour].as_f64().unwrap();
        assert!(number("phase_error_rad", "before") > 0.3);
        assert!(number("phase_error_rad", "after") < 0.05, "{outcome}");
        assert!(number("black_db", "before") - number("black_db", "after") > 10.0);
        assert!(
            number("unevenness", "after") < 0.5 * number("unevenness", "before"),
            "{outcome}"
        );
        assert!(number("strehl", "after") > 0.95, "{outcome}");
    }
    for name in [
        "curves.svg",
        "residuals.svg",
        "maps.svg",
        "laser.svg",
        "search.svg",
        "spot.png",
        "black.png",
    ] {
        assert!(folder.path("out").join(name).is_file(), "{name}");
    }
    // Existing files are not overwritten.
    assert!(folder.fails(&rehearse, 1).contains("--overwrite"));

    the_same_by_hand(&folder);
    bad_captures_are_named(&folder);
    holograms_are_for_it(&folder);
    another_size_is_refused(&folder);
}

fn bytes(folder: &Folder, name: &str) -> Vec<u8> {
    fs::read(folder.path(name)).unwrap()
}

/// Calibrating the same photographs with separate commands gives the same files.
fn the_same_by_hand(folder: &Folder) {
    fs::write(folder.path("bare.toml"), "width = 144\nheight = 64").unwrap();
    let said = folder.succeeds(&LUT);
    assert!(said.contains("red") && said.contains("table:"), "{said}");
    assert_eq!(bytes(folder, "table.pfp"), bytes(folder, "out/table.pfp"));
    assert!(folder.path("report/curves.svg").is_file());
    let full: ndarray::Array3<u8> = ndarray_npy::read_npy(folder.path("full/full_green.npy")).unwrap();
    assert_eq!(full.dim(), (64, 144, 256));
    assert!(full[(32, 72, 255)] > 150 && full[(32, 72, 0)] == 0);
    assert!(folder.fails(&LUT, 1).contains("--overwrite"));
    folder.succeeds(&[
        "calibrate",
        "laser",
        "out/captures",
        "--gaussians",
        "1",
        "--display",
        "bare.toml",
        "-o",
        "laser.png",
    ]);
    assert_eq!(bytes(folder, "laser.png"), bytes(folder, "out/laser.png"));
}

/// Bad photographs are reported by name, and an existing table stays.
fn bad_captures_are_named(folder: &Folder) {
    let captures = folder.path("out/captures");
    fs::remove_file(captures.join("green/capture_007.png")).unwrap();
    fs::rename(
        captures.join("red/capture_200.png"),
        captures.join("red/capture_201.png"),
    )
    .unwrap();
    fs::write(captures.join("blue/capture_001.png"), b"no picture").unwrap();
    let forced: Vec<_> = LUT.iter().copied().chain(["--overwrite"]).collect();
    let said = folder.fails(&forced, 1);
    for words in [
        "green/capture_007: is missing",
        "red/capture_200: is missing",
        "red/capture_201: shows pattern 200",
        "blue/capture_001: ",
        "4 of 768 captures cannot be used",
    ] {
        assert!(said.contains(words), "no {words:?} in {said}");
    }
    assert_eq!(said.lines().filter(|l| l.starts_with("error")).count(), 1, "{said}");
    assert_eq!(bytes(folder, "table.pfp"), bytes(folder, "out/table.pfp"));
}

/// Creates a hologram for the calibrated display and views it on that display.
fn holograms_are_for_it(folder: &Folder) {
    let rgb = image::RgbImage::from_fn(96, 48, |x, y| image::Rgb([(x * 2) as u8, (y * 5) as u8, 90]));
    rgb.save(folder.path("rgb.png")).unwrap();
    image::GrayImage::from_pixel(96, 48, image::Luma([128]))
        .save(folder.path("depth.png"))
        .unwrap();
    let hologram = |more: &[&'static str]| {
        let all = [
            "hologram",
            "--rgb",
            "rgb.png",
            "--depth",
            "depth.png",
            "--method",
            "layers",
            "--planes",
            "9",
        ];
        folder.succeeds(&all.iter().chain(more).copied().collect::<Vec<_>>());
    };
    hologram(&["--display", "bare.toml", "-o", "plain.png"]);
    hologram(&["--display", "out/display.toml", "-o", "h.png"]);
    assert_ne!(bytes(folder, "plain.png"), bytes(folder, "h.png"));
    let said = folder.fails(&["refocus", "h.png", "--z-mm", "0", "-o", "v.png"], 1);
    assert!(
        said.contains("per_pixel or phases of each laser, laser, aberration") && said.contains("--display"),
        "{said}"
    );
    folder.succeeds(&["refocus", "plain.png", "--z-mm", "0", "-o", "plain_view.png"]);
    folder.succeeds(&[
        "refocus",
        "h.png",
        "--z-mm",
        "0",
        "--display",
        "out/display.toml",
        "-o",
        "view.png",
    ]);
    let read = |name: &str| picture::read_rgb(&folder.path(name)).unwrap();
    let inner = ndarray::s![.., 8..40, 8..88];
    let (plain, view) = (read("plain_view.png"), read("view.png"));
    let alike = metrics::compare(plain.slice(inner), view.slice(inner))
        .unwrap()
        .psnr_overall;
    assert!(alike > 22.0, "{alike}");
}

fn another_size_is_refused(folder: &Folder) {
    fs::write(
        folder.path("other.toml"),
        "width = 160\nheight = 64\nper_pixel = \"table.pfp\"",
    )
    .unwrap();
    let said = folder.fails(
        &[
            "hologram",
            "--rgb",
            "rgb.png",
            "--depth",
            "depth.png",
            "--display",
            "other.toml",
            "-o",
            "o.png",
        ],
        1,
    );
    assert!(said.contains("is for 144×64"), "{said}");
}

#[test]
fn patterns_are_written_once() {
    let folder = Folder::new();
    fs::write(folder.path("display.toml"), "width = 144\nheight = 64").unwrap();
    let write = [
        "calibrate",
        "lut",
        "--patterns",
        "patterns",
        "--display",
        "display.toml",
    ];
    folder.succeeds(&write);
    let pattern = image::open(folder.path("patterns/pattern_200.png"))
        .unwrap()
        .into_luma8();
    assert_eq!(pattern.dimensions(), (144, 64));
    assert_eq!((pattern.get_pixel(80, 40)[0], pattern.get_pixel(81, 40)[0]), (200, 0));
    assert_eq!(fs::read_dir(folder.path("patterns")).unwrap().count(), 256);
    assert!(folder.fails(&write, 1).contains("--overwrite"));
    folder.fails(&["calibrate", "lut"], 2);
    folder.fails(&["calibrate", "lut", "--captures", "x"], 2);
    fs::write(folder.path("small.toml"), "width = 64\nheight = 64").unwrap();
    let said = folder.fails(&["calibrate", "lut", "--patterns", "p", "--display", "small.toml"], 1);
    assert!(said.contains("144×64"), "{said}");
}

#[test]
fn an_aberration_is_searched_round_by_round() {
    let folder = Folder::new();
    let wanted: Coefficients = [0.9, -1.1, 0.6, 0.8, -0.9];
    let display = Display::from_toml("width = 80\nheight = 72").unwrap();
    fs::write(folder.path("display.toml"), "width = 80\nheight = 72").unwrap();
    let correction = Aberration::new([[0.0; 5], wanted, [0.0; 5]]).unwrap();
    let simulated = SimulatedDisplay::new(&display, 2.0, 8)
        .unwrap()
        .with_aberration(correction);
    let mut camera = simulated.camera().clone();
    camera.exposure = spot::exposure(&display, 1, 7e-3);
    let simulated = simulated.with_camera(camera);
    let search = [
        "calibrate",
        "aberration",
        "search",
        "--z-mm",
        "7",
        "--colour",
        "green",
        "--display",
        "display.toml",
        "-o",
        "aberration.toml",
    ];
    for round in 0..spot::ROUNDS {
        folder.succeeds(&search);
        let here = folder.path("search").join(format!("round_{round}"));
        if round == 0 {
            // A search that was stopped before it wrote its first trials writes them.
            fs::remove_file(here.join("trial_02.png")).unwrap();
            let said = folder.fails(&search, 1);
            assert!(said.contains("capture_00.png") && said.contains("missing"), "{said}");
        }
        for i in 0..spot::TRIALS {
            let trial = Photograph::read(&here.join(format!("trial_{i:02}.png")), 0).unwrap();
            let levels: Vec<u8> = trial.values.iter().map(|v| *v as u8).collect();
            let levels = Array2::from_shape_vec((72, 80), levels).unwrap();
            let shot = (round * 100 + i) as u64;
            let photo = simulated.photograph(levels.view(), 1, 7e-3, shot).unwrap();
            photo.write(&here.join(format!("capture_{i:02}.png"))).unwrap();
        }
    }
    let said = folder.succeeds(&search);
    assert!(said.contains("coefficients"), "{said}");
    let entries = calibration::read_entries(&folder.path("aberration.toml")).unwrap();
    let left: Coefficients = std::array::from_fn(|i| wanted[i] - entries[0].green[i]);
    // The modulator itself is not calibrated here.
    assert!(
        spot::strehl(&wanted) < 0.6 && spot::strehl(&left) > 0.95,
        "{} {} {left:?}",
        spot::strehl(&wanted),
        spot::strehl(&left)
    );
    assert_eq!(entries[0].red, [0.0; 5]);
    assert!(folder.fails(&search, 1).contains("--overwrite"));
}

#[test]
fn a_rehearsal_that_cannot_end_is_refused_before_it_begins() {
    let folder = Folder::new();
    for (size, spot_z_mm, word) in [
        ("144x64", "12", "frame of 144×64"),
        ("80x48", "5.5", "no room for marks"),
        ("144x64", "0", "focus at 0.000 mm"),
    ] {
        let rehearse = [
            "calibrate",
            "rehearse",
            "--size",
            size,
            "--spot-z-mm",
            spot_z_mm,
            "-o",
            "out",
        ];
        let said = folder.fails(&rehearse, 1);
        assert!(said.contains(word), "{said}");
        // The first photographs are taken only after this folder is created.
        assert!(!folder.path("out").exists(), "{said}");
    }
}
