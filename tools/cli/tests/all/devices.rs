//! Tests the conversion from an image to the input of each modulator and back, and the one-line error for each wrong
//! input.
use crate::folder;
use crate::reference::fft2;
use ndarray::Array2;
use phasefront::Size;

use folder::{Folder, SMALL_HOLOGRAM};
use phasefront::output::{ModulatorSpec, Packing};
use phasefront_io::hologram::packed::Image;
use phasefront_io::hologram::{self, Hologram, Levels};
use phasefront_io::picture;
use std::fs;
use std::path::Path;
use std::process::Command;

const SMALL: Size = Size { width: 48, height: 32 };

/// Writes `rgb.png` and `depth.png`.
fn frame(folder: &Folder, Size { width, height }: Size) {
    let rgb = image::RgbImage::from_fn(width as u32, height as u32, |x, y| {
        image::Rgb([(x * 5) as u8, (y * 7) as u8, 90])
    });
    rgb.save(folder.path("rgb.png")).unwrap();
    let depth = image::GrayImage::from_fn(width as u32, height as u32, |x, _| {
        image::Luma([if x < width as u32 / 2 { 30 } else { 220 }])
    });
    depth.save(folder.path("depth.png")).unwrap();
}

fn levels(path: &Path) -> Vec<u16> {
    match hologram::read_hologram(path).unwrap() {
        Hologram::Levels(Levels::Bytes(levels), _) => levels.iter().map(|level| u16::from(*level)).collect(),
        Hologram::Levels(Levels::Words(levels), _) => levels.iter().copied().collect(),
        Hologram::Complex(..) => panic!("levels were written"),
    }
}

/// Makes a hologram of the folder's frame, whose values are amplitudes; `--display` and `-o` follow.
const SWEPT_AMPLITUDES: [&str; 9] = [
    "hologram",
    "--rgb",
    "rgb.png",
    "--depth",
    "depth.png",
    "--method",
    "sweep",
    "--rgb-encoding",
    "amplitude",
];

#[test]
fn every_device_takes_a_frame_whose_levels_are_the_holograms() {
    for name in ModulatorSpec::names() {
        let device = ModulatorSpec::shipped(name).unwrap();
        let folder = Folder::new();
        // Bit-plane cells need every pixel. Elsewhere a small hologram is centred.
        let (size, fit) = match device.packing {
            Packing::BitPlanes(_) => (device.display.size(), &["--fit", "cover"][..]),
            _ => (SMALL, &[][..]),
        };
        frame(&folder, SMALL);
        let size = format!("{}x{}", size.width, size.height);
        let to = ["--display", name, "--packed", "frame.png", "-o", "hologram.png"];
        let told = folder.succeeds(&[&SMALL_HOLOGRAM[..], fit, &to, &["--json"]].concat());
        let told: serde_json::Value = serde_json::from_str(&told).unwrap();
        let frames = if folder.path("frame.png").exists() {
            vec!["frame.png"]
        } else {
            vec!["frame-red.png", "frame-green.png", "frame-blue.png"]
        };
        assert_eq!(told["packed"], serde_json::json!(frames), "{name}");
        let back = ["--display", name, "--size", &size, "-o", "back.png"];
        folder.succeeds(&[&["unpack"], &frames[..], &back].concat());
        let hologram = levels(&folder.path("hologram.png"));
        assert_eq!(levels(&folder.path("back.png")), hologram, "{name}");
        let most = hologram.iter().max().unwrap();
        let highest = (1u16 << device.display.bits()) - 1;
        assert!(*most <= highest && *most > highest / 2, "{name}: {most}");
        // The separate command gives the same frame.
        folder.succeeds(&["pack", "hologram.png", "--display", name, "-o", "frame_.png"]);
        let again = frames[0].replace("frame", "frame_");
        let [packed, again] = [frames[0], &again].map(|name| fs::read(folder.path(name)).unwrap());
        assert_eq!(packed, again, "{name}");
        folder.succeeds(&["refocus", "hologram.png", "--z-mm", "0", "-o", "view.png"]);
    }
}

#[test]
fn a_view_is_not_turned_by_what_the_panel_adds() {
    let folder = Folder::new();
    frame(&folder, Size { width: 64, height: 48 });
    let flat = image::GrayImage::from_fn(64, 48, |x, y| image::Luma([(x * 3 + y * y) as u8]));
    flat.save(folder.path("flat.bmp")).unwrap();
    let plain = "width = 64\nheight = 48\n";
    fs::write(folder.path("plain.toml"), plain).unwrap();
    let added = "carrier_mrad = [6.0, -2.0]\nlens_mm = 400\nflatness = \"flat.bmp\"\n";
    fs::write(folder.path("added.toml"), format!("{plain}{added}")).unwrap();
    fs::write(folder.path("over.toml"), format!("{plain}range_turns = 1.7\n")).unwrap();
    let mut views = Vec::new();
    for name in ["plain", "added", "over"] {
        let (toml, hologram, view) = (
            format!("{name}.toml"),
            format!("{name}.png"),
            format!("{name}-view.png"),
        );
        folder.succeeds(&[&SWEPT_AMPLITUDES[..], &["--display", &toml, "-o", &hologram]].concat());
        folder.succeeds(&["refocus", &hologram, "--display", &toml, "--z-mm", "0", "-o", &view]);
        views.push(picture::read_rgb(&folder.path(&view)).unwrap());
    }
    assert_ne!(levels(&folder.path("plain.png")), levels(&folder.path("added.png")));
    assert!(
        levels(&folder.path("over.png")).iter().any(|level| *level > 170),
        "beyond one turn"
    );
    for other in &views[1..] {
        let alike = phasefront_core::optics::metrics::compare(other.view(), views[0].view()).unwrap();
        assert!(alike.psnr_overall > 35.0, "{}", alike.psnr_overall);
    }
    // A view of this hologram needs the display file.
    let errors = folder.fails(&["refocus", "added.png", "--z-mm", "0", "-o", "v.png"], 1);
    assert!(errors.contains("--display"), "{errors}");
}

/// Returns the PSNR of each colour's picture in dB, as an aperture of the whole first order shows the `levels` of a
/// panel that retards light of colour c by `turns[c]` of 2π at level 256. The brightness is fitted.
fn shown_on(levels: &[u16], turns: [f64; 3], picture: &image::RgbImage) -> [f64; 3] {
    use num_complex::Complex64;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    std::array::from_fn(|colour| {
        let levels = &levels[colour * width * height..][..width * height];
        let phase = |level: &u16| f64::from(*level) / 256.0 * turns[colour] * std::f64::consts::TAU;
        let field = Array2::from_shape_fn((height, width), |(y, x)| Complex64::cis(phase(&levels[y * width + x])));
        let mut spectrum = fft2(&field, false);
        for ((y, x), value) in spectrum.indexed_iter_mut() {
            let frequency = |at: usize, of: usize| (at.min(of - at)) as f64 / of as f64;
            let (fy, fx) = (frequency(y, height), frequency(x, width));
            if fx * fx + fy * fy > 0.25 {
                *value = Complex64::ZERO;
            }
        }
        let seen: Vec<f64> = fft2(&spectrum, true).iter().map(|value| value.norm()).collect();
        let want: Vec<f64> = picture
            .pixels()
            .map(|pixel| f64::from(pixel.0[colour]) / 255.0)
            .collect();
        let gain = seen.iter().zip(&want).map(|(a, b)| a * b).sum::<f64>() / seen.iter().map(|a| a * a).sum::<f64>();
        let errors = seen.iter().zip(&want).map(|(a, b)| (gain * a - b).powi(2));
        -10.0 * (errors.sum::<f64>() / want.len() as f64).log10()
    })
}

/// A panel is measured once, at 638 nm, where 256 levels are a turn. Its path is the same for all lasers, so they are
/// 1.23 turns of green and 1.42 of blue.
#[test]
fn one_measurement_of_a_panel_serves_three_lasers() {
    let folder = Folder::new();
    // Fine detail in every colour, as pictures have: blocks of 3 pixels.
    let picture = image::RgbImage::from_fn(160, 128, |x, y| {
        let block = (y / 3 * 54 + x / 3).wrapping_mul(0x9E37_79B1);
        image::Rgb([8, 16, 24].map(|shift| 40 + ((block >> shift) & 127) as u8))
    });
    picture.save(folder.path("rgb.png")).unwrap();
    image::GrayImage::from_pixel(160, 128, image::Luma([128]))
        .save(folder.path("depth.png"))
        .unwrap();
    let table: String = (0..256).map(|level| format!("{level}\n")).collect();
    fs::write(folder.path("lut.txt"), table).unwrap();
    let turns: Vec<String> = (0..256).map(|level| format!("{}", f64::from(level) / 256.0)).collect();
    let turns = turns.join(", ");
    let panel = [1.0, 638.0 / 520.0, 638.0 / 450.0];
    let made = |name: &str, line: &str| {
        fs::write(folder.path("d.toml"), format!("width = 160\nheight = 128\n{line}\n")).unwrap();
        let output = format!("{name}.png");
        let told = folder.run(&[&SWEPT_AMPLITUDES[..], &["--display", "d.toml", "-o", &output]].concat());
        let said = String::from_utf8(told.stderr).unwrap();
        assert!(told.status.success(), "{said}");
        (levels(&folder.path(&output)), said)
    };
    let ideal = shown_on(&made("ideal", "").0, [1.0; 3], &picture);
    assert!(ideal.iter().all(|psnr| *psnr > 15.0), "{ideal:?}");
    for line in [
        "range_turns = { turns = 1.0, at_nm = 638 }",
        "range_turns = { turns = 1.0906666666666667, at_nm = 585 }",
        "range_turns = [1.0, 1.226923, 1.417778]",
        &format!("levels_turns = {{ turns = [{turns}], at_nm = 638 }}"),
        "lut = { file = \"lut.txt\", at_nm = 638 }",
    ] {
        let (levels, said) = made("panel", line);
        assert!(!said.contains("one wavelength"), "{line}: {said}");
        let shown = shown_on(&levels, panel, &picture);
        println!("{:.40}: ideal {ideal:.1?}, shown {shown:.1?}", line);
        for colour in 0..3 {
            assert!(
                shown[colour] > ideal[colour] - 1.0,
                "{line}: {shown:?}, ideally {ideal:?}"
            );
        }
    }
    // One table for all lasers is for one of them, and is told so.
    let (levels, said) = made("panel", "lut = \"lut.txt\"");
    assert!(
        said.contains("lut holds for one wavelength, and the display has 3 lasers"),
        "{said}"
    );
    let shown = shown_on(&levels, panel, &picture);
    println!("one for all: {shown:.1?}");
    assert!(shown[0] > ideal[0] - 1.0 && shown[2] < ideal[2] - 5.0, "{shown:?}");
    // A view needs the display's file, and is that of the ideal panel.
    made("panel", "range_turns = { turns = 1.0, at_nm = 638 }");
    let view = folder.succeeds(&[
        "refocus",
        "panel.png",
        "--display",
        "d.toml",
        "--z-mm",
        "0",
        "-o",
        "view.png",
    ]);
    assert!(!view.is_empty());
    let seen = picture::read_rgb(&folder.path("view.png")).unwrap();
    folder.succeeds(&["refocus", "ideal.png", "--z-mm", "0", "-o", "ideal-view.png"]);
    let best = picture::read_rgb(&folder.path("ideal-view.png")).unwrap();
    let alike = phasefront_core::optics::metrics::compare(seen.view(), best.view()).unwrap();
    assert!(alike.psnr_overall > 35.0, "{}", alike.psnr_overall);
}

#[test]
fn wrong_values_of_each_laser_are_named() {
    let folder = Folder::new();
    fs::write(folder.path("lut.txt"), "0\n".repeat(255) + "9\n").unwrap();
    for (line, word) in [
        ("range_turns = [1.0, 1.2]", "for 2 lasers; the display has 3"),
        ("range_turns = \"1.0\"", "at_nm"),
        ("range_turns = { turns = 1.0, at_nm = 0.638 }", "at_nm is 0.638"),
        ("lut = [\"lut.txt\"]", "names 1 files; the display has 3"),
        ("bits = 4\nrange_turns = [1.0, 1.2, 1.4]", "8 bits"),
    ] {
        fs::write(folder.path("d.toml"), line).unwrap();
        let said = folder.fails(&["devices", "d.toml"], 1);
        assert!(said.contains(word), "{line}: {said}");
    }
}

#[test]
fn maps_of_one_image_become_bit_planes() {
    let folder = Folder::new();
    frame(&folder, Size { width: 64, height: 48 });
    let cells = "{ memory = [3, 2, 1, 7, 0, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12], layout = [[2, 3], [0, 1]] }";
    let toml = format!("width = 64\nheight = 48\nbits = 4\npacking = {cells}\n");
    fs::write(folder.path("plm.toml"), toml).unwrap();
    let image = [
        "multiplex",
        "--rgb",
        "rgb.png",
        "--depth",
        "depth.png",
        "--display",
        "plm.toml",
    ];
    let more = [
        "--maps",
        "8",
        "--packed",
        "frame.png",
        "--judge",
        "--json",
        "-o",
        "maps",
    ];
    let told: serde_json::Value = serde_json::from_str(&folder.succeeds(&[&image[..], &more].concat())).unwrap();
    let shown = told["shown"].as_array().unwrap();
    assert_eq!(shown.len(), 4);
    assert!(shown[3]["psnr_db"].as_f64() > shown[0]["psnr_db"].as_f64());
    // The first plane of each channel is the first map of its colour, with the separate command too.
    folder.succeeds(&["unpack", "frame.png", "--display", "plm.toml", "-o", "first.png"]);
    assert_eq!(
        levels(&folder.path("first.png")),
        levels(&folder.path("maps/phase_000.png"))
    );
    let maps: Vec<String> = (0..8).map(|n| format!("maps/phase_{n:03}.png")).collect();
    let maps: Vec<&str> = maps.iter().map(String::as_str).collect();
    let green = ["--colour", "green", "--display", "plm.toml", "-o", "green.png"];
    folder.succeeds(&[&["pack"], &maps[..], &green].concat());
    assert_eq!(
        Image::read(&folder.path("green.png")).unwrap().size,
        Size { width: 128, height: 96 }
    );
    let errors = folder.fails(&[&["pack"], &maps[..5], &green].concat(), 1);
    assert!(errors.contains("24"), "{errors}");
}

#[test]
fn what_is_wrong_is_one_line() {
    let folder = Folder::new();
    frame(&folder, Size { width: 48, height: 32 });
    image::open(folder.path("rgb.png"))
        .unwrap()
        .save(folder.path("rgb.jpg"))
        .unwrap();
    let files = [
        ("key.toml", "widht = 48"),
        ("bits.toml", "bits = 12"),
        ("packing.toml", "packing = \"gray\""),
        ("flat.toml", "width = 48\nheight = 32\nflatness = \"rgb.png\""),
        ("size.toml", "width = 48\nheight = 33\nflatness = \"depth.png\""),
        ("steep.toml", "width = 48\nheight = 32\ncarrier_mrad = [90, 0]"),
        ("scale.toml", "width = 48\nheight = 32\nscale = [1, 2, 1]"),
    ];
    for (name, text) in files {
        fs::write(folder.path(name), text).unwrap();
    }
    let hologram = [
        "hologram",
        "--rgb",
        "rgb.png",
        "--depth",
        "depth.png",
        "--method",
        "sweep",
        "-o",
        "h.png",
    ];
    for (display, word) in [
        ("key.toml", "widht"),
        ("bits.toml", "bits is 12"),
        ("packing.toml", "gray"),
        ("flat.toml", "grey"),
        ("size.toml", "48×33"),
        ("steep.toml", "0.5"),
        ("scale.toml", "scale"),
        ("santec", "santec-slm-200"),
        ("none.toml", "none.toml"),
    ] {
        let errors = folder.fails(&[&hologram[..], &["--display", display]].concat(), 1);
        assert!(
            errors.contains(word) && errors.lines().count() == 1,
            "{display}: {errors}"
        );
        assert!(!folder.path("h.png").exists());
    }
    // A panel with a range below 2π is encoded for its range, with a warning.
    fs::write(folder.path("short.toml"), "width = 48\nheight = 32\nrange_turns = 0.8").unwrap();
    let output = folder.run(&[&hologram[..], &["--display", "short.toml"]].concat());
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && told.contains("reach 0.80 of 2π"), "{told}");
    folder.succeeds(&[&hologram[..], &["--display", "holoeye-pluto"]].concat());
    for (arguments, word) in [
        (
            &["pack", "h.png", "--display", "santec-slm-200", "-o", "f.png"][..],
            "8 bits",
        ),
        (&["pack", "h.png", "--display", "ti-plm-p47", "-o", "f.png"], "bits"),
        (
            &["pack", "rgb.jpg", "--display", "holoeye-pluto", "-o", "f.png"],
            "a picture and no phase map",
        ),
        (
            &["unpack", "rgb.png", "--display", "holoeye-gaea-2", "-o", "f.png"],
            "3840×2160",
        ),
        (&["unpack", "rgb.png", "--display", "holoeye-pluto", "-o", "f.png"], "3"),
        (&["link", "pattern", "--size", "100x100", "-o", "f.png"], "512"),
        (&["link", "read", "rgb.png"], "512"),
        (&["show", "none.png"], "none.png"),
    ] {
        let errors = folder.fails(arguments, 1);
        assert!(
            errors.contains(word) && errors.lines().count() == 1,
            "{arguments:?}: {errors}"
        );
    }
}

/// Writes the file of a display and the files of displays that differ from it.
fn write_displays(folder: &Folder) {
    for (name, text) in [
        ("own", ""),
        ("near", "pitch_um = 8.000001\nwavelengths_nm = [638.000001, 520, 450]\n"),
        ("fine", "pitch_um = 3.74\n"),
        ("lasers", "wavelengths_nm = [660, 532, 450]\n"),
        ("bits", "bits = 4\n"),
        ("calibrated", "lut = \"lut.txt\"\ncarrier_mrad = [2, 0]\n"),
    ] {
        let toml = format!("width = 64\nheight = 48\n{text}");
        fs::write(folder.path(&format!("{name}.toml")), toml).unwrap();
    }
    let levels: Vec<_> = (0..256).map(|level: u16| (255 - level).to_string()).collect();
    fs::write(folder.path("lut.txt"), levels.join(" ")).unwrap();
}

#[test]
fn a_hologram_is_for_the_display_that_it_was_made_for() {
    let folder = Folder::new();
    frame(&folder, Size { width: 64, height: 48 });
    write_displays(&folder);
    let make = "hologram --rgb rgb.png --depth depth.png --method sweep --planes 4 --display own.toml";
    let call = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let succeeds = |line: &str| {
        let call = call(line);
        folder.succeeds(&call.iter().map(String::as_str).collect::<Vec<_>>())
    };
    succeeds(&format!("{make} --complex f.npy -o h.png"));
    succeeds(&format!("{make} --offset-mm 3 -o moved.png"));
    let commands = [
        "pack h.png -o n.png",
        "refocus h.png --z-mm 0 -o n.png",
        "view h.png --views 2 -o n.html",
    ];
    for display in ["own", "near", "calibrated"] {
        for command in commands {
            succeeds(&format!("{command} --display {display}.toml"));
        }
    }
    for name in ["n.png", "n.html"] {
        fs::remove_file(folder.path(name)).unwrap();
    }
    for (display, theirs, ours) in [
        ("fine.toml", "for a pitch of 8 µm", "has a pitch of 3.74 µm"),
        (
            "lasers.toml",
            "for lasers of 638/520/450 nm",
            "has lasers of 660/532/450 nm",
        ),
        ("bits.toml", "for levels of 8 bits", "has levels of 4 bits"),
        (
            "own.toml --offset-mm 3",
            "for an offset of 0 mm",
            "has an offset of 3 mm",
        ),
        (
            "ti-plm-p47",
            "levels of 8 bits, a pitch of 8 µm",
            "levels of 4 bits, a pitch of 10.8 µm",
        ),
    ] {
        for command in commands.into_iter().chain(["show h.png"]) {
            let call = call(&format!("{command} --display {display}"));
            let errors = folder.fails(&call.iter().map(String::as_str).collect::<Vec<_>>(), 1);
            assert!(
                errors.lines().count() == 1 && errors.contains("h.png: the hologram is "),
                "{errors}"
            );
            assert!(errors.contains(theirs) && errors.contains(ours), "{call:?}: {errors}");
            assert!(!folder.path("n.png").exists() && !folder.path("n.html").exists());
        }
    }
    let planes = [
        "pack",
        "h.png",
        "h.png",
        "--colour",
        "red",
        "--display",
        "ti-plm-p47",
        "-o",
        "n.png",
    ];
    assert!(folder.fails(&planes, 1).contains("levels of 4 bits"));
    // A field has no levels, and an offset can be given.
    succeeds("refocus f.npy --z-mm 0 --display bits.toml -o n.png");
    succeeds("refocus moved.png --z-mm 0 --display own.toml --offset-mm 3 -o n.png");
    // The command does not guess calibration data that a hologram needs.
    succeeds(&format!("{} -o c.png", make.replace("own", "calibrated")));
    let errors = folder.fails(&["view", "c.png", "-o", "c.html"], 1);
    assert!(
        errors.contains("carrier_mrad") && errors.contains("--display"),
        "{errors}"
    );
}

#[test]
fn devices_are_listed_with_their_sources() {
    let folder = Folder::new();
    let text = folder.succeeds(&["devices"]);
    for name in ModulatorSpec::names() {
        assert!(text.contains(name), "{text}");
    }
    let one = folder.succeeds(&["devices", "ti-plm-p67"]);
    assert!(one.contains("unconfirmed") && one.contains("width: "), "{one}");
    assert!(one.contains("638, 520, 450 nm"), "{one}");
    // A file is described with all that it sets.
    let set =
        "width = 64\nheight = 48\noffset_mm = 6.5\ncarrier_mrad = [6.0, -2.0]\nlut = \"lut.txt\"\nflip_x = true\n";
    fs::write(folder.path("set.toml"), set).unwrap();
    let lut: Vec<_> = (0..256).map(|level| format!("{level}\n")).collect();
    fs::write(folder.path("lut.txt"), lut.concat()).unwrap();
    let set = folder.succeeds(&["devices", "set.toml"]);
    for part in ["6.5 mm from", "lut, carrier_mrad", "left to right"] {
        assert!(set.contains(part), "{part}: {set}");
    }
    // The user's own devices are listed too, and one with the name of a bundled device replaces it.
    fs::create_dir_all(folder.path("phasefront/devices")).unwrap();
    fs::write(folder.path("phasefront/devices/mine.toml"), "width = 123\nheight = 99").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_phasefront"))
        .args(["devices", "--json"])
        .env("XDG_CONFIG_HOME", folder.0.path())
        .output()
        .unwrap();
    let list: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&list[0]["name"], &list[0]["width"]), (&"mine".into(), &123.into()));
}

#[test]
fn the_links_pattern_goes_through_files() {
    let folder = Folder::new();
    folder.succeeds(&["link", "pattern", "--size", "640x96", "-o", "pattern.png"]);
    let read = ["link", "read", "pattern.png", "--size", "640x96"];
    assert_eq!(folder.succeeds(&read), "every pixel arrives as it is\n");
    // A link with limited range changes the pattern like this.
    let pattern = image::open(folder.path("pattern.png")).unwrap().into_rgb8();
    let limited = image::RgbImage::from_fn(640, 96, |x, y| {
        image::Rgb(pattern.get_pixel(x, y).0.map(|v| 16 + (u32::from(v) * 219 / 255) as u8))
    });
    limited.save(folder.path("limited.png")).unwrap();
    let read = folder.run(&["link", "read", "limited.png", "--size", "640x96"]);
    let told = String::from_utf8(read.stdout).unwrap();
    assert!(told.starts_with("limited range"), "{told}");
    assert_eq!(read.status.code(), Some(1), "scripts see that the link changes pixels");
}

/// A Meadowlark table has two columns: the numbers 0 to 255, and the levels or voltages.
#[test]
fn tables_of_two_columns_are_read_and_voltages_are_the_drivers() {
    let folder = Folder::new().with_frame();
    let level = |i: usize| 250 - i * 3 / 4;
    let column: Vec<_> = (0..256).map(|i| level(i).to_string()).collect();
    fs::write(folder.path("one.txt"), column.join("\n")).unwrap();
    for (name, factor, first) in [("two.lut", 1, 0), ("volts.lut", 8, 0), ("late.lut", 1, 1)] {
        let lines: String = (0..256)
            .map(|i| format!("{}\t{}\r\n", i + first, factor * level(i)))
            .collect();
        fs::write(folder.path(name), lines).unwrap();
    }
    let downward: String = (0..256).rev().map(|i| format!("{i} {}\n", level(i))).collect();
    fs::write(folder.path("downward.lut"), &downward).unwrap();
    fs::write(folder.path("marked.txt"), format!("\u{feff}{}", column.join("\n"))).unwrap();
    fs::write(folder.path("twice.lut"), downward.replace("255 59", "254 59")).unwrap();
    fs::write(folder.path("flat.txt"), "7\n".repeat(256)).unwrap();
    let made = |table: &str| {
        fs::write(folder.path("d.toml"), format!("lut = \"{table}\"")).unwrap();
        folder.run(&[&SMALL_HOLOGRAM[..], &["--display", "d.toml", "-o", "h.png"]].concat())
    };
    let shown = |table: &str| {
        assert!(made(table).status.success());
        levels(&folder.path("h.png"))
    };
    for table in ["two.lut", "downward.lut", "marked.txt"] {
        assert_eq!(shown("one.txt"), shown(table), "{table}");
    }
    for (table, words) in [
        ("volts.lut", "load the file into the modulator's driver"),
        ("late.lut", "each of 0 to 255 once"),
        ("twice.lut", "each of 0 to 255 once"),
        ("flat.txt", "the level 7 for every phase"),
    ] {
        let said = String::from_utf8(made(table).stderr).unwrap();
        assert!(said.contains(words) && said.lines().count() == 1, "{said}");
    }
}

#[test]
fn one_colour_is_packed_and_messages_are_those_of_the_packing() {
    let folder = Folder::new();
    frame(&folder, SMALL);
    let pluto = ["--display", "holoeye-pluto"];
    folder.succeeds(&[&SMALL_HOLOGRAM[..], &pluto, &["-o", "h.png", "--packed", "all.png"]].concat());
    folder.succeeds(&[&["pack", "h.png", "--colour", "green", "-o", "green.png"][..], &pluto].concat());
    let read = |name: &str| Image::read(&folder.path(name)).unwrap();
    assert_eq!(read("green.png"), read("all-green.png"));
    assert!(!folder.path("green-green.png").exists());
    for (arguments, word) in [
        (&["pack", "h.png", "h.png", "-o", "f.png"][..], "pack one at a time"),
        (
            &["pack", "h.png", "h.png", "--colour", "green", "-o", "f.png"],
            "pack one at a time",
        ),
    ] {
        let said = folder.fails(&[arguments, &pluto].concat(), 1);
        assert!(said.contains(word), "{said}");
    }
    // A file that builds on the device packs alike.
    fs::write(folder.path("mine.toml"), "device = \"holoeye-pluto\"").unwrap();
    folder.succeeds(&[
        "pack",
        "h.png",
        "--display",
        "mine.toml",
        "--colour",
        "red",
        "-o",
        "red.png",
    ]);
    assert_eq!(read("red.png"), read("all-red.png"));
    let said = folder.succeeds(&["devices", "mine.toml"]);
    assert!(said.contains("1920x1080"), "{said}");
}
