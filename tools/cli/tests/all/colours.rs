//! Judges displayed colours by an independent model: levels in a file become light behind the aperture by this file's
//! own Fourier optics, its colour by the standard observer, and the difference by CIEDE2000.
use crate::folder::{Folder, SMALL_HOLOGRAM};
use crate::reference::fft2;
use ndarray::{Array2, Array3};
use num_complex::Complex64;
use phasefront::input::RgbEncoding;
use phasefront_calibration::white::CHECKER;
use phasefront_io::film;
use phasefront_io::picture::colours;
use serde_json::Value;
use std::f64::consts::PI;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Command;

type Colour = [f64; 3];
type Matrix = [Colour; 3];

/// sRGB's and BT.2020's light to X, Y, Z, from IEC 61966-2-1 and BT.2020; D65; as published.
const SRGB: Matrix = [
    [0.4124564, 0.3575761, 0.1804375],
    [0.2126729, 0.7151522, 0.0721750],
    [0.0193339, 0.1191920, 0.9503041],
];
const BT2020: Matrix = [
    [0.6369580, 0.1446169, 0.1688810],
    [0.2627002, 0.6779981, 0.0593017],
    [0.0, 0.0280727, 1.0609851],
];
const DISPLAY_P3: Matrix = [
    [0.4865709, 0.2656677, 0.1982173],
    [0.2289746, 0.6917385, 0.0792869],
    [0.0, 0.0451134, 1.0439444],
];
const ADOBE_RGB: Matrix = [
    [0.5767309, 0.1855540, 0.1881852],
    [0.2973769, 0.6273491, 0.0752741],
    [0.0270343, 0.0706872, 0.9911085],
];
const D65: Colour = [0.95047, 1.0, 1.08883];

/// X, Y, Z of the CIE 1931 2° observer by wavelength in nm (ISO/CIE 11664-1, table of 1 nm).
fn observer(nm: u32) -> Colour {
    match nm {
        445 => [0.34806, 0.0298, 1.7826],
        450 => [0.3362, 0.038, 1.77211],
        457 => [0.308884, 0.05257304, 1.7208581],
        515 => [0.0291, 0.6082, 0.1117],
        520 => [0.06327, 0.71, 0.07825],
        532 => [0.18914, 0.8849624, 0.03693564],
        633 => [0.5811052, 0.2353344, 0.00003572],
        638 => [0.4847436, 0.1911552, 0.00002364],
        640 => [0.4479, 0.175, 0.00002],
        _ => panic!("{nm}"),
    }
}

fn times(m: &Matrix, v: Colour) -> Colour {
    m.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
}

/// Solves m·x = v by Cramer's rule.
fn solved(m: &Matrix, v: Colour) -> Colour {
    let det = |m: &Matrix| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    [0, 1, 2].map(|column| {
        let mut with = *m;
        for row in 0..3 {
            with[row][column] = v[row];
        }
        det(&with) / det(m)
    })
}

/// Returns X, Y, Z (rows) of lasers (columns) balanced to D65.
fn balanced(nm: [u32; 3]) -> Matrix {
    let columns = nm.map(observer);
    let pure: Matrix = [0, 1, 2].map(|row| [0, 1, 2].map(|laser| columns[laser][row]));
    let powers = solved(&pure, D65);
    pure.map(|row| [0, 1, 2].map(|laser| row[laser] * powers[laser]))
}

fn decoded(v: f64) -> f64 {
    if v <= 0.04045 {
        v / 12.92
    } else {
        ((v + 0.055) / 1.055).powf(2.4)
    }
}

fn encoded(light: f64) -> f64 {
    if light <= 0.0031308 {
        12.92 * light
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

pub(crate) fn srgb_xyz(rgb: [u8; 3]) -> Colour {
    times(&SRGB, rgb.map(|v| decoded(f64::from(v) / 255.0)))
}

pub(crate) fn lab(xyz: Colour) -> Colour {
    let f = |t: f64| {
        if t > 216.0 / 24389.0 {
            t.cbrt()
        } else {
            (24389.0 / 27.0 * t + 16.0) / 116.0
        }
    };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i].max(0.0) / D65[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIEDE2000 (CIE 142-2001; Sharma, Wu and Dalal, 2005).
pub(crate) fn ciede2000(a: Colour, b: Colour) -> f64 {
    let chroma = |c: Colour| c[1].hypot(c[2]);
    let mean = (chroma(a) + chroma(b)) / 2.0;
    let g = 0.5 * (1.0 - (mean.powi(7) / (mean.powi(7) + 25f64.powi(7))).sqrt());
    let polar = |c: Colour| {
        let x = (1.0 + g) * c[1];
        (x.hypot(c[2]), c[2].atan2(x).to_degrees().rem_euclid(360.0))
    };
    let ((c1, h1), (c2, h2)) = (polar(a), polar(b));
    let grey = c1 * c2 == 0.0;
    let mut turn = if grey { 0.0 } else { h2 - h1 };
    turn -= 360.0 * f64::from(i8::from(turn > 180.0) - i8::from(turn < -180.0));
    let (dl, dc, dh) = (
        b[0] - a[0],
        c2 - c1,
        2.0 * (c1 * c2).sqrt() * (turn / 2.0).to_radians().sin(),
    );
    let (l, c) = ((a[0] + b[0]) / 2.0, (c1 + c2) / 2.0);
    let h = match (grey, (h1 - h2).abs() <= 180.0) {
        (true, _) => h1 + h2,
        (false, true) => (h1 + h2) / 2.0,
        (false, false) if h1 + h2 < 360.0 => (h1 + h2 + 360.0) / 2.0,
        (false, false) => (h1 + h2 - 360.0) / 2.0,
    };
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(h - 30.0) + 0.24 * cos(2.0 * h) + 0.32 * cos(3.0 * h + 6.0) - 0.2 * cos(4.0 * h - 63.0);
    let sl = 1.0 + 0.015 * (l - 50.0).powi(2) / (20.0 + (l - 50.0).powi(2)).sqrt();
    let (sc, sh) = (1.0 + 0.045 * c, 1.0 + 0.015 * c * t);
    let angle = 30.0 * (-((h - 275.0) / 25.0).powi(2)).exp();
    let rt = -2.0 * (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt() * (2.0 * angle).to_radians().sin();
    let (l, c, h) = (dl / sl, dc / sc, dh / sh);
    (l * l + c * c + h * h + rt * c * h).sqrt()
}

/// Test data of Sharma, Wu and Dalal: pairs 1, 7, 17, 25, 31 and 34.
#[test]
fn ciede2000_is_as_published() {
    for (a, b, right) in [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
        ([22.7233, 20.0904, -46.694], [23.0331, 14.973, -42.5619], 2.0373),
        ([2.0776, 0.0795, -1.135], [0.9033, -0.0636, -0.5514], 0.9082),
    ] {
        assert!(
            (ciede2000(a, b) - right).abs() < 1e-4,
            "{a:?} {b:?}: {}",
            ciede2000(a, b)
        );
    }
}

const SIDE: usize = 20;
const COLUMNS: usize = 8;

/// The ColorChecker's colours and 24 random ones.
fn patches() -> Vec<[u8; 3]> {
    let mut state = 59u32;
    let mut random = || {
        state = state.wrapping_mul(1664525).wrapping_add(1013904223);
        (state >> 24) as u8
    };
    let mut all = CHECKER.to_vec();
    all.extend((0..24).map(|_| [random(), random(), random()]));
    all
}

/// Writes patches in a grid as `rgb.png`, and flat depth in the middle of the volume.
fn write_patches(folder: &Folder, patches: &[[u8; 3]]) {
    let (width, height) = (SIDE * COLUMNS, SIDE * patches.len().div_ceil(COLUMNS));
    let picture = image::RgbImage::from_fn(width as u32, height as u32, |x, y| {
        image::Rgb(patches[y as usize / SIDE * COLUMNS + x as usize / SIDE])
    });
    picture.save(folder.path("rgb.png")).unwrap();
    let depth = image::GrayImage::from_pixel(width as u32, height as u32, image::Luma([128]));
    depth.save(folder.path("depth.png")).unwrap();
}

/// Returns the mean light of each laser in the middle of each patch: that of the levels behind the aperture.
fn light(path: &Path, count: usize) -> Vec<Vec<f64>> {
    let image = image::open(path).unwrap();
    let bytes = match &image {
        image::DynamicImage::ImageLuma8(grey) => grey.as_raw(),
        image::DynamicImage::ImageRgb8(rgb) => rgb.as_raw(),
        other => panic!("{:?}", other.color()),
    };
    let (width, height) = (image.width() as usize, image.height() as usize);
    let lasers = bytes.len() / (width * height);
    let scale = info(path)["scale"].as_f64().unwrap();
    let mut patches = vec![Vec::new(); count];
    for laser in 0..lasers {
        let field = Array2::from_shape_fn((height, width), |(y, x)| {
            let level = f64::from(bytes[(y * width + x) * lasers + laser]);
            Complex64::from_polar(scale, 2.0 * PI * level / 256.0)
        });
        let mut spectrum = fft2(&field, false);
        let frequency = |k: usize, n: usize| (if 2 * k < n { k as f64 } else { k as f64 - n as f64 }) / n as f64;
        for ((ky, kx), value) in spectrum.indexed_iter_mut() {
            if frequency(kx, width).hypot(frequency(ky, height)) > 0.5 {
                *value = Complex64::ZERO;
            }
        }
        let shown = fft2(&spectrum, true);
        for (i, patch) in patches.iter_mut().enumerate() {
            let (top, left) = (i / COLUMNS * SIDE, i % COLUMNS * SIDE);
            let inner = 5..SIDE - 5;
            let sum: f64 = (inner
                .clone()
                .flat_map(|y| inner.clone().map(move |x| (top + y, left + x))))
            .map(|at| shown[at].norm_sqr())
            .sum();
            patch.push(sum / (inner.len() * inner.len()) as f64);
        }
    }
    patches
}

/// Returns the JSON of the text chunk of a hologram.
fn info(path: &Path) -> Value {
    let reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).unwrap()));
    let reader = reader.read_info().unwrap();
    let chunks = &reader.info().uncompressed_latin1_text;
    let text = &chunks.iter().find(|chunk| chunk.keyword == "phasefront").unwrap().text;
    serde_json::from_str(text).unwrap()
}

fn summary(errors: &[f64]) -> (f64, f64) {
    let most = errors.iter().copied().fold(0.0, f64::max);
    (errors.iter().sum::<f64>() / errors.len() as f64, most)
}

fn hologram(folder: &Folder, more: &[&str]) {
    let call = ["hologram", "--rgb", "rgb.png", "--depth", "depth.png", "-o", "h.png"];
    folder.succeeds(&[&call[..], more].concat());
}

#[test]
fn written_levels_show_the_colours_of_the_picture() {
    let (folder, patches) = (Folder::new(), patches());
    write_patches(&folder, &patches);
    // Saturated colours of Display P3 leave a laser almost dark, where noise counts most, or lie outside.
    for (nm, encoding, to_xyz, limit) in [
        ([638, 520, 450], "srgb", SRGB, 4.0),
        ([633, 532, 457], "srgb", SRGB, 4.0),
        ([638, 532, 450], "srgb", SRGB, 4.0),
        ([640, 515, 445], "srgb", SRGB, 4.5),
        ([638, 520, 450], "display-p3", DISPLAY_P3, 8.0),
    ] {
        fs::write(folder.path("d.toml"), format!("wavelengths_nm = {nm:?}\n")).unwrap();
        let more = ["--display", "d.toml", "--method", "sweep", "--rgb-encoding", encoding];
        hologram(&folder, &more);
        let lasers = balanced(nm);
        let shown = light(&folder.path("h.png"), patches.len());
        let errors: Vec<f64> = (shown.iter().zip(&patches))
            .map(|(light, rgb)| {
                let xyz = times(&lasers, [light[0], light[1], light[2]]);
                let wanted = times(&to_xyz, rgb.map(|v| decoded(f64::from(v) / 255.0)));
                ciede2000(lab(xyz), lab(wanted))
            })
            .collect();
        let (mean, most) = summary(&errors);
        println!("{nm:?} {encoding}: CIEDE2000 mean {mean:.2}, max {most:.2}");
        assert!(
            mean <= 1.5 && most <= limit,
            "{nm:?} {encoding}: {mean} {most} {errors:?}"
        );
    }
}

/// The levels' own light as value, which is what `amplitude` shows, is not the picture's colour.
#[test]
fn amplitudes_show_other_colours_than_the_picture_has() {
    let (folder, patches) = (Folder::new(), patches());
    write_patches(&folder, &patches);
    hologram(&folder, &["--method", "sweep", "--rgb-encoding", "amplitude"]);
    let lasers = balanced([638, 520, 450]);
    let shown = light(&folder.path("h.png"), patches.len());
    let errors: Vec<f64> = (shown.iter().zip(&patches))
        .map(|(light, rgb)| ciede2000(lab(times(&lasers, [light[0], light[1], light[2]])), lab(srgb_xyz(*rgb))))
        .collect();
    let (mean, _) = summary(&errors);
    println!("amplitude: CIEDE2000 mean {mean:.2}");
    assert!(mean > 4.0, "{mean}");
    assert!(info(&folder.path("h.png")).get("srgb_of_light").is_none());
}

#[test]
fn one_laser_shows_the_luminance() {
    let (folder, patches) = (Folder::new(), patches());
    write_patches(&folder, &patches);
    fs::write(folder.path("one.toml"), "wavelengths_nm = [532]\n").unwrap();
    hologram(
        &folder,
        &["--display", "one.toml", "--method", "sweep", "--rgb-encoding", "srgb"],
    );
    let shown = light(&folder.path("h.png"), patches.len());
    for (light, rgb) in shown.iter().zip(&patches) {
        let grey = |y: f64| lab(D65.map(|v| y * v));
        let error = ciede2000(grey(light[0]), grey(srgb_xyz(*rgb)[1]));
        assert!(error < 1.0, "{rgb:?}: {error}");
    }
}

/// Views of the hologram show the picture's own values.
#[test]
fn views_turn_light_back_into_srgb() {
    let (folder, patches) = (Folder::new(), patches());
    write_patches(&folder, &patches);
    for toml in ["", "powers = [1, 1, 1]\n", "wavelengths_nm = [532]\n"] {
        fs::write(folder.path("d.toml"), toml).unwrap();
        hologram(
            &folder,
            &["--display", "d.toml", "--method", "sweep", "--rgb-encoding", "srgb"],
        );
        folder.succeeds(&["refocus", "h.png", "--z-mm", "0", "-o", "view.png"]);
        let view = image::open(folder.path("view.png")).unwrap().into_rgb8();
        for (i, rgb) in patches.iter().enumerate() {
            let (top, left) = (i / COLUMNS * SIDE, i % COLUMNS * SIDE);
            let mut mean = [0.0; 3];
            for y in 5..SIDE - 5 {
                for x in 5..SIDE - 5 {
                    let pixel = view.get_pixel((left + x) as u32, (top + y) as u32).0;
                    for c in 0..3 {
                        mean[c] += decoded(f64::from(pixel[c]) / 255.0) / 100.0;
                    }
                }
            }
            let (seen, wanted) = (times(&SRGB, mean), srgb_xyz(*rgb));
            let wanted = if toml.contains("532") {
                D65.map(|v| wanted[1] * v)
            } else {
                wanted
            };
            // What all lasers show at most is the brightest D65 that they mix.
            let error = ciede2000(lab(seen), lab(wanted));
            // Lasers of equal power show D65 with less of their range, so that the darkest colours have more noise.
            let limit = if toml.contains("powers") { 6.0 } else { 4.0 };
            assert!(error < limit, "{toml} {rgb:?}: {error} {mean:?}");
        }
    }
}

/// An ICC profile (version 2) of a matrix and a gamma, written by hand: `columns` are X, Y, Z of red, green and blue,
/// adapted to D50.
pub(crate) fn icc(columns: [Colour; 3], gamma: Option<f64>) -> Vec<u8> {
    let fixed = |v: f64| ((v * 65536.0).round() as i32).to_be_bytes();
    let xyz = |v: Colour| [b"XYZ \0\0\0\0".as_slice(), &v.map(fixed).concat()].concat();
    let curve = match gamma {
        Some(gamma) => [
            b"curv\0\0\0\0\0\0\0\x01".as_slice(),
            &((gamma * 256.0).round() as u16).to_be_bytes(),
            &[0, 0],
        ]
        .concat(),
        None => {
            let samples =
                (0..1024).flat_map(|i| ((decoded(f64::from(i) / 1023.0) * 65535.0).round() as u16).to_be_bytes());
            [b"curv\0\0\0\0\0\0\x04\0".to_vec(), samples.collect()].concat()
        }
    };
    let description = b"desc\0\0\0\0\0\0\0\x02x\0\0\0\0\0\0\0\0\0\0\0"
        .iter()
        .copied()
        .chain([0; 78])
        .collect::<Vec<u8>>();
    let tags: Vec<(&[u8; 4], Vec<u8>)> = vec![
        (b"desc", description),
        (b"wtpt", xyz([0.9642, 1.0, 0.8249])),
        (b"rXYZ", xyz(columns[0])),
        (b"gXYZ", xyz(columns[1])),
        (b"bXYZ", xyz(columns[2])),
        (b"rTRC", curve.clone()),
        (b"gTRC", curve.clone()),
        (b"bTRC", curve),
    ];
    let mut table = (tags.len() as u32).to_be_bytes().to_vec();
    let mut data = Vec::new();
    for (name, bytes) in &tags {
        let at = 128 + 4 + 12 * tags.len() + data.len();
        table.extend_from_slice(&name[..]);
        table.extend((at as u32).to_be_bytes());
        table.extend((bytes.len() as u32).to_be_bytes());
        data.extend(bytes);
        data.resize(data.len().next_multiple_of(4), 0);
    }
    let mut head = vec![0; 128];
    head[..4].copy_from_slice(&((132 + 12 * tags.len() + data.len()) as u32).to_be_bytes());
    head[8..12].copy_from_slice(&[2, 0x40, 0, 0]);
    head[12..16].copy_from_slice(b"mntr");
    head[16..20].copy_from_slice(b"RGB ");
    head[20..24].copy_from_slice(b"XYZ ");
    head[36..40].copy_from_slice(b"acsp");
    head[68..80].copy_from_slice(&[0.9642, 1.0, 0.8249].map(fixed).concat());
    [head, table, data].concat()
}

/// Display P3's and Adobe RGB's colorants as their profiles have them, adapted to D50.
pub(crate) const P3_COLORANTS: [Colour; 3] = [
    [0.51512, 0.2412, -0.00105],
    [0.29198, 0.69225, 0.04189],
    [0.1571, 0.06657, 0.78407],
];
const ADOBE_COLORANTS: [Colour; 3] = [
    [0.60974, 0.31111, 0.01947],
    [0.20528, 0.62567, 0.06087],
    [0.14919, 0.06322, 0.74457],
];

/// Writes the patches, one pixel each, as a PNG of 16 bits whose values are `values` of each patch's X, Y, Z, with
/// chunks.
fn write_png(path: &Path, values: impl Fn(Colour) -> Colour, profile: Option<Vec<u8>>, chunks: &[([u8; 4], Vec<u8>)]) {
    let patches = patches();
    let mut info = png::Info::with_size(patches.len() as u32, 1);
    (info.color_type, info.bit_depth) = (png::ColorType::Rgb, png::BitDepth::Sixteen);
    info.icc_profile = profile.map(Into::into);
    let mut writer = png::Encoder::with_info(fs::File::create(path).unwrap(), info)
        .unwrap()
        .write_header()
        .unwrap();
    for (name, data) in chunks {
        writer.write_chunk(png::chunk::ChunkType(*name), data).unwrap();
    }
    let pixels = patches.iter().flat_map(|rgb| values(srgb_xyz(*rgb)));
    let bytes: Vec<u8> = pixels
        .flat_map(|v| ((v.clamp(0.0, 1.0) * 65535.0).round() as u16).to_be_bytes())
        .collect();
    writer.write_image_data(&bytes).unwrap();
    writer.finish().unwrap();
}

/// Hybrid log-gamma for a screen of 1000 cd/m² where white is 203 cd/m² (BT.2100).
fn hlg(light: Colour) -> Colour {
    let light = light.map(|v| v.max(0.0) * 203.0 / 1000.0);
    let luminance = 0.2627 * light[0] + 0.678 * light[1] + 0.0593 * light[2];
    let gain = luminance.max(1e-12).powf((1.0 - 1.2) / 1.2);
    light.map(|v| {
        let scene = v * gain;
        if scene <= 1.0 / 12.0 {
            (3.0 * scene).sqrt()
        } else {
            0.17883277 * (12.0 * scene - 0.28466892).ln() + 0.55991073
        }
    })
}

/// Perceptual quantization where white is 203 cd/m² (SMPTE ST 2084).
fn pq(light: Colour) -> Colour {
    light.map(|v| {
        let y = (v.max(0.0) * 203.0 / 10000.0).powf(0.1593017578125);
        ((0.8359375 + 18.8515625 * y) / (1.0 + 18.6875 * y)).powf(78.84375)
    })
}

/// The same picture in every form shows the same colours.
#[test]
fn the_same_picture_in_every_form_shows_the_same() {
    let folder = Folder::new();
    let patches = patches();
    let srgb = |xyz: Colour| solved(&SRGB, xyz).map(|v| encoded(v.max(0.0)));
    let p3 = |xyz: Colour| solved(&DISPLAY_P3, xyz).map(|v| encoded(v.max(0.0)));
    let adobe = |xyz: Colour| solved(&ADOBE_RGB, xyz).map(|v| v.max(0.0).powf(256.0 / 563.0));
    let at = |name: &str| folder.path(name);
    write_png(&at("srgb.png"), srgb, None, &[]);
    write_png(&at("p3.png"), p3, Some(icc(P3_COLORANTS, None)), &[]);
    write_png(
        &at("adobe.png"),
        adobe,
        Some(icc(ADOBE_COLORANTS, Some(563.0 / 256.0))),
        &[],
    );
    write_png(&at("p3-cicp.png"), p3, None, &[(*b"cICP", vec![12, 13, 0, 1])]);
    let linear = (100000u32.to_be_bytes()).to_vec();
    write_png(&at("linear.png"), |xyz| solved(&SRGB, xyz), None, &[(*b"gAMA", linear)]);
    let wide = |xyz: Colour| solved(&BT2020, xyz);
    write_png(
        &at("hlg.png"),
        |xyz| hlg(wide(xyz)),
        None,
        &[(*b"cICP", vec![9, 18, 0, 1])],
    );
    write_png(
        &at("pq.png"),
        |xyz| pq(wide(xyz)),
        None,
        &[(*b"cICP", vec![9, 16, 0, 1])],
    );
    // JPEG has blocks: each patch is one of 16 by 16.
    let mut jpeg = image::codecs::jpeg::JpegEncoder::new_with_quality(fs::File::create(at("p3.jpg")).unwrap(), 100);
    image::ImageEncoder::set_icc_profile(&mut jpeg, icc(P3_COLORANTS, None)).unwrap();
    let blocks = image::RgbImage::from_fn(16 * patches.len() as u32, 16, |x, _| {
        image::Rgb(p3(srgb_xyz(patches[x as usize / 16])).map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8))
    });
    jpeg.encode_image(&blocks).unwrap();

    let lasers = balanced([638, 520, 450]);
    let display = phasefront::Display::default();
    for (name, encoding) in [
        ("srgb.png", RgbEncoding::Srgb),
        ("p3.png", RgbEncoding::DisplayP3),
        ("p3.jpg", RgbEncoding::DisplayP3),
        ("p3-cicp.png", RgbEncoding::DisplayP3),
        ("adobe.png", RgbEncoding::Bt2020),
        ("linear.png", RgbEncoding::Bt2020),
        ("hlg.png", RgbEncoding::Bt2020Hlg),
        ("pq.png", RgbEncoding::Bt2020Pq),
    ] {
        let (read, _) = colours::read(&at(name), None).unwrap();
        assert_eq!(read.encoding, encoding, "{name}");
        let (_, height, width) = read.rgb.dim();
        let frame = phasefront::RgbdFrame::new(read.rgb, Array2::zeros((height, width))).unwrap();
        let shown: Array3<f32> = frame.decoded(encoding, &display).rgb().to_owned();
        let step = width / patches.len();
        for (i, rgb) in patches.iter().enumerate() {
            let at = (height / 2, i * step + step / 2);
            let light = [0, 1, 2].map(|c| f64::from(shown[(c, at.0, at.1)]).powi(2));
            let error = ciede2000(lab(times(&lasers, light)), lab(srgb_xyz(*rgb)));
            assert!(error < 2.0, "{name}: {rgb:?} is {error} off");
        }
    }
    // The caller's word counts more than the file's.
    let asked = Some(RgbEncoding::Amplitude);
    assert_eq!(
        colours::read(&at("p3.png"), asked).unwrap().0.encoding,
        RgbEncoding::Amplitude
    );
}

/// Two even pictures differ by what CIEDE2000 says, whatever the encoding of each.
#[test]
fn compare_says_how_far_colours_are_apart() {
    let folder = Folder::new();
    let (one, other) = ([180, 120, 60], [170, 130, 75]);
    for (name, rgb) in [("one.png", one), ("other.png", other)] {
        image::RgbImage::from_pixel(24, 20, image::Rgb(rgb))
            .save(folder.path(name))
            .unwrap();
    }
    let compared =
        |a: &str, b: &str| -> Value { serde_json::from_str(&folder.succeeds(&["compare", a, b, "--json"])).unwrap() };
    let right = ciede2000(lab(srgb_xyz(one)), lab(srgb_xyz(other)));
    let found = compared("one.png", "other.png")["ciede2000"].as_f64().unwrap();
    assert!((found - right).abs() < 0.01, "{found} {right}");
    let p3 = |xyz: Colour| solved(&DISPLAY_P3, xyz).map(|v| encoded(v.max(0.0)));
    write_png(&folder.path("p3.png"), p3, Some(icc(P3_COLORANTS, None)), &[]);
    let srgb = |xyz: Colour| solved(&SRGB, xyz).map(|v| encoded(v.max(0.0)));
    write_png(&folder.path("srgb.png"), srgb, None, &[]);
    let same = compared("p3.png", "srgb.png");
    assert!(same["ciede2000"].as_f64().unwrap() < 0.3, "{same}");
    assert!(same["psnr_overall"].as_f64().unwrap() > 45.0, "{same}");
}

/// A hologram and its picture are compared in sRGB, or, of amplitudes, as amplitudes.
#[test]
fn a_hologram_is_compared_with_its_picture_as_it_is_seen() {
    let folder = Folder::new();
    write_patches(&folder, &patches());
    for (encoding, has_colours) in [("auto", true), ("amplitude", false)] {
        hologram(&folder, &["--method", "sweep", "--rgb-encoding", encoding]);
        let said = folder.succeeds(&["compare", "h.png", "rgb.png", "--z-mm", "0", "--json"]);
        let said: Value = serde_json::from_str(&said).unwrap();
        assert_eq!(
            said["ciede2000"].as_f64().is_some_and(|error| error < 4.0),
            has_colours,
            "{said}"
        );
        assert!(said["psnr_overall"].as_f64().unwrap() > 20.0, "{encoding}: {said}");
    }
}

/// A field is seen as its hologram was, by the `.json` beside it; light of which nothing is known, as it looks.
#[test]
fn encoded_fields_are_seen_in_their_colours() {
    let folder = Folder::new();
    write_patches(&folder, &patches());
    for (encoding, has_colours) in [("auto", true), ("amplitude", false)] {
        let more = ["--method", "sweep", "--rgb-encoding", encoding, "--complex", "f.npy"];
        hologram(&folder, &more);
        folder.succeeds(&["encode", "f.npy", "-o", "e.png"]);
        let matrix = |name: &str| info(&folder.path(name)).get("srgb_of_light").cloned();
        assert_eq!(matrix("e.png").is_some(), has_colours, "{encoding}");
        assert_eq!(matrix("e.png"), matrix("h.png"), "{encoding}");
        fs::copy(folder.path("f.npy"), folder.path("alone.npy")).unwrap();
        folder.succeeds(&["encode", "alone.npy", "-o", "e.png"]);
        assert!(matrix("e.png").is_some());
    }
}

/// A modulator of the catalogue says nothing of lasers, and the command says so once.
#[test]
fn an_unknown_white_is_told_once() {
    let folder = Folder::new();
    write_patches(&folder, &patches());
    let told = |more: &[&str]| {
        let output = folder.run(&[&SMALL_HOLOGRAM[..], &["-o", "h.png"], more].concat());
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stderr)
            .matches("says nothing of your lasers")
            .count()
    };
    assert_eq!(told(&["--display", "holoeye-leto"]), 1);
    assert_eq!(told(&["--display", "holoeye-leto", "--rgb-encoding", "amplitude"]), 0);
    assert_eq!(told(&[]), 0);
    fs::write(folder.path("d.toml"), "powers = [1.0, 0.7, 0.4]\n").unwrap();
    assert_eq!(told(&["--display", "d.toml"]), 0);
}

/// `judge` says how far the displayed colours are from those of the reference.
#[test]
fn judge_says_how_far_colours_are() {
    let folder = Folder::new();
    write_patches(&folder, &patches());
    for (encoding, has_colours) in [("auto", true), ("amplitude", false)] {
        let flags = ["--json", "--rgb-encoding", encoding];
        let said = folder.succeeds(&[&["judge"], &SMALL_HOLOGRAM[1..], &flags].concat());
        let said: Value = serde_json::from_str(&said).unwrap();
        for row in said["rows"].as_array().unwrap() {
            assert_eq!(
                row["ciede2000"].as_f64().is_some_and(|error| error < 5.0),
                has_colours,
                "{row}"
            );
        }
    }
}

/// A broken profile is sRGB, with a warning.
#[test]
fn a_profile_that_is_broken_is_said_and_taken_for_srgb() {
    let folder = Folder::new();
    let values = |xyz: Colour| solved(&SRGB, xyz).map(|v| encoded(v.max(0.0)));
    write_png(&folder.path("broken.png"), values, Some(b"no profile".to_vec()), &[]);
    let (read, _) = colours::read(&folder.path("broken.png"), None).unwrap();
    assert_eq!(read.encoding, RgbEncoding::Srgb);
}

/// Films say their colours by tags, which ffmpeg writes. The light of HDR films is mapped to that of their SDR twins.
#[test]
fn films_say_their_colours() {
    let folder = Folder::new();
    let mut raw = fs::File::create(folder.path("raw")).unwrap();
    raw.write_all(&[128; 3 * 64 * 64]).unwrap();
    for (primaries, transfer, matrix, encoding) in [
        ("bt709", "bt709", "bt709", RgbEncoding::Srgb),
        ("smpte432", "bt709", "bt709", RgbEncoding::DisplayP3),
        ("bt2020", "bt2020-10", "bt2020nc", RgbEncoding::Bt2020),
        ("bt2020", "arib-std-b67", "bt2020nc", RgbEncoding::Srgb),
        ("bt2020", "smpte2084", "bt2020nc", RgbEncoding::Srgb),
    ] {
        let path = folder.path("film.mp4");
        let made = Command::new("ffmpeg")
            .args([
                "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", "64x64", "-i",
            ])
            .arg(folder.path("raw"))
            .args(["-c:v", "libx264", "-pix_fmt", "yuv420p", "-color_primaries", primaries])
            .args(["-color_trc", transfer, "-colorspace", matrix])
            .arg(&path)
            .status();
        assert!(made.expect("ffmpeg runs: apt-get install ffmpeg").success());
        assert_eq!(film::about(&path).unwrap().encoding, encoding, "{primaries} {transfer}");
    }
}
