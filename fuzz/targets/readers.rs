//! Fuzzes the readers of `phasefront-io` and `phasefront-lab`: the first byte selects the reader, the rest is the file.
#![no_main]

use phasefront::Size;
use libfuzzer_sys::fuzz_target;
use phasefront_io::{display, hologram, ldi, picture};
use phasefront_lab::scene;
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let Some((kind, file)) = data.split_first() else { return };
    let folder = std::env::temp_dir().join(format!("phasefront-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let write = |name: &str| {
        let path = folder.join(name);
        std::fs::write(&path, file).expect("a file");
        path
    };
    let told = |result: phasefront_io::Result<()>| {
        if let Err(why) = result {
            assert!(!why.to_string().contains(char::is_control), "{why}");
        }
    };
    let model = |path: &Path| scene::read_model(path, Size { width: 8, height: 8 }, None).map(|_| ());
    match kind % 12 {
        0 => told(picture::read_rgb(&write("a.png")).map(|_| ())),
        1 => told(picture::depth_map::read_depth(&write("a.npy"), false).map(|_| ())),
        2 => told(hologram::read_hologram(&write("a.png")).map(|_| ())),
        3 => told(display::read_display(&write("a.toml")).map(|_| ())),
        4 => told(model(&write("a.glb"))),
        5 => told(model(&write("a.gltf"))),
        6 => {
            write("a.mtl");
            let obj = folder.join("a.obj");
            std::fs::write(&obj, [b"mtllib a.mtl\n", file].concat()).expect("a file");
            told(model(&obj));
        }
        7 => {
            write("layer_0.png");
            write("depth_0.png");
            told(ldi::Ldi::read(&folder).map(|_| ()));
        }
        8 => {
            std::fs::write(folder.join("a.json"), r#"{"display": {}}"#).expect("a file");
            told(hologram::read_hologram(&write("a.npy")).map(|_| ()));
        }
        9 => told(picture::photo::read(&write("a.jpg"), None).map(|_| ())),
        10 => told(picture::depth_map::read_depth(&write("a.exr"), false).map(|_| ())),
        _ => {
            write("a.lut");
            let path = folder.join("lut.toml");
            std::fs::write(&path, "lut = \"a.lut\"").expect("a file");
            told(display::read_display(&path).map(|_| ()));
        }
    }
});
