//! Tests `phasefront calibrate` with photographs by a program, which is a shell script over photographs of a rehearsal.
#![cfg(unix)]
use crate::folder;

use folder::Folder;
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_core::optics::metrics;
use phasefront_io::picture;
use std::fs;
use std::path::Path;
use std::process::Command;
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
    assert!(folder.fails(&patterns, 1).contains("--capture goes with --captures"));
    assert!(!Path::new(&folder.path("p")).exists());
}
