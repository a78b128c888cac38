//! Runs the crate's command in its own folder, for the tests of both commands.

use std::path::PathBuf;
use std::process::{Command, Output};

const COMMAND: &str = match option_env!("CARGO_BIN_EXE_phasefront") {
    Some(path) => path,
    None => match option_env!("CARGO_BIN_EXE_phasefront-lab") {
        Some(path) => path,
        None => panic!("the crate has no command"),
    },
};

/// Makes a small hologram of [`Folder::with_frame`]'s frame; `-o` and what differs follow.
#[allow(dead_code, reason = "not every test needs a hologram")]
pub(crate) const SMALL_HOLOGRAM: [&str; 9] = [
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

pub(crate) struct Folder(pub(crate) tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Folder(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs the command in this folder.
    pub(crate) fn run(&self, arguments: &[&str]) -> Output {
        Command::new(COMMAND)
            .args(arguments)
            .current_dir(self.0.path())
            .env_remove("RUST_LOG")
            .output()
            .unwrap()
    }

    /// Runs the command, checks that it succeeds and returns its output.
    pub(crate) fn succeeds(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{arguments:?}: {errors}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs the command, checks that it fails with `code` and without a panic, and returns its error output.
    #[track_caller]
    pub(crate) fn fails(&self, arguments: &[&str], code: i32) -> String {
        let output = self.run(arguments);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
        assert!(!errors.contains("panicked"), "{errors}");
        errors
    }

    /// Adds a small frame, `rgb.png` and `depth.png` of 48×32 pixels.
    #[allow(dead_code, reason = "not every test needs a frame")]
    pub(crate) fn with_frame(self) -> Self {
        let rgb = image::RgbImage::from_fn(48, 32, |x, y| image::Rgb([(x * 5) as u8, (y * 7) as u8, 90]));
        rgb.save(self.path("rgb.png")).unwrap();
        let depth = image::GrayImage::from_fn(48, 32, |x, _| image::Luma([if x < 24 { 30 } else { 220 }]));
        depth.save(self.path("depth.png")).unwrap();
        self
    }
}
