//! Tests `phasefront show` and `screens` on virtual X servers, whose pixels are read back.
use crate::folder;
use phasefront::Size;

use folder::Folder;
use phasefront_io::hologram::packed::{Image, Kind};
use std::fs;
use std::io::{BufRead, BufReader, Write, stderr};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// An X server without a physical monitor.
struct Server {
    process: Child,
    display: String,
    /// The size of all its screens together.
    size: Size,
    folder: tempfile::TempDir,
}

impl Server {
    /// Starts Xvfb with one screen, which stores the displayed image in a file.
    fn with_one_screen(size: Size) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new("Xvfb");
        let depth = format!("{}x{}x24", size.width, size.height);
        command.args(["-screen", "0", &depth, "-fbdir"]).arg(folder.path());
        Server::start(command, size, folder, "xvfb")
    }

    /// Starts Xorg with a screen of 640×480 and one of 640×400 to its right. Xvfb never reports more than one screen.
    fn with_two_screens() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let config = folder.path().join("xorg.conf");
        fs::write(&config, XORG).unwrap();
        let mut command = Command::new("Xorg");
        command.args(["-noreset", "-novtswitch", "-sharevts", "-nolisten", "tcp", "-config"]);
        command.arg(config).arg("-logfile").arg(folder.path().join("log"));
        let server = Server::start(
            command,
            Size {
                width: 1280,
                height: 480,
            },
            folder,
            "xserver-xorg-core xserver-xorg-video-dummy",
        );
        server.client("xrandr", &["--addmode", "DUMMY1", "640x400"], "x11-xserver-utils");
        let second = ["--output", "DUMMY1", "--mode", "640x400", "--right-of", "DUMMY0"];
        server.client("xrandr", &second, "x11-xserver-utils");
        server
    }

    fn start(mut command: Command, size: Size, folder: tempfile::TempDir, packages: &str) -> Self {
        let mut process = command
            .args(["-displayfd", "1"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|e| panic!("{command:?}: {e}: apt-get install {packages}"));
        // Once the server accepts connections, it prints the number of the free display that it took.
        let mut number = String::new();
        let stdout = process.stdout.take().unwrap();
        BufReader::new(stdout).read_line(&mut number).unwrap();
        let number = number.trim();
        assert!(
            !number.is_empty(),
            "{command:?} does not start: apt-get install {packages}"
        );
        let display = format!(":{number}");
        Server {
            process,
            display,
            size,
            folder,
        }
    }

    /// Returns the output of an X client program.
    fn client(&self, program: &str, arguments: &[&str], package: &str) -> Vec<u8> {
        let run = Command::new(program)
            .args(arguments)
            .env("DISPLAY", &self.display)
            .output();
        let output = run.unwrap_or_else(|e| panic!("{program}: {e}: apt-get install {package}"));
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{program} {arguments:?}: {errors}");
        output.stdout
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

    /// Returns the JSON output of the command.
    fn told(&self, folder: &Folder, arguments: &[&str]) -> serde_json::Value {
        let output = self.command(folder, arguments).arg("--json").output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {errors}{WINDOWS}");
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// Returns the one-line error of the command, which has code 1.
    fn refusal(&self, folder: &Folder, arguments: &[&str], display: &str) -> String {
        let output = self
            .command(folder, arguments)
            .env("DISPLAY", display)
            .output()
            .unwrap();
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {errors}");
        assert_eq!(errors.lines().count(), 1, "{errors}");
        errors
    }

    /// Returns the displayed pixels as rows of red, green and blue, from X's window dump.
    fn pixels(&self) -> Vec<u8> {
        let file = self.folder.path().join("Xvfb_screen0");
        let dump = if file.exists() {
            fs::read(file).unwrap()
        } else {
            self.client("xwd", &["-root", "-silent"], "x11-apps")
        };
        let number = |n: usize| u32::from_be_bytes([0, 1, 2, 3].map(|i| dump[4 * n + i])) as usize;
        // The dump has a header, a colour map with 12 bytes per entry, and rows of words with blue first.
        let (header, colours, line) = (number(0), number(19), number(12));
        let Size { width, height } = self.size;
        assert_eq!((number(4), number(5), number(11)), (width, height, 32));
        let image = &dump[header + 12 * colours..];
        let rows = image.chunks(line).take(height);
        rows.flat_map(|row| row[..4 * width].chunks(4).flat_map(|p| [p[2], p[1], p[0]]))
            .collect()
    }

    /// Runs `show` until the server has displayed each of `frames` without a changed pixel.
    fn displays(&self, folder: &Folder, arguments: &[&str], frames: &[&[u8]]) {
        let arguments = [&["show", "--seconds", "60"], arguments].concat();
        let mut player = self.command(folder, &arguments).spawn().unwrap();
        let (start, mut seen) = (Instant::now(), vec![false; frames.len()]);
        while seen.contains(&false) {
            let ended = player.try_wait().unwrap();
            assert!(ended.is_none(), "{arguments:?} ended: {ended:?}{WINDOWS}");
            let late = start.elapsed() > Duration::from_secs(50);
            assert!(!late, "{arguments:?}: which frames were seen: {seen:?}");
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

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A hint for failures to open a window.
const WINDOWS: &str = "; windows need apt-get install libx11-6 libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0";

const XORG: &str = r#"
Section "Device"
    Identifier "device"
    Driver "dummy"
    VideoRam 65536
EndSection
Section "Monitor"
    Identifier "monitor"
    HorizSync 5-1000
    VertRefresh 5-200
EndSection
Section "Screen"
    Identifier "screen"
    Device "device"
    Monitor "monitor"
    DefaultDepth 24
    SubSection "Display"
        Depth 24
        Modes "640x480"
        Virtual 2048 1024
    EndSubSection
EndSection
"#;

/// Creates a frame whose neighbouring pixels differ.
fn noise(seed: u32, Size { width, height }: Size) -> Image {
    let byte = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed * 977) >> 13) as u8;
    Image {
        size: Size { width, height },
        bytes: (0..3 * (width * height) as u32).map(byte).collect(),
        kind: Kind::Rgb,
    }
}

/// Creates a black desktop of `size` with a frame at (`left`, `top`).
fn amid_black(frame: &Image, Size { width, height }: Size, (left, top): (usize, usize)) -> Vec<u8> {
    let mut desktop = vec![0; 3 * width * height];
    for (y, row) in frame.bytes.chunks(3 * frame.size.width).enumerate() {
        desktop[3 * ((top + y) * width + left)..][..row.len()].copy_from_slice(row);
    }
    desktop
}

/// Bypasses the test harness, which hides the output of passing tests.
#[allow(clippy::explicit_write)]
fn say(line: &str) {
    writeln!(stderr(), "{line}").unwrap();
}

#[test]
fn a_screen_shows_exactly_what_it_is_given() {
    let size = Size {
        width: 640,
        height: 480,
    };
    let server = Server::with_one_screen(size);
    let folder = Folder::new();
    let frames = [1, 2].map(|seed| noise(seed, size));
    fs::create_dir(folder.path("frames")).unwrap();
    for (n, frame) in frames.iter().enumerate() {
        frame.write(&folder.path(&format!("frames/{n}.png"))).unwrap();
    }
    let list = server.told(&folder, &["screens"]);
    assert_eq!(list.as_array().unwrap().len(), 1);
    assert_eq!((&list[0]["width"], &list[0]["height"]), (&640.into(), &480.into()));

    // One frame, then both at 5 Hz: the displayed image is always one whole frame, and each frame appears.
    let [first, second] = frames.each_ref().map(|frame| &frame.bytes[..]);
    server.displays(&folder, &["frames/0.png"], &[first]);
    server.displays(&folder, &["frames", "--rate", "5"], &[first, second]);
    say(&format!(
        "640×480: all {} pixels of 2 frames read back exactly",
        640 * 480
    ));

    // A smaller frame is centred on black.
    let small = noise(
        3,
        Size {
            width: 200,
            height: 100,
        },
    );
    small.write(&folder.path("small.png")).unwrap();
    server.displays(&folder, &["small.png"], &[&amid_black(&small, size, (220, 190))]);

    // The link pattern arrives unchanged.
    folder.succeeds(&["link", "pattern", "--size", "640x480", "-o", "pattern.png"]);
    let pattern = image::open(folder.path("pattern.png")).unwrap().into_rgb8();
    server.displays(&folder, &["pattern.png"], &[&pattern]);

    // A grey phase map of other software is shown level by level.
    let map = image::GrayImage::from_fn(640, 480, |x, y| image::Luma([(x * 7 + y * 13) as u8]));
    map.save(folder.path("map.bmp")).unwrap();
    std::fs::write(
        folder.path("one.toml"),
        "width = 640\nheight = 480\nwavelengths_nm = [532]\n",
    )
    .unwrap();
    let shown: Vec<u8> = map.as_raw().iter().flat_map(|level| [*level; 3]).collect();
    server.displays(&folder, &["map.bmp", "--display", "one.toml"], &[&shown]);

    let told = server.told(&folder, &["show", "frames/0.png", "--seconds", "0.1"]);
    assert_eq!(told["screen"]["width"], 640);
}

#[test]
fn the_second_screen_shows_exactly_what_it_is_given() {
    let server = Server::with_two_screens();
    let folder = Folder::new();
    let list = server.told(&folder, &["screens"]);
    let told = |n: usize| {
        [
            &list[n]["number"],
            &list[n]["width"],
            &list[n]["height"],
            &list[n]["at"][0],
        ]
    };
    assert_eq!(told(0), [1, 640, 480, 0]);
    assert_eq!(told(1), [2, 640, 400, 640]);
    let frame = noise(
        1,
        Size {
            width: 640,
            height: 400,
        },
    );
    frame.write(&folder.path("frame.png")).unwrap();
    let desktop = amid_black(&frame, server.size, (640, 0));
    server.displays(&folder, &["frame.png", "--screen", "2"], &[&desktop]);
    say(&format!(
        "640×400 on screen 2: all {} pixels read back exactly, screen 1 black",
        640 * 400
    ));
    // On the first screen there is space around the frame.
    let desktop = amid_black(&frame, server.size, (0, 40));
    server.displays(&folder, &["frame.png", "--screen", "1"], &[&desktop]);
}

#[test]
fn what_a_screen_cannot_show_is_refused() {
    let server = Server::with_one_screen(Size {
        width: 320,
        height: 240,
    });
    let folder = Folder::new();
    let frames = [
        (
            "fits.png",
            Size {
                width: 320,
                height: 240,
            },
        ),
        (
            "wide.png",
            Size {
                width: 321,
                height: 240,
            },
        ),
        (
            "high.png",
            Size {
                width: 320,
                height: 241,
            },
        ),
    ];
    for (name, size) in frames {
        noise(1, size).write(&folder.path(name)).unwrap();
    }
    for (name, screen, words) in [
        ("fits.png", "2", "there is no screen 2; there are 1"),
        ("fits.png", "0", "there is no screen 0; there are 1"),
        ("wide.png", "1", "frames of 321×240 do not fit screen 1 of 320×240"),
        ("high.png", "1", "frames of 320×241 do not fit screen 1 of 320×240"),
    ] {
        let said = server.refusal(&folder, &["show", name, "--screen", screen], &server.display);
        assert!(said.contains(words), "{said}");
    }
    for flag in ["--rate", "--seconds"] {
        let said = folder.fails(&["show", "fits.png", flag, "0"], 2);
        assert!(said.contains(&format!("{flag} 0: it must lie above 0")), "{said}");
    }
    // The error also appears without a desktop.
    for arguments in [&["screens"][..], &["show", "fits.png"]] {
        for display in ["", ":60000"] {
            let said = server.refusal(&folder, arguments, display);
            assert!(said.contains("no desktop") && !said.contains(".rs"), "{said}");
        }
    }
}
