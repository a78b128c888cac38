//! Tests files as other programs write them: OpenEXR's and OpenCV's pictures of linear light, OpenCV's PFM and KITTI's
//! units. The files' numbers are those of the script's arrays in each comment.
use crate::folder::Folder;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ndarray::{Array2, Array3, array};
use phasefront_core::depth::DepthUnit;
use phasefront_io::frame::{self, DepthOptions};
use phasefront_io::picture::{colours, depth_map};

/// Halves of the pixels of [`light`], by OpenEXR 3.5 in Python.
const COLOUR_EXR: &str = "di8xAQIAAABjaGFubmVscwBjaGxpc3QANwAAAEIAAQAAAAAAAAABAAAAAQAAAEcAAQAAAAAAAAABAAAAAQAAAFIAAQAAAAAAAAAB\
    AAAAAQAAAABjb21wcmVzc2lvbgBjb21wcmVzc2lvbgABAAAAA2RhdGFXaW5kb3cAYm94MmkAEAAAAAAAAAAAAAAAAwAAAAEAAABk\
    aXNwbGF5V2luZG93AGJveDJpABAAAAAAAAAAAAAAAAMAAAABAAAAbGluZU9yZGVyAGxpbmVPcmRlcgABAAAAAHBpeGVsQXNwZWN0\
    UmF0aW8AZmxvYXQABAAAAAAAgD9zY3JlZW5XaW5kb3dDZW50ZXIAdjJmAAgAAAAAAAAAAAAAAHNjcmVlbldpbmRvd1dpZHRoAGZs\
    b2F0AAQAAAAAAIA/dHlwZQBzdHJpbmcADQAAAHNjYW5saW5laW1hZ2UAXgEAAAAAAAAAAAAALgAAAHheY4hc3tAAww0NM9NBJAhs\
    8tsQsMlvi8+mrhqPPQ0RK1z2tDg07OkAADckF8U=";
/// The same numbers with 32 bits, with the chromaticities of BT.2020.
const WIDE_EXR: &str = "di8xAQIAAABjaGFubmVscwBjaGxpc3QANwAAAEIAAgAAAAAAAAABAAAAAQAAAEcAAgAAAAAAAAABAAAAAQAAAFIAAgAAAAAAAAAB\
    AAAAAQAAAABjaHJvbWF0aWNpdGllcwBjaHJvbWF0aWNpdGllcwAgAAAAfT81PwaBlT57FC4+MQhMP90kBj5/ajw9NxqgPrByqD5j\
    b21wcmVzc2lvbgBjb21wcmVzc2lvbgABAAAAA2RhdGFXaW5kb3cAYm94MmkAEAAAAAAAAAAAAAAAAwAAAAEAAABkaXNwbGF5V2lu\
    ZG93AGJveDJpABAAAAAAAAAAAAAAAAMAAAABAAAAbGluZU9yZGVyAGxpbmVPcmRlcgABAAAAAHBpeGVsQXNwZWN0UmF0aW8AZmxv\
    YXQABAAAAAAAgD9zY3JlZW5XaW5kb3dDZW50ZXIAdjJmAAgAAAAAAAAAAAAAAHNjcmVlbldpbmRvd1dpZHRoAGZsb2F0AAQAAAAA\
    AIA/dHlwZQBzdHJpbmcADQAAAHNjYW5saW5laW1hZ2UAoAEAAAAAAAAAAAAAQgAAAHheY2gQ8FZtAAEwzcAAooEkEDAwMORP+Qti\
    Q/hgEYaGtROdGhr2OSHT+x33OzY0AMngFW4Q1gEHkPr9jgcAMK8lwQ==";
/// R, G, B and A of the same numbers, and Z from 0 to 7.
const BEAUTY_EXR: &str = "di8xAQIAAABjaGFubmVscwBjaGxpc3QAWwAAAEEAAgAAAAAAAAABAAAAAQAAAEIAAgAAAAAAAAABAAAAAQAAAEcAAgAAAAAAAAAB\
    AAAAAQAAAFIAAgAAAAAAAAABAAAAAQAAAFoAAgAAAAAAAAABAAAAAQAAAABjb21wcmVzc2lvbgBjb21wcmVzc2lvbgABAAAAA2Rh\
    dGFXaW5kb3cAYm94MmkAEAAAAAAAAAAAAAAAAwAAAAEAAABkaXNwbGF5V2luZG93AGJveDJpABAAAAAAAAAAAAAAAAMAAAABAAAA\
    bGluZU9yZGVyAGxpbmVPcmRlcgABAAAAAHBpeGVsQXNwZWN0UmF0aW8AZmxvYXQABAAAAAAAgD9zY3JlZW5XaW5kb3dDZW50ZXIA\
    djJmAAgAAAAAAAAAAAAAAHNjcmVlbldpbmRvd1dpZHRoAGZsb2F0AAQAAAAAAIA/dHlwZQBzdHJpbmcADQAAAHNjYW5saW5laW1h\
    Z2UAggEAAAAAAAAAAAAAVwAAAHheY4CBBgFv1QYQANMQPpAEAhB5wAGuDshnyJ/yF8IC6wCJAIHCA4cDCQv2O0Jgw9qJTg0N+5yQ\
    abB4w37HAw4HHODqgPz9wSvcYDIg8yAqwBAANa07wQ==";
/// The same numbers, by OpenCV 5.0.
const COLOUR_HDR: &str = "Iz9SQURJQU5DRQpGT1JNQVQ9MzItYml0X3JsZV9yZ2JlCgotWSAyICtYIDQKAAAAANvb236AAACBgEAggACAAIEAAICBgICAgYBA\
    AIM=";
/// Disparities in pixels, by OpenCV 5.0: 64 32 16 inf, 128 64 0 8.
const DISPARITY_PFM: &str = "UGYKNCAyCi0xCgAAAEMAAIBCAAAAAAAAAEEAAIBCAAAAQgAAgEEAAIB/";
/// 16 bits, by OpenCV 5.0: 256 512 0 2560, 25600 384 128 1.
const KITTI_PNG: &str = "iVBORw0KGgoAAAANSUhEUgAAAAQAAAACEAAAAAAKU/78AAAAGklEQVQIHWNkZGBk+MfAxcCYwjC34T8DQyMAG2wEDoIZRWsAAAAA\
    SUVORK5CYII=";

/// The units of [`KITTI_PNG`] with 65535 in the place of 1, by netpbm 11's pngtopnm, and as text by pnmtoplainpnm.
const WORDS_PGM: &str = "UDUKNCAyCjY1NTM1CgEAAgAAAAoAZAABgACA//8=";
const PLAIN_PGM: &str = "UDIKNCAyCjY1NTM1CjI1NiA1MTIgMCAyNTYwIAoyNTYwMCAzODQgMTI4IDY1NTM1IAo=";
/// The same modulo 251, by pngtopnm.
const BYTES_PGM: &str = "UDUKNCAyCjI1NQoFCgAy+YWAGA==";
/// 1.5 2.25 0 3, NaN 0.5 4 2 as depth beside an array rgb, by numpy.savez_compressed 2.4.
const COMPRESSED_NPZ: &str = "UEsDBC0AAAAIAAAAIQCrsNC3//////////8JABQAZGVwdGgubnB5AQAQAKAAAAAAAAAAXQAAAAAAAACb7BfqGxDJyFDGUK2eklqcXKRu\
    paBuk2airqOgnpZfVFKUmBefX5SSChJ3S8wpTgWKF2ckFqQC+RpGOgommjoKtQpkAy4GhgP2DAwCDgxg4ACkD9QDGUCxBpCYAwBQSwME\
    LQAAAAgAAAAhAHsore3//////////wcAFAByZ2IubnB5AQAQAJgAAAAAAAAATAAAAAAAAACb7BfqGxDJyFDGUK2eklqcXKRupaBeU2qo\
    rqOgnpZfVFKUmBefX5SSChJ3S8wpTgWKF2ckFqQC+RpGOgomOgrGmjoKtQrkAS4GHAAAUEsBAi0DLQAAAAgAAAAhAKuw0LddAAAAoAAA\
    AAkAAAAAAAAAAAAAAIABAAAAAGRlcHRoLm5weVBLAQItAy0AAAAIAAAAIQB7KK3tTAAAAJgAAAAHAAAAAAAAAAAAAACAAZgAAAByZ2Iu\
    bnB5UEsFBgAAAAACAAIAbAAAAB0BAAAAAA==";
/// The same in 64 bits, without a name, by numpy.savez 2.4.
const LONE_NPZ: &str = "UEsDBC0AAAAAAAAAIQDPBrtj//////////8JABQAYXJyXzAubnB5AQAQAMAAAAAAAAAAwAAAAAAAAACTTlVNUFkBAHYAeydkZXNjcic6\
    ICc8ZjgnLCAnZm9ydHJhbl9vcmRlcic6IEZhbHNlLCAnc2hhcGUnOiAoMiwgNCksIH0gICAgICAgICAgICAgICAgICAgICAgICAgICAg\
    ICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgCgAAAAAAAPg/AAAAAAAAAkAAAAAAAAAAAAAAAAAAAAhAAAAAAAAA+H8AAAAAAADg\
    PwAAAAAAABBAAAAAAAAAAEBQSwECLQMtAAAAAAAAACEAzwa7Y8AAAADAAAAACQAAAAAAAAAAAAAAgAEAAAAAYXJyXzAubnB5UEsFBgAA\
    AAABAAEANwAAAPsAAAAAAA==";
/// The same in 16 bits as (1, 1, 2, 4), as networks give it, by numpy.save 2.4.
const NETWORK_NPY: &str = "k05VTVBZAQB2AHsnZGVzY3InOiAnPGYyJywgJ2ZvcnRyYW5fb3JkZXInOiBGYWxzZSwgJ3NoYXBlJzogKDEsIDEsIDIsIDQpLCB9ICAg\
    ICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgIAoAPoBAAAAAQgB+ADgARABA";

/// The pixels of the pictures, (3, 2, 4): linear light.
fn light() -> Array3<f32> {
    let pixels: [[f32; 3]; 8] = [
        [0.0, 0.0, 0.0],
        [0.214041, 0.214041, 0.214041],
        [1.0, 0.0, 0.0],
        [0.5, 0.25, 0.125],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
        [4.0, 2.0, 0.001],
    ];
    Array3::from_shape_fn((3, 2, 4), |(c, y, x)| pixels[4 * y + x][c])
}

fn written(folder: &Folder, name: &str, file: &str) {
    std::fs::write(folder.path(name), STANDARD.decode(file).unwrap()).unwrap();
}

/// Returns the light of the file in linear sRGB.
fn linear(folder: &Folder, name: &str) -> Array3<f32> {
    let (read, _) = colours::read(&folder.path(name), None).unwrap();
    read.linear_srgb().unwrap()
}

fn most_apart(a: &Array3<f32>, b: &Array3<f32>) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn linear_light_of_other_programs_is_read_as_light() {
    let folder = Folder::new();
    for (name, file, least) in [
        ("colour.exr", COLOUR_EXR, 2e-3),
        ("beauty.exr", BEAUTY_EXR, 2e-3),
        // The three colours of a pixel share their exponent: 8 bits of the largest.
        ("colour.hdr", COLOUR_HDR, 6e-3),
    ] {
        written(&folder, name, file);
        let apart = most_apart(&linear(&folder, name), &light().mapv(|v| v.min(1.0)));
        assert!(apart < least, "{name}: {apart}");
    }
    // Red, green and blue of BT.2020 lie outside sRGB, and its grey is sRGB's.
    written(&folder, "wide.exr", WIDE_EXR);
    let wide = linear(&folder, "wide.exr");
    // ITU-R BT.2087: the matrix from linear BT.2020 to linear BT.709, of the pixel 0.5 0.25 0.125.
    let want = [
        0.5 * 1.6605 - 0.25 * 0.5876 - 0.125 * 0.0728,
        -0.5 * 0.1246 + 0.25 * 1.1329 - 0.125 * 0.0083,
        -0.5 * 0.0182 - 0.25 * 0.1006 + 0.125 * 1.1187,
    ];
    for (c, want) in want.into_iter().enumerate() {
        assert!((wide[(c, 0, 3)] - want).abs() < 2e-3, "{c}: {} {want}", wide[(c, 0, 3)]);
        assert!((wide[(c, 0, 1)] - 0.214).abs() < 2e-3 && wide[(c, 0, 2)] == [1.0, 0.0, 0.0][c]);
    }
}

#[test]
fn a_command_takes_a_renderers_file_for_colour_and_depth() {
    let folder = Folder::new();
    written(&folder, "beauty.exr", BEAUTY_EXR);
    let arguments = [
        "--rgb",
        "beauty.exr",
        "--depth",
        "beauty.exr",
        "--depth-unit",
        "m",
        "-o",
        "h.png",
    ];
    let output = folder.run(&[&["hologram"], &arguments[..]].concat());
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.success() && errors.contains("12.5 % of its pixels are brighter"),
        "{errors}"
    );
    // A broken file and one of numbers without colours are refused in one line.
    let whole = STANDARD.decode(COLOUR_EXR).unwrap();
    for end in [40, 200, whole.len() - 9] {
        std::fs::write(folder.path("cut.exr"), &whole[..end]).unwrap();
        assert!(colours::read(&folder.path("cut.exr"), None).is_err());
    }
    written(&folder, "cut.hdr", &COLOUR_HDR[..68]);
    assert!(colours::read(&folder.path("cut.hdr"), None).is_err());
}

#[test]
fn kittis_unit_is_a_256th_of_a_metre() {
    let folder = Folder::new();
    written(&folder, "kitti.png", KITTI_PNG);
    let depth = depth_map::read_depth(&folder.path("kitti.png"), false).unwrap();
    assert_eq!(depth[(0, 3)], 2560.0);
    image::RgbImage::from_pixel(4, 2, image::Rgb([90, 120, 30]))
        .save(folder.path("rgb.png"))
        .unwrap();
    let arguments = [
        "--rgb",
        "rgb.png",
        "--depth",
        "kitti.png",
        "--depth-unit",
        "kitti",
        "--near",
        "1",
        "--far",
        "100",
    ];
    let output = folder.succeeds(&[&["hologram"], &arguments[..], &["-o", "k.png"]].concat());
    // One of eight pixels is 0, which is no reading; the others lie from 1/256 m to 100 m.
    assert!(output.contains("from 1.000 m to 100.000 m, 12.5 %"), "{output}");
    folder.succeeds(&[&["hologram"], &arguments[..6], &["--json", "-o", "k2.png"]].concat());
    let same = [
        "--rgb",
        "rgb.png",
        "--depth",
        "kitti.png",
        "--depth-unit",
        "raw",
        "--depth-scale",
        "256",
        "-o",
        "r.png",
    ];
    folder.succeeds(&[&["hologram"], &same[..]].concat());
    let pixels = |name: &str| image::open(folder.path(name)).unwrap().into_rgb8().into_raw();
    assert_eq!(pixels("k2.png"), pixels("r.png"));
}

/// Middlebury 2014: z = baseline · f / (d + doffs), with the baseline in millimetres.
#[test]
fn middleburys_calibration_makes_pixels_distances() {
    let folder = Folder::new();
    written(&folder, "disp0.pfm", DISPARITY_PFM);
    image::RgbImage::from_pixel(4, 2, image::Rgb([90, 120, 30]))
        .save(folder.path("rgb.png"))
        .unwrap();
    let read = |folder: &Folder| {
        let options = DepthOptions {
            unit: DepthUnit::Disparity,
            near_m: Some(1.0),
            far_m: Some(10.0),
            inverted: false,
        };
        frame::read(&folder.path("rgb.png"), &folder.path("disp0.pfm"), options, None)
    };
    let metres = |d: f32| 0.2 * 1000.0 / (d + 16.0);
    let calibration = "cam0=[1000 0 2; 0 1000 1; 0 0 1]\ncam1=[1000 0 18; 0 1000 1; 0 0 1]\ndoffs=16\nbaseline=200\n\
                       width=4\nheight=2\nndisp=130\nisint=0\n";
    std::fs::write(folder.path("calib.txt"), calibration).unwrap();
    let found = read(&folder).unwrap().depth;
    let of = |d: f32| ((metres(d) - 1.0) / 9.0).clamp(0.0, 1.0);
    let want: Array2<f32> = array![
        [of(64.0), of(32.0), of(16.0), f32::NAN],
        [of(128.0), of(64.0), f32::NAN, of(8.0)]
    ];
    for (found, want) in found.iter().zip(&want) {
        assert!(
            (found - want).abs() < 1e-5 || (found.is_nan() && want.is_nan()),
            "{found} {want}"
        );
    }
    // The calibration of another size would make other distances.
    std::fs::write(folder.path("calib.txt"), calibration.replace("width=4", "width=8")).unwrap();
    let refused = read(&folder).unwrap_err().to_string();
    assert!(
        refused.contains("calib.txt") && refused.lines().count() == 1,
        "{refused}"
    );
    // Another file of this name is none of it, and the numbers are inverse metres.
    std::fs::write(folder.path("calib.txt"), "K: 1 0 0\n").unwrap();
    assert_ne!(read(&folder).unwrap().depth[(0, 0)], found[(0, 0)]);
}

#[test]
fn depth_of_netpbm_and_numpy_is_read() {
    let folder = Folder::new();
    let none = f32::NAN;
    let words = array![[256.0, 512.0, 0.0, 2560.0], [25600.0, 384.0, 128.0, none]];
    let bytes = array![[5.0, 10.0, 0.0, 50.0], [249.0, 133.0, 128.0, 24.0]];
    let metres = array![[1.5, 2.25, 0.0, 3.0], [none, 0.5, 4.0, 2.0]];
    for (name, file, want) in [
        ("words.pgm", WORDS_PGM, &words),
        ("plain.pgm", PLAIN_PGM, &words),
        ("bytes.pgm", BYTES_PGM, &bytes),
        ("compressed.npz", COMPRESSED_NPZ, &metres),
        ("lone.npz", LONE_NPZ, &metres),
        ("network.npy", NETWORK_NPY, &metres),
    ] {
        written(&folder, name, file);
        let found = depth_map::read_depth(&folder.path(name), false).unwrap();
        assert_eq!(found.dim(), want.dim(), "{name}");
        for (found, want) in found.iter().zip(want) {
            assert!(
                found == want || found.is_nan() && want.is_nan(),
                "{name}: {found} {want}"
            );
        }
    }
}

/// Folders of `hologram` and `video` take the colour that a single picture may have.
#[test]
fn folders_hold_linear_colour() {
    let folder = Folder::new();
    for name in ["rgb", "depth", "scan"] {
        std::fs::create_dir(folder.path(name)).unwrap();
    }
    let depth = image::ImageBuffer::from_fn(4, 2, |x, y| image::Luma([(4000 * (1 + x) + 9000 * y) as u16]));
    for (name, ending, file) in [("a", "exr", COLOUR_EXR), ("b", "hdr", COLOUR_HDR)] {
        written(&folder, &format!("rgb/{name}.{ending}"), file);
        depth.save(folder.path(&format!("depth/{name}.png"))).unwrap();
        folder.succeeds(&[
            "hologram",
            "--rgb",
            &format!("rgb/{name}.{ending}"),
            "--depth",
            &format!("depth/{name}.png"),
            "-o",
            &format!("{name}.png"),
        ]);
    }
    folder.succeeds(&["hologram", "--rgb", "rgb", "--depth", "depth", "-o", "made"]);
    let pixels = |name: &str| image::open(folder.path(name)).unwrap().into_rgb8().into_raw();
    for name in ["a.png", "b.png"] {
        assert_eq!(pixels(&format!("made/{name}")), pixels(name), "{name}");
    }
    for index in 0..2 {
        written(&folder, &format!("scan/color_{index}.exr"), COLOUR_EXR);
        depth.save(folder.path(&format!("scan/depth_{index}.png"))).unwrap();
    }
    folder.succeeds(&["video", "scan", "-o", "frames"]);
    assert!(folder.path("frames/phase_000001.png").is_file());
}
