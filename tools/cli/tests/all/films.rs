//! Tests films as cameras and depth programs write them: of varying frame rate, in high dynamic range, with false
//! colours for depth, and with a margin between colour and depth. All need ffmpeg: apt-get install ffmpeg.
use crate::colours::{ciede2000, lab, srgb_xyz};
use crate::folder::Folder;
use crate::video::film;
use image::{ImageBuffer, Luma, Rgb, RgbImage};
use phasefront_io::film::{self, Film, Pixels};
use std::path::Path;
use std::process::Command;

const WIDTH: u32 = 48;
const HEIGHT: u32 = 32;
/// Codecs that keep every bit.
const LOSSLESS: [&str; 4] = ["-c:v", "ffv1", "-pix_fmt", "gbrp"];
const LOSSLESS_GREY: [&str; 4] = ["-c:v", "ffv1", "-pix_fmt", "gray16le"];

fn colour(index: u32) -> RgbImage {
    RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        Rgb([
            5 * x as u8,
            8 * y as u8,
            if (x + 4 * index) % 16 < 8 { 200 } else { 40 },
        ])
    })
}

/// Returns depth that rises from left to right, with a step that moves.
fn depth(index: u32) -> ImageBuffer<Luma<u16>, Vec<u16>> {
    ImageBuffer::from_fn(WIDTH, HEIGHT, |x, _| match x {
        x if (4 * index..4 * index + 10).contains(&x) => Luma([30 * 257]),
        x => Luma([(120 + 2 * x as u16) * 257]),
    })
}

/// Returns a depth in the colours of a rainbow, as programs show it.
fn false_colours(index: u32) -> RgbImage {
    let depth = depth(index);
    RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        let d = (depth.get_pixel(x, y).0[0] / 257) as u8;
        Rgb([d, 255 - d.abs_diff(128), 255 - d])
    })
}

/// Creates a folder `in` with `frames` numbered frames.
fn frames(frames: u32) -> Folder {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("in")).unwrap();
    for index in 0..frames {
        colour(index)
            .save(folder.path(&format!("in/color_{index}.png")))
            .unwrap();
        depth(index)
            .save(folder.path(&format!("in/depth_{index}.png")))
            .unwrap();
    }
    folder
}

impl Folder {
    /// Makes the film `name` of the folder's pictures of `kind` at 30 pictures a second.
    fn film(&self, kind: &str, name: &str, codec: &[&str]) {
        let pictures = self.path(&format!("in/{kind}_%d.png"));
        film(&["-framerate", "30"], &pictures, &self.path(name), codec);
    }

    /// Runs ffmpeg in this folder.
    fn ffmpeg(&self, arguments: &[&str]) {
        let status = Command::new("ffmpeg")
            .args(["-v", "error", "-y"])
            .args(arguments)
            .current_dir(self.0.path())
            .status();
        assert!(
            status.expect("ffmpeg runs: apt-get install ffmpeg").success(),
            "{arguments:?}"
        );
    }
}

#[test]
#[ignore = "slow: 15 seconds of a core"]
fn picture_n_of_a_film_of_varying_rate_has_depth_n() {
    let folder = frames(12);
    // Pictures 0, 1, 2, 3, 8, 9, 11 at their times of 30 pictures a second, as a phone in dim light gives them.
    let kept = [0u32, 1, 2, 3, 8, 9, 11];
    let select = "select='lt(n,4)+eq(n,8)+eq(n,9)+eq(n,11)'";
    let vary = |codec: &[&'static str]| [&["-vf", select, "-fps_mode", "vfr"][..], codec].concat();
    folder.film("color", "vary.mkv", &vary(&LOSSLESS));
    folder.film("color", "vary.mp4", &vary(&["-c:v", "libx264rgb", "-qp", "0"]));
    std::fs::create_dir(folder.path("kept")).unwrap();
    for (at, index) in kept.iter().enumerate() {
        for kind in ["color", "depth"] {
            let from = folder.path(&format!("in/{kind}_{index}.png"));
            std::fs::copy(from, folder.path(&format!("kept/{kind}_{at}.png"))).unwrap();
        }
    }
    // The depth has a constant rate, as a program that estimates it picture by picture writes it.
    film(
        &["-framerate", "24"],
        &folder.path("kept/depth_%d.png"),
        &folder.path("depth.mkv"),
        &LOSSLESS_GREY,
    );
    for name in ["vary.mkv", "vary.mp4"] {
        let about = film::about(&folder.path(name)).unwrap();
        // The last picture begins at 11/30 s and lasts 1/30 s, or as long as pictures do in the mean.
        let length = about.frames as f64 / about.rate_hz;
        assert_eq!(about.frames, 7);
        assert!((0.39..0.45).contains(&length), "{name}: {length}");
        let out = name.replace('.', "-");
        folder.video(name, &out, &["--depth-video", "depth.mkv", "--rate", "30"]);
        folder.video("kept", &format!("{out}-files"), &[]);
        let made = folder.holograms(&out);
        assert!(
            made.len() == 7 && made == folder.holograms(&format!("{out}-files")),
            "{name}"
        );
        // A film of the previews is as long as the film of the colour.
        folder.video(name, &format!("{out}-seen.mp4"), &["--depth-video", "depth.mkv"]);
        let seen = film::about(&folder.path(&format!("{out}-seen.mp4"))).unwrap();
        assert_eq!(seen.frames, 7);
        assert!(
            (seen.frames as f64 / seen.rate_hz - length).abs() < 0.01,
            "{name}: {seen:?}"
        );
    }
}

#[test]
fn depth_in_false_colours_is_refused_as_stills_are() {
    let folder = frames(3);
    for index in 0..3 {
        false_colours(index)
            .save(folder.path(&format!("in/false_{index}.png")))
            .unwrap();
    }
    let still = [
        "hologram",
        "--rgb",
        "in/color_0.png",
        "--depth",
        "in/false_0.png",
        "-o",
        "h.png",
    ];
    assert!(folder.fails(&still, 1).contains("false colours"));
    folder.film("color", "colour.mkv", &LOSSLESS);
    folder.film("false", "false.mp4", &["-c:v", "libx264", "-pix_fmt", "yuv420p"]);
    folder.film(
        "depth",
        "grey.mp4",
        &["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "35"],
    );
    for (name, depth) in [("false-beside.mkv", "false.mp4"), ("grey-beside.mkv", "grey.mp4")] {
        let beside = [
            "-filter_complex",
            "[0]format=gbrp[a];[1]format=gbrp[b];[a][b]hstack",
            "-frames:v",
            "3",
            "-c:v",
            "ffv1",
            name,
        ];
        folder.ffmpeg(&[&["-i", "colour.mkv", "-i", depth], &beside[..]].concat());
    }
    for (flags, name) in [
        (&["colour.mkv", "--depth-video", "false.mp4"][..], "false.mp4"),
        (&["false-beside.mkv", "--depth-beside"], "false-beside.mkv"),
    ] {
        let errors = folder.fails(&[&["video"], flags, &["-o", "out"]].concat(), 1);
        assert!(
            errors.lines().count() == 1 && errors.contains(name) && errors.contains("false colours"),
            "{errors}"
        );
        assert!(!folder.path("out").exists());
    }
    folder.video("colour.mkv", "grey", &["--depth-video", "grey.mp4"]);
    folder.video("grey-beside.mkv", "beside", &["--depth-beside"]);
    assert_eq!(
        (folder.holograms("grey").len(), folder.holograms("beside").len()),
        (3, 3)
    );
}

#[test]
#[ignore = "slow: 10 seconds of a core"]
fn a_margin_between_colour_and_depth_is_cut() {
    let folder = frames(3);
    folder.film("color", "colour.mkv", &LOSSLESS);
    folder.film("depth", "depth.mkv", &LOSSLESS);
    let beside = |name: &str, pad: &str, codec: &[&str]| {
        let parts = format!("[0]format=gbrp{pad}[a];[1]format=gbrp[b];[a][b]hstack");
        folder.ffmpeg(
            &[
                &["-i", "colour.mkv", "-i", "depth.mkv", "-filter_complex", &parts],
                codec,
                &[name],
            ]
            .concat(),
        );
    };
    beside("plain.mkv", "", &["-c:v", "ffv1"]);
    assert_eq!(folder.video("plain.mkv", "plain", &["--depth-beside"]), "");
    let made = folder.holograms("plain");
    for (name, pad, width) in [
        ("a.mkv", "pad=iw+50:ih:0:0:white", "50"),
        ("b.mkv", "pad=iw+7:ih:0:0:black", "7"),
    ] {
        beside(name, &format!(",{pad}"), &["-c:v", "ffv1"]);
        let told = folder.video(name, &format!("{name}-out"), &["--depth-beside"]);
        assert!(
            told.lines().count() == 1 && told.contains(&format!("the {width} columns")),
            "{told}"
        );
        assert!(folder.holograms(&format!("{name}-out")) == made, "{name}");
    }
    // Where a codec blurs its edges, the margin is found all the same.
    beside(
        "lossy.mp4",
        ",pad=iw+50:ih:0:0:white",
        &["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "30"],
    );
    let told = folder.video("lossy.mp4", "lossy", &["--depth-beside"]);
    assert!(told.contains("the 50 columns"), "{told}");
    // Depth of another field of view is no depth of a film.
    let errors = folder.fails(&["video", "colour.mkv", "--depth-video", "plain.mkv", "-o", "no"], 1);
    assert!(
        errors.contains("false colours") || errors.contains("aspect"),
        "{errors}"
    );
}

/// Returns the signal of hybrid log-gamma for light of a display of 1000 cd/m², BT.2020 primaries, by ITU-R BT.2100.
fn hlg(nits: [f64; 3]) -> [f64; 3] {
    let [r, g, b] = nits.map(|l| l / 1000.0);
    let luminance = 0.2627 * r + 0.6780 * g + 0.0593 * b;
    let scene = luminance.max(1e-9).powf((1.0 - 1.2) / 1.2);
    [r, g, b].map(|l| {
        let e = l * scene;
        let (a, b, c) = (0.17883277, 0.28466892, 0.55991073);
        if e <= 1.0 / 12.0 {
            (3.0 * e).sqrt()
        } else {
            a * (12.0 * e - b).ln() + c
        }
    })
}

/// Returns the signal of the perceptual quantizer for light, by ITU-R BT.2100.
fn pq(nits: [f64; 3]) -> [f64; 3] {
    nits.map(|l| {
        let y = (l / 10_000.0).powf(2610.0 / 16384.0);
        let (c1, c2, c3) = (3424.0 / 4096.0, 2413.0 / 4096.0 * 32.0, 2392.0 / 4096.0 * 32.0);
        ((c1 + c2 * y) / (1.0 + c3 * y)).powf(2523.0 / 4096.0 * 128.0)
    })
}

/// Returns the light of an SDR picture's pixel whose white has `white` cd/m², in BT.2020 primaries (ITU-R BT.2087), by
/// the display of ITU-R BT.1886.
fn light(pixel: [u8; 3], white: f64) -> [f64; 3] {
    let [r, g, b] = pixel.map(|v| white * (f64::from(v) / 255.0).powf(2.4));
    [
        0.6274 * r + 0.3293 * g + 0.0433 * b,
        0.0691 * r + 0.9195 * g + 0.0114 * b,
        0.0164 * r + 0.0880 * g + 0.8956 * b,
    ]
}

/// Returns a picture with some white. ffmpeg's zscale takes each channel of hybrid log-gamma for itself, which is exact
/// for `grey` alone.
fn scene(grey: bool) -> RgbImage {
    RgbImage::from_fn(WIDTH, HEIGHT, |x, y| match x {
        0..8 => Rgb([255; 3]),
        _ if grey => Rgb([(4 * x + 2 * y) as u8; 3]),
        _ => Rgb([5 * x as u8, 8 * y as u8, 60 + 3 * y as u8]),
    })
}

/// Writes a lossless HDR film of one picture of this light.
fn hdr_film(path: &Path, transfer: &str, signal: impl Fn(u32, u32) -> [f64; 3]) {
    let words = ImageBuffer::<Rgb<u16>, Vec<u16>>::from_fn(WIDTH, HEIGHT, |x, y| {
        Rgb(signal(x, y).map(|v| (v.clamp(0.0, 1.0) * 65535.0).round() as u16))
    });
    let picture = path.with_extension("png");
    words.save(&picture).unwrap();
    let tags = [
        "-color_primaries",
        "bt2020",
        "-color_trc",
        transfer,
        "-colorspace",
        "rgb",
    ];
    film(
        &["-framerate", "10"],
        &picture,
        path,
        &[&["-c:v", "ffv1", "-pix_fmt", "gbrp16le"], &tags[..]].concat(),
    );
}

fn first_picture(path: &Path) -> RgbImage {
    let about = film::about(path);
    let mut film = Film::open(path, Pixels::Rgb, about.as_ref()).unwrap();
    let picture = film.read().unwrap().unwrap();
    RgbImage::from_raw(WIDTH, HEIGHT, picture.bytes).unwrap()
}

#[test]
#[ignore = "slow: 15 seconds of a core"]
fn films_of_high_dynamic_range_show_what_their_sdr_twins_show() {
    let folder = Folder::new();
    for (name, transfer) in [("hlg.mkv", "arib-std-b67"), ("pq.mkv", "smpte2084")] {
        let path = folder.path(name);
        let sdr = scene(name == "hlg.mkv");
        let at = |x, y| sdr.get_pixel(x, y).0;
        let signal = if name == "pq.mkv" { pq } else { hlg };
        // SDR's light as it is, and with white at the reference white of HDR.
        for white in [100.0, 203.0] {
            hdr_film(&path, transfer, |x, y| signal(light(at(x, y), white)));
            let seen = first_picture(&path);
            let apart = sdr.iter().zip(seen.iter()).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(apart.unwrap() <= 4, "{name}, white of {white}: {apart:?}");
            let colour = |pixel: &Rgb<u8>| lab(srgb_xyz(pixel.0));
            let errors = sdr
                .pixels()
                .zip(seen.pixels())
                .map(|(a, b)| ciede2000(colour(a), colour(b)));
            let most = errors.fold(0.0, f64::max);
            println!("{name}, white of {white}: CIEDE2000 at most {most:.2}");
            assert!(most < 2.0, "{name}, white of {white}: {most}");
        }
        // Highlights of a scene keep their order, and its white stays near white.
        hdr_film(&path, transfer, |x, y| match x {
            40.. => signal([110.0 * f64::from(x - 39); 3]),
            _ => signal(light(at(x, y), 203.0)),
        });
        let seen = first_picture(&path);
        let row: Vec<u8> = (40..WIDTH).map(|x| seen.get_pixel(x, 5).0[1]).collect();
        assert!(row.is_sorted() && row[0] < row[7] && row[7] > 250, "{name}: {row:?}");
        assert!(
            (225..255).contains(&seen.get_pixel(2, 5).0[1]),
            "{name}: {:?}",
            seen.get_pixel(2, 5)
        );
        let grey = [at(20, 10), seen.get_pixel(20, 10).0];
        assert!(
            grey[0].iter().zip(grey[1]).all(|(a, b)| a.abs_diff(b) <= 8),
            "{name}: {grey:?}"
        );
    }
}
