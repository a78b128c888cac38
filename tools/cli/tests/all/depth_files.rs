//! Tests depth files as renderers, cameras and other programs write them: numbers for no reading, layers of OpenEXR,
//! windows, lossy compression, wrong signs.
use crate::folder;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer, LayerAttributes,
    SmallVec, Vec2, WritableImage, f16,
};
use folder::Folder;
use image::{DynamicImage, ImageBuffer, Luma};
use ndarray::{Array2, s};
use ndarray_npy::write_npy;
use phasefront_core::depth::DepthUnit;
use phasefront_io::frame::{self, Captured, DepthOptions};
use phasefront_io::picture::depth_map;
use serde_json::Value;
use std::fs;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype;

const WIDTH: usize = 60;
const HEIGHT: usize = 40;

/// Returns a scene from 1 m to 2 m, with no reading (`none`) in a sixth of it.
fn scene(none: f32) -> Array2<f32> {
    Array2::from_shape_fn((HEIGHT, WIDTH), |(y, x)| match x < 10 {
        true => none,
        false => 1.0 + (x + y) as f32 / 100.0,
    })
}

fn with_colour() -> Folder {
    let folder = Folder::new();
    let colour = image::RgbImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
        image::Rgb([4 * x as u8, 6 * y as u8, 90])
    });
    colour.save(folder.path("rgb.png")).unwrap();
    folder
}

fn read(folder: &Folder, name: &str, unit: DepthUnit) -> phasefront_io::Result<Captured> {
    let options = DepthOptions {
        unit,
        near_m: None,
        far_m: None,
        inverted: false,
    };
    frame::read(&folder.path("rgb.png"), &folder.path(name), options, None)
}

/// A layer of an OpenEXR file: its name, its channels, and the place of its data window.
type Part<'a> = (&'a str, Vec<(&'a str, FlatSamples)>, (i32, i32), (usize, usize));

fn exr(folder: &Folder, name: &str, parts: Vec<Part<'_>>) {
    let layers: Vec<_> = (parts.into_iter())
        .map(|(part, channels, at, size)| {
            let channels: SmallVec<[_; 4]> = (channels.into_iter())
                .map(|(name, samples)| AnyChannel::new(name, samples))
                .collect();
            let attributes = LayerAttributes::named(part).with_position(Vec2(at.0, at.1));
            Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels))
        })
        .collect();
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions((WIDTH, HEIGHT)));
    let image = Image::from_layers(attributes, layers);
    image.write().to_file(folder.path(name)).unwrap();
}

/// Writes one part that fills the display window.
fn exr_of(folder: &Folder, name: &str, channels: Vec<(&str, FlatSamples)>) {
    exr(folder, name, vec![("", channels, (0, 0), (WIDTH, HEIGHT))]);
}

fn floats(values: &Array2<f32>) -> FlatSamples {
    FlatSamples::F32(values.iter().copied().collect())
}

fn noise(seed: u32) -> FlatSamples {
    let values = (0..(WIDTH * HEIGHT) as u32).map(|i| (i.wrapping_mul(2_654_435_761 + seed) >> 8) as f32 / 1e7);
    FlatSamples::F32(values.collect())
}

/// Compares normalized depth, NaN included, within `tolerance`.
#[track_caller]
fn assert_same(got: &Array2<f32>, want: &Array2<f32>, tolerance: f32, name: &str) {
    assert_eq!(got.dim(), want.dim(), "{name}");
    let is_same = |(a, b): (&f32, &f32)| a.is_nan() && b.is_nan() || (a - b).abs() <= tolerance;
    assert!(got.iter().zip(want).all(is_same), "{name}");
}

#[test]
fn numbers_for_no_reading_are_holes_in_every_format() {
    let folder = with_colour();
    write_npy(folder.path("nan.npy"), &scene(f32::NAN)).unwrap();
    let want = read(&folder, "nan.npy", DepthUnit::Metres).unwrap();
    assert_eq!(want.depth.iter().filter(|d| d.is_nan()).count(), 10 * HEIGHT);
    let shown = want.shown.unwrap();
    assert!(shown.near_m < 1.16 && (1.9..1.99).contains(&shown.far_m), "{shown:?}");

    for (name, none) in [
        ("inf", f32::INFINITY),
        ("1e10", 1e10),
        ("1e9", 1e9),
        ("max", f32::MAX),
        ("zero", 0.0),
        ("minus", -1.0),
    ] {
        write_npy(folder.path(&format!("{name}.npy")), &scene(none)).unwrap();
        exr_of(&folder, &format!("{name}.exr"), vec![("Z", floats(&scene(none)))]);
        for ending in ["npy", "exr"] {
            let name = format!("{name}.{ending}");
            let got = read(&folder, &name, DepthUnit::Metres).unwrap();
            assert_same(&got.depth, &want.depth, 0.0, &name);
            assert_eq!(got.shown, want.shown, "{name}");
        }
    }
    let half = |none: f32| scene(none).mapv(f16::from_f32);
    exr_of(
        &folder,
        "half.exr",
        vec![("Z", FlatSamples::F16(half(65504.0).iter().copied().collect()))],
    );
    let header = format!("{{'descr': '<f2', 'fortran_order': False, 'shape': ({HEIGHT}, {WIDTH}), }}");
    let values = half(65504.0).iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    let length = (header.len() as u16).to_le_bytes();
    fs::write(
        folder.path("half.npy"),
        [&b"\x93NUMPY\x01\0"[..], &length, header.as_bytes(), &values].concat(),
    )
    .unwrap();
    for name in ["half.exr", "half.npy"] {
        let got = read(&folder, name, DepthUnit::Metres).unwrap();
        assert_same(&got.depth, &want.depth, 2e-3, name);
    }

    // Integers: the largest code of their type.
    let codes = |none: f32, scale: f32| scene(none).mapv(|m| if m == none { none } else { (scale * m).round() });
    let words: Vec<u16> = codes(65535.0, 1000.0).iter().map(|v| *v as u16).collect();
    let grey: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_raw(WIDTH as u32, HEIGHT as u32, words.clone()).unwrap();
    grey.save(folder.path("mm.png")).unwrap();
    DynamicImage::from(grey)
        .to_rgb16()
        .save(folder.path("rgb16.png"))
        .unwrap();
    let mut tiff = TiffEncoder::new(fs::File::create(folder.path("mm.tif")).unwrap()).unwrap();
    tiff.write_image::<colortype::Gray16>(WIDTH as u32, HEIGHT as u32, &words)
        .unwrap();
    write_npy(folder.path("mm.npy"), &codes(65535.0, 1000.0).mapv(|v| v as u16)).unwrap();
    write_npy(folder.path("signed.npy"), &codes(32767.0, 1000.0).mapv(|v| v as i16)).unwrap();
    write_npy(
        folder.path("long.npy"),
        &codes(-5.0, 1000.0).mapv(|v| if v < 0.0 { i32::MAX } else { v as i32 }),
    )
    .unwrap();
    for name in ["mm.png", "rgb16.png", "mm.tif", "mm.npy", "signed.npy", "long.npy"] {
        let got = read(&folder, name, DepthUnit::Millimetres).unwrap();
        assert_same(&got.depth, &want.depth, 2e-3, name);
    }
    let raw = DepthUnit::Raw { units_per_m: 1000.0 };
    assert_same(&read(&folder, "mm.png", raw).unwrap().depth, &want.depth, 2e-3, "raw");
    // As normalized depth, the largest code is the farthest surface.
    let normalized = depth_map::read_depth(&folder.path("mm.png"), true).unwrap();
    assert_eq!(normalized[(0, 0)], 1.0);
}

#[test]
fn the_range_is_told_and_a_doubtful_one_is_warned_of() {
    let folder = with_colour();
    let call = |name: &str, unit: &str, more: &[&str]| {
        let flags = [
            "hologram", "--rgb", "rgb.png", "--method", "sweep", "--planes", "8", "-o", "h.png",
        ];
        let output = folder.run(&[&flags[..], &["--depth", name, "--depth-unit", unit], more].concat());
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{errors}");
        (String::from_utf8(output.stdout).unwrap(), errors)
    };
    write_npy(folder.path("m.npy"), &scene(1e10)).unwrap();
    let (said, errors) = call("m.npy", "m", &[]);
    assert!(
        said.contains("depth from 1.1") && said.contains("16.7 % of it without a reading"),
        "{said}"
    );
    assert_eq!(errors, "");
    let (said, _) = call("m.npy", "m", &["--json"]);
    let depth = &serde_json::from_str::<Value>(&said).unwrap()["depth"];
    let far = depth["far_m"].as_f64().unwrap();
    assert!(
        (1.9..1.99).contains(&far) && depth["holes"].as_f64() == Some(0.166667),
        "{depth}"
    );

    // A far plane that no rule knows.
    write_npy(folder.path("far.npy"), &scene(1000.0)).unwrap();
    let (said, errors) = call("far.npy", "m", &[]);
    assert!(said.contains("m to 1000.000 m"), "{said}");
    assert!(
        errors.contains("83 % of the depth") && errors.contains("--far") && errors.lines().count() == 1,
        "{errors}"
    );
    let (_, errors) = call("far.npy", "m", &["--far", "2"]);
    assert_eq!(errors, "");
    // Normalized depth has no range.
    write_npy(folder.path("n.npy"), &scene(2.0).mapv(|v| v / 2.0)).unwrap();
    let (said, _) = call("n.npy", "normalized", &["--json"]);
    assert!(
        serde_json::from_str::<Value>(&said).unwrap()["depth"].is_null(),
        "{said}"
    );
}

#[test]
fn a_component_of_a_vector_is_never_depth() {
    let folder = Folder::new();
    let z = scene(1.5);
    exr_of(&folder, "z.exr", vec![("Z", floats(&z))]);
    let depth = |name: &str| depth_map::read_depth(&folder.path(name), false);
    assert_same(&depth("z.exr").unwrap(), &z, 0.0, "z.exr");
    let vector = |name: &'static str| -> Vec<(&'static str, FlatSamples)> {
        let names: [&str; 3] = match name {
            "nn" => ["nn.X", "nn.Y", "nn.Z"],
            "N" => ["N.X", "N.Y", "N.Z"],
            _ => ["position.X", "position.Y", "position.Z"],
        };
        names.into_iter().zip([noise(1), noise(2), noise(3)]).collect()
    };
    for (name, channel, vectors) in [
        ("mitsuba.exr", "dd.y", vec!["nn"]),
        ("arnold.exr", "Z", vec!["N", "position"]),
        ("vray.exr", "zDepth.Z", vec!["nn", "position"]),
        ("blender.exr", "ViewLayer.Depth.Z", vec!["N"]),
        ("late.exr", "zz.depth", vec!["N"]),
    ] {
        let mut channels: Vec<_> = vectors.into_iter().flat_map(vector).collect();
        channels.push((channel, floats(&z)));
        exr_of(&folder, name, channels);
        assert_same(&depth(name).unwrap(), &z, 0.0, name);
    }
    // Each vector in a part of its own: the first part that has a channel Z is not the depth.
    let whole = |part: &'static str, channels| (part, channels, (0, 0), (WIDTH, HEIGHT));
    let xyz = || vec![("X", noise(1)), ("Y", noise(2)), ("Z", noise(3))];
    exr(
        &folder,
        "parts.exr",
        vec![
            whole("normal", xyz()),
            whole("depth", vec![("Z", floats(&z))]),
            whole("position", xyz()),
        ],
    );
    assert_same(&depth("parts.exr").unwrap(), &z, 0.0, "parts.exr");

    exr_of(&folder, "vectors.exr", [vector("nn"), vector("position")].concat());
    exr_of(
        &folder,
        "two.exr",
        vec![("Back.Depth.Z", floats(&z)), ("Front.Depth.Z", noise(1))],
    );
    exr(
        &folder,
        "views.exr",
        vec![
            whole("left", vec![("Z", floats(&z))]),
            whole("right", vec![("Z", noise(1))]),
        ],
    );
    for (name, words) in [
        ("vectors.exr", ["nn.Z", "position.Z"]),
        ("two.exr", ["Back.Depth.Z", "Front.Depth.Z"]),
        ("views.exr", ["left.Z", "right.Z"]),
    ] {
        let why = depth(name).unwrap_err().to_string();
        assert!(
            words.iter().all(|word| why.contains(word)) && !why.contains('\n'),
            "{why}"
        );
    }
}

#[test]
fn a_data_window_is_laid_into_the_display_window() {
    let folder = with_colour();
    let z = scene(1.5);
    let part = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        z.slice(s![rows, columns]).as_standard_layout().into_owned()
    };
    // Trimmed by a quarter on each side, with the aspect ratio of the whole.
    let (rows, columns) = (10..30, 15..45);
    let trimmed = part(rows.clone(), columns.clone());
    exr(
        &folder,
        "trimmed.exr",
        vec![("", vec![("Z", floats(&trimmed))], (15, 10), (30, 20))],
    );
    let depth = |name: &str| depth_map::read_depth(&folder.path(name), false);
    let got = depth("trimmed.exr").unwrap();
    let want = Array2::from_shape_fn((HEIGHT, WIDTH), |(y, x)| {
        if rows.contains(&y) && columns.contains(&x) {
            z[(y, x)]
        } else {
            f32::NAN
        }
    });
    assert_same(&got, &want, 0.0, "trimmed");
    let captured = read(&folder, "trimmed.exr", DepthUnit::Metres).unwrap();
    assert_eq!(captured.depth.dim(), (HEIGHT, WIDTH));
    assert_eq!(captured.shown.unwrap().holes, 0.75);

    // Overscan: the data window is larger than the display window.
    let overscan = Array2::from_shape_fn((HEIGHT + 8, WIDTH + 6), |(y, x)| {
        let inside = (4..HEIGHT + 4).contains(&y) && (2..WIDTH + 2).contains(&x);
        if inside { z[(y - 4, x - 2)] } else { 99.0 }
    });
    let wide = (WIDTH + 6, HEIGHT + 8);
    exr(
        &folder,
        "overscan.exr",
        vec![("", vec![("Z", floats(&overscan))], (-2, -4), wide)],
    );
    assert_same(&depth("overscan.exr").unwrap(), &z, 0.0, "overscan");

    // Nothing in the picture.
    exr(
        &folder,
        "outside.exr",
        vec![("", vec![("Z", floats(&trimmed))], (900, 0), (30, 20))],
    );
    let why = read(&folder, "outside.exr", DepthUnit::Metres).unwrap_err().to_string();
    assert!(why.contains("no reading"), "{why}");
}

#[test]
fn lossy_webp_and_depth_in_one_channel_are_read() {
    let folder = with_colour();
    let grey = image::GrayImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| Luma([(20 + 2 * x + y) as u8]));
    grey.save(folder.path("grey.png")).unwrap();
    let rgb = DynamicImage::from(grey.clone()).to_rgb8();
    let encoder = webp::Encoder::from_rgb(&rgb, WIDTH as u32, HEIGHT as u32);
    let mut apart = 0;
    for quality in [50.0, 80.0, 95.0] {
        let bytes = encoder.encode(quality);
        fs::write(folder.path("lossy.webp"), &*bytes).unwrap();
        let decoded = image::load_from_memory(&bytes).unwrap().to_rgb8();
        apart = decoded.pixels().map(|p| p.0[0].abs_diff(p.0[1])).fold(apart, u8::max);
        let want = read(&folder, "grey.png", DepthUnit::Normalized).unwrap();
        let got = read(&folder, "lossy.webp", DepthUnit::Normalized).unwrap();
        assert_same(&got.depth, &want.depth, 0.03, "lossy.webp");
    }
    assert!(apart > 0, "the encoder left no colour to tolerate");
    let red = image::RgbImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
        image::Rgb([grey.get_pixel(x, y).0[0], 0, 0])
    });
    red.save(folder.path("red.png")).unwrap();
    let want = depth_map::read_depth(&folder.path("grey.png"), true).unwrap();
    assert_eq!(depth_map::read_depth(&folder.path("red.png"), true).unwrap(), want);
}

#[test]
fn a_wrong_sign_and_wrong_numbers_are_named() {
    let folder = with_colour();
    write_npy(folder.path("opengl.npy"), &scene(2.0).mapv(|z| -z)).unwrap();
    write_npy(folder.path("inverse.npy"), &scene(2.0).mapv(|z| 900.0 / z)).unwrap();
    for (name, unit, words) in [
        ("opengl.npy", "m", &["sign", "negative"][..]),
        ("opengl.npy", "normalized", &["sign", "negative"]),
        (
            "inverse.npy",
            "normalized",
            &["--depth-unit", "--invert", "holds 818.1818"],
        ),
    ] {
        let call = [
            "hologram",
            "--rgb",
            "rgb.png",
            "--depth",
            name,
            "--depth-unit",
            unit,
            "-o",
            "h.png",
        ];
        let errors = folder.fails(&call, 1);
        assert!(errors.lines().count() == 1 && errors.contains(name), "{errors}");
        assert!(words.iter().all(|word| errors.contains(word)), "{errors}");
    }
}

#[test]
fn a_cut_jpeg_is_refused() {
    let folder = with_colour();
    let rgb = image::open(folder.path("rgb.png")).unwrap();
    rgb.save(folder.path("whole.jpg")).unwrap();
    write_npy(folder.path("m.npy"), &scene(0.0)).unwrap();
    let whole = fs::read(folder.path("whole.jpg")).unwrap();
    for end in [whole.len() - 2, whole.len() * 3 / 4, whole.len() / 2] {
        fs::write(folder.path("cut.jpg"), &whole[..end]).unwrap();
        for flags in [
            ["--rgb", "cut.jpg", "--depth", "m.npy"],
            ["--rgb", "rgb.png", "--depth", "cut.jpg"],
        ] {
            let errors = folder.fails(
                &[&["hologram"], &flags[..], &["--depth-unit", "m", "-o", "h.png"]].concat(),
                1,
            );
            assert!(errors.contains("cut.jpg") && errors.contains("cut short"), "{errors}");
        }
    }
}
