//! Runs the examples on the sample scene and checks the metadata of the files that they write. The tests of the Python
//! examples check that the command reads these files.
#![allow(clippy::unwrap_used)]

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::process::Command;

#[test]
fn the_examples_make_holograms() {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../samples");
    let folder = tempfile::tempdir().unwrap();
    let hologram = folder.path().join("hologram.png");
    for (example, size, word) in [
        (env!("CARGO_BIN_EXE_still"), (1920, 1080), "pixels in"),
        (env!("CARGO_BIN_EXE_live"), (640, 360), "processed"),
    ] {
        let mut example = Command::new(example);
        let example = example.args(["scene_rgb.jpg", "scene_depth.png"].map(|name| samples.join(name)));
        let output = example.arg(&hologram).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let told = String::from_utf8(output.stdout).unwrap();
        assert!(told.contains(word), "{told}");
        let file = BufReader::new(File::open(&hologram).unwrap());
        let png = png::Decoder::new(file).read_info().unwrap();
        assert_eq!((png.info().width, png.info().height), size);
        let about = &png.info().uncompressed_latin1_text[0];
        assert_eq!(about.keyword, "phasefront");
        let about: serde_json::Value = serde_json::from_str(&about.text).unwrap();
        assert!(
            about["scale"].as_f64().unwrap() > 0.0 && about["display"]["width"] == size.0,
            "{about}"
        );
        std::fs::remove_file(&hologram).unwrap();
    }
}
