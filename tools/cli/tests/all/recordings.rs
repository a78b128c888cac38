//! Tests folders of frames as people record them: with other files beside the frames, without some frames, in every
//! unit. `video` reads a frame as `hologram` reads a still.
use crate::folder::Folder;
use crate::inputs::jpeg;
use phasefront_io::hologram::{self, Hologram};
use serde_json::Value;
use std::fs;

const WIDTH: u32 = 48;
const HEIGHT: u32 = 32;

type Grey16 = image::ImageBuffer<image::Luma<u16>, Vec<u16>>;

fn colour(index: u32) -> image::RgbImage {
    image::RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        image::Rgb([5 * x as u8, 8 * y as u8, 60 + 30 * index as u8])
    })
}

/// Returns a plane whose depth rises from left to right, without 0.
fn normalized(index: u32) -> Grey16 {
    Grey16::from_fn(WIDTH, HEIGHT, |x, _| {
        image::Luma([(1300 * (x + 1) + 500 * index) as u16])
    })
}

fn millimetres(index: u32) -> Grey16 {
    Grey16::from_fn(WIDTH, HEIGHT, |x, _| image::Luma([(600 + 40 * x + 10 * index) as u16]))
}

impl Folder {
    /// Writes the frames 0, 1 and 2 to the paths that `name` gives for a kind and a number.
    fn with_frames(self, depth: fn(u32) -> Grey16, name: impl Fn(&str, u32) -> String) -> Self {
        for index in 0..3 {
            let [rgb, deep] = ["color", "depth"].map(|kind| self.path(&name(kind, index)));
            for path in [&rgb, &deep] {
                fs::create_dir_all(path.parent().unwrap()).unwrap();
            }
            colour(index).save(rgb).unwrap();
            depth(index).save(deep).unwrap();
        }
        self
    }

    /// Runs `video` by the sweep with `flags` into the folder `output`, and returns its errors.
    pub(crate) fn video(&self, input: &str, output: &str, flags: &[&str]) -> String {
        let call = ["video", input, "--method", "sweep", "-o", output];
        let output = self.run(&[&call[..], flags].concat());
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{input} {flags:?}: {errors}");
        errors
    }

    /// Returns the holograms of an output folder.
    pub(crate) fn holograms(&self, output: &str) -> Vec<Hologram> {
        let path = |index: u32| self.path(&format!("{output}/phase_{index:06}.png"));
        let paths = (0..).map(path).take_while(|path| path.exists());
        paths.map(|path| hologram::read_hologram(&path).unwrap()).collect()
    }

    fn request(&self, output: &str) -> Value {
        serde_json::from_slice(&fs::read(self.path(output).join("request.json")).unwrap()).unwrap()
    }
}

/// Returns the names of numbered files in one folder.
fn flat(kind: &str, index: u32) -> String {
    format!("in/{kind}_{index}.png")
}

/// Returns the names of a scan in two folders.
fn scan(kind: &str, index: u32) -> String {
    let kind = if kind == "color" { "rgb" } else { kind };
    format!("scan/{kind}/{index:05}.png")
}

#[test]
fn the_unit_that_is_said_is_taken_in_every_layout() {
    let folder = Folder::new()
        .with_frames(normalized, flat)
        .with_frames(normalized, scan);
    for (flags, name) in [(&[][..], "far"), (&["--invert"], "near")] {
        let flags = [&["--depth-unit", "normalized"], flags].concat();
        let [a, b] = ["flat", "scan"].map(|layout| format!("{layout}-{name}"));
        assert_eq!(folder.video("in", &a, &flags), "");
        assert_eq!(folder.video("scan", &b, &flags), "");
        let made = folder.holograms(&a);
        assert!(made.len() == 3 && made == folder.holograms(&b), "{name}");
        assert_eq!(folder.request(&b)["--depth-unit"], "normalized");
    }
    // Such a scan has millimetres if nothing is said, and the request says so.
    folder.video("scan", "mm", &[]);
    assert!(folder.holograms("mm") != folder.holograms("scan-far"));
    assert_eq!(folder.request("mm")["--depth-unit"], "mm");
    folder.video("in", "as-mm", &["--depth-unit", "mm"]);
    assert!(folder.holograms("mm") == folder.holograms("as-mm"));
}

#[test]
fn video_doubts_what_a_hologram_doubts() {
    let folder = Folder::new();
    let doubt = |errors: &str| -> Vec<String> {
        let after_the_name = |line: &str| {
            let name = line.find(".png: ").expect("the depth's name");
            line[name + 6..].to_owned()
        };
        errors.lines().map(after_the_name).collect()
    };
    let zeros = |index| {
        let mut depth = normalized(index);
        depth
            .enumerate_pixels_mut()
            .filter(|(x, ..)| x % 4 == 0)
            .for_each(|(.., v)| v.0[0] = 0);
        depth
    };
    // A far plane of numbers that no rule knows.
    let crowded = Grey16::from_fn(WIDTH, HEIGHT, |x, y| match x % 4 {
        0 => image::Luma([60_000]),
        _ => *millimetres(0).get_pixel(x, y),
    });
    let turned = jpeg(&colour(0).into(), 3);
    for (name, depth, turns, flags, word) in [
        ("millimetres", millimetres(0), false, &[][..], "say so by --depth-unit"),
        ("zeros", zeros(0), false, &[], "25 % of it is 0"),
        ("turned", normalized(0), true, &[], "Exif data turn the colour"),
        (
            "crowded",
            crowded,
            false,
            &["--depth-unit", "mm"],
            "71 % of the depth lies",
        ),
        (
            "clipped",
            millimetres(0),
            false,
            &["--depth-unit", "mm", "--near", "2.45", "--far", "9"],
            "both are metres",
        ),
    ] {
        fs::create_dir(folder.path(name)).unwrap();
        for index in 0..2 {
            match turns {
                true => fs::write(folder.path(&format!("{name}/color_{index}.jpg")), &turned).unwrap(),
                false => colour(index)
                    .save(folder.path(&format!("{name}/color_{index}.png")))
                    .unwrap(),
            }
            depth.save(folder.path(&format!("{name}/depth_{index}.png"))).unwrap();
        }
        let [rgb, deep] =
            [if turns { "color_0.jpg" } else { "color_0.png" }, "depth_0.png"].map(|file| format!("{name}/{file}"));
        let call = [
            "hologram", "--rgb", &rgb, "--depth", &deep, "--method", "sweep", "-o", "h.png",
        ];
        let still = folder.run(&[&call[..], flags].concat());
        let still = doubt(&String::from_utf8(still.stderr).unwrap());
        assert!(still.len() == 1 && still[0].contains(word), "{still:?}");
        // However many frames give rise to it, a video has one warning.
        assert_eq!(
            doubt(&folder.video(name, &format!("{name}-out"), flags)),
            still,
            "{name}"
        );
    }
    // Where 0 is the farthest, it is no missing reading.
    assert_eq!(folder.video("zeros", "inverted", &["--invert"]), "");
    // Frames of another aspect ratio are refused as stills are.
    Grey16::from_pixel(WIDTH, WIDTH, image::Luma([40_000]))
        .save(folder.path("zeros/depth_0.png"))
        .unwrap();
    let still = ["--rgb", "zeros/color_0.png", "--depth", "zeros/depth_0.png"];
    let still = folder.fails(&[&["hologram"], &still[..], &["-o", "h.png"]].concat(), 1);
    assert!(still.contains("aspect ratios differ"), "{still}");
    assert_eq!(folder.fails(&["video", "zeros", "-o", "other"], 1), still);
}

#[test]
fn files_beside_frames_are_left_alone() {
    let folder = Folder::new()
        .with_frames(normalized, flat)
        .with_frames(normalized, scan);
    let said = ["--depth-unit", "normalized"];
    folder.video("in", "plain", &said);
    let made = folder.holograms("plain");
    let pairs = ["--pairs", "color_*,depth_*", "--depth-unit", "normalized"];
    for ending in ["json", "txt", "xmp", "meta", "yml", "AAE", "csv"] {
        for index in 0..3 {
            for name in [
                flat("color", index),
                flat("depth", index),
                scan("color", index),
                scan("depth", index),
            ] {
                fs::write(folder.path(&name).with_extension(ending), "{}").unwrap();
            }
        }
    }
    // A camera's pose as an array beside its picture, and a hidden file of macOS.
    fs::write(folder.path("in/color_1.npy"), "{}").unwrap();
    fs::write(folder.path("scan/rgb/00001.npy"), "{}").unwrap();
    fs::write(folder.path("in/._color_1.png"), "{}").unwrap();
    fs::write(folder.path("scan/rgb/._00001.png"), "{}").unwrap();
    for (input, flags, output) in [("in", &said[..], "a"), ("scan", &said, "b"), ("in", &pairs, "c")] {
        assert_eq!(folder.video(input, output, flags), "", "{output}");
        assert!(folder.holograms(output) == made, "{output}");
    }
}

#[test]
fn frames_without_depth_are_left_out_and_counted() {
    let folder = Folder::new()
        .with_frames(normalized, flat)
        .with_frames(normalized, scan);
    fs::create_dir_all(folder.path("named/rgb")).unwrap();
    fs::create_dir_all(folder.path("named/depth")).unwrap();
    for (index, name) in ["cat", "dog", "eel"].iter().enumerate() {
        colour(index as u32)
            .save(folder.path(&format!("named/rgb/{name}.png")))
            .unwrap();
        normalized(index as u32)
            .save(folder.path(&format!("named/depth/{name}.png")))
            .unwrap();
    }
    let said = ["--depth-unit", "normalized"];
    let pairs = [&["--pairs", "color_*.png,depth_*.png"], &said[..]].concat();
    for (input, flags, lost, name) in [
        ("in", &said[..], "in/depth_1.png", "color_1.png"),
        ("in", &pairs, "in/depth_1.png", "color_1.png"),
        ("scan", &said, "scan/depth/00001.png", "00001.png"),
        ("named", &said, "named/rgb/dog.png", "dog.png"),
    ] {
        let _ = fs::remove_file(folder.path(lost));
        let output = format!("{input}-{}", flags.len());
        let errors = folder.video(input, &output, flags);
        assert_eq!(errors.lines().count(), 1, "{errors}");
        assert!(errors.contains("2 of 3 frames") && errors.contains(name), "{errors}");
        assert_eq!(folder.holograms(&output).len(), 2, "{input}");
    }
    for index in [0, 2] {
        fs::remove_file(folder.path(&flat("depth", index))).unwrap();
    }
    let errors = folder.fails(&["video", "in", "-o", "none"], 1);
    assert!(
        errors.lines().count() == 1 && errors.contains("color_0.png"),
        "{errors}"
    );
}

#[test]
fn one_frame_in_two_files_is_refused() {
    let folder = Folder::new()
        .with_frames(normalized, flat)
        .with_frames(normalized, scan);
    let twice = |input: &str, files: [&str; 2]| {
        let [first, second] = files.map(|file| folder.path(input).join(file));
        fs::copy(first, &second).unwrap();
        let errors = folder.fails(&["video", input, "--depth-unit", "normalized", "-o", "out"], 1);
        fs::remove_file(second).unwrap();
        assert_eq!(errors.lines().count(), 1, "{errors}");
        for file in files {
            let name = file.rsplit('/').next().unwrap();
            assert!(errors.contains(name), "{errors}");
        }
        assert!(!folder.path("out").exists());
    };
    twice("in", ["color_1.png", "color_1.bmp"]);
    twice("in", ["color_1.png", "rgb_1.png"]);
    twice("in", ["depth_1.png", "depth_001.png"]);
    twice("scan", ["rgb/00001.png", "rgb/00001.webp"]);
    twice("scan", ["rgb/00001.png", "rgb/1-000033.png"]);
    twice("scan", ["depth/00001.png", "depth/00001.exr"]);
}

/// Tests lists as Windows programs write them, and colour images without depth in reach.
#[test]
fn lists_of_tum_are_read_with_a_mark_and_out_of_reach_images_are_counted() {
    let folder = Folder::new().with_frames(normalized, |kind, index| format!("tum/{kind}/{index}.png"));
    let list = |name: &str, text: &[u8]| fs::write(folder.path("tum").join(name), text).unwrap();
    let text = |kind: &str, times: [&str; 3]| -> String {
        (0..3)
            .map(|index| format!("{} {kind}/{index}.png\n", times[index]))
            .collect()
    };
    let colours = text("color", ["1.00", "1.04", "1.08"]);
    let depths = text("depth", ["1.01", "1.05", "1.09"]);
    list("rgb.txt", colours.as_bytes());
    list("depth.txt", depths.as_bytes());
    assert_eq!(folder.video("tum", "plain", &[]), "");
    let made = folder.holograms("plain");
    assert_eq!(made.len(), 3);
    assert_eq!(folder.request("plain")["--depth-scale"], "5000");
    let marked = |text: &str| format!("\u{feff}{}", text.replace('\n', "\r\n"));
    let wide = |text: &str| {
        marked(text)
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect::<Vec<_>>()
    };
    list("rgb.txt", marked(&colours).as_bytes());
    list("depth.txt", &wide(&format!("# time file\n{depths}")));
    assert_eq!(folder.video("tum", "marked", &[]), "");
    assert!(folder.holograms("marked") == made);
    list("depth.txt", text("depth", ["1.01", "7.0", "8.0"]).as_bytes());
    let errors = folder.video("tum", "few", &[]);
    assert!(
        errors.lines().count() == 1 && errors.contains("1 of the 3 colour images"),
        "{errors}"
    );
    list("depth.txt", text("depth", ["1.13", "7.0", "8.0"]).as_bytes());
    let errors = folder.fails(&["video", "tum", "-o", "none"], 1);
    assert!(
        errors.contains("none of the 3") && errors.contains("0.050 s away"),
        "{errors}"
    );
}
