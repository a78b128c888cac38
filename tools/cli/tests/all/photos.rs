//! Tests photos with embedded depth, built byte by byte from the specifications, and depth from the user's own network.
use crate::colours::{P3_COLORANTS, icc};
use crate::depth_models;
use crate::folder;
use phasefront::Size;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use depth_models::{WEIGHTS, network};
use folder::Folder;
use image::{DynamicImage, ImageFormat};
use ndarray::Array3;
use phasefront::input::{ColourScale, DepthNetwork};
use phasefront_io::hologram;
use phasefront_io::picture::photo::{self, Range};
use std::fs;
use std::io::Cursor;
use std::process::Command;

const WIDTH: u32 = 48;
const HEIGHT: u32 = 32;

/// Creates a photo that is blue on the left, where it is near.
fn colour() -> DynamicImage {
    image::RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        if x < WIDTH / 2 {
            image::Rgb([40, 4 * y as u8, 220])
        } else {
            image::Rgb([200, 90, 20])
        }
    })
    .into()
}

/// Creates the photo's depth at half the size, near on the left.
fn depth() -> image::GrayImage {
    image::GrayImage::from_fn(WIDTH / 2, HEIGHT / 2, |x, y| {
        image::Luma([if x < WIDTH / 4 { 10 + y as u8 } else { 230 }])
    })
}

fn encoded(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// Wraps `content` in an APP1 segment of a JPEG.
fn app1(content: &[u8]) -> Vec<u8> {
    let length = u16::try_from(content.len() + 2).unwrap().to_be_bytes();
    [&[0xFF, 0xE1], &length[..], content].concat()
}

/// Returns the photo with `segments` after its start marker.
fn jpeg(segments: &[Vec<u8>]) -> Vec<u8> {
    let plain = encoded(colour(), ImageFormat::Jpeg);
    [&plain[..2], &segments.concat(), &plain[2..]].concat()
}

fn xmp(description: &str) -> Vec<u8> {
    let packet = format!(
        r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">{description}</rdf:RDF></x:xmpmeta>"#
    );
    [&b"http://ns.adobe.com/xap/1.0/\0"[..], packet.as_bytes()].concat()
}

/// Returns GDepth's attributes with `more`, which holds the data if it is short enough.
fn gdepth(more: &str) -> Vec<u8> {
    xmp(&format!(
        r#"<rdf:Description rdf:about="" xmlns:GDepth="http://ns.google.com/photos/1.0/depthmap/" xmlns:xmpNote="http://ns.adobe.com/xmp/note/" GDepth:Format="RangeInverse" GDepth:Near="0.5" GDepth:Far="4" GDepth:Units="m" GDepth:Mime="image/png" {more}/>"#
    ))
}

const GUID: &str = "36BE52D449F3E6B9760D7602FF75168D";

/// Returns extended XMP in parts of `size`.
fn extended(text: &[u8], size: usize) -> Vec<Vec<u8>> {
    let total = (text.len() as u32).to_be_bytes();
    let parts = text.chunks(size).enumerate().map(|(i, part)| {
        let offset = ((i * size) as u32).to_be_bytes();
        app1(
            &[
                b"http://ns.adobe.com/xmp/extension/\0",
                GUID.as_bytes(),
                &total,
                &offset,
                part,
            ]
            .concat(),
        )
    });
    parts.collect()
}

fn extended_gdepth(size: usize) -> Vec<Vec<u8>> {
    let data = STANDARD.encode(encoded(depth(), ImageFormat::Png));
    let text = format!(
        r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" xmlns:GDepth="http://ns.google.com/photos/1.0/depthmap/" GDepth:Data="{data}"/></rdf:RDF></x:xmpmeta>"#
    );
    extended(text.as_bytes(), size)
}

fn short_gdepth() -> Vec<u8> {
    let data = STANDARD.encode(encoded(depth(), ImageFormat::Png));
    jpeg(&[app1(&gdepth(&format!(r#"GDepth:Data="{data}""#)))])
}

fn long_gdepth() -> Vec<u8> {
    let main = app1(&gdepth(&format!(r#"xmpNote:HasExtendedXMP="{GUID}""#)));
    // The parts are out of order, which the specification permits.
    let mut parts = extended_gdepth(60);
    parts.reverse();
    jpeg(&[&[main], &parts[..]].concat())
}

/// Creates a Dynamic Depth photo, followed by a depth image and another item.
fn dynamic_depth() -> Vec<u8> {
    let image = encoded(depth(), ImageFormat::Png);
    let other = [7; 99];
    let directory = format!(
        r#"<rdf:Description xmlns:Device="http://ns.google.com/photos/dd/1.0/device/" xmlns:Container="http://ns.google.com/photos/dd/1.0/container/" xmlns:Item="http://ns.google.com/photos/dd/1.0/item/" xmlns:Camera="http://ns.google.com/photos/dd/1.0/camera/" xmlns:DepthMap="http://ns.google.com/photos/dd/1.0/depthmap/">
<Device:Container><Container:Directory><rdf:Seq>
<rdf:li rdf:parseType="Resource"><Container:Item Item:Mime="image/jpeg" Item:Length="0" Item:DataURI="primary_image"/></rdf:li>
<rdf:li rdf:parseType="Resource"><Container:Item Item:Mime="image/png" Item:Length="{}" Item:Padding="3" Item:DataURI="android/depthmap"/></rdf:li>
<rdf:li rdf:parseType="Resource"><Container:Item Item:Mime="video/mp4" Item:Length="99" Item:DataURI="motion"/></rdf:li>
</rdf:Seq></Container:Directory></Device:Container>
<Device:Cameras><rdf:Seq><rdf:li rdf:parseType="Resource"><Device:Camera><Camera:DepthMap rdf:parseType="Resource">
<DepthMap:Format>RangeLinear</DepthMap:Format><DepthMap:Near>500</DepthMap:Near><DepthMap:Far>4000</DepthMap:Far><DepthMap:Units>mm</DepthMap:Units><DepthMap:DepthURI>android/depthmap</DepthMap:DepthURI>
</Camera:DepthMap></Device:Camera></rdf:li></rdf:Seq></Device:Cameras></rdf:Description>"#,
        image.len()
    );
    [jpeg(&[app1(&xmp(&directory))]), image, vec![0; 3], other.to_vec()].concat()
}

#[test]
fn each_kind_of_photo_gives_its_depth_and_becomes_a_hologram() {
    let folder = Folder::new();
    fs::write(folder.path("display.toml"), "width = 64\nheight = 64").unwrap();
    let kinds = [
        ("short.jpg", short_gdepth(), photo::Range::Inverse),
        ("long.jpg", long_gdepth(), photo::Range::Inverse),
        ("dynamic.jpg", dynamic_depth(), photo::Range::Linear),
    ];
    for (name, bytes, range) in kinds {
        let path = folder.path(name);
        fs::write(&path, &bytes).unwrap();
        let read = photo::read(&path, None).unwrap();
        assert_eq!((read.range, read.range_m), (range, Some((0.5, 4.0))), "{name}");
        let known = depth();
        for (x, y, value) in known.enumerate_pixels() {
            let d = read.depth[(y as usize, x as usize)];
            assert!((d - f32::from(value.0[0]) / 255.0).abs() < 1e-6, "{name}");
        }
        // d = far·near / (far − d_n·(far − near)), or linear.
        let metres = read.metres().unwrap()[(0, 20)];
        let d_n = f32::from(known.get_pixel(20, 0).0[0]) / 255.0;
        let wanted = match range {
            photo::Range::Inverse => 2.0 / (4.0 - d_n * 3.5),
            photo::Range::Linear => 0.5 + d_n * 3.5,
        };
        assert!((metres - wanted).abs() < 1e-4, "{name}: {metres} {wanted}");
        let call = ["hologram", "--photo", name, "--display", "display.toml", "-o", "h.png"];
        folder.succeeds(&call);
        assert_eq!(
            hologram::read_hologram(&folder.path("h.png")).unwrap().size(),
            Size { width: 64, height: 64 }
        );
        folder.succeeds(&[&call[..], &["--near", "0.52", "--far", "2", "--fit", "cover"]].concat());
    }
}

#[test]
fn a_photo_and_its_depth_are_turned_upright_together() {
    // Big-endian Exif with one tag in its directory: orientation (0x0112, one short) 6, a quarter turn.
    let exif = [
        &b"Exif\0\0MM\0\x2A\0\0\0\x08\0\x01"[..],
        &[0x01, 0x12, 0, 3, 0, 0, 0, 1, 0, 6, 0, 0, 0, 0, 0, 0],
    ]
    .concat();
    let data = STANDARD.encode(encoded(depth(), ImageFormat::Png));
    let bytes = jpeg(&[app1(&exif), app1(&gdepth(&format!(r#"GDepth:Data="{data}""#)))]);
    let folder = Folder::new();
    fs::write(folder.path("p.jpg"), bytes).unwrap();
    let read = photo::read(&folder.path("p.jpg"), None).unwrap();
    assert_eq!(read.colours.rgb.dim(), (3, WIDTH as usize, HEIGHT as usize));
    assert_eq!(read.depth.dim(), (WIDTH as usize / 2, HEIGHT as usize / 2));
    // The left side of the stored photo is now the top: near, and blue.
    assert!(read.depth[(2, 5)] < 0.2 && read.depth[(20, 5)] > 0.8);
    assert!(read.colours.rgb[(2, 5, 9)] > 0.7 && read.colours.rgb[(2, 40, 9)] < 0.3);
}

#[test]
fn photos_that_would_take_gigabytes_or_hours_get_one_line() {
    let folder = Folder::new();
    // 700 kB of it would decode to 512 MiB.
    let mut words = Vec::new();
    let mut encoder = png::Encoder::new(&mut words, 8192, 8192);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Sixteen);
    drop(encoder.write_header().unwrap());
    words.truncate(33);
    words.extend(b"\0\0\0\x04IDAT\0\0\0\0\0\0\0\0");
    let words = jpeg(&[app1(&gdepth(&format!(r#"GDepth:Data="{}""#, STANDARD.encode(words))))]);
    let segments = jpeg(&vec![app1(b""); 9000]);
    for (name, bytes, word) in [
        ("words.jpg", words, "8192×8192 pixels; 16777216 in all are the most"),
        ("segments.jpg", segments, "over 8192 segments"),
    ] {
        fs::write(folder.path(name), bytes).unwrap();
        let errors = folder.fails(&["hologram", "--photo", name, "-o", "h.png"], 1);
        assert_eq!(errors.lines().count(), 1, "{name}: {errors}");
        assert!(errors.contains(name) && errors.contains(word), "{name}: {errors}");
    }
}

#[test]
fn photos_that_cannot_be_used_get_one_line() {
    let folder = Folder::new();
    let extended = app1(&gdepth(&format!(r#"xmpNote:HasExtendedXMP="{GUID}""#)));
    let parts = extended_gdepth(60);
    let mut cut = dynamic_depth();
    cut.drain(..0);
    cut.truncate(600);
    let heic = [&[0, 0, 0, 24][..], b"ftypheic\0\0\0\0mif1heic"].concat();
    let directory_only = String::from_utf8_lossy(&dynamic_depth()).replace("android/depthmap\"", "other\"");
    let no_item = [
        jpeg(&[app1(&xmp(
            &directory_only
                [directory_only.find("<rdf:Description").unwrap()..directory_only.find("</rdf:RDF>").unwrap()],
        ))]),
        vec![0; 4000],
    ]
    .concat();
    let broken = |data: &str| jpeg(&[app1(&gdepth(&format!(r#"GDepth:Data="{data}""#)))]);
    // A few bytes would decode to 17 GB, and another few to 4 GB.
    let gif = [&b"GIF89a"[..], &[0xFF; 4], &[0x80, 0, 0], &[0; 30]].concat();
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 1 << 15, (1 << 11) + 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::One);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&vec![0; (1 << 12) * ((1 << 11) + 1)]).unwrap();
    writer.finish().unwrap();
    let long = [GUID.as_bytes(), &u32::MAX.to_be_bytes(), &[0; 4], b"short"].concat();
    let long = app1(&[&b"http://ns.adobe.com/xmp/extension/\0"[..], &long].concat());
    let marks = "<a/>".repeat(1 << 16);
    let marks = self::extended(marks.as_bytes(), 60_000);
    let cases = [
        ("gif.jpg", broken(&STANDARD.encode(gif)), "the depth inside is a GIF"),
        ("png.jpg", broken(&STANDARD.encode(png)), "16777216 in all are the most"),
        (
            "long.jpg",
            jpeg(&[extended.clone(), long]),
            "4294967295 bytes are there",
        ),
        (
            "marks.jpg",
            jpeg(&[std::slice::from_ref(&extended), &marks[..]].concat()),
            "elements and attributes",
        ),
        ("heic.jpg", heic, "heif-convert"),
        ("text.jpg", b"nothing".to_vec(), "is no JPEG"),
        ("plain.jpg", jpeg(&[]), "--depth-network"),
        (
            "other.jpg",
            jpeg(&[app1(&xmp("<rdf:Description/>"))]),
            "neither GDepth nor",
        ),
        ("xml.jpg", jpeg(&[app1(&xmp("<rdf:Desc"))]), "XMP is broken"),
        ("base.jpg", broken("!!!!"), "no base64"),
        ("image.jpg", broken("AAAAAAAA"), "the depth inside is not a picture"),
        ("empty.jpg", broken(""), "the depth inside"),
        ("data.jpg", jpeg(&[app1(&gdepth(""))]), "no Data"),
        (
            "parts.jpg",
            jpeg(&[&[extended], &parts[1..]].concat()),
            "bytes are there",
        ),
        ("cut.jpg", cut, "not a whole"),
        ("uri.jpg", no_item, "no such item"),
    ];
    for (name, bytes, word) in cases {
        fs::write(folder.path(name), bytes).unwrap();
        let errors = folder.fails(&["hologram", "--photo", name, "-o", "h.png"], 1);
        assert_eq!(errors.lines().count(), 1, "{name}: {errors}");
        assert!(errors.contains(name) && errors.contains(word), "{name}: {errors}");
    }
    let behind = dynamic_depth();
    fs::write(folder.path("end.jpg"), &behind[..behind.len() - 400]).unwrap();
    let errors = folder.fails(&["hologram", "--photo", "end.jpg", "-o", "h.png"], 1);
    assert_eq!(errors.lines().count(), 1, "{errors}");
}

#[test]
fn a_network_that_the_user_brings_sees_depth() {
    let folder = Folder::new();
    let rgb = Array3::from_shape_fn((3, 32, 48), |(c, y, x)| ((7 * c + 3 * y + x) % 50) as f32 / 50.0);
    for interleaved in [false, true] {
        let path = folder.path("depth.onnx");
        fs::write(&path, network(Some((32, 48)), interleaved)).unwrap();
        let mut network = DepthNetwork::open(&path).unwrap();
        network.colours = ColourScale::Signed;
        let seen = network
            .estimator(Size { width: 48, height: 32 })
            .unwrap()
            .estimate(rgb.as_slice().unwrap())
            .unwrap();
        assert_eq!(seen.dim(), (32, 48));
        for ((y, x), value) in seen.indexed_iter() {
            let wanted: f32 = (0..3).map(|c| WEIGHTS[c] * (2.0 * rgb[(c, y, x)] - 1.0)).sum();
            assert!(
                (value - wanted).abs() < 1e-5,
                "interleaved {interleaved}: {value} {wanted}"
            );
        }
    }
    fs::write(folder.path("open.onnx"), network(None, false)).unwrap();
    let mut network = DepthNetwork::open(&folder.path("open.onnx")).unwrap();
    network.gives_distance = true;
    let seen = network
        .estimator(Size { width: 48, height: 32 })
        .unwrap()
        .estimate(rgb.as_slice().unwrap())
        .unwrap();
    assert_eq!(seen.dim(), (448, 672));
    network.gives_distance = false;
    let nearer = network
        .estimator(Size { width: 48, height: 32 })
        .unwrap()
        .estimate(rgb.as_slice().unwrap())
        .unwrap();
    assert_eq!(nearer, -seen);
}

#[test]
fn any_photo_becomes_a_hologram_by_a_network() {
    let folder = Folder::new();
    colour().save(folder.path("rgb.png")).unwrap();
    fs::write(folder.path("photo.jpg"), short_gdepth()).unwrap();
    fs::write(folder.path("depth.onnx"), network(Some((16, 24)), false)).unwrap();
    let by = |from: &[&str], more: &[&str]| {
        let common = ["--depth-network", "depth.onnx", "--method", "sweep", "-o", "h.png"];
        folder.succeeds(&[&["hologram"], from, &common[..], more].concat());
        hologram::read_hologram(&folder.path("h.png")).unwrap()
    };
    let near_left = by(&["--rgb", "rgb.png"], &[]);
    // Blue is near, so the hologram equals that of the same image with depth that is near on the left.
    let depth = image::GrayImage::from_fn(WIDTH, HEIGHT, |x, _| image::Luma([if x < WIDTH / 2 { 0 } else { 255 }]));
    depth.save(folder.path("depth.png")).unwrap();
    folder.succeeds(&[
        "hologram",
        "--rgb",
        "rgb.png",
        "--depth",
        "depth.png",
        "--method",
        "sweep",
        "-o",
        "h.png",
    ]);
    let known = hologram::read_hologram(&folder.path("h.png")).unwrap();
    let turned = by(&["--rgb", "rgb.png"], &["--invert"]);
    let view = |hologram: &hologram::Hologram| hologram.views(&[2e-3]).unwrap().remove(0);
    let apart = |a: &hologram::Hologram, b: &hologram::Hologram| (view(a) - view(b)).mapv(f32::abs).mean().unwrap();
    assert!(apart(&near_left, &known) < 0.3 * apart(&turned, &known));
    by(&["--photo", "photo.jpg"], &["--fit", "centre"]);
    fs::write(folder.path("no.onnx"), b"no network").unwrap();
    for (arguments, word) in [
        (["--rgb", "rgb.png", "--depth-network", "no.onnx"], "ONNX"),
        (["--rgb", "rgb.png", "--depth-network", "missing.onnx"], "no such file"),
        (
            [
                "--rgb",
                "rgb.png",
                "--depth-network",
                concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/rgbd-8.onnx"),
            ],
            "three colours",
        ),
    ] {
        let errors = folder.fails(&[&["hologram"], &arguments[..], &["-o", "n.png"]].concat(), 1);
        assert!(errors.lines().count() == 1 && errors.contains(word), "{errors}");
    }
}

#[test]
fn folders_of_photos_and_of_pictures_become_holograms_too() {
    let folder = Folder::new();
    for name in ["photos", "pictures"] {
        fs::create_dir(folder.path(name)).unwrap();
    }
    fs::write(folder.path("display.toml"), "width = 64\nheight = 64").unwrap();
    fs::write(folder.path("photos/cat.jpg"), short_gdepth()).unwrap();
    fs::write(folder.path("photos/dog.jpg"), dynamic_depth()).unwrap();
    colour().save(folder.path("pictures/cat.png")).unwrap();
    fs::write(folder.path("depth.onnx"), network(Some((16, 24)), false)).unwrap();
    let kinds = [
        ("photos", &["--photo"][..], "cat.jpg"),
        ("pictures", &["--depth-network", "depth.onnx", "--rgb"], "cat.png"),
    ];
    for (name, flags, picture) in kinds {
        let made = |input: &str, output: &str| {
            let call = [
                &["hologram", "--display", "display.toml"],
                flags,
                &[input, "-o", output],
            ];
            folder.succeeds(&call.concat());
        };
        let out = format!("out-{name}");
        made(name, &out);
        made(&format!("{name}/{picture}"), "h.png");
        let read = |name: &str| hologram::read_hologram(&folder.path(name)).unwrap();
        assert!(read("h.png") == read(&format!("{out}/cat.png")));
    }
    assert!(folder.path("out-photos/dog.png").exists());
}

/// Checks that the command fails in one line that has all `words`.
fn refuses(folder: &Folder, arguments: &[&str], words: &[&str]) {
    let errors = folder.fails(arguments, 1);
    assert!(
        errors.lines().count() == 1 && words.iter().all(|word| errors.contains(word)),
        "{errors}"
    );
}

/// A picture without depth lies on one plane, and looks sharp there.
#[test]
fn a_picture_lies_on_one_plane() {
    let folder = Folder::new();
    colour().save(folder.path("rgb.png")).unwrap();
    let call = |more: &[&'static str]| {
        let base = [
            "hologram", "--rgb", "rgb.png", "--depth", "flat", "--method", "sweep", "-o", "h.png",
        ];
        [&base[..], more].concat()
    };
    folder.succeeds(&call(&["--z-mm", "1.5"]));
    let made = hologram::read_hologram(&folder.path("h.png")).unwrap();
    let half = image::GrayImage::from_pixel(WIDTH, HEIGHT, image::Luma([64]));
    half.save(folder.path("quarter.png")).unwrap();
    let mut by_file = call(&[]);
    by_file[4] = "quarter.png";
    folder.succeeds(&by_file);
    // z = 6 mm/2 − 6 mm·64/255 = 1.494 mm.
    let known = hologram::read_hologram(&folder.path("h.png")).unwrap();
    let view = |hologram: &hologram::Hologram, z_m: f64| hologram.views(&[z_m]).unwrap().remove(0);
    let apart = |z_m: f64| (view(&made, 1.5e-3) - view(&known, z_m)).mapv(f32::abs).mean().unwrap();
    assert!(
        apart(1.494e-3) < 0.3 * apart(-1.5e-3),
        "{} {}",
        apart(1.494e-3),
        apart(-1.5e-3)
    );
    refuses(&folder, &call(&["--z-mm", "3.5"]), &["--z-mm 3.5", "-3 mm to 3 mm"]);
    by_file.extend(["--z-mm", "1"]);
    refuses(&folder, &by_file, &["--z-mm is for --depth flat"]);
    refuses(&folder, &call(&["--invert"]), &["--invert", "flat"]);
}

/// A photo that holds no depth takes that of a network, whatever its kind.
#[test]
fn a_photo_without_depth_takes_that_of_a_network() {
    let folder = Folder::new();
    colour().to_rgb8().save(folder.path("plain.jpg")).unwrap();
    colour().save(folder.path("plain.png")).unwrap();
    fs::write(folder.path("depth.onnx"), network(Some((16, 24)), false)).unwrap();
    for name in ["plain.jpg", "plain.png"] {
        let call = [
            "hologram", "--photo", name, "--method", "sweep", "-o", "h.png", "--fit", "centre",
        ];
        let network = ["--depth-network", "depth.onnx"];
        folder.succeeds(&[&call[..], &network].concat());
        assert!(hologram::read_hologram(&folder.path("h.png")).is_ok());
    }
    refuses(
        &folder,
        &["hologram", "--photo", "plain.jpg", "-o", "n.png"],
        &["--depth-network", "--depth flat"],
    );
}

/// Writes `name`.heic by libheif's encoder: `rgba` in Display P3, its alpha as the auxiliary picture of type `aux`, 1
/// for alpha and 2 for depth.
#[cfg(not(windows))]
fn write_heic(folder: &Folder, name: &str, rgba: &image::RgbaImage, aux: u8) {
    let mut png = std::io::BufWriter::new(fs::File::create(folder.path("rgba.png")).unwrap());
    let mut encoder = image::codecs::png::PngEncoder::new(&mut png);
    image::ImageEncoder::set_icc_profile(&mut encoder, icc(P3_COLORANTS, None)).unwrap();
    let (w, h) = rgba.dimensions();
    image::ImageEncoder::write_image(encoder, rgba, w, h, image::ExtendedColorType::Rgba8).unwrap();
    drop(png);
    let made = Command::new("heif-enc")
        .args(["-L", "-p", "chroma=444", "rgba.png", "-o", "made.heic"])
        .current_dir(folder.path("."))
        .output();
    let made = made.expect("heif-enc runs: apt-get install libheif-examples");
    assert!(made.status.success(), "{made:?}");
    let mut bytes = fs::read(folder.path("made.heic")).unwrap();
    let kind = b"urn:mpeg:hevc:2015:auxid:1";
    let at = bytes.windows(kind.len()).position(|found| found == kind).unwrap();
    bytes[at + kind.len() - 1] = b'0' + aux;
    fs::write(folder.path(&format!("{name}.heic")), bytes).unwrap();
}

/// An iPhone's portrait: HEIC in Display P3 with an auxiliary picture of disparity. Nobody packs libheif's programs for
/// Windows.
#[cfg(not(windows))]
#[test]
fn a_heic_portrait_becomes_a_hologram() {
    let folder = Folder::new();
    let near = |x: u32, y: u32| (20..60).contains(&x) && (16..48).contains(&y);
    let rgba = image::RgbaImage::from_fn(96, 64, |x, y| match near(x, y) {
        true => image::Rgba([230, 120, (4 * x) as u8, 240]),
        false => image::Rgba([40, (3 * y) as u8, 90, 30]),
    });
    write_heic(&folder, "portrait", &rgba, 2);
    write_heic(&folder, "plain", &rgba, 1);
    let read = photo::read(&folder.path("portrait.heic"), None).unwrap();
    assert_eq!(read.colours.encoding, phasefront::input::RgbEncoding::DisplayP3);
    assert_eq!((read.range, read.range_m), (Range::Inverse, None));
    for (at, (x, y)) in [(40, 30), (5, 5), (80, 50)].into_iter().enumerate() {
        let pixel = rgba.get_pixel(x, y).0;
        let depth = 1.0 - f32::from(pixel[3]) / 255.0;
        assert!((read.depth[(y as usize, x as usize)] - depth).abs() < 0.02, "{at}");
        for (channel, level) in pixel.iter().enumerate().take(3) {
            let value = read.colours.rgb[(channel, y as usize, x as usize)];
            assert!(
                (value - f32::from(*level) / 255.0).abs() < 0.03,
                "{at} {channel}: {value}"
            );
        }
    }
    fs::write(folder.path("display.toml"), "width = 96\nheight = 64").unwrap();
    let more = ["--display", "display.toml", "--method", "sweep", "-o", "h.png"];
    folder.succeeds(&[&["hologram", "--photo", "portrait.heic"], &more[..]].concat());
    assert!(hologram::read_hologram(&folder.path("h.png")).is_ok());
    folder.succeeds(&[&["hologram", "--rgb", "plain.heic", "--depth", "flat"], &more[..]].concat());
    refuses(
        &folder,
        &["hologram", "--photo", "plain.heic", "-o", "n.png"],
        &["plain.heic", "no depth", "--depth-network"],
    );
    fs::write(folder.path("cut.heic"), b"\0\0\0\x18ftypheic\0\0\0\0mif1heic").unwrap();
    refuses(
        &folder,
        &["hologram", "--photo", "cut.heic", "-o", "n.png"],
        &["cut.heic", "heif-"],
    );
    // Without the program the message names its package.
    for call in [
        ["hologram", "--photo", "portrait.heic"],
        ["hologram", "--rgb", "portrait.heic"],
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_phasefront"))
            .args([&call[..], &["-o", "n.png"]].concat())
            .args(if call[1] == "--rgb" {
                &["--depth", "flat"][..]
            } else {
                &[]
            })
            .current_dir(folder.path("."))
            .env("PATH", folder.path("."))
            .output()
            .unwrap();
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{errors}");
        assert!(
            errors.lines().count() == 1 && errors.contains("libheif-examples"),
            "{errors}"
        );
    }
}
