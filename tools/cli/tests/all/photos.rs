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

/// Creates a portrait as Google's camera writes it: the directory in the extended XMP, its items in `rdf:value`, the
/// pictures behind the photo, and the camera's own data behind them.
fn google_portrait() -> Vec<u8> {
    let original = encoded(colour(), ImageFormat::Jpeg);
    let map = encoded(depth(), ImageFormat::Jpeg);
    let confidence = encoded(
        image::GrayImage::from_pixel(24, 16, image::Luma([255])),
        ImageFormat::Jpeg,
    );
    let item = |uri: &str, length: usize| {
        format!(
            r#"<rdf:li rdf:parseType="Resource"><rdf:value rdf:parseType="Resource"><Item:Mime>image/jpeg</Item:Mime><Item:Length>{length}</Item:Length><Item:DataURI>{uri}</Item:DataURI></rdf:value></rdf:li>"#
        )
    };
    let items = [
        item("primary_image", 0),
        item("android/original_image", original.len()),
        item("android/depthmap", map.len()),
        item("android/confidencemap", confidence.len()),
    ]
    .concat();
    let text = format!(
        r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" xmlns:Device="http://ns.google.com/photos/dd/1.0/device/" xmlns:Container="http://ns.google.com/photos/dd/1.0/container/" xmlns:Item="http://ns.google.com/photos/dd/1.0/item/" xmlns:Camera="http://ns.google.com/photos/dd/1.0/camera/" xmlns:DepthMap="http://ns.google.com/photos/dd/1.0/depthmap/"><Device:Container rdf:parseType="Resource"><Container:Directory><rdf:Seq>{items}</rdf:Seq></Container:Directory></Device:Container><Device:Cameras><rdf:Seq><rdf:li rdf:parseType="Resource"><rdf:value rdf:parseType="Resource"><Camera:DepthMap rdf:parseType="Resource"><DepthMap:Format>RangeInverse</DepthMap:Format><DepthMap:Near>0.3</DepthMap:Near><DepthMap:Far>6.5</DepthMap:Far><DepthMap:Units>Meters</DepthMap:Units><DepthMap:DepthURI>android/depthmap</DepthMap:DepthURI><DepthMap:ConfidenceURI>android/confidencemap</DepthMap:ConfidenceURI></Camera:DepthMap></rdf:value></rdf:li></rdf:Seq></Device:Cameras></rdf:Description></rdf:RDF></x:xmpmeta>"#
    );
    let main = xmp(&format!(
        r#"<rdf:Description rdf:about="" xmlns:xmpNote="http://ns.adobe.com/xmp/note/" xmlns:GCamera="http://ns.google.com/photos/1.0/camera/" GCamera:BurstPrimary="1" xmpNote:HasExtendedXMP="{GUID}"/>"#
    ));
    let photo = jpeg(&[&[app1(&main)], &extended(text.as_bytes(), 60_000)[..]].concat());
    [&photo[..], &original, &map, &confidence, b"aecDebug camera data"].concat()
}

#[test]
fn a_portrait_of_googles_camera_gives_its_depth() {
    let folder = Folder::new();
    let whole = google_portrait();
    let data = b"aecDebug camera data".len();
    // Phones that write no data of their own behind the pictures, and those that write it before them.
    let plain = whole[..whole.len() - data].to_vec();
    let photo = plain.windows(2).position(|mark| mark == [0xFF, 0xD9]).unwrap() + 2;
    let before = [&plain[..photo], b"aecDebug", &plain[photo..]].concat();
    for (name, bytes) in [("behind.jpg", &whole), ("plain.jpg", &plain), ("before.jpg", &before)] {
        fs::write(folder.path(name), bytes).unwrap();
        let read = photo::read(&folder.path(name), None).unwrap();
        assert_eq!((read.range, read.range_m), (Range::Inverse, Some((0.3, 6.5))), "{name}");
        for (x, y, value) in depth().enumerate_pixels() {
            let d = read.depth[(y as usize, x as usize)];
            assert!((d - f32::from(value.0[0]) / 255.0).abs() < 0.05, "{name} {x} {y}: {d}");
        }
    }
    // Cut as a messenger cuts it: the directory is there, and the pictures are not.
    fs::write(folder.path("sent.jpg"), &whole[..photo]).unwrap();
    let refused = photo::read(&folder.path("sent.jpg"), None).unwrap_err().to_string();
    assert!(
        refused.contains("take the original") && refused.lines().count() == 1,
        "{refused}"
    );
}

/// Appends Samsung's trailer of blocks, each of a kind, a name and data, as exiftool's documentation describes it.
fn with_samsung_trailer(mut file: Vec<u8>, blocks: &[(u16, &str, &[u8])]) -> Vec<u8> {
    let block = |(kind, name, data): &(u16, &str, &[u8])| {
        let head = [0u16.to_le_bytes(), kind.to_le_bytes()].concat();
        [&head[..], &(name.len() as u32).to_le_bytes(), name.as_bytes(), data].concat()
    };
    let written: Vec<Vec<u8>> = blocks.iter().map(block).collect();
    let mut back: usize = written.iter().map(Vec::len).sum();
    let mut directory = [
        &b"SEFH"[..],
        &107u32.to_le_bytes(),
        &(blocks.len() as u32).to_le_bytes(),
    ]
    .concat();
    for ((kind, ..), block) in blocks.iter().zip(&written) {
        directory.extend([0u16.to_le_bytes(), kind.to_le_bytes()].concat());
        directory.extend([(back as u32).to_le_bytes(), (block.len() as u32).to_le_bytes()].concat());
        back -= block.len();
    }
    file.extend(written.concat());
    let length = (directory.len() as u32).to_le_bytes();
    file.extend([&directory[..], &length, b"SEFT"].concat());
    file
}

#[test]
fn samsungs_depth_is_refused_by_its_name() {
    let folder = Folder::new();
    let map = [9u8; 300];
    for (kind, depth, tag) in [
        (0x0AB1, "DualShot_DepthMap_1", "-DepthMapTiff"),
        (0x0B41, "SingeShot_DepthMap_1", "-SingleShotDepthMapTiff"),
    ] {
        let utc: (u16, &str, &[u8]) = (0x0A01, "Image_UTC_Data", b"1700000000000");
        // Samsung's camera writes XMP of its own, which says nothing of depth.
        let photo = jpeg(&[app1(&xmp("<rdf:Description/>"))]);
        fs::write(
            folder.path("s.jpg"),
            with_samsung_trailer(photo.clone(), &[utc, (kind, depth, &map)]),
        )
        .unwrap();
        refuses(
            &folder,
            &["hologram", "--photo", "s.jpg", "-o", "n.png"],
            1,
            &["s.jpg", depth, "exiftool", tag],
        );
        // Another trailer of Samsung's holds no depth.
        fs::write(folder.path("utc.jpg"), with_samsung_trailer(photo, &[utc])).unwrap();
        refuses(
            &folder,
            &["hologram", "--photo", "utc.jpg", "-o", "n.png"],
            1,
            &["neither GDepth nor"],
        );
    }
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

/// Checks that the command fails with `code` in one line that has all `words`.
fn refuses(folder: &Folder, arguments: &[&str], code: i32, words: &[&str]) {
    let errors = folder.fails(arguments, code);
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
    refuses(&folder, &call(&["--z-mm", "3.5"]), 2, &["--z-mm 3.5", "-3 mm to 3 mm"]);
    by_file.extend(["--z-mm", "1"]);
    refuses(&folder, &by_file, 2, &["--z-mm is for --depth flat"]);
    refuses(&folder, &call(&["--invert"]), 2, &["--invert", "flat"]);
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
        1,
        &["--depth-network (docs/depth.md", "--depth flat"],
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
        1,
        &["plain.heic", "no depth", "--depth-network"],
    );
    fs::write(folder.path("cut.heic"), b"\0\0\0\x18ftypheic\0\0\0\0mif1heic").unwrap();
    refuses(
        &folder,
        &["hologram", "--photo", "cut.heic", "-o", "n.png"],
        1,
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

/// Returns a HEIC of [`write_heic`] with a transformation of both its pictures in the place of their `pixi`, which only
/// informs: `irot` in quarter turns anticlockwise, or `imir` with 1 to exchange left and right.
#[cfg(not(windows))]
fn transformed(folder: &Folder, name: &str, kind: &[u8; 4], value: u8) -> Vec<u8> {
    let mut bytes = fs::read(folder.path(name)).unwrap();
    let places: Vec<usize> = (0..bytes.len() - 5)
        .filter(|at| &bytes[*at..*at + 4] == b"pixi")
        .collect();
    assert_eq!(places.len(), 2, "one of each picture");
    for at in places {
        bytes[at..at + 4].copy_from_slice(kind);
        bytes[at + 4] = value;
    }
    bytes
}

/// Returns `file` with Apple's XMP for depth among its data.
#[cfg(not(windows))]
fn with_apple_xmp(mut file: Vec<u8>, format: &[u8; 4], accuracy: &str) -> Vec<u8> {
    let format = u32::from_be_bytes(*format);
    let packet = format!(
        r#"<x:xmpmeta xmlns:x="adobe:ns:meta/" x:xmptk="XMP Core 6.0.0"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" xmlns:apdi="http://ns.apple.com/pixeldatainfo/1.0/" xmlns:depthData="http://ns.apple.com/depthData/1.0/"><apdi:IntMinValue>0</apdi:IntMinValue><apdi:IntMaxValue>255</apdi:IntMaxValue><apdi:StoredFormat>1278226488</apdi:StoredFormat><apdi:NativeFormat>{format}</apdi:NativeFormat><apdi:FloatMinValue>0.5</apdi:FloatMinValue><apdi:FloatMaxValue>4</apdi:FloatMaxValue><depthData:Accuracy>{accuracy}</depthData:Accuracy></rdf:Description></rdf:RDF></x:xmpmeta>"#
    );
    file.extend((packet.len() as u32 + 8).to_be_bytes());
    file.extend(b"mdat");
    file.extend(packet.as_bytes());
    file
}

/// A portrait that the container turns or mirrors, and one whose depth is distance.
#[cfg(not(windows))]
#[test]
fn a_heic_portrait_is_upright_and_its_depth_is_what_the_file_says() {
    let folder = Folder::new();
    let rgba = image::RgbaImage::from_fn(96, 64, |x, y| match x < 40 && y < 20 {
        true => image::Rgba([230, 120, 60, 240]),
        false => image::Rgba([40, 90, 200, 30]),
    });
    write_heic(&folder, "stored", &rgba, 2);
    for (name, kind, value, shape, near) in [
        // The near corner, at the top left, comes to the bottom left, the bottom right and the top right.
        ("turned.heic", b"irot", 1, (96, 64), (90, 5)),
        ("half.heic", b"irot", 2, (64, 96), (60, 90)),
        ("mirrored.heic", b"imir", 1, (64, 96), (5, 90)),
    ] {
        fs::write(folder.path(name), transformed(&folder, "stored.heic", kind, value)).unwrap();
        let read = photo::read(&folder.path(name), None).unwrap();
        assert_eq!(read.depth.dim(), shape, "{name}");
        assert_eq!(read.colours.rgb.dim(), (3, shape.0, shape.1), "{name}");
        let (y, x) = near;
        let opposite = (shape.0 - 1 - y, shape.1 - 1 - x);
        assert!(read.depth[near] < 0.1 && read.depth[opposite] > 0.8, "{name}");
        assert!(read.colours.rgb[(0, y, x)] > 0.8, "{name}");
        assert!(read.colours.rgb[(0, opposite.0, opposite.1)] < 0.3, "{name}");
    }
    let stored = fs::read(folder.path("stored.heic")).unwrap();
    for (format, accuracy, range, range_m) in [
        (b"hdis", "absolute", Range::Inverse, Some((0.25, 2.0))),
        (b"hdis", "relative", Range::Inverse, None),
        (b"fdep", "absolute", Range::Linear, Some((0.5, 4.0))),
    ] {
        fs::write(
            folder.path("said.heic"),
            with_apple_xmp(stored.clone(), format, accuracy),
        )
        .unwrap();
        let read = photo::read(&folder.path("said.heic"), None).unwrap();
        assert_eq!((read.range, read.range_m), (range, range_m));
        // Level 240 of 255 lies at 3.794/m, which is 0.264 m, or at 3.794 m.
        let level = 240.0 / 255.0;
        let d = if range == Range::Linear { level } else { 1.0 - level };
        assert!((read.depth[(5, 5)] - d).abs() < 0.02, "{}", read.depth[(5, 5)]);
        if let Some(metres) = read.metres() {
            let want = if range == Range::Linear { 3.794 } else { 1.0 / 3.794 };
            assert!((metres[(5, 5)] / want - 1.0).abs() < 0.03, "{} {want}", metres[(5, 5)]);
        }
    }
    folder.succeeds(&[
        "hologram",
        "--photo",
        "said.heic",
        "--near",
        "1",
        "--far",
        "4",
        "--fit",
        "centre",
        "-o",
        "h.png",
    ]);
}
