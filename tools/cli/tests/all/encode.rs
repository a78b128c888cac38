//! Tests `phasefront encode`: from a complex field to levels, phases and frames, and the one-line errors.
use crate::folder;

use folder::{Folder, SMALL_HOLOGRAM};
use ndarray::{Array2, Array3, ArrayD};
use num_complex::{Complex32, Complex64};
use phasefront_io::hologram::{self, Hologram, Levels};
use std::f32::consts::TAU;
use std::fs;

const H: usize = 32;
const W: usize = 48;

/// Returns a smooth field with (C, H, W) = (`colours`, 32, 48).
fn field(colours: usize) -> Array3<Complex32> {
    Array3::from_shape_fn((colours, H, W), |(c, y, x)| {
        let amplitude = 0.6 + 0.3 * ((x + 5 * c) as f32 / 9.0).sin() * (y as f32 / 7.0).cos();
        Complex32::from_polar(amplitude, 0.11 * x as f32 - 0.07 * y as f32)
    })
}

fn levels(folder: &Folder, name: &str) -> Array3<u16> {
    match hologram::read_hologram(&folder.path(name)).unwrap() {
        Hologram::Levels(Levels::Bytes(levels), _) => levels.mapv(u16::from),
        Hologram::Levels(Levels::Words(levels), _) => levels,
        Hologram::Complex(..) => panic!("levels were written"),
    }
}

fn with_display(toml: &str) -> Folder {
    let folder = Folder::new();
    fs::write(
        folder.path("d.toml"),
        format!("width = {W}\nheight = {H}\noffset_mm = 2\n{toml}"),
    )
    .unwrap();
    folder
}

/// A field that `hologram --complex` wrote is at the modulator, and becomes the same levels again.
#[test]
fn the_field_of_a_hologram_becomes_its_levels() {
    let folder = with_display("").with_frame();
    for more in [
        &["--encoder", "double"][..],
        &["--midpoint-steps", "1"],
        &["--scale", "0.8"],
    ] {
        let display = ["--display", "d.toml"];
        let made = [
            &SMALL_HOLOGRAM[..],
            &display,
            more,
            &["--complex", "f.npy", "-o", "h.png"],
        ]
        .concat();
        folder.succeeds(&made);
        folder.succeeds(&[&["encode", "f.npy"], &display[..], more, &["-o", "e.png"]].concat());
        assert_eq!(levels(&folder, "e.png"), levels(&folder, "h.png"), "{more:?}");
        let infos = ["e.png", "h.png"].map(|name| hologram::read_hologram(&folder.path(name)).unwrap().info().clone());
        assert_eq!(infos[0], infos[1]);
    }
    let said = folder.fails(&["encode", "f.npy", "--offset-mm", "1", "-o", "e.png"], 1);
    assert!(said.contains("an offset of 2 mm"), "{said}");
    // A z takes the field as any other.
    folder.succeeds(&[
        "encode",
        "f.npy",
        "--z-mm",
        "2",
        "--display",
        "d.toml",
        "--scale",
        "0.8",
        "-o",
        "z.png",
    ]);
    assert_eq!(levels(&folder, "z.png"), levels(&folder, "h.png"));
}

/// Both number types and both orders of memory are one field; its view is the field.
#[test]
fn one_laser_takes_a_plane_and_shows_it() {
    let folder = with_display("wavelengths_nm = [532]\n");
    let plane = field(1).index_axis_move(ndarray::Axis(0), 0);
    ndarray_npy::write_npy(folder.path("f.npy"), &plane).unwrap();
    let double = plane.mapv(|v| Complex64::new(v.re.into(), v.im.into()));
    ndarray_npy::write_npy(folder.path("double.npy"), &double).unwrap();
    let columns = plane.t().as_standard_layout().into_owned();
    ndarray_npy::write_npy(folder.path("columns.npy"), &columns.t()).unwrap();
    let encode = |name: &str, out: &str| {
        let more = ["--display", "d.toml", "--z-mm", "1", "--phases", "p.npy", "--json"];
        let said = folder.succeeds(
            &[
                &["encode", name],
                &more[..],
                &["--packed", "frame.png", "--judge", "-o", out],
            ]
            .concat(),
        );
        serde_json::from_str::<serde_json::Value>(&said).unwrap()
    };
    let said = encode("f.npy", "a.png");
    assert!(said["shown"]["psnr_db"].as_f64().unwrap() > 25.0, "{said}");
    assert_eq!(
        (said["width"].as_u64(), said["encoder"].as_str()),
        (Some(48), Some("anti-alias"))
    );
    let expected = levels(&folder, "a.png");
    for name in ["double.npy", "columns.npy"] {
        encode(name, "b.png");
        assert_eq!(levels(&folder, "b.png"), expected, "{name}");
    }
    let phases: Array3<f32> = ndarray_npy::read_npy(folder.path("p.npy")).unwrap();
    assert_nearest(&phases, &expected, 256.0);
    let frame = image::open(folder.path("frame.png")).unwrap().into_luma8();
    assert!(frame.as_raw().iter().zip(&expected).all(|(a, b)| u16::from(*a) == *b));

    folder.succeeds(&["refocus", "a.png", "--z-mm", "1", "-o", "seen.png"]);
    let seen = image::open(folder.path("seen.png")).unwrap().into_luma8();
    let mut worst = 0.0f32;
    for (x, y, pixel) in seen.enumerate_pixels() {
        let inner = (8..40).contains(&x) && (8..24).contains(&y);
        let apart = f32::from(pixel[0]) / 255.0 - plane[(y as usize, x as usize)].norm();
        worst = if inner { worst.max(apart.abs()) } else { worst };
    }
    assert!(worst < 0.1, "{worst}");
}

/// Checks that each level of `count` in a turn is the nearest one of its phase.
fn assert_nearest(phases: &Array3<f32>, levels: &Array3<u16>, count: f32) {
    for (phase, level) in phases.iter().zip(levels) {
        let apart = phase / TAU * count - f32::from(*level);
        let apart = (apart + count / 2.0).rem_euclid(count) - count / 2.0;
        assert!((0.0..TAU).contains(phase) && apart.abs() < 0.501, "{phase} {level}");
    }
}

/// A frame of a PLM holds the levels.
#[test]
fn a_field_goes_to_the_frame_of_a_plm_and_back() {
    let folder = Folder::new();
    let field = Array3::from_shape_fn((3, 540, 960), |(c, y, x)| {
        Complex32::from_polar(0.5, (c * 7 + y * 3 + x) as f32 * 0.01)
    });
    ndarray_npy::write_npy(folder.path("f.npy"), &field).unwrap();
    let plm = ["--display", "ti-plm-p47"];
    folder.succeeds(
        &[
            &["encode", "f.npy"],
            &plm[..],
            &["--packed", "frame.png", "-o", "h.png"],
        ]
        .concat(),
    );
    assert_eq!(image::image_dimensions(folder.path("frame.png")).unwrap(), (1920, 1080));
    folder.succeeds(&[&["unpack", "frame.png"], &plm[..], &["-o", "back.png"]].concat());
    assert_eq!(levels(&folder, "back.png"), levels(&folder, "h.png"));
}

#[test]
fn ten_bits_and_a_smaller_field_are_taken() {
    let folder = with_display("bits = 10\nwavelengths_nm = [532]\n");
    let small = field(1)
        .slice_move(ndarray::s![.., ..20, ..30])
        .as_standard_layout()
        .into_owned();
    ndarray_npy::write_npy(folder.path("f.npy"), &small).unwrap();
    let flags = [
        "--display",
        "d.toml",
        "--phases",
        "p.npy",
        "--packed",
        "frame.png",
        "-o",
        "h.png",
    ];
    folder.succeeds(&[&["encode", "f.npy"], &flags[..]].concat());
    let levels = levels(&folder, "h.png");
    assert_eq!(levels.dim(), (1, 20, 30));
    assert!(levels.iter().any(|level| *level > 255));
    let phases: Array3<f32> = ndarray_npy::read_npy(folder.path("p.npy")).unwrap();
    assert_eq!(
        phases.mapv(|p| (p / TAU * 1024.0).round_ties_even() as u16 % 1024),
        levels
    );
    assert_eq!(image::image_dimensions(folder.path("frame.png")).unwrap(), (48, 32));
}

#[test]
fn what_is_no_field_is_named() {
    let folder = with_display("wavelengths_nm = [532]\n");
    let refused = |name: &str, more: &[&str]| {
        let said = folder.fails(&[&["encode", name, "-o", "h.png"], more].concat(), 1);
        assert_eq!(
            said.lines().filter(|line| line.starts_with("error")).count(),
            1,
            "{said}"
        );
        assert!(!folder.path("h.png").exists());
        said
    };
    let one = ["--display", "d.toml"];
    let write = |array: &ArrayD<Complex32>| ndarray_npy::write_npy(folder.path("f.npy"), array).unwrap();

    assert!(refused("none.npy", &one).contains("none.npy"));
    fs::write(folder.path("text.npy"), "no array").unwrap();
    assert!(refused("text.npy", &one).contains("is not a whole .npy"));
    ndarray_npy::write_npy(folder.path("real.npy"), &Array2::<f64>::ones((H, W))).unwrap();
    assert!(refused("real.npy", &one).contains("field.astype(numpy.complex64)"));
    write(&ArrayD::ones(vec![W]));
    assert!(refused("f.npy", &one).contains("a field is (H, W) or (C, H, W)"));
    write(&field(3).into_dyn());
    assert!(refused("f.npy", &one).contains("has 3 planes; the display has one laser"));
    write(&field(1).into_dyn());
    assert!(refused("f.npy", &[]).contains("has 1 planes; the display has 3 lasers"));
    write(&ArrayD::ones(vec![H + 1, W]));
    assert!(refused("f.npy", &one).contains("48×33 does not fit the modulator of 48×32"));
    let mut dirty = field(1);
    dirty[(0, 4, 7)] = Complex32::new(f32::NAN, 0.0);
    write(&dirty.into_dyn());
    assert!(refused("f.npy", &one).contains("row 4, column 7"));
    write(&ArrayD::zeros(vec![H, W]));
    assert!(refused("f.npy", &one).contains("dark"));
    write(&field(1).into_dyn());
    assert!(refused("f.npy", &["--display", "d.toml", "--scale", "0"]).contains("scale"));
    let bytes = fs::read(folder.path("f.npy")).unwrap();
    fs::write(folder.path("f.npy"), &bytes[..bytes.len() - 3]).unwrap();
    assert!(refused("f.npy", &one).contains("is not a whole"));
}
