//! Tests common pictures and depth maps in all supported formats, and files that must be refused.
use crate::folder;
use phasefront::Size;

use exr::prelude::WritableImage;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec};
use folder::Folder;
use image::{DynamicImage, ImageFormat};
use ndarray::{Array2, Array3};
use ndarray_npy::write_npy;
use num_complex::Complex32;
use phasefront::Display;
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_core::depth::DepthUnit;
use phasefront_io::frame::{self, DepthOptions};
use phasefront_io::hologram::{self, Hologram, HologramInfo, Levels};
use phasefront_io::input::decode::{self, COLOUR_FORMATS, DEPTH_FORMATS, Reading};
use phasefront_io::picture::{self, depth_map};
use std::fs;
use std::io::Cursor;
use std::path::Path;
use tiff::encoder::colortype::{self, ColorType};
use tiff::encoder::{TiffEncoder, TiffValue};
use tiff::tags::Tag;

const WIDTH: u32 = 24;
const HEIGHT: u32 = 16;
/// The size of the scene's pictures.
const WHOLE: Size = Size {
    width: WIDTH as usize,
    height: HEIGHT as usize,
};

fn colour() -> image::RgbImage {
    image::RgbImage::from_fn(WIDTH, HEIGHT, |x, y| image::Rgb([10 * x as u8, 15 * y as u8, 90]))
}

fn colour16() -> image::ImageBuffer<image::Rgb<u16>, Vec<u16>> {
    image::ImageBuffer::from_fn(WIDTH, HEIGHT, |x, y| {
        image::Rgb([2570 * x as u16, 3855 * y as u16, 90 * 257])
    })
}

/// Returns the depth of a frame: a step, and a slope along y.
fn depth(x: u32, y: u32) -> u16 {
    if x < WIDTH / 2 { 8000 + 16 * y as u16 } else { 56_000 }
}

fn depth16() -> image::ImageBuffer<image::Luma<u16>, Vec<u16>> {
    image::ImageBuffer::from_fn(WIDTH, HEIGHT, |x, y| image::Luma([depth(x, y)]))
}

fn metres() -> Array2<f32> {
    Array2::from_shape_fn((HEIGHT as usize, WIDTH as usize), |(y, x)| {
        f32::from(depth(x as u32, y as u32)) / 10_000.0
    })
}

/// Writes a TIFF of `size`, with an orientation unless it is 0.
fn tiff<C: ColorType>(path: &Path, size: Size, values: &[C::Inner], orientation: u16)
where
    [C::Inner]: TiffValue,
{
    let mut encoder = TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
    let mut image = encoder.new_image::<C>(size.width as u32, size.height as u32).unwrap();
    if orientation > 0 {
        image.encoder().write_tag(Tag::Orientation, orientation).unwrap();
    }
    image.write_data(values).unwrap();
}

fn exr(path: &Path, channels: Vec<(&str, FlatSamples)>) {
    let channels: SmallVec<[_; 4]> = (channels.into_iter())
        .map(|(name, samples)| AnyChannel::new(name, samples))
        .collect();
    let layer = Layer::new(
        (WIDTH as usize, HEIGHT as usize),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels),
    );
    Image::from_layer(layer).write().to_file(path).unwrap();
}

/// Returns big-endian Exif with one tag in its directory: orientation (0x0112, one short).
fn exif(orientation: u8) -> Vec<u8> {
    [
        &b"MM\0\x2A\0\0\0\x08\0\x01"[..],
        &[0x01, 0x12, 0, 3, 0, 0, 0, 1, 0, orientation, 0, 0, 0, 0, 0, 0],
    ]
    .concat()
}

/// Encodes `image` as a JPEG with an orientation.
pub(crate) fn jpeg(image: &DynamicImage, orientation: u8) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
    let bytes = bytes.into_inner();
    let content = [&b"Exif\0\0"[..], &exif(orientation)].concat();
    let length = (content.len() as u16 + 2).to_be_bytes();
    [&bytes[..2], &[0xFF, 0xE1], &length, &content, &bytes[2..]].concat()
}

fn options(unit: DepthUnit) -> DepthOptions {
    DepthOptions {
        unit,
        near_m: None,
        far_m: None,
        inverted: false,
    }
}

#[test]
fn colour_is_the_same_from_every_format() {
    let folder = Folder::new();
    let (bytes, words) = (colour(), colour16());
    for name in ["c.png", "c.bmp", "c.webp"] {
        bytes.save(folder.path(name)).unwrap();
    }
    words.save(folder.path("w.png")).unwrap();
    let sides = WHOLE;
    tiff::<colortype::RGB8>(&folder.path("c.tif"), sides, bytes.as_raw(), 0);
    tiff::<colortype::RGB16>(&folder.path("w.tiff"), sides, words.as_raw(), 0);
    let rgba = DynamicImage::from(words.clone()).into_rgba16();
    tiff::<colortype::RGBA16>(&folder.path("a.tif"), sides, rgba.as_raw(), 0);
    let want = picture::read_rgb(&folder.path("c.png")).unwrap();
    assert_eq!(want.dim(), (3, HEIGHT as usize, WIDTH as usize));
    for name in ["c.bmp", "c.webp", "w.png", "c.tif", "w.tiff", "a.tif"] {
        let read = picture::read_rgb(&folder.path(name)).unwrap();
        assert!((&read - &want).iter().all(|v| v.abs() < 1e-6), "{name}");
    }
    // The same function reads a calibration's photographs.
    let photograph = Photograph::read(&folder.path("w.tiff"), 0).unwrap();
    assert_eq!((photograph.values[1], photograph.full), (2570, 65535));
}

#[test]
fn depth_is_the_same_from_every_format() {
    let folder = Folder::new();
    let words = depth16();
    let want = Array2::from_shape_fn((HEIGHT as usize, WIDTH as usize), |(y, x)| {
        f32::from(depth(x as u32, y as u32)) / 65535.0
    });
    let sides = WHOLE;
    words.save(folder.path("grey.png")).unwrap();
    let all = DynamicImage::from(words.clone());
    all.to_rgb16().save(folder.path("rgb.png")).unwrap();
    all.to_rgba16().save(folder.path("rgba.png")).unwrap();
    all.to_luma_alpha16().save(folder.path("alpha.png")).unwrap();
    tiff::<colortype::Gray16>(&folder.path("grey.tif"), sides, words.as_raw(), 0);
    let wide: Vec<u32> = words.iter().map(|v| u32::from(*v) * 65537).collect();
    tiff::<colortype::Gray32>(&folder.path("wide.tif"), sides, &wide, 0);
    let real: Vec<f32> = want.iter().copied().collect();
    tiff::<colortype::Gray32Float>(&folder.path("real.tif"), sides, &real, 0);
    let double: Vec<f64> = real.iter().map(|v| f64::from(*v)).collect();
    tiff::<colortype::Gray64Float>(&folder.path("double.tif"), sides, &double, 0);
    exr(
        &folder.path("z.exr"),
        vec![
            ("A", FlatSamples::F32(vec![1.0; real.len()])),
            ("ViewLayer.Depth.Z", FlatSamples::F32(real.clone())),
        ],
    );
    exr(
        &folder.path("one.exr"),
        vec![("whatever", FlatSamples::F32(real.clone()))],
    );
    exr(
        &folder.path("grey.exr"),
        ["R", "G", "B"].map(|c| (c, FlatSamples::F32(real.clone()))).into(),
    );
    write_npy(folder.path("real.npy"), &want).unwrap();
    let stack = want.clone().insert_axis(ndarray::Axis(2));
    write_npy(folder.path("last.npy"), &stack).unwrap();
    write_npy(folder.path("first.npy"), &want.clone().insert_axis(ndarray::Axis(0))).unwrap();
    let batch = want.clone().insert_axis(ndarray::Axis(0)).insert_axis(ndarray::Axis(0));
    write_npy(folder.path("batch.npy"), &batch).unwrap();
    // A PGM, and a PFM, whose rows run from the bottom up.
    let header = |kind: &str, last: &str| format!("{kind}\n{WIDTH} {HEIGHT}\n{last}\n").into_bytes();
    let levels: Vec<u8> = words.iter().flat_map(|v| v.to_be_bytes()).collect();
    fs::write(folder.path("grey.pgm"), [header("P5", "65535"), levels].concat()).unwrap();
    let rows = want.rows().into_iter().rev().flatten();
    let values: Vec<u8> = rows.flat_map(|v| v.to_le_bytes()).collect();
    fs::write(folder.path("real.pfm"), [header("Pf", "-1"), values].concat()).unwrap();
    for name in [
        "grey.png",
        "rgb.png",
        "rgba.png",
        "alpha.png",
        "grey.tif",
        "wide.tif",
        "real.tif",
        "double.tif",
        "z.exr",
        "one.exr",
        "grey.exr",
        "real.npy",
        "last.npy",
        "first.npy",
        "batch.npy",
        "grey.pgm",
        "real.pfm",
    ] {
        let read = depth_map::read_depth(&folder.path(name), true).unwrap();
        assert!((&read - &want).iter().all(|v| v.abs() < 1e-6), "{name}");
    }
    // The same depth with 8 bits, as equal colours.
    let bytes = DynamicImage::from(words.clone()).into_luma8();
    bytes.save(folder.path("b.png")).unwrap();
    let want = depth_map::read_depth(&folder.path("b.png"), true).unwrap();
    let all = DynamicImage::from(bytes);
    all.to_rgb8().save(folder.path("b3.png")).unwrap();
    all.to_rgba8().save(folder.path("b4.png")).unwrap();
    all.to_rgb8().save(folder.path("b.webp")).unwrap();
    for name in ["b3.png", "b4.png", "b.webp"] {
        assert_eq!(depth_map::read_depth(&folder.path(name), true).unwrap(), want, "{name}");
    }
}

#[test]
fn a_unit_means_the_same_for_every_format() {
    let folder = Folder::new();
    colour().save(folder.path("c.png")).unwrap();
    write_npy(folder.path("m.npy"), &metres()).unwrap();
    let values: Vec<f32> = metres().iter().copied().collect();
    tiff::<colortype::Gray32Float>(&folder.path("m.tif"), WHOLE, &values, 0);
    exr(&folder.path("m.exr"), vec![("Z", FlatSamples::F32(values))]);
    let millimetres = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(WIDTH, HEIGHT, |x, y| {
        image::Luma([(metres()[(y as usize, x as usize)] * 1000.0).round() as u16])
    });
    DynamicImage::from(millimetres)
        .to_rgb16()
        .save(folder.path("mm.png"))
        .unwrap();
    let read = |name: &str, unit| frame::read(&folder.path("c.png"), &folder.path(name), options(unit), None).unwrap();
    let want = read("m.npy", DepthUnit::Metres);
    for (name, unit) in [
        ("m.tif", DepthUnit::Metres),
        ("m.exr", DepthUnit::Metres),
        ("mm.png", DepthUnit::Millimetres),
    ] {
        let apart = read(name, unit).depth - &want.depth;
        assert!(apart.iter().all(|d| d.abs() < 1e-3), "{name}");
    }
}

#[test]
fn colours_are_no_depth_and_the_formats_are_listed() {
    let folder = Folder::new();
    colour().save(folder.path("c.png")).unwrap();
    colour16().save(folder.path("w.png")).unwrap();
    exr(
        &folder.path("c.exr"),
        ["R", "G", "B"]
            .map(|c| {
                (
                    c,
                    FlatSamples::F32(vec![c.as_bytes()[0].into(); (WIDTH * HEIGHT) as usize]),
                )
            })
            .into(),
    );
    exr(
        &folder.path("two.exr"),
        ["U", "V"]
            .map(|c| (c, FlatSamples::F32(vec![1.0; (WIDTH * HEIGHT) as usize])))
            .into(),
    );
    fs::write(folder.path("t.png"), "text").unwrap();
    let refused = |read: phasefront_io::Result<()>, word: &str| {
        let why = read.unwrap_err().to_string();
        assert!(why.contains(word) && !why.contains('\n'), "{why}");
    };
    for name in ["c.png", "w.png"] {
        refused(
            depth_map::read_depth(&folder.path(name), true).map(|_| ()),
            "false colours",
        );
        refused(
            depth_map::read_depth(&folder.path(name), true).map(|_| ()),
            DEPTH_FORMATS,
        );
    }
    refused(
        depth_map::read_depth(&folder.path("c.exr"), true).map(|_| ()),
        "Z or depth",
    );
    refused(depth_map::read_depth(&folder.path("two.exr"), true).map(|_| ()), "U, V");
    refused(picture::read_rgb(&folder.path("two.exr")).map(|_| ()), "U, V");
    refused(picture::read_rgb(&folder.path("t.png")).map(|_| ()), COLOUR_FORMATS);
    // --help and the guide list exactly the supported formats.
    let squeezed = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let help = squeezed(&folder.succeeds(&["hologram", "--help"]));
    let guide = squeezed(include_str!("../../../../docs/depth.md"));
    for formats in [COLOUR_FORMATS, DEPTH_FORMATS] {
        assert!(help.contains(formats), "{help}");
        assert!(guide.contains(formats), "docs/depth.md: {formats}");
    }
}

#[test]
fn pictures_are_upright_as_their_exif_says() {
    let folder = Folder::new();
    let upright = DynamicImage::from(colour());
    // The picture that a rotated camera stores.
    let stored = |orientation: u8| match orientation {
        3 => upright.rotate180(),
        6 => upright.rotate270(),
        8 => upright.rotate90(),
        _ => upright.clone(),
    };
    let want = picture::read_rgb(&{
        fs::write(folder.path("1.jpg"), jpeg(&upright, 1)).unwrap();
        folder.path("1.jpg")
    })
    .unwrap();
    for orientation in [3, 6, 8] {
        let name = format!("{orientation}.jpg");
        fs::write(folder.path(&name), jpeg(&stored(orientation), orientation)).unwrap();
        let read = picture::read_rgb(&folder.path(&name)).unwrap();
        assert_eq!(read.dim(), want.dim());
        // The codec's blocks lie elsewhere.
        let apart = (&read - &want).mapv(f32::abs).mean().unwrap();
        assert!(apart < 0.02, "{orientation}: {apart}");
    }
    // Depth with the same stored orientation and tag is turned too. Depth without the tag is refused.
    let turned = DynamicImage::from(depth16()).rotate270().into_luma16();
    let sides = Size {
        width: turned.width() as usize,
        height: turned.height() as usize,
    };
    tiff::<colortype::Gray16>(&folder.path("turned.tif"), sides, turned.as_raw(), 6);
    tiff::<colortype::Gray16>(&folder.path("stored.tif"), sides, turned.as_raw(), 0);
    let real: Vec<f32> = turned.iter().map(|v| f32::from(*v) / 65535.0).collect();
    tiff::<colortype::Gray32Float>(&folder.path("real.tif"), sides, &real, 6);
    depth16().save(folder.path("upright.png")).unwrap();
    let read = |name: &str| {
        frame::read(
            &folder.path("6.jpg"),
            &folder.path(name),
            options(DepthUnit::Normalized),
            None,
        )
    };
    let want = read("upright.png").unwrap();
    for name in ["turned.tif", "real.tif"] {
        let apart = read(name).unwrap().depth - &want.depth;
        assert!(apart.iter().all(|d| d.abs() < 1e-5), "{name}");
    }
    let why = read("stored.tif").unwrap_err().to_string();
    assert!(why.contains("Exif data turn it"), "{why}");
    // A rotation by 180° cannot be detected from the sizes.
    let output = folder.run(&[
        "hologram",
        "--rgb",
        "3.jpg",
        "--depth",
        "upright.png",
        "--method",
        "sweep",
        "-o",
        "h.png",
    ]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.contains("Exif"), "{said}");
    let output = folder.run(&[
        "hologram",
        "--rgb",
        "1.jpg",
        "--depth",
        "upright.png",
        "--method",
        "sweep",
        "-o",
        "h.png",
    ]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && !said.contains("Exif"), "{said}");
}

#[test]
fn pictures_that_are_not_read_say_what_to_do() {
    let folder = Folder::new();
    depth16().save(folder.path("d.png")).unwrap();
    fs::write(folder.path("p.heic"), b"\0\0\0\x18ftypheic\0\0\0\0mif1heic").unwrap();
    fs::write(folder.path("p.avif"), b"\0\0\0\x18ftypavif\0\0\0\0mif1avif").unwrap();
    let gif = [&b"GIF89a"[..], &[0xFF; 4], &[0; 30]].concat();
    fs::write(folder.path("p.gif"), gif).unwrap();
    for (name, word) in [("p.avif", "save it as"), ("p.gif", "save its picture as PNG")] {
        for flags in [
            &["--rgb", name, "--depth", "d.png"][..],
            &["--rgb", "d.png", "--depth", name],
            &["--photo", name],
        ] {
            if flags[0] == "--photo" && name == "p.gif" {
                continue;
            }
            let errors = folder.fails(&[&["hologram"], flags, &["-o", "h.png"]].concat(), 1);
            assert!(
                errors.lines().count() == 1 && errors.contains(name) && errors.contains(word),
                "{errors}"
            );
        }
    }
}

/// Returns the headers of pictures of 65,535 × 65,535 pixels.
fn large() -> Vec<(&'static str, Vec<u8>)> {
    let side = 65_535u32;
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, side, side);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::One);
    drop(encoder.write_header().unwrap());
    png.truncate(33);
    png.extend(b"\0\0\0\x04IDAT\0\0\0\0\0\0\0\0");
    let bmp = [
        &b"BM"[..],
        &[0; 8],
        &54u32.to_le_bytes(),
        &40u32.to_le_bytes(),
        &side.to_le_bytes(),
        &side.to_le_bytes(),
        &[1, 0, 24, 0],
        &[0; 24],
    ]
    .concat();
    let entry = |tag: u16, kind: u16, value: u32| {
        [
            &tag.to_le_bytes()[..],
            &kind.to_le_bytes(),
            &1u32.to_le_bytes(),
            &value.to_le_bytes(),
        ]
        .concat()
    };
    let tiff = [
        b"II*\0\x08\0\0\0\x08\0".to_vec(),
        entry(256, 4, side),
        entry(257, 4, side),
        entry(258, 3, 16),
        entry(259, 3, 1),
        entry(262, 3, 1),
        entry(273, 4, 8),
        entry(277, 3, 1),
        entry(279, 4, 8),
        vec![0; 4],
    ]
    .concat();
    // A lossy WebP picture has 14 bits per side.
    let webp = {
        let data = [&[0x30, 1, 0][..], &[0x9d, 1, 0x2a], &[0xFF, 0x3F, 0xFF, 0x3F], &[0; 20]].concat();
        let chunk = [&b"VP8 "[..], &(data.len() as u32).to_le_bytes(), &data].concat();
        [&b"RIFF"[..], &(chunk.len() as u32 + 4).to_le_bytes(), b"WEBP", &chunk].concat()
    };
    vec![("png", png), ("bmp", bmp), ("tif", tiff), ("webp", webp)]
}

/// Returns the header of an OpenEXR file of 8192×8192 pixels and `channels` channels of 32 bits, in tiles of `tile` or
/// in lines.
fn large_exr(channels: usize, tile: Option<u32>) -> Vec<u8> {
    let attribute = |name: &str, kind: &str, value: &[u8]| {
        [
            name.as_bytes(),
            b"\0",
            kind.as_bytes(),
            b"\0",
            &(value.len() as u32).to_le_bytes(),
            value,
        ]
        .concat()
    };
    let list: Vec<u8> = (0..channels)
        .flat_map(|i| {
            let name = if i == 0 { "Z".to_owned() } else { format!("a{i:03}") };
            [
                name.as_bytes(),
                b"\0",
                &[2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0],
            ]
            .concat()
        })
        .collect();
    let window: Vec<u8> = [0u32, 0, 8191, 8191]
        .iter()
        .flat_map(|side| side.to_le_bytes())
        .collect();
    let tiles = tile.map(|side| [&side.to_le_bytes()[..], &side.to_le_bytes(), &[0]].concat());
    [
        b"\x76\x2f\x31\x01\x02".to_vec(),
        vec![if tile.is_some() { 2 } else { 0 }, 0, 0],
        attribute("channels", "chlist", &[list, vec![0]].concat()),
        attribute("compression", "compression", &[3]),
        attribute("dataWindow", "box2i", &window),
        attribute("displayWindow", "box2i", &window),
        attribute("lineOrder", "lineOrder", &[0]),
        attribute("pixelAspectRatio", "float", &1f32.to_le_bytes()),
        attribute("screenWindowCenter", "v2f", &[0; 8]),
        attribute("screenWindowWidth", "float", &1f32.to_le_bytes()),
        tiles
            .map(|tiles| attribute("tiles", "tiledesc", &tiles))
            .unwrap_or_default(),
        vec![0; 64],
    ]
    .concat()
}

#[test]
fn large_pictures_are_refused_before_memory_is_taken() {
    let folder = Folder::new();
    for (name, bytes) in large() {
        let path = folder.path(&format!("large.{name}"));
        fs::write(&path, bytes).unwrap();
        for read in [
            picture::read_rgb(&path).map(|_| ()),
            depth_map::read_depth(&path, true).map(|_| ()),
        ] {
            let why = read.unwrap_err().to_string();
            assert!(why.contains("pixels; 67108864 in all are the most"), "{name}: {why}");
        }
    }
}

/// All channels of an OpenEXR file are decoded, whichever is read, and a tile is decoded whole.
#[test]
fn large_layers_and_tiles_of_openexr_are_refused_before_memory_is_taken() {
    let folder = Folder::new();
    for (channels, tile) in [
        (9, None),
        (9, Some(64)),
        (2, Some(8192)),
        (1, Some(u32::MAX >> 1)),
        (5, Some(4096)),
    ] {
        let path = folder.path("large.exr");
        fs::write(&path, large_exr(channels, tile)).unwrap();
        let why = depth_map::read_depth(&path, false).unwrap_err().to_string();
        let is_large = (channels, tile) != (1, Some(u32::MAX >> 1));
        assert_eq!(
            why.contains("268435456 are the most: save depth alone"),
            is_large,
            "{why}"
        );
    }
}

/// A colour profile of a few bytes may unpack to gigabytes.
#[test]
fn colour_profiles_are_bounded() {
    let folder = Folder::new();
    let mut info = png::Info::with_size(2, 1);
    info.color_type = png::ColorType::Rgb;
    info.icc_profile = Some(vec![0; 1 << 27].into());
    let mut bytes = Vec::new();
    let mut writer = png::Encoder::with_info(&mut bytes, info)
        .unwrap()
        .write_header()
        .unwrap();
    writer.write_image_data(&[1, 2, 3, 4, 5, 6]).unwrap();
    writer.finish().unwrap();
    fs::write(folder.path("profile.png"), bytes).unwrap();
    let (image, _) = decode::open_picture(&folder.path("profile.png"), Reading::AS_STORED).unwrap();
    assert_eq!(image.as_bytes(), [1, 2, 3, 4, 5, 6]);
}

/// Calls that name files that are not regular.
#[cfg(unix)]
const NO_REGULAR_FILES: &[&str] = &[
    "hologram --rgb c.png --depth d.png --method sweep -o h.png --display lut.toml",
    "hologram --rgb c.png --depth d.png --method sweep -o h.png --display per_pixel.toml",
    "hologram --rgb c.png --depth d.png --method sweep -o h.png --display laser.toml",
    "hologram --rgb c.png --depth d.png --method sweep -o h.png --display aberration.toml",
    "hologram --rgb c.png --depth d.png --method sweep -o h.png --display flat.toml",
    "hologram --rgb c.png --depth d.png --method sweep -o h.png --display csv.toml",
    "hologram --rgb c.png --depth d.png --method sweep -o h.png --display zero.toml",
    "hologram --photo /dev/zero -o h.png",
    "hologram --photo pipe -o h.png",
    "hologram --rgb /dev/zero --depth d.png -o h.png",
    "hologram --rgb pipe --depth d.png -o h.png",
    "hologram --rgb c.png --depth pipe -o h.png",
    "hologram --rgb c.png --depth-network pipe -o h.png",
    "hologram --rgb c.png --depth-network /dev/zero -o h.png",
    "hologram --rgb c.png --depth d.png --network /dev/zero -o h.png",
    "hologram --rgb c.png --depth d.png --network pipe -o h.png",
    "refocus pipe --z-mm 0 -o v.png",
    "view zero.toml -o v.html",
];

#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    let folder = Folder::new();
    colour().save(folder.path("c.png")).unwrap();
    depth16().save(folder.path("d.png")).unwrap();
    for key in ["lut", "per_pixel", "laser", "aberration"] {
        fs::write(
            folder.path(&format!("{key}.toml")),
            format!("width = 24\nheight = 16\n{key} = \"/dev/zero\""),
        )
        .unwrap();
    }
    fs::write(
        folder.path("flat.toml"),
        "width = 24\nheight = 16\nflatness = \"/dev/zero\"",
    )
    .unwrap();
    std::os::unix::fs::symlink("/dev/zero", folder.path("zero.toml")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", folder.path("zero.csv")).unwrap();
    fs::write(
        folder.path("csv.toml"),
        "width = 24\nheight = 16\nflatness = \"zero.csv\"",
    )
    .unwrap();
    assert!(
        std::process::Command::new("mkfifo")
            .arg(folder.path("pipe"))
            .status()
            .unwrap()
            .success()
    );
    for call in NO_REGULAR_FILES {
        let errors = folder.fails(&call.split(' ').collect::<Vec<_>>(), 1);
        assert_eq!(errors.lines().count(), 1, "{call}: {errors}");
        assert!(errors.contains("not a regular file"), "{call}: {errors}");
    }
    // The contents of a file that is not a table are not printed.
    fs::write(
        folder.path("passwd.toml"),
        "width = 24\nheight = 16\nlut = \"/etc/passwd\"",
    )
    .unwrap();
    let errors = folder.fails(
        &[
            "hologram",
            "--rgb",
            "c.png",
            "--depth",
            "d.png",
            "--display",
            "passwd.toml",
            "-o",
            "h.png",
        ],
        1,
    );
    assert!(!errors.contains("root"), "{errors}");
}

fn info(scale: Option<f32>) -> HologramInfo {
    HologramInfo {
        encoder: Some("anti-alias".into()),
        scale,
        ..HologramInfo::new(Display::default())
    }
}

#[test]
fn holograms_that_say_what_cannot_be_are_refused() {
    let folder = Folder::new();
    let path = folder.path("h.png");
    let write = |level: u8, info: &HologramInfo| {
        let levels = Levels::Bytes(Array3::from_elem((3, 8, 8), level));
        hologram::write_hologram(&path, &Hologram::Levels(levels, info.clone())).unwrap();
    };
    let refused = |info: &HologramInfo, word: &str| {
        write(0, info);
        let why = hologram::read_hologram(&path).unwrap_err().to_string();
        assert!(why.contains("h.png") && why.contains(word), "{why}");
    };
    for scale in [0.0, -1.0, 1e38, 1e-30, -0.0] {
        refused(&info(Some(scale)), "scale");
    }
    let with = |lut, levels_turns| HologramInfo {
        lut,
        levels_turns,
        ..info(Some(1.2))
    };
    refused(&with(Some(vec![1; 7]), None), "7 entries");
    refused(&with(None, Some(vec![0.0, 0.5])), "2 levels");
    refused(&with(None, Some(vec![0.5; 256])), "levels");
    let named = HologramInfo {
        encoder: Some("e".repeat(10_000)),
        ..info(Some(1.0))
    };
    refused(&named, "10000 bytes");
    let few_bits = HologramInfo {
        display: Display::from_toml("bits = 4").unwrap(),
        ..info(Some(1.0))
    };
    write(16, &few_bits);
    let why = hologram::read_hologram(&path).unwrap_err().to_string();
    assert!(why.contains("a level of 16, over the 4 bits"), "{why}");
    for scale in [None, Some(1.1)] {
        write(0, &info(scale));
        hologram::read_hologram(&path).unwrap();
    }
    let field = folder.path("f.npy");
    hologram::write_complex(&field, Array3::<Complex32>::zeros((3, 8, 8)).view(), &info(Some(-1.0))).unwrap();
    let why = hologram::read_hologram(&field).unwrap_err().to_string();
    assert!(why.contains("f.json") && why.contains("scale"), "{why}");
}

#[test]
#[ignore = "slow: 25 seconds of a core"]
fn cut_and_damaged_files_of_every_format_are_read_or_refused() {
    let folder = Folder::new();
    let small = image::imageops::resize(&colour(), 6, 4, image::imageops::FilterType::Nearest);
    let grey = DynamicImage::from(small.clone()).into_luma16();
    for name in ["a.png", "a.webp", "a.bmp", "a.jpg"] {
        small.save(folder.path(name)).unwrap();
    }
    grey.save(folder.path("g.png")).unwrap();
    tiff::<colortype::RGB16>(
        &folder.path("a.tif"),
        Size { width: 6, height: 4 },
        DynamicImage::from(small).into_rgb16().as_raw(),
        6,
    );
    let real: Vec<f32> = grey.iter().map(|v| f32::from(*v)).collect();
    tiff::<colortype::Gray32Float>(&folder.path("f.tif"), Size { width: 6, height: 4 }, &real, 0);
    exr(
        &folder.path("z.exr"),
        vec![("Z", FlatSamples::F32(vec![1.5; (WIDTH * HEIGHT) as usize]))],
    );
    write_npy(folder.path("a.npy"), &Array2::<f32>::ones((4, 6))).unwrap();
    for name in [
        "a.png", "g.png", "a.webp", "a.bmp", "a.jpg", "a.tif", "f.tif", "z.exr", "a.npy",
    ] {
        let whole = fs::read(folder.path(name)).unwrap();
        let path = folder.path(&format!("damaged-{name}"));
        let is_colour = name.starts_with('a') && name != "a.npy";
        let try_one = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            let read = if is_colour {
                picture::read_rgb(&path).map(|_| ())
            } else {
                depth_map::read_depth(&path, true).map(|_| ())
            };
            if let Err(why) = read {
                assert!(!why.to_string().contains('\n'), "{name}: {why}");
            }
        };
        for end in 0..whole.len() {
            try_one(&whole[..end]);
        }
        for at in 0..whole.len() {
            for value in [0xFF, whole[at] ^ 1 << (at % 8)] {
                let mut damaged = whole.clone();
                damaged[at] = value;
                try_one(&damaged);
            }
        }
    }
}
