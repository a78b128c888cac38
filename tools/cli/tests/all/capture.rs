//! Tests `phasefront calibrate` with photographs by a program, which is a shell script over photographs of a rehearsal.
#![cfg(unix)]
use crate::folder;

use folder::Folder;
use ndarray::Array2;
use phasefront::Display;
use phasefront::target::Response;
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::simulated_display::SimulatedDisplay;
use phasefront_core::optics::metrics;
use phasefront_io::display::calibration;
use phasefront_io::picture;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Answers each request by the rehearsal's photograph that is next, but for `FAULTS`, cases of the request's number.
const PROGRAM: &str = r#"
n=$(cat count 2>/dev/null || echo 0)
while read -r line; do
    n=$((n + 1)); echo $n >count; echo "$line" >>asked
    photo=$(echo "$line" | sed 's/.*"photo":"\([^"]*\)".*/\1/')
    k=$(ls "$(dirname "$photo")" | grep -c '^capture_')
    echo "a driver says hello"
    case $n in
        FAULTS
        *) cp "$(printf 'SOURCE/capture_%03d.png' "$k")" "$photo" ;;
    esac
    echo '{"done": {"exposure_s": 0.5}}'
done
"#;

/// The arguments that calibrate the curves with the program.
const LUT: [&str; 12] = [
    "calibrate",
    "lut",
    "--captures",
    "taken",
    "-o",
    "table.pfp",
    "--display",
    "one.toml",
    "--overwrite",
    "--capture",
    "sh",
    "program.sh",
];

/// Rehearses with one laser and writes the program.
fn rehearsed(faults: &str) -> Folder {
    let folder = Folder::new();
    let rehearse = [
        "calibrate",
        "rehearse",
        "--size",
        "144x64",
        "--zoom",
        "1.6",
        "--spot-z-mm",
        "5.5",
    ];
    let one = ["--laser-nm", "532", "--captures", "--json", "-o", "out"];
    let said = folder.succeeds(&[&rehearse[..], &one].concat());
    let outcome: serde_json::Value = serde_json::from_str(&said).unwrap();
    let number = |what: &str, when: &str| outcome[what][when][0].as_f64().unwrap();
    assert!(
        number("phase_error_rad", "before") > 0.3 && number("phase_error_rad", "after") < 0.05,
        "{said}"
    );
    assert!(number("strehl", "after") > 0.95 && number("unevenness", "after") < number("unevenness", "before"));
    assert_eq!(outcome["phase_error_rad"]["after"].as_array().unwrap().len(), 1);
    fs::write(
        folder.path("one.toml"),
        "width = 144\nheight = 64\nwavelengths_nm = [532]",
    )
    .unwrap();
    write_program(&folder, "out/captures/laser", faults);
    folder
}

fn write_program(folder: &Folder, source: &str, faults: &str) {
    let program = PROGRAM.replace("SOURCE", source).replace("FAULTS", faults);
    fs::write(folder.path("program.sh"), program).unwrap();
}

fn read(folder: &Folder, name: &str) -> Photograph {
    Photograph::read(&folder.path(name), 0).unwrap()
}

fn taken(folder: &Folder) -> usize {
    let names = fs::read_dir(folder.path("taken/laser")).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with("capture_")).count()
}

/// Writes a photograph of the rehearsal whose values `change` changes.
fn spoiled(folder: &Folder, source: &str, name: &str, change: impl Fn(&Photograph, usize) -> u16) {
    let photo = read(folder, source);
    let values = (0..photo.values.len()).map(|i| change(&photo, i)).collect();
    Photograph { values, ..photo }.write(&folder.path(name)).unwrap();
}

/// Bad photographs are asked for again, and a run that ends is resumed. The table is that of the rehearsal.
#[test]
#[ignore = "slow: 20 seconds of a core"]
fn bad_photographs_are_asked_for_again_and_good_ones_once() {
    let folder = rehearsed(
        r#"6) cp dark.png "$photo" ;;
        10) echo '{"error": "the camera is asleep"}'; continue ;;
        14) ;;
        21) cp small.png "$photo" ;;
        31) cp moved.png "$photo" ;;
        35) cp bright.png "$photo" ;;
        41) exit 3 ;;"#,
    );
    let source = |k: usize| format!("out/captures/laser/capture_{k:03}.png");
    spoiled(&folder, &source(5), "dark.png", |_, i| (i % 7) as u16);
    let small = read(&folder, &source(17));
    let (height, width, values) = small.shrunk(2);
    let values = values.iter().map(|v| *v as u16).collect();
    let small = Photograph {
        height,
        width,
        values,
        full: small.full,
    };
    small.write(&folder.path("small.png")).unwrap();
    spoiled(&folder, &source(26), "moved.png", |photo, i| {
        photo.values[i / photo.width * photo.width + (i + 4) % photo.width]
    });
    spoiled(&folder, &source(29), "bright.png", |photo, i| {
        photo.values[i].saturating_mul(8) & 0xfff0
    });

    let said = folder.fails(&LUT, 1);
    for words in [
        "taken/laser/capture_005.png: shows 0 of the 4 corner marks",
        "taken/laser/capture_008.png: the camera is asleep",
        "incoming.png",
        "others are",
        "is shifted by (-4",
        "of its pixels are saturated",
        "--capture sh: it ended (exit status: 3); what was taken is kept",
    ] {
        assert!(said.contains(words), "no {words:?} in {said}");
    }
    assert_eq!(
        said.lines().filter(|line| line.starts_with("error")).count(),
        1,
        "{said}"
    );
    assert_eq!(taken(&folder), 34, "{said}");

    folder.succeeds(&LUT);
    assert_eq!(taken(&folder), 256);
    let count: usize = fs::read_to_string(folder.path("count"))
        .unwrap()
        .trim()
        .parse()
        .unwrap();
    assert_eq!(count, 256 + 7, "a photograph that exists is not asked for");
    let bytes = |name: &str| fs::read(folder.path(name)).unwrap();
    assert_eq!(bytes("table.pfp"), bytes("out/table.pfp"));

    let asked = fs::read_to_string(folder.path("asked")).unwrap();
    let asked: Vec<serde_json::Value> = asked.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(asked[0]["colour"], "laser");
    assert_eq!(asked[0]["wavelength_nm"], 532.0);
    assert_eq!(
        (&asked[0]["expose"], &asked[0]["settings"]),
        (&true.into(), &serde_json::Value::Null)
    );
    // The first request after the resumption has the settings of the run before.
    assert_eq!(
        (&asked[41]["expose"], &asked[41]["settings"]["exposure_s"]),
        (&false.into(), &0.5.into())
    );
    assert!(
        asked[6]["again"].as_str().unwrap().contains("corner marks"),
        "{}",
        asked[6]
    );
    assert!(!folder.path("taken/laser/show.png").exists() && !folder.path("taken/laser/incoming.png").exists());
    the_laser_is_measured_without_a_diffuser(&folder);
    a_picture_is_displayed(&folder);
}

/// A picture on the calibrated display of one laser is that on a perfect one.
fn a_picture_is_displayed(folder: &Folder) {
    let rgb = image::RgbImage::from_fn(96, 48, |x, y| image::Rgb([(x * 2) as u8, (y * 5) as u8, 90]));
    rgb.save(folder.path("rgb.png")).unwrap();
    let depth = image::GrayImage::from_pixel(96, 48, image::Luma([128]));
    depth.save(folder.path("depth.png")).unwrap();
    let view = |display: &str, name: &str| {
        let image = [
            "hologram",
            "--rgb",
            "rgb.png",
            "--depth",
            "depth.png",
            "--method",
            "layers",
            "--planes",
            "9",
        ];
        folder.succeeds(&[&image[..], &["--display", display, "-o", "h.png"]].concat());
        folder.succeeds(&["refocus", "h.png", "--z-mm", "0", "--display", display, "-o", name]);
        picture::read_rgb(&folder.path(name)).unwrap()
    };
    let (perfect, calibrated) = (view("one.toml", "a.png"), view("out/display.toml", "b.png"));
    let inner = ndarray::s![.., 8..40, 8..88];
    let alike = metrics::compare(perfect.slice(inner), calibrated.slice(inner)).unwrap();
    assert!(alike.psnr_overall > 22.0, "{}", alike.psnr_overall);
}

/// The program's flat modulator takes the diffuser's place; here it is the rehearsal's diffuser.
fn the_laser_is_measured_without_a_diffuser(folder: &Folder) {
    write_program(folder, "none", r#"*) cp out/captures/laser/diffuser.png "$photo" ;;"#);
    let laser = [
        "calibrate",
        "laser",
        "taken",
        "--gaussians",
        "1",
        "-o",
        "laser.png",
        "--display",
        "one.toml",
    ];
    folder.succeeds(&[&laser[..], &["--capture", "sh", "program.sh"]].concat());
    let bytes = |name: &str| fs::read(folder.path(name)).unwrap();
    assert_eq!(bytes("laser.png"), bytes("out/laser.png"));
    assert!(folder.path("taken/laser/flat.png").is_file());
}

#[test]
fn programs_that_do_not_help_are_named() {
    let folder = Folder::new();
    fs::write(
        folder.path("one.toml"),
        "width = 144\nheight = 64\nwavelengths_nm = [532]",
    )
    .unwrap();
    let (blank, full) = (vec![1000; 300 * 150], 65535);
    let blank = Photograph {
        height: 150,
        width: 300,
        values: blank,
        full,
    };
    blank.write(&folder.path("blank.png")).unwrap();
    write_program(&folder, "none", r#"*) cp blank.png "$photo" ;;"#);
    let said = folder.fails(&LUT, 1);
    assert!(
        said.contains("no good photograph in 3 tries; those before are kept"),
        "{said}"
    );
    assert_eq!(said.matches("shows 0 of the 4 corner marks").count(), 4, "{said}");
    assert_eq!(taken(&folder), 0);

    fs::write(folder.path("program.sh"), "sleep 1000 & echo $! >sleep; wait").unwrap();
    let slow = [&LUT[..9], &["--capture-timeout-s", "0.5"], &LUT[9..]].concat();
    assert!(folder.fails(&slow, 1).contains("no answer in 0.5 seconds"));
    // What the program started ends too.
    let alive = format!("kill -0 {}", fs::read_to_string(folder.path("sleep")).unwrap());
    let is_alive = || Command::new("sh").args(["-c", &alive]).status().unwrap().success();
    assert!((0..500).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        !is_alive()
    }));
    // Messages are no answer, and a line without an end is none either.
    fs::write(folder.path("program.sh"), "while :; do echo a driver says hello; done").unwrap();
    assert!(folder.fails(&slow, 1).contains("no answer in 0.5 seconds"));
    fs::write(folder.path("program.sh"), "exec cat /dev/zero").unwrap();
    assert!(folder.fails(&LUT, 1).contains("a line of over 65536 bytes"));
    let absent = [&LUT[..10], &["no-such-program"]].concat();
    assert!(
        folder
            .fails(&absent, 1)
            .contains("--capture no-such-program: cannot be started")
    );
    let patterns = [
        "calibrate",
        "lut",
        "--patterns",
        "p",
        "--display",
        "one.toml",
        "--capture",
        "sh",
    ];
    assert!(folder.fails(&patterns, 2).contains("--capture goes with --captures"));
    assert!(!Path::new(&folder.path("p")).exists());
}

/// Waits until the process `id`, which a shell wrote to `file`, has ended.
fn ends(folder: &Folder, file: &str) -> bool {
    let alive = format!("kill -0 {}", fs::read_to_string(folder.path(file)).unwrap().trim());
    let quiet = |command: &mut Command| command.stderr(Stdio::null()).status().unwrap().success();
    (0..1000).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        !quiet(Command::new("sh").args(["-c", &alive]))
    })
}

/// A terminal sends an interrupt to the command alone, because the program has a process group of its own.
#[test]
fn an_interrupt_ends_a_program_that_hangs_too() {
    // The second program ignores interrupts.
    for ignored in ["", "trap '' INT; "] {
        let folder = Folder::new();
        fs::write(
            folder.path("one.toml"),
            "width = 144\nheight = 64\nwavelengths_nm = [532]",
        )
        .unwrap();
        let program = format!("{ignored}read -r line; sleep 1000 & echo $! >sleep.part; mv sleep.part sleep; wait");
        fs::write(folder.path("program.sh"), program).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_phasefront"))
            .args(LUT)
            .current_dir(folder.path(""))
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        while !folder.path("sleep").exists() {
            std::thread::sleep(Duration::from_millis(10));
            assert_eq!(command.try_wait().unwrap(), None);
        }
        let id = command.id().to_string();
        assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        let status = command.wait().unwrap();
        assert_eq!(
            std::os::unix::process::ExitStatusExt::signal(&status),
            Some(2),
            "{status}"
        );
        assert!(ends(&folder, "sleep"));
    }
}

/// A folder without photographs costs a line for each colour, not for each photograph.
#[test]
fn a_folder_without_photographs_is_told_in_a_line_for_each_colour() {
    let folder = Folder::new();
    fs::write(folder.path("three.toml"), "width = 144\nheight = 64").unwrap();
    for colour in ["red", "green", "blue"] {
        fs::create_dir_all(folder.path(&format!("taken/{colour}"))).unwrap();
    }
    let said = folder.fails(
        &[
            "calibrate",
            "lut",
            "--captures",
            "taken",
            "-o",
            "t.pfp",
            "--display",
            "three.toml",
        ],
        1,
    );
    assert_eq!(said.lines().count(), 4, "{said}");
    assert!(
        said.contains("red: 256 of 256 photographs are missing, the first of pattern_000.png"),
        "{said}"
    );
    assert!(said.contains("768 of 768 captures cannot be used"), "{said}");
}

#[test]
fn two_runs_do_not_photograph_into_one_folder() {
    let folder = Folder::new();
    fs::write(
        folder.path("one.toml"),
        "width = 144\nheight = 64\nwavelengths_nm = [532]",
    )
    .unwrap();
    fs::write(folder.path("program.sh"), "read -r line; touch asked; sleep 1000").unwrap();
    let all = [
        &["calibrate", "all", "bench", "--z-mm", "5.5", "--display", "one.toml"][..],
        &LUT[9..],
    ]
    .concat();
    for call in [&LUT[..], &all] {
        let mut first = Command::new(env!("CARGO_BIN_EXE_phasefront"))
            .args(call)
            .current_dir(folder.path(""))
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        while !folder.path("asked").exists() {
            std::thread::sleep(Duration::from_millis(10));
            assert_eq!(first.try_wait().unwrap(), None);
        }
        let said = folder.fails(call, 1);
        assert!(
            said.contains("another run takes photographs there") && said.lines().count() == 1,
            "{said}"
        );
        let id = first.id().to_string();
        assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        first.wait().unwrap();
        fs::remove_file(folder.path("asked")).unwrap();
    }
}

#[test]
fn all_calibrations_need_a_program_and_what_they_can_use() {
    let folder = Folder::new();
    for (name, text) in [
        ("one.toml", "width = 144\nheight = 64\nwavelengths_nm = [532]\n"),
        ("ten.toml", "width = 144\nheight = 64\nbits = 10\n"),
        ("lens.toml", "width = 144\nheight = 64\nlens_mm = 900\n"),
    ] {
        fs::write(folder.path(name), text).unwrap();
    }
    for (call, code, words) in [
        ("--display one.toml --z-mm 5.5", 2, "--capture is needed"),
        (
            "--display ten.toml --z-mm 5.5 --capture sh",
            1,
            "a display of 10 bits; curves are measured for 8 bits",
        ),
        ("--display one.toml --z-mm 900 --capture sh", 1, "z"),
        (
            "--display lens.toml --z-mm 5.5 --photographs 8 --capture sh",
            2,
            "without carrier, lens and flatness",
        ),
    ] {
        let all = format!("calibrate all bench {call}");
        let said = folder.fails(&all.split(' ').collect::<Vec<_>>(), code);
        assert!(said.contains(words) && said.lines().count() == 1, "{said}");
        assert!(!folder.path("bench").exists());
    }
}

const MODEL: [&str; 14] = [
    "calibrate",
    "model",
    "taken",
    "--photographs",
    "8",
    "-o",
    "model.pfm",
    "--display",
    "one.toml",
    "--json",
    "--overwrite",
    "--capture",
    "sh",
    "program.sh",
];

/// Photographs the holograms that `calibrate model` writes, as `source/capture_000.png` (the marks) and so on.
fn holograms(folder: &Folder) {
    let text = "width = 144\nheight = 72\nwavelengths_nm = [532]\n";
    let display = Display::from_toml(text).unwrap();
    let simulated = SimulatedDisplay::new(&display, 2.5, 3).unwrap().with_faults();
    let Response::PerPixel(table) = simulated.response().unwrap() else {
        panic!("a table");
    };
    calibration::write_per_pixel(&folder.path("table.pfp"), &table).unwrap();
    fs::write(folder.path("one.toml"), format!("{text}per_pixel = \"table.pfp\"\n")).unwrap();
    let by_hand: Vec<&str> = MODEL[..11]
        .iter()
        .map(|word| if *word == "taken" { "hand" } else { *word })
        .collect();
    let said = folder.succeeds(&by_hand);
    assert!(said.contains("\"missing\":9"), "{said}");
    let list = fs::read_to_string(folder.path("hand/holograms.json")).unwrap();
    let list: serde_json::Value = serde_json::from_str(&list).unwrap();
    fs::create_dir(folder.path("source")).unwrap();
    for k in 0..9 {
        let (name, z_mm) = match k {
            0 => ("hand/laser/marks.png".to_owned(), 0.0),
            k => (
                format!("hand/laser/hologram_{:03}.png", k - 1),
                list["z_mm"][k - 1].as_f64().unwrap(),
            ),
        };
        let shown = read(folder, &name);
        let levels = Array2::from_shape_fn((72, 144), |(y, x)| shown.values[y * 144 + x] as u8);
        let photo = simulated.photograph(levels.view(), 0, z_mm / 1e3, k as u64).unwrap();
        photo
            .write(&folder.path(&format!("source/capture_{k:03}.png")))
            .unwrap();
    }
}

/// A camera that sees nothing, saturates, moves half-way or drops a frame costs one line each, and a new photograph.
#[test]
#[ignore = "slow: 20 seconds of a core"]
fn a_model_is_learned_by_a_program_whose_camera_fails_at_times() {
    let folder = Folder::new();
    holograms(&folder);
    spoiled(&folder, "source/capture_001.png", "dark.png", |_, _| 700);
    spoiled(&folder, "source/capture_004.png", "moved.png", |photo, i| {
        photo.values[(i + 12 * (photo.width + 1)) % photo.values.len()]
    });
    spoiled(&folder, "source/capture_002.png", "bright.png", |photo, i| {
        photo.values[i].saturating_mul(20) & 0xfff0
    });
    write_program(
        &folder,
        "source",
        r#"1) cp dark.png "$photo" ;;
        3) cp dark.png "$photo" ;;
        5) cp bright.png "$photo" ;;
        8) cp source/capture_003.png "$photo" ;;
        9) cp moved.png "$photo" ;;
        11) exit 3 ;;"#,
    );
    let said = folder.fails(&MODEL, 1);
    let lines = [
        "taken/laser/capture_marks.png: shows 0 of the 4 corner marks",
        "taken/laser/capture_000.png: shows nothing",
        "taken/laser/capture_001.png: ",
        "taken/laser/capture_003.png: shows the hologram before it",
        "taken/laser/capture_003.png: does not show its hologram where the marks were",
        "--capture sh: it ended (exit status: 3); what was taken is kept",
    ];
    assert_eq!(said.lines().count(), lines.len(), "{said}");
    for (line, words) in said.lines().zip(lines) {
        assert!(line.contains(words) && !line.contains("write patterns"), "{said}");
    }
    assert!(said.contains("saturated"), "{said}");
    assert_eq!(taken(&folder), 5, "{said}");
    let fitted: serde_json::Value = serde_json::from_str(&folder.succeeds(&MODEL)).unwrap();
    assert_eq!(taken(&folder), 9);
    let asked = fs::read_to_string(folder.path("asked")).unwrap();
    assert_eq!(
        asked.lines().count(),
        9 + 6,
        "a photograph that exists is not asked for"
    );
    let misfit = |i: usize| fitted["misfit"][0][i].as_f64().unwrap();
    assert!(misfit(1) < 0.5 * misfit(0), "{fitted}");
}
