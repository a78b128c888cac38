//! From an image to what each modulator takes, and back; one line for each thing that is wrong; a screen that shows
//! what it is given.
#![allow(clippy::unwrap_used)]

mod folder;

use folder::Folder;
use phasefront::device::{Device, Packing};
use phasefront_lab::files::{self, Hologram};
use phasefront_lab::packed::{Image, Kind};
use std::fs;
use std::io::{BufRead, BufReader, Write, stderr};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Writes `rgb.png` and `depth.png`.
fn frame(folder: &Folder, (width, height): (u32, u32)) {
    let rgb = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([(x * 5) as u8, (y * 7) as u8, 90]));
    rgb.save(folder.path("rgb.png")).unwrap();
    let depth = image::GrayImage::from_fn(width, height, |x, _| {
        image::Luma([if x < width / 2 { 30 } else { 220 }])
    });
    depth.save(folder.path("depth.png")).unwrap();
}

fn levels(path: &Path) -> Vec<u16> {
    match files::read_hologram(path).unwrap() {
        Hologram::PhaseOnly(levels, _) => levels.iter().map(|level| u16::from(*level)).collect(),
        Hologram::Words(levels, _) => levels.iter().copied().collect(),
        Hologram::Complex(..) => panic!("levels were written"),
    }
}

#[test]
fn every_device_takes_a_frame_whose_levels_are_the_holograms() {
    for name in Device::names() {
        let device = Device::shipped(name).unwrap();
        let folder = Folder::new();
        // Cells need every pixel; elsewhere a small hologram stands in the middle.
        let (size, fit) = match device.packing {
            Packing::BitPlanes(_) => (
                (device.display.width(), device.display.height()),
                &["--fit", "cover"][..],
            ),
            _ => ((48, 32), &[][..]),
        };
        frame(&folder, (48, 32));
        let size = format!("{}x{}", size.0, size.1);
        let made = [
            "hologram",
            "--rgb",
            "rgb.png",
            "--depth",
            "depth.png",
            "--method",
            "sweep",
            "--planes",
            "8",
        ];
        let to = ["--display", name, "--packed", "frame.png", "-o", "hologram.png"];
        folder.succeeds(&[&made[..], fit, &to].concat());
        let frames = match folder.path("frame.png").exists() {
            true => vec!["frame.png"],
            false => vec!["frame-red.png", "frame-green.png", "frame-blue.png"],
        };
        let back = ["--display", name, "--size", &size, "-o", "back.png"];
        folder.succeeds(&[&["unpack"], &frames[..], &back].concat());
        let hologram = levels(&folder.path("hologram.png"));
        assert_eq!(levels(&folder.path("back.png")), hologram, "{name}");
        let most = hologram.iter().max().unwrap();
        let highest = (1u16 << device.display.bits()) - 1;
        assert!(*most <= highest && *most > highest / 2, "{name}: {most}");
        // By hand it is the same frame.
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
    frame(&folder, (64, 48));
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
        let frame = [
            "hologram",
            "--rgb",
            "rgb.png",
            "--depth",
            "depth.png",
            "--method",
            "sweep",
        ];
        folder.succeeds(&[&frame[..], &["--display", &toml, "-o", &hologram]].concat());
        folder.succeeds(&["refocus", &hologram, "--display", &toml, "--z-mm", "0", "-o", &view]);
        views.push(files::read_rgb(&folder.path(&view)).unwrap());
    }
    assert_ne!(levels(&folder.path("plain.png")), levels(&folder.path("added.png")));
    assert!(
        levels(&folder.path("over.png")).iter().any(|level| *level > 170),
        "beyond one turn"
    );
    for other in &views[1..] {
        let alike = phasefront_lab::metrics::compare(other.view(), views[0].view()).unwrap();
        assert!(alike.psnr_overall > 35.0, "{}", alike.psnr_overall);
    }
    // Without its file such a hologram cannot be looked at.
    let errors = folder.fails(&["refocus", "added.png", "--z-mm", "0", "-o", "v.png"], 1);
    assert!(errors.contains("--display"), "{errors}");
}

#[test]
fn maps_of_one_image_become_bit_planes() {
    let folder = Folder::new();
    frame(&folder, (64, 48));
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
    // The first plane of each channel is the first map of its colour, also by hand.
    folder.succeeds(&["unpack", "frame.png", "--display", "plm.toml", "-o", "first.png"]);
    assert_eq!(
        levels(&folder.path("first.png")),
        levels(&folder.path("maps/phase_000.png"))
    );
    let maps: Vec<String> = (0..8).map(|n| format!("maps/phase_{n:03}.png")).collect();
    let maps: Vec<&str> = maps.iter().map(String::as_str).collect();
    let green = ["--colour", "green", "--display", "plm.toml", "-o", "green.png"];
    folder.succeeds(&[&["pack"], &maps[..], &green].concat());
    assert_eq!(Image::read(&folder.path("green.png")).unwrap().shape, (96, 128));
    let errors = folder.fails(&[&["pack"], &maps[..5], &green].concat(), 1);
    assert!(errors.contains("24"), "{errors}");
}

#[test]
fn what_is_wrong_is_one_line() {
    let folder = Folder::new();
    frame(&folder, (48, 32));
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
    // A panel under 2π is encoded for what it can, and that is told.
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
            &["pack", "rgb.png", "--display", "holoeye-pluto", "-o", "f.png"],
            "hologram",
        ),
        (
            &["unpack", "rgb.png", "--display", "holoeye-gaea-2", "-o", "f.png"],
            "3840×2160",
        ),
        (&["unpack", "rgb.png", "--display", "holoeye-pluto", "-o", "f.png"], "3"),
        (&["link", "pattern", "--size", "100x100", "-o", "f.png"], "512"),
        (&["link", "read", "rgb.png"], "512"),
        (&["show", "none.png"], "none.png"),
        (&["show", "rgb.png", "--rate", "0"], "--rate"),
    ] {
        let errors = folder.fails(arguments, 1);
        assert!(
            errors.contains(word) && errors.lines().count() == 1,
            "{arguments:?}: {errors}"
        );
    }
}

#[test]
fn a_hologram_is_for_the_display_that_it_was_made_for() {
    let folder = Folder::new();
    frame(&folder, (64, 48));
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
    // A field has no levels, and an offset can be said.
    succeeds("refocus f.npy --z-mm 0 --display bits.toml -o n.png");
    succeeds("refocus moved.png --z-mm 0 --display own.toml --offset-mm 3 -o n.png");
    // What a hologram needs a display for is not made up.
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
    for name in Device::names() {
        assert!(text.contains(name), "{text}");
    }
    let one = folder.succeeds(&["devices", "ti-plm-p67"]);
    assert!(one.contains("unconfirmed") && one.contains("width: "), "{one}");
    // One of the user's stands beside them, before one of the same name.
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
    // What a link of limited range makes of it.
    let pattern = image::open(folder.path("pattern.png")).unwrap().into_rgb8();
    let limited = image::RgbImage::from_fn(640, 96, |x, y| {
        image::Rgb(pattern.get_pixel(x, y).0.map(|v| 16 + (u32::from(v) * 219 / 255) as u8))
    });
    limited.save(folder.path("limited.png")).unwrap();
    let told = folder.succeeds(&["link", "read", "limited.png", "--size", "640x96"]);
    assert!(told.starts_with("limited range"), "{told}");
}

/// A virtual X server with one screen, which keeps in a file what it displays.
struct Screen {
    server: Child,
    display: String,
    size: (usize, usize),
    folder: tempfile::TempDir,
}

impl Screen {
    fn open((width, height): (usize, usize)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut server = Command::new("Xvfb")
            .args([
                "-displayfd",
                "1",
                "-screen",
                "0",
                &format!("{width}x{height}x24"),
                "-fbdir",
            ])
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb runs: apt-get install xvfb");
        // Once it takes connections it prints the number of a display that was free.
        let mut number = String::new();
        let stdout = server.stdout.take().unwrap();
        BufReader::new(stdout).read_line(&mut number).unwrap();
        assert!(!number.trim().is_empty(), "the X server does not start");
        Screen {
            server,
            display: format!(":{}", number.trim()),
            size: (width, height),
            folder,
        }
    }

    fn command(&self, folder: &Folder, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_phasefront"));
        command
            .args(arguments)
            .current_dir(folder.0.path())
            .env("DISPLAY", &self.display)
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET");
        command
    }

    /// What the command prints as JSON.
    fn told(&self, folder: &Folder, arguments: &[&str]) -> serde_json::Value {
        let output = self.command(folder, arguments).arg("--json").output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.success(),
            "{arguments:?}: {errors} (windows need apt-get install libx11-6 libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0)"
        );
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// Rows of red, green, blue of what it displays, from a file of X's window dump.
    fn pixels(&self) -> Vec<u8> {
        let bytes = fs::read(self.folder.path().join("Xvfb_screen0")).unwrap();
        let number = |n: usize| u32::from_be_bytes([0, 1, 2, 3].map(|i| bytes[4 * n + i])) as usize;
        // Header, its colour map of 12 bytes an entry, then lines of words, blue first.
        let (header, colours, line) = (number(0), number(19), number(12));
        let (width, height) = self.size;
        assert_eq!((number(4), number(5), number(11)), (width, height, 32));
        let image = &bytes[header + 12 * colours..];
        let rows = image.chunks(line).take(height);
        rows.flat_map(|row| row[..4 * width].chunks(4).flat_map(|p| [p[2], p[1], p[0]]))
            .collect()
    }

    /// Runs `show` with these arguments until the screen has displayed each of `frames`, every pixel as it is.
    fn displays(&self, folder: &Folder, arguments: &[&str], frames: &[&[u8]]) {
        let arguments = [&["show", "--screen", "1", "--seconds", "60"], arguments].concat();
        let mut player = self.command(folder, &arguments).spawn().unwrap();
        let (start, mut seen) = (Instant::now(), vec![false; frames.len()]);
        while seen.contains(&false) {
            let ended = player.try_wait().unwrap();
            assert!(ended.is_none(), "{arguments:?} ended: {ended:?}");
            let late = start.elapsed() > Duration::from_secs(50);
            assert!(
                !late,
                "{arguments:?}: of {} frames these were seen: {seen:?}",
                frames.len()
            );
            let pixels = self.pixels();
            if let Some(n) = frames.iter().position(|frame| **frame == pixels) {
                seen[n] = true;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        player.kill().unwrap();
        player.wait().unwrap();
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// A frame in which any two neighbours differ.
fn noise(seed: u32, (width, height): (usize, usize)) -> Image {
    let byte = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed * 977) >> 13) as u8;
    Image {
        shape: (height, width),
        bytes: (0..3 * (width * height) as u32).map(byte).collect(),
        kind: Kind::Rgb,
    }
}

#[test]
fn a_screen_shows_exactly_what_it_is_given() {
    let size = (640, 480);
    let screen = Screen::open(size);
    let folder = Folder::new();
    let frames = [1, 2].map(|seed| noise(seed, size));
    fs::create_dir(folder.path("frames")).unwrap();
    for (n, frame) in frames.iter().enumerate() {
        frame.write(&folder.path(&format!("frames/{n}.png"))).unwrap();
    }
    let list = screen.told(&folder, &["screens"]);
    assert_eq!(list.as_array().unwrap().len(), 1);
    assert_eq!((&list[0]["width"], &list[0]["height"]), (&640.into(), &480.into()));

    // One frame, then both at 5 a second: what is displayed is one of them, whole, and each is seen.
    let [first, second] = frames.each_ref().map(|frame| &frame.bytes[..]);
    screen.displays(&folder, &["frames/0.png"], &[first]);
    screen.displays(&folder, &["frames", "--rate", "5"], &[first, second]);

    // A smaller frame lies in the middle with black around it.
    let small = noise(3, (200, 100));
    small.write(&folder.path("small.png")).unwrap();
    let mut around = vec![0; 3 * 640 * 480];
    for (y, row) in small.bytes.chunks(3 * 200).enumerate() {
        around[3 * ((190 + y) * 640 + 220)..][..row.len()].copy_from_slice(row);
    }
    screen.displays(&folder, &["small.png"], &[&around]);

    // The pattern of the link arrives as it is.
    folder.succeeds(&["link", "pattern", "--size", "640x480", "-o", "pattern.png"]);
    let pattern = image::open(folder.path("pattern.png")).unwrap().into_rgb8();
    screen.displays(&folder, &["pattern.png"], &[&pattern]);

    let told = screen.told(&folder, &["show", "frames/0.png", "--seconds", "0.1"]);
    assert_eq!(told["screen"]["width"], 640);
    let line = format!(
        "640×480: all {} pixels of 4 frames read back exactly, and of 200×100 amid black",
        640 * 480
    );
    // Past the test harness, which keeps what passing tests print.
    writeln!(stderr(), "{line}").unwrap();
}

#[test]
fn what_a_screen_cannot_show_is_refused() {
    let screen = Screen::open((320, 240));
    let folder = Folder::new();
    noise(1, (320, 240)).write(&folder.path("fits.png")).unwrap();
    noise(1, (321, 240)).write(&folder.path("wide.png")).unwrap();
    noise(1, (320, 241)).write(&folder.path("high.png")).unwrap();
    for (arguments, word) in [
        (
            ["show", "fits.png", "--screen", "2"],
            "there is no screen 2; there are 1",
        ),
        (
            ["show", "fits.png", "--screen", "0"],
            "there is no screen 0; there are 1",
        ),
        (
            ["show", "wide.png", "--screen", "1"],
            "frames of 321×240 do not fit screen 1 of 320×240",
        ),
        (
            ["show", "high.png", "--screen", "1"],
            "frames of 320×241 do not fit screen 1 of 320×240",
        ),
    ] {
        let refused = screen.command(&folder, &arguments).output().unwrap();
        let errors = String::from_utf8_lossy(&refused.stderr);
        assert_eq!(refused.status.code(), Some(1), "{errors}");
        assert!(errors.contains(word) && errors.lines().count() == 1, "{errors}");
    }
    // Without a desktop too.
    for arguments in [&["screens"][..], &["show", "fits.png"]] {
        let refused = screen
            .command(&folder, arguments)
            .env_remove("DISPLAY")
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&refused.stderr);
        assert_eq!(refused.status.code(), Some(1), "{errors}");
        assert!(errors.contains("no desktop") && errors.lines().count() == 1, "{errors}");
    }
}
