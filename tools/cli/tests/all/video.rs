//! Tests `phasefront video` with folders and pipes, frame by frame and live. Every frame is processed or reported
//! dropped.
use crate::skip;
use phasefront::Size;

use phasefront_io::hologram::{self, Hologram};
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;

fn phasefront(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_phasefront"));
    command.args(arguments).env_remove("RUST_LOG");
    command
}

fn json(arguments: &[&str]) -> Value {
    let output = phasefront(arguments).arg("--json").output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn refusal(arguments: &[&str], code: i32) -> String {
    let output = phasefront(arguments).stdin(Stdio::null()).output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
    assert_eq!(errors.lines().count(), 1, "{errors}");
    errors
}

/// Creates colour, and depth in millimetres, of a square that moves over a wall.
fn frame(index: u32) -> (image::RgbImage, image::ImageBuffer<image::Luma<u16>, Vec<u16>>) {
    let square = |x: u32, y: u32| (8 + index * 4..24 + index * 4).contains(&x) && (12..30).contains(&y);
    let colour = image::RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        if square(x, y) {
            image::Rgb([240, 180, 40])
        } else {
            image::Rgb([20, 60, 2 * x as u8])
        }
    });
    let depth = image::ImageBuffer::from_fn(WIDTH, HEIGHT, |x, y| match square(x, y) {
        true => image::Luma([800]),
        false if x == 3 => image::Luma([0]),
        false => image::Luma([2000]),
    });
    (colour, depth)
}

fn folder(frames: u32) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("in");
    std::fs::create_dir(&input).unwrap();
    for index in 0..frames {
        let (colour, depth) = frame(index);
        colour.save(input.join(format!("color_{index}.png"))).unwrap();
        depth.save(input.join(format!("depth_{index}.png"))).unwrap();
    }
    (dir, input)
}

/// Asserts that every frame is reported exactly once.
fn sums_agree(report: &Value) {
    let count = |v: &Value| v.as_u64().unwrap();
    let dropped: u64 = report["dropped"].as_object().unwrap().values().map(count).sum();
    let told = ["processed", "failed", "refused"]
        .map(|key| count(&report[key]))
        .iter()
        .sum::<u64>();
    assert_eq!(count(&report["submitted"]), told + dropped, "{report}");
}

#[test]
fn a_folder_becomes_phase_maps_previews_and_statistics() {
    let (dir, input) = folder(4);
    let out = dir.path().join("out");
    let (input, out_name) = (input.to_str().unwrap(), out.to_str().unwrap());
    let report = json(&[
        "video",
        input,
        "--depth-unit",
        "mm",
        "--preview-mm",
        "3",
        "--offset-mm",
        "1",
        "-o",
        out_name,
    ]);
    assert_eq!(
        (report["processed"].as_u64(), report["failed"].as_u64()),
        (Some(4), Some(0))
    );
    sums_agree(&report);
    let times = &report["frame_times"];
    assert_eq!(times["frames"], 4);
    for stage in ["colour", "depth", "method", "propagate", "encode", "total"] {
        let (median, most) = (&times["median_ms"][stage], &times["p95_ms"][stage]);
        assert!(median.as_f64().unwrap() <= most.as_f64().unwrap(), "{stage}: {times}");
    }
    assert!(times["first_ms"].as_f64() > Some(0.0), "{times}");
    let written: Value = serde_json::from_slice(&std::fs::read(out.join("statistics.json")).unwrap()).unwrap();
    assert_eq!(written, report);
    for index in 0..4 {
        let path = out.join(format!("phase_{index:06}.png"));
        let Hologram::Levels(levels, info) = hologram::read_hologram(&path).unwrap() else {
            panic!("a phase map");
        };
        assert_eq!(levels.dim(), (3, HEIGHT as usize, WIDTH as usize));
        assert!(info.scale.unwrap() > 0.0 && info.display.offset_m() == 1e-3);
        // The square is bright at its position, and the wall is not.
        let preview = image::open(out.join(format!("preview_{index:06}.png")))
            .unwrap()
            .into_rgb8();
        let at = |x: u32| preview.get_pixel(x, 21)[0];
        assert!(at(16 + index * 4) > 150 && at(48 + index * 4 % 8) < 90, "{index}");
    }
    // A frame's phase map can be viewed like any hologram.
    let phase = out.join("phase_000002.png");
    let seen = dir.path().join("seen.png");
    let refocused = phasefront(&["refocus", phase.to_str().unwrap(), "--z-mm", "3", "-o"])
        .arg(&seen)
        .status();
    assert!(refocused.unwrap().success() && seen.exists());
}

#[test]
fn a_live_stream_answers_or_drops_every_frame() {
    let (_dir, input) = folder(3);
    let input = input.to_str().unwrap();
    for extra in [&[][..], &["--adaptive"]] {
        let mut arguments = vec![
            "video",
            input,
            "--depth-unit",
            "mm",
            "--live",
            "--rate",
            "1000",
            "--repeat",
            "60",
        ];
        arguments.extend(extra);
        let report = json(&arguments);
        assert_eq!(report["submitted"], 180);
        assert!(report["processed"].as_u64().unwrap() > 0);
        sums_agree(&report);
    }
}

#[test]
fn raw_frames_come_through_a_pipe_and_equal_those_of_files() {
    let (dir, input) = folder(3);
    let (files, pipe) = (dir.path().join("files"), dir.path().join("pipe"));
    let (files_name, pipe_name) = (files.to_str().unwrap(), pipe.to_str().unwrap());
    json(&["video", input.to_str().unwrap(), "--depth-unit", "mm", "-o", files_name]);
    let mut child = phasefront(&["video", "-", "--raw", "64x48", "--depth-unit", "mm", "-o", pipe_name])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    for index in 0..3 {
        let (colour, depth) = frame(index);
        stdin.write_all(colour.as_raw()).unwrap();
        let bytes: Vec<u8> = depth.as_raw().iter().flat_map(|v| v.to_le_bytes()).collect();
        stdin.write_all(&bytes).unwrap();
    }
    drop(stdin);
    assert!(child.wait().unwrap().success());
    for index in 0..3 {
        let name = format!("phase_{index:06}.png");
        let levels = |dir: &Path| image::open(dir.join(&name)).unwrap().into_rgb8().into_raw();
        assert_eq!(levels(&files), levels(&pipe), "{name}");
    }
}

#[test]
fn wrong_input_is_named() {
    let (dir, input) = folder(2);
    let name = input.to_str().unwrap();
    let out = dir.path().join("out");
    let refusal =
        |arguments: &[&str], code| refusal(&[&["video"], arguments, &["-o", out.to_str().unwrap()]].concat(), code);
    assert!(refusal(&["-"], 2).contains("--raw"));
    assert!(refusal(&["-", "--raw", "64x48"], 1).contains("no frame"));
    assert!(refusal(&[name, "--raw", "64x48"], 2).contains("give - as input"));
    assert!(refusal(&[name, "--near", "1"], 2).contains("--far"));
    assert!(refusal(&[name, "--rate", "0"], 2).contains("--rate"));
    let normalized = refusal(&[name, "--near", "1", "--far", "2"], 2);
    assert!(normalized.contains("name the unit by --depth-unit"), "{normalized}");
    // Arguments without an effect are refused.
    for (arguments, word) in [
        (
            &["-", "--raw", "64x48", "--repeat", "2"][..],
            "--repeat goes with a folder",
        ),
        (
            &["-", "--raw", "64x48", "--invert"],
            "--invert goes with a folder or a film",
        ),
        (
            &["-", "--raw", "64x48", "--pairs", "a*,b*"],
            "--pairs goes with a folder",
        ),
        (&[name, "--depth-beside"], "--depth-beside goes with a film"),
        (&[name, "--depth-network", "n.onnx"], "--depth-network goes with a film"),
        (&[name, "--depth-scale", "5000"], "--depth-unit raw"),
        (
            &[name, "--depth-unit", "mm", "--method", "sweep", "--network", "8"],
            "--method network or auto",
        ),
    ] {
        let said = refusal(arguments, 2);
        assert!(said.contains(word), "{arguments:?}: {said}");
    }
    let empty = dir.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    assert!(refusal(&[empty.to_str().unwrap()], 1).contains("no frames"));
    assert!(!out.exists());
}

#[test]
fn depth_beyond_near_and_far_and_another_size_are_told_of() {
    let (dir, input) = folder(1);
    let display = dir.path().join("display.toml");
    std::fs::write(&display, "width = 96\nheight = 48").unwrap();
    let told = |more: &[&str]| {
        let call = [
            "video",
            input.to_str().unwrap(),
            "--json",
            "--depth-unit",
            "mm",
            "--method",
            "sweep",
        ];
        let output = phasefront(&[&call[..], more].concat()).output().unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let metres = told(&["--near", "500", "--far", "4000"]);
    assert!(
        metres.contains("100 % of the depth") && metres.contains("both are metres"),
        "{metres}"
    );
    assert_eq!(told(&["--near", "0.5", "--far", "4"]), "");
    let size = told(&["--display", display.to_str().unwrap()]);
    assert!(
        size.contains("64×48") && size.contains("the modulator 96×48: --size 96x48"),
        "{size}"
    );
    assert_eq!(told(&["--display", display.to_str().unwrap(), "--size", "96x48"]), "");
}

/// Tests a real sensor's holes, noise and misaligned colour, as video and as a live stream.
#[test]
fn a_captured_sequence_runs_as_video_and_live() {
    let redwood = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/redwood");
    let Some(input) = redwood.to_str().filter(|_| redwood.exists()) else {
        skip::or_fail("captured data", format!("{} is not there", redwood.display()));
        return;
    };
    let size = ["--depth-unit", "mm", "--size", "320x240"];
    let report = json(&[&["video", input, "--repeat", "2"], &size[..]].concat());
    assert_eq!(report["processed"], 10);
    sums_agree(&report);
    let live = ["video", input, "--live", "--rate", "200", "--repeat", "20"];
    let report = json(&[&live, &size[..]].concat());
    assert_eq!(
        (report["submitted"].as_u64(), report["failed"].as_u64()),
        (Some(100), Some(0))
    );
    sums_agree(&report);
}

/// Returns all files of a folder and their contents, without the statistics.
fn contents(dir: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "png"))
        .map(|path| {
            (
                path.file_name().unwrap().to_string_lossy().into_owned(),
                std::fs::read(&path).unwrap(),
            )
        })
        .collect();
    files.sort();
    files
}

/// Returns the holograms of a folder, without the records of their sources.
fn holograms(dir: &Path) -> Vec<(String, Hologram)> {
    let read = |(name, _)| {
        let hologram = hologram::read_hologram(&dir.join(&name)).unwrap();
        (name, hologram)
    };
    contents(dir).into_iter().map(read).collect()
}

#[test]
fn a_run_that_was_killed_is_taken_up_and_gives_the_same_files() {
    let (dir, input) = folder(9);
    let input = input.to_str().unwrap();
    for method in ["network", "auto"] {
        let (whole, cut) = (
            dir.path().join(format!("whole-{method}")),
            dir.path().join(format!("cut-{method}")),
        );
        let flags = [
            "video",
            input,
            "--depth-unit",
            "mm",
            "--preview-mm",
            "1",
            "--method",
            method,
            "-o",
        ];
        json(&[&flags[..], &[whole.to_str().unwrap()]].concat());
        let call = [&flags[..], &[cut.to_str().unwrap()]].concat();
        let mut child = phasefront(&call).stdout(Stdio::null()).spawn().unwrap();
        while !cut.join("phase_000003.png").exists() && child.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        // The output of the interrupted run must be incomplete, however far it got.
        for index in 5..9 {
            let _ = std::fs::remove_file(cut.join(format!("phase_{index:06}.png")));
        }
        assert!(
            refusal(&call, 1).contains("--resume"),
            "nothing is overwritten in silence"
        );
        for (name, _) in contents(&cut) {
            image::open(cut.join(&name)).expect("a killed run leaves whole files alone");
        }
        let before = std::fs::metadata(cut.join("phase_000001.png"))
            .unwrap()
            .modified()
            .unwrap();
        json(&[&call[..], &["--resume"]].concat());
        assert!(contents(&whole) == contents(&cut), "{method}");
        let after = std::fs::metadata(cut.join("phase_000001.png"))
            .unwrap()
            .modified()
            .unwrap();
        assert_eq!(before, after, "what is there is not made again");
        json(&[&call[..], &["--overwrite"]].concat());
        assert!(contents(&whole) == contents(&cut), "{method}");
    }
}

/// Creates `path` from `from`: a film from pictures, or pictures from a film.
pub(crate) fn film(rate: &[&str], from: &Path, path: &Path, codec: &[&str]) {
    let made = Command::new("ffmpeg")
        .args(["-v", "error", "-y"])
        .args(rate)
        .arg("-i")
        .arg(from)
        .args(codec)
        .arg(path)
        .status();
    assert!(made.expect("ffmpeg runs: apt-get install ffmpeg").success());
}

#[test]
fn the_shorter_of_two_films_ends_the_video_and_is_named() {
    let (dir, input) = folder(3);
    let at = |name: &str| dir.path().join(name);
    let rate = ["-framerate", "10"];
    for (length, frames) in [("long", "3"), ("short", "2")] {
        for (kind, format) in [("color", "gbrp"), ("depth", "gray16le")] {
            let codec = ["-c:v", "ffv1", "-pix_fmt", format, "-frames:v", frames];
            let pictures = input.join(format!("{kind}_%d.png"));
            film(&rate, &pictures, &at(&format!("{kind}-{length}.mkv")), &codec);
        }
    }
    for (colour, depth, ends) in [("long", "short", "of depth ends"), ("short", "long", "of colour ends")] {
        let out = at(colour);
        let output = Command::new(env!("CARGO_BIN_EXE_phasefront"))
            .arg("video")
            .arg(at(&format!("color-{colour}.mkv")))
            .arg("--depth-video")
            .arg(at(&format!("depth-{depth}.mkv")))
            .args(["--depth-unit", "mm", "-o"])
            .arg(&out)
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && errors.contains(ends), "{errors}");
        assert_eq!(holograms(&out).len(), 2);
    }
}

#[test]
fn films_go_in_and_come_out() {
    let (dir, input) = folder(5);
    let at = |name: &str| dir.path().join(name);
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let (lossless, rate) = (["-c:v", "ffv1"], ["-framerate", "10"]);
    film(
        &rate,
        &input.join("color_%d.png"),
        &at("colour.mkv"),
        &[&lossless[..], &["-pix_fmt", "gbrp"]].concat(),
    );
    film(
        &rate,
        &input.join("depth_%d.png"),
        &at("depth.mkv"),
        &[&lossless[..], &["-pix_fmt", "gray16le"]].concat(),
    );
    let (colour, depth) = (text(&at("colour.mkv")), text(&at("depth.mkv")));
    let call = ["video", &colour, "--depth-video", &depth, "--depth-unit", "mm", "-o"];
    // A lossless film gives the same frames as its pictures.
    let films = text(&at("films"));
    json(&[&call[..], &[&films]].concat());
    let files = text(&at("files"));
    json(&[
        "video",
        input.to_str().unwrap(),
        "--depth-unit",
        "mm",
        "--rate",
        "10",
        "-o",
        &files,
    ]);
    assert!(holograms(&at("films")) == holograms(&at("files")));
    // The outputs are a preview film and a lossless film of the phases.
    let out = text(&at("out.mp4"));
    json(&[&call[..], &[&out]].concat());
    assert!(refusal(&[&call[..], &[&out]].concat(), 1).contains("--overwrite"));
    let about = phasefront_io::film::about(&at("out.mp4")).unwrap();
    assert_eq!((about.frames, about.rate_hz), (5, 10.0));
    let phases = at("out-phases.mp4");
    let back = at("back");
    std::fs::create_dir(&back).unwrap();
    film(&[], &phases, &back.join("phase_%06d.png"), &["-start_number", "0"]);
    for index in 0..5 {
        let levels = |dir: &Path| {
            image::open(dir.join(format!("phase_{index:06}.png")))
                .unwrap()
                .into_rgb8()
        };
        assert_eq!(levels(&at("out")), levels(&back), "{index}");
    }
    // Depth beside colour, in one picture.
    let half = Command::new("ffmpeg")
        .args(["-v", "error", "-y", "-i", &colour, "-i", &depth, "-filter_complex"])
        .args(["[1]format=gray,format=gbrp[d];[0][d]hstack", "-c:v", "ffv1"])
        .arg(at("beside.mkv"))
        .status();
    assert!(half.unwrap().success());
    let report = json(&[
        "video",
        &text(&at("beside.mkv")),
        "--depth-beside",
        "--invert",
        "-o",
        &text(&at("b")),
    ]);
    assert_eq!(report["processed"], 5);
    let first = hologram::read_hologram(&at("b").join("phase_000000.png")).unwrap();
    assert_eq!(
        first.size(),
        Size {
            width: WIDTH as usize,
            height: HEIGHT as usize
        }
    );
    assert!(refusal(&["video", &colour, "-o", &text(&at("c"))], 1).contains("--depth-network"));
    std::fs::write(at("no.mp4"), "no film").unwrap();
    let no = refusal(
        &["video", &text(&at("no.mp4")), "--depth-beside", "-o", &text(&at("c"))],
        1,
    );
    assert!(no.contains("no.mp4") && no.contains("ffmpeg"), "{no}");
}

#[test]
fn folders_are_read_as_data_sets_lay_them() {
    let (dir, input) = folder(3);
    let at = |name: &str| dir.path().join(name);
    for name in ["redwood/rgb", "redwood/depth", "tum/rgb", "tum/depth"] {
        std::fs::create_dir_all(at(name)).unwrap();
    }
    let (mut colours, mut depths) = (String::new(), String::new());
    for index in 0..3 {
        let (colour, depth) = (
            input.join(format!("color_{index}.png")),
            input.join(format!("depth_{index}.png")),
        );
        std::fs::copy(
            &colour,
            at(&format!("redwood/rgb/000000{index}-00000000{index}000.png")),
        )
        .unwrap();
        std::fs::copy(
            &depth,
            at(&format!("redwood/depth/000000{index}-00000000{index}017.png")),
        )
        .unwrap();
        std::fs::copy(&colour, at(&format!("tum/rgb/{index}.png"))).unwrap();
        // TUM's depth has five units per millimetre.
        let mut raw = image::open(&depth).unwrap().into_luma16();
        raw.iter_mut().for_each(|v| *v *= 5);
        raw.save(at(&format!("tum/depth/{index}.png"))).unwrap();
        colours += &format!("{index}.00 rgb/{index}.png\n");
        depths += &format!("{index}.01 depth/{index}.png\n");
    }
    std::fs::write(at("tum/rgb.txt"), format!("# colour\n{colours}")).unwrap();
    std::fs::write(at("tum/depth.txt"), format!("# depth\n{depths}")).unwrap();
    let made = |input: &Path, name: &str, more: &[&str]| {
        let out = at(name);
        json(&[&["video", input.to_str().unwrap(), "-o", out.to_str().unwrap()], more].concat());
        holograms(&out)
    };
    let plain = made(&input, "a", &["--depth-unit", "mm"]);
    assert_eq!(plain.len(), 3);
    assert!(made(&at("redwood"), "b", &[]) == plain);
    assert!(made(&at("tum"), "c", &[]) == plain);
    let pairs = [
        "--pairs",
        "rgb/*.png,depth/*.png",
        "--depth-unit",
        "raw",
        "--depth-scale",
        "5000",
    ];
    assert!(made(&at("tum"), "d", &pairs) == plain);
    let out = at("e").to_str().unwrap().to_owned();
    assert!(refusal(&["video", input.to_str().unwrap(), "--pairs", "rgb_*", "-o", &out], 2).contains("comma"));
    // Folders with equal names, and the names in the documentation of --pairs.
    for name in ["plain/rgb", "plain/depth", "left"] {
        std::fs::create_dir_all(at(name)).unwrap();
    }
    for (index, name) in ["cat", "dog", "eel"].iter().enumerate() {
        let (colour, depth) = (
            input.join(format!("color_{index}.png")),
            input.join(format!("depth_{index}.png")),
        );
        std::fs::copy(&colour, at(&format!("plain/rgb/{name}.png"))).unwrap();
        std::fs::copy(&depth, at(&format!("plain/depth/{name}.png"))).unwrap();
        std::fs::copy(&colour, at(&format!("left/left_{index}.png"))).unwrap();
        std::fs::copy(&depth, at(&format!("left/left_{index}_z.png"))).unwrap();
    }
    assert!(made(&at("plain"), "f", &["--depth-unit", "mm"]) == plain);
    let pairs = ["--pairs", "left_*.png,left_*_z.png", "--depth-unit", "mm"];
    assert!(made(&at("left"), "g", &pairs) == plain);
}

#[test]
fn a_run_without_output_is_refused_unless_it_reports() {
    let (_dir, input) = folder(1);
    let input = input.to_str().unwrap();
    assert!(refusal(&["video", input, "--depth-unit", "mm"], 2).contains("-o"));
    assert_eq!(json(&["video", input, "--depth-unit", "mm"])["processed"], 1);
    let live = phasefront(&["video", input, "--depth-unit", "mm", "--live"])
        .output()
        .unwrap();
    assert!(live.status.success() && !live.stdout.is_empty());
}

#[test]
fn a_bad_frame_is_named() {
    let (dir, input) = folder(3);
    let out = dir.path().join("out");
    let call = [
        "video",
        input.to_str().unwrap(),
        "--depth-unit",
        "mm",
        "-o",
        out.to_str().unwrap(),
    ];
    let empty = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(WIDTH, HEIGHT);
    empty.save(input.join("depth_1.png")).unwrap();
    let error = refusal(&call, 1);
    assert!(
        error.contains("color_1.png") && error.contains("no usable reading"),
        "{error}"
    );
    // A frame of another size would be stretched to the size of the first.
    let (colour, depth) = frame(1);
    depth.save(input.join("depth_1.png")).unwrap();
    image::imageops::thumbnail(&colour, WIDTH / 2, HEIGHT / 2)
        .save(input.join("color_1.png"))
        .unwrap();
    let call = [&call[..], &["--overwrite"]].concat();
    let error = refusal(&call, 1);
    assert!(error.contains("color_1.png") && error.contains("32×24"), "{error}");
    assert!(error.contains("64×48") && error.contains("hologram"), "{error}");
    assert!(out.join("phase_000000.png").exists() && !out.join("phase_000001.png").exists());
    // The error is the only trace of the bad frame, so the run can resume once the frame is repaired.
    colour.save(input.join("color_1.png")).unwrap();
    let mended = [&call[..call.len() - 1], &["--resume"]].concat();
    assert_eq!(json(&mended)["processed"], 3);
}

#[test]
fn a_run_is_resumed_with_the_same_flags_and_input_alone() {
    let (dir, input) = folder(3);
    let out = dir.path().join("out");
    let call = [
        "video",
        input.to_str().unwrap(),
        "--depth-unit",
        "mm",
        "-o",
        out.to_str().unwrap(),
    ];
    json(&call);
    std::fs::remove_file(out.join("phase_000002.png")).unwrap();
    let before = contents(&out);
    let refused = |more: &[&str]| refusal(&[&call[..], &["--resume"], more].concat(), 1);
    for (more, earlier, now) in [
        (&["--method", "sweep"][..], "--method auto", "--method sweep"),
        (
            &["--dark-threshold", "0.2"],
            "no --dark-threshold",
            "--dark-threshold 0.2",
        ),
        (&["--local-steps", "3"], "no --local-steps", "--local-steps 3"),
        (&["--method", "auto", "--network", "15"], "no --network", "--network 15"),
        (&["--precision", "f32"], "no --precision", "--precision f32"),
        (&["--brightness", "max"], "--brightness smoothed", "--brightness max"),
        (&["--rate", "24"], "--rate 30", "--rate 24"),
        (&["--offset-mm", "2"], "display offset_mm 0", "display offset_mm 2"),
        (&["--preview-mm", "1"], "no --preview-mm", "--preview-mm 1"),
        (&["--near", "1", "--far", "2"], "no --far", "--far 2"),
    ] {
        let error = refused(more);
        assert!(
            error.contains(earlier) && error.contains(now) && error.contains("--overwrite"),
            "{error}"
        );
    }
    // One picture is replaced by another.
    let second = std::fs::read(input.join("color_1.png")).unwrap();
    std::fs::copy(input.join("color_0.png"), input.join("color_1.png")).unwrap();
    let error = refused(&[]);
    assert!(
        error.contains("phase_000001.png") && error.contains("another frame"),
        "{error}"
    );
    std::fs::write(input.join("color_1.png"), second).unwrap();
    assert!(contents(&out) == before, "nothing was written");
    // A folder whose flags are unknown is not resumed either.
    let request = std::fs::read(out.join("request.json")).unwrap();
    std::fs::remove_file(out.join("request.json")).unwrap();
    assert!(refused(&[]).contains("request.json"));
    assert!(!out.join("request.json").exists());
    std::fs::write(out.join("request.json"), request).unwrap();
    json(&[&call[..], &["--resume"]].concat());
    assert_eq!(contents(&out).len(), 3);
}

#[test]
fn depth_that_goes_the_other_way_is_not_resumed() {
    let (dir, input) = folder(2);
    let out = dir.path().join("out");
    for index in 0..2 {
        let depth = image::GrayImage::from_fn(WIDTH, HEIGHT, |x, y| image::Luma([(2 * x + y) as u8 + index]));
        depth.save(input.join(format!("depth_{index}.png"))).unwrap();
    }
    let call = ["video", input.to_str().unwrap(), "-o", out.to_str().unwrap()];
    json(&call);
    let error = refusal(&[&call[..], &["--resume", "--invert"]].concat(), 1);
    assert!(error.contains("no --invert, this run has --invert"), "{error}");
}

#[test]
fn one_run_at_a_time_writes_into_a_folder() {
    let (dir, input) = folder(1);
    let out = dir.path().join("out");
    let mut first = phasefront(&["video", "-", "--raw", "64x48", "--depth-unit", "mm", "-o"])
        .arg(&out)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut stdin = first.stdin.take().unwrap();
    let (colour, depth) = frame(0);
    stdin.write_all(colour.as_raw()).unwrap();
    let bytes: Vec<u8> = depth.as_raw().iter().flat_map(|v| v.to_le_bytes()).collect();
    stdin.write_all(&bytes).unwrap();
    while !out.join("phase_000000.png").exists() && first.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    let before = std::fs::read(out.join("phase_000000.png")).unwrap();
    let (input, out_name) = (input.to_str().unwrap(), out.to_str().unwrap());
    for more in [&[][..], &["--resume"], &["--overwrite"]] {
        let error = refusal(
            &[&["video", input, "--depth-unit", "mm", "-o", out_name], more].concat(),
            1,
        );
        assert!(error.contains("another run"), "{error}");
    }
    assert_eq!(std::fs::read(out.join("phase_000000.png")).unwrap(), before);
    drop(stdin);
    assert!(first.wait().unwrap().success());
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_whole_files_and_names_resume() {
    use std::os::unix::process::ExitStatusExt;
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    std::fs::create_dir(at("in")).unwrap();
    // Large frames, so that writing them takes a while.
    for index in 0..4 {
        let (colour, depth) = frame(index);
        image::imageops::resize(&colour, 1024, 768, image::imageops::Nearest)
            .save(at(&format!("in/color_{index}.png")))
            .unwrap();
        depth.save(at(&format!("in/depth_{index}.png"))).unwrap();
    }
    let (input, out) = (at("in").to_str().unwrap().to_owned(), at("out"));
    let call = [
        "video",
        &input,
        "--depth-unit",
        "mm",
        "--method",
        "sweep",
        "-o",
        out.to_str().unwrap(),
    ];
    let names = || -> Vec<String> {
        let entries = std::fs::read_dir(&out).into_iter().flatten().flatten();
        entries
            .map(|entry| entry.file_name().to_string_lossy().into_owned())
            .collect()
    };
    let half = |names: &[String]| names.iter().any(|name| name.ends_with(".tmp"));
    let child = phasefront(&call)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while !(names().contains(&"phase_000000.png".to_owned()) && half(&names())) {
        assert!(!out.join("phase_000003.png").exists(), "no file was seen half written");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.unwrap().success());
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.signal(), Some(2), "{errors}");
    assert!(
        errors.lines().count() == 1 && errors.contains("out") && errors.contains("--resume"),
        "{errors}"
    );
    assert!(!half(&names()), "{:?}", names());
    assert!(!out.join("phase_000003.png").exists(), "the run was interrupted");
    json(&[&call[..], &["--resume"]].concat());
    assert_eq!(holograms(&out).len(), 4);
}

/// Tests a film about which ffmpeg complains at length: more than a pipe holds.
#[cfg(unix)]
#[test]
fn what_ffmpeg_complains_about_stops_nothing() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let script = |code: u8| {
        format!(
            "#!/bin/sh\n[ \"$1\" = -version ] && exit 0\n\
             i=0; while [ $i -lt 3000 ]; do echo \"complaint number $i of a film that is damaged\" >&2; i=$((i+1)); done\n\
             printf 'P6\\n64 48\\n255\\n'; head -c 9216 /dev/zero; exit {code}\n"
        )
    };
    let path = std::env::join_paths(
        [dir.path()]
            .into_iter()
            .map(Path::to_owned)
            .chain(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default())),
    );
    let path = path.unwrap();
    std::fs::write(at("film.mp4"), "any").unwrap();
    let run = |code: u8| {
        std::fs::write(at("ffmpeg"), script(code)).unwrap();
        std::fs::set_permissions(at("ffmpeg"), std::fs::Permissions::from_mode(0o755)).unwrap();
        let mut child = phasefront(&["video", "--depth-beside", "--json"])
            .arg(at("film.mp4"))
            .env("PATH", &path)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // A deadlock between the run and ffmpeg would never end.
        let waits = std::time::Duration::from_millis(20);
        let ended = (0..3000).any(|_| {
            std::thread::sleep(waits);
            child.try_wait().unwrap().is_some()
        });
        if !ended {
            child.kill().unwrap();
        }
        let output = child.wait_with_output().unwrap();
        assert!(ended, "the run hangs");
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, errors) = run(0);
    assert_eq!(code, Some(0), "{errors}");
    assert!(
        errors.starts_with("warn: ") && errors.contains("complaint number 2999"),
        "{errors}"
    );
    let (code, errors) = run(1);
    assert_eq!((code, errors.lines().count()), (Some(1), 1), "{errors}");
    assert!(
        errors.contains("film.mp4") && errors.contains("complaint number 2999"),
        "{errors}"
    );
}

#[test]
#[ignore = "slow: 15 seconds of a core"]
fn films_have_any_names_and_are_films_alone() {
    let (dir, input) = folder(2);
    let at = |name: &str| dir.path().join(name);
    film(
        &["-framerate", "10"],
        &input.join("color_%d.png"),
        &at("a.mp4"),
        &["-vf", "format=gray,negate", "-c:v", "libx264rgb", "-qp", "0"],
    );
    let run = |arguments: &[&str]| {
        let output = phasefront(arguments).current_dir(dir.path()).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), errors)
    };
    let done = (Some(0), String::new());
    for (index, name) in ["a.mp4", "x:b.mp4", "concat:a.mp4", "file:c.mp4", "100%d.mp4"]
        .iter()
        .enumerate()
    {
        if index > 0 {
            std::fs::copy(at("a.mp4"), at(name)).unwrap();
        }
        let out = format!("out{index}");
        assert_eq!(run(&["video", name, "--depth-beside", "-o", &out]), done, "{name}");
        assert!(contents(&at("out0")) == contents(&at(&out)), "{name}");
    }
    // A text file that names another film.
    std::fs::write(at("list.mp4"), "ffconcat version 1.0\nfile a.mp4\n").unwrap();
    let (code, errors) = run(&["video", "list.mp4", "--depth-beside", "-o", "no"]);
    assert!(code == Some(1) && errors.contains("list.mp4"), "{errors}");
    assert!(phasefront_io::film::about(&at("list.mp4")).is_none());
    // Paths that ffmpeg would take for patterns, options or protocols.
    for folder in ["p%d", "%%"] {
        std::fs::create_dir(at(folder)).unwrap();
    }
    for name in ["p%d/x.mp4", "%%/x.mp4", "-x.mp4", "concat:x.mp4"] {
        let output = format!("-o={name}");
        assert_eq!(run(&["video", "a.mp4", "--depth-beside", &output]), done, "{name}");
        assert_eq!(
            phasefront_io::film::about(&at(name)).map(|about| about.frames),
            Some(2),
            "{name}"
        );
    }
    let (code, errors) = run(&["video", "a.mp4", "--depth-beside", "-o", "nowhere/x.mp4"]);
    assert!(code == Some(1) && errors.contains("nowhere"), "{errors}");
    assert!(!at("nowhere").exists());
}

#[test]
fn films_replace_no_file_unasked() {
    let (dir, input) = folder(2);
    let at = |name: &str| dir.path().join(name);
    let out = at("x.mp4").to_str().unwrap().to_owned();
    let call = ["video", input.to_str().unwrap(), "--depth-unit", "mm", "-o", &out];
    std::fs::write(at("x.half.mp4"), "mine").unwrap();
    std::fs::write(at("x-phases.mp4"), "mine").unwrap();
    for more in [&[][..], &["--resume"]] {
        assert!(refusal(&[&call[..], more].concat(), 1).contains("x-phases.mp4"));
        assert_eq!(std::fs::read(at("x-phases.mp4")).unwrap(), b"mine");
    }
    std::fs::remove_file(at("x-phases.mp4")).unwrap();
    json(&call);
    assert_eq!(std::fs::read(at("x.half.mp4")).unwrap(), b"mine");
    // The films of an earlier run are written again when it is resumed.
    std::fs::remove_file(at("x/phase_000001.png")).unwrap();
    json(&[&call[..], &["--resume"]].concat());
    std::fs::write(at("x-phases.mp4"), "old").unwrap();
    json(&[&call[..], &["--overwrite"]].concat());
    assert_ne!(std::fs::read(at("x-phases.mp4")).unwrap(), b"old");
    // The input film is not replaced.
    let pictures = input.join("depth_%d.png");
    film(
        &["-framerate", "10"],
        &pictures,
        &at("y.mp4"),
        &["-c:v", "libx264rgb", "-qp", "0"],
    );
    let before = std::fs::read(at("y.mp4")).unwrap();
    let out = at("y.mp4").to_str().unwrap().to_owned();
    let error = refusal(&["video", &out, "--depth-beside", "--overwrite", "-o", &out], 1);
    assert!(error.contains("input"), "{error}");
    assert_eq!(std::fs::read(at("y.mp4")).unwrap(), before);
}
