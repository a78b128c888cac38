//! Tests `phasefront hologram` on folders of pictures. Each picture is processed separately under its own name.
use phasefront::Size;
use phasefront_io::hologram;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The pictures and their sizes.
const PICTURES: [(&str, u32, u32); 3] = [("cat", 64, 48), ("dog 2", 40, 56), ("eel", 64, 48)];

fn phasefront(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasefront"))
        .args(arguments)
        .env_remove("RUST_LOG")
        .output()
        .unwrap()
}

fn report(output: &Output) -> Value {
    let errors = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {errors}"))
}

fn json(arguments: &[&str]) -> Value {
    let output = phasefront(&[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    report(&output)
}

fn refusal(arguments: &[&str], code: i32) -> String {
    let output = phasefront(arguments);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
    assert_eq!(errors.lines().count(), 1, "{errors}");
    errors
}

struct Folder(tempfile::TempDir);

impl Folder {
    /// Creates a folder with the `PICTURES` in `rgb` and `depth`.
    fn new() -> Self {
        let folder = Folder(tempfile::tempdir().unwrap());
        for name in ["rgb", "depth"] {
            std::fs::create_dir(folder.path(name)).unwrap();
        }
        for (index, (name, width, height)) in PICTURES.into_iter().enumerate() {
            let shift = 40 * index as u8;
            let colour = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([4 * x as u8, 4 * y as u8, shift]));
            let depth = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(x + y) as u8 + shift]));
            colour.save(folder.path(&format!("rgb/{name}.png"))).unwrap();
            depth.save(folder.path(&format!("depth/{name}.png"))).unwrap();
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    fn call(&self, more: &[&str]) -> Vec<String> {
        let flags = ["hologram", "--rgb", "", "--depth", "", "-o", ""].map(str::to_owned);
        let mut call = flags.to_vec();
        (call[2], call[4], call[6]) = (self.text("rgb"), self.text("depth"), self.text("out"));
        call.extend(more.iter().map(|flag| (*flag).to_owned()));
        call
    }
}

fn borrowed(call: &[String]) -> Vec<&str> {
    call.iter().map(String::as_str).collect()
}

fn modified(path: &Path) -> std::time::SystemTime {
    std::fs::metadata(path).unwrap().modified().unwrap()
}

#[test]
fn each_picture_of_a_folder_is_what_it_is_by_itself() {
    let folder = Folder::new();
    std::fs::write(folder.path("rgb/notes.txt"), "no picture").unwrap();
    let report = json(&borrowed(&folder.call(&[])));
    assert_eq!(
        (report["made"].as_u64(), report["kept"].as_u64()),
        (Some(3), Some(0)),
        "{report}"
    );
    for (name, width, height) in PICTURES {
        let one = folder.text("one.png");
        let (rgb, depth) = (
            folder.text(&format!("rgb/{name}.png")),
            folder.text(&format!("depth/{name}.png")),
        );
        json(&["hologram", "--rgb", &rgb, "--depth", &depth, "-o", &one]);
        let alone = hologram::read_hologram(one.as_ref()).unwrap();
        let among = hologram::read_hologram(&folder.path(&format!("out/{name}.png"))).unwrap();
        assert_eq!(
            alone.size(),
            Size {
                width: width as usize,
                height: height as usize
            }
        );
        assert_eq!(alone, among, "{name}");
    }
}

#[test]
fn a_bad_picture_is_named_and_the_others_are_made() {
    let folder = Folder::new();
    std::fs::write(folder.path("rgb/cat.png"), "no picture").unwrap();
    std::fs::copy(folder.path("rgb/eel.png"), folder.path("rgb/fox.png")).unwrap();
    let output = phasefront(&borrowed(&folder.call(&["--json"])));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), errors.lines().count()), (Some(1), 3), "{errors}");
    assert!(errors.contains("cat.png") && errors.contains("fox.png"), "{errors}");
    assert!(
        errors.lines().next_back().unwrap().contains("2 of 4 pictures failed"),
        "{errors}"
    );
    let report = report(&output);
    assert_eq!(
        (report["made"].as_u64(), report["failed"][0]["picture"].as_str()),
        (Some(2), Some("cat"))
    );
    assert!(folder.path("out/dog 2.png").exists() && folder.path("out/eel.png").exists());
    assert!(!folder.path("out/cat.png").exists() && !folder.path("out/fox.png").exists());
}

#[test]
fn holograms_of_the_same_request_are_kept() {
    let folder = Folder::new();
    json(&borrowed(&folder.call(&[])));
    let eel = folder.path("out/eel.png");
    let before = modified(&eel);
    assert!(refusal(&borrowed(&folder.call(&[])), 1).contains("--resume"));
    let error = refusal(&borrowed(&folder.call(&["--resume", "--method", "sweep"])), 1);
    assert!(
        error.contains("no --method") && error.contains("--method sweep"),
        "{error}"
    );
    assert!(
        refusal(&borrowed(&folder.call(&["--resume", "--dark-threshold", "0.1"])), 1).contains("--dark-threshold 0.1")
    );
    // One output is missing, and one picture has changed.
    std::fs::remove_file(folder.path("out/cat.png")).unwrap();
    let dog = std::fs::read(folder.path("out/dog 2.png")).unwrap();
    for name in ["rgb", "depth"] {
        std::fs::copy(
            folder.path(&format!("{name}/cat.png")),
            folder.path(&format!("{name}/dog 2.png")),
        )
        .unwrap();
    }
    let report = json(&borrowed(&folder.call(&["--resume"])));
    assert_eq!(
        (report["made"].as_u64(), report["kept"].as_u64()),
        (Some(2), Some(1)),
        "{report}"
    );
    assert_eq!(modified(&eel), before);
    assert_ne!(std::fs::read(folder.path("out/dog 2.png")).unwrap(), dog);
    let report = json(&borrowed(&folder.call(&["--overwrite"])));
    assert_eq!(report["made"], 3);
    assert_ne!(modified(&eel), before);
}

#[test]
fn flat_pictures_on_another_plane_are_not_resumed() {
    let folder = Folder::new();
    let [rgb, out] = ["rgb", "out"].map(|name| folder.text(name));
    let call = [
        "hologram", "--rgb", &rgb, "--depth", "flat", "--method", "sweep", "-o", &out,
    ];
    json(&call);
    let error = refusal(&[&call[..], &["--resume", "--z-mm", "1"]].concat(), 1);
    assert!(error.contains("no --z-mm") && error.contains("--z-mm 1"), "{error}");
    assert_eq!(json(&[&call[..], &["--resume"]].concat())["kept"], 3);
}

#[test]
fn folders_that_cannot_be_meant_are_refused_before_work() {
    let folder = Folder::new();
    let [rgb, depth, out] = ["rgb", "depth", "out"].map(|name| folder.text(name));
    let cat = folder.text("depth/cat.png");
    let refused = |arguments: &[&str], code| refusal(&[&["hologram"], arguments].concat(), code);
    assert!(refused(&["--rgb", &rgb, "--depth", &cat, "-o", &out], 2).contains("two folders"));
    assert!(refused(&["--rgb", &rgb, "--depth", &depth, "-o", &folder.text("a.png")], 1).contains("folder"));
    let into = refused(&["--rgb", &rgb, "--depth", &depth, "--overwrite", "-o", &rgb], 1);
    assert!(into.contains("input"), "{into}");
    assert!(refused(&["--rgb", &rgb, "--depth", &depth, "-o", &out, "--judge"], 2).contains("--judge"));
    std::fs::create_dir(folder.path("none")).unwrap();
    let none = folder.text("none");
    assert!(refused(&["--rgb", &none, "--depth", &none, "-o", &out], 1).contains("no pictures"));
    std::fs::copy(folder.path("rgb/cat.png"), folder.path("rgb/cat.jpg")).unwrap();
    assert!(refused(&["--rgb", &rgb, "--depth", &depth, "-o", &out], 1).contains("a name of its own"));
    assert!(!folder.path("out").exists());
}
